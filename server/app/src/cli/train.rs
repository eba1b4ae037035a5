//! `stair train`: a run with a scripted teacher, in the terminal.

use std::path::PathBuf;
use std::process::ExitCode;
use std::sync::mpsc::{Sender, channel};
use std::time::{Duration, Instant};

use anyhow::Context as _;
use domain::teacher::{Judge, Scripted, TeacherSettings};
use indicatif::{ProgressBar, ProgressDrawTarget, ProgressStyle};
use lab::config::{Layers, RunConfig, identity, scripted_teacher};
use lab::history::Sitting;
use lab::message::{Command, Event};
use lab::run::{Outcome, Run};
use lab::words::counted;
use serde_json::json;

use super::interrupt::on_interrupt;
use super::{BadInput, number};
use crate::provenance;

/// Train an agent with a scripted teacher.
#[derive(Debug, clap::Args)]
#[command(after_help = "Examples:
  stair train go-fetch-return --preset quick
  stair train window-open --method pebble --preset quick --labels 500 --seed 3
  stair train window-open --set feedback.queries_per_session=20 --json
  stair train window-open --teacher mistaken --set teacher.mistake=0.2
  stair train --resume data/train/window-open-stair-1")]
pub struct Args {
    /// The task, where no file of --config names it; `stair tasks` lists them
    #[arg(required_unless_present_any = ["resume", "config"])]
    task: Option<String>,
    /// The method; `stair tasks` lists them
    #[arg(long)]
    method: Option<String>,
    /// A preset on top of the task's and the method's own: quick, paper_table
    #[arg(long)]
    preset: Vec<String>,
    /// A TOML file with settings
    #[arg(long, value_name = "FILE")]
    config: Option<PathBuf>,
    /// One setting, such as agent.batch=256
    #[arg(long = "set", value_name = "KEY=VALUE")]
    settings: Vec<String>,
    /// Of every random stream
    #[arg(long, value_parser = number::whole::<u64>, allow_negative_numbers = true)]
    seed: Option<u64>,
    /// Who answers: oracle, mistaken, inconsistent, myopic, noisy, equal, skip, coin [default:
    /// oracle; with --resume whoever has answered so far]
    #[arg(long)]
    teacher: Option<String>,
    /// Answers in all
    #[arg(long, allow_negative_numbers = true)]
    labels: Option<u32>,
    /// Environment steps in all
    #[arg(long, value_parser = number::whole::<u64>, allow_negative_numbers = true)]
    steps: Option<u64>,
    /// cpu or cuda; a run may go on on another device than it began on
    #[arg(long)]
    device: Option<String>,
    /// The run's folder [default: data/train/TASK-METHOD-SEED]
    #[arg(long, value_name = "DIR")]
    out: Option<PathBuf>,
    /// Go on with the run in this folder
    #[arg(long, value_name = "DIR", conflicts_with_all = [
        "task", "method", "preset", "config", "settings", "seed", "labels", "steps", "out",
    ])]
    resume: Option<PathBuf>,
    /// No progress bar; one JSON object at the end
    #[arg(long)]
    json: bool,
    /// Stop with a checkpoint when stdin ends: for programs that start this one
    #[arg(long)]
    until_eof: bool,
}

/// Runs the command.
///
/// # Errors
/// Settings that do not fit ([`BadInput`]), a folder that cannot be written, a run that fails.
#[expect(
    clippy::needless_pass_by_value,
    reason = "every command has this signature"
)]
pub fn run(args: Args) -> anyhow::Result<ExitCode> {
    let started = Instant::now();
    let is_new = args.resume.is_none();
    let wanted = args.teacher.as_deref().or(is_new.then_some("oracle"));
    if let Some(name) = wanted {
        judge(name, 0, &TeacherSettings::default())?; // a wrong name is said before anything is done
    }
    let (mut run, folder) = open(&args, wanted)?;
    let here = provenance::here(&run.config().device);
    let (mut sitting, complaint) = Sitting::begin(&folder, &here, started)?;
    if let Some(complaint) = complaint {
        eprintln!("{complaint}");
    }
    let teacher = sitting.answered_by(wanted).map_err(BadInput::from_error)?;
    let judge = judge(teacher, run.config().seed, &run.config().teacher)?;
    sitting.keep()?;
    let mut teacher = Scripted::new(judge, run.consumed_sequence());
    let (sender, commands) = channel();
    stop_when_told(sender, args.until_eof)?;
    let mut progress = Progress::new(&run, args.json);
    let outcome = sitting.drive(&mut run, &mut teacher, &commands, &mut |event| {
        progress.show(&event);
    })?;
    let wall_s = sitting.history().wall_s;
    progress.bar.finish_and_clear();
    let config = run.config();
    match outcome {
        Outcome::Stopped => eprintln!(
            "Stopped at step {}. Go on with: stair train --resume {}",
            run.step(),
            folder.display()
        ),
        Outcome::Finished(finished) if args.json => println!(
            "{}",
            json!({
                "task": config.task, "method": config.method, "seed": config.seed,
                "env_steps": finished.step, "labels": finished.labels,
                "success_rate": finished.success_rate, "return_mean": finished.return_mean,
                "wall_s": wall_s, "checkpoint": folder,
                "weights": finished.weights,
            })
        ),
        Outcome::Finished(finished) => println!(
            "{} on {}: success {:.2}, return {:.0} after {} and {}, {:.0} s. Weights {}.\n\
             Look at it: stair render {} --policy {} --out clip.mp4",
            config.method,
            config.task,
            finished.success_rate,
            finished.return_mean,
            counted(finished.step, "step", "steps"),
            counted(finished.labels.into(), "label", "labels"),
            wall_s,
            finished.weights,
            config.task,
            folder.display()
        ),
    }
    Ok(ExitCode::SUCCESS)
}

fn open(args: &Args, teacher: Option<&str>) -> anyhow::Result<(Run, PathBuf)> {
    if let Some(folder) = &args.resume {
        let (run, complaints) =
            Run::resume_on(folder, args.device.as_deref()).map_err(BadInput::from_error)?;
        for complaint in complaints {
            eprintln!("Passed over a damaged checkpoint. {complaint}");
        }
        return Ok((run, folder.clone()));
    }
    let config = RunConfig::resolve(&layers(args)?).map_err(BadInput::from_error)?;
    let named = || {
        format!(
            "data/train/{}-{}-{}",
            config.task, config.method, config.seed
        )
        .into()
    };
    let folder = args.out.clone().unwrap_or_else(named);
    let run = Run::start_with(config, &folder, teacher).map_err(BadInput::from_error)?;
    Ok((run, folder))
}

fn layers(args: &Args) -> anyhow::Result<Layers> {
    let file = match &args.config {
        None => None,
        Some(path) => {
            let name = path.display().to_string();
            let text = std::fs::read_to_string(path).with_context(|| format!("cannot read {name}"));
            Some((name, text.map_err(BadInput::from_error)?))
        }
    };
    for setting in &args.settings {
        refuse_identity(setting)?;
    }
    let mut overrides = args.settings.clone();
    overrides.extend(args.seed.map(|seed| format!("seed={seed}")));
    overrides.extend(
        args.labels
            .map(|labels| format!("feedback.budget={labels}")),
    );
    overrides.extend(
        args.steps
            .map(|steps| format!("training.total_steps={steps}")),
    );
    overrides.extend(
        args.device
            .as_ref()
            .map(|device| format!("device={device}")),
    );
    Ok(Layers {
        task: args.task.clone(),
        method: args.method.clone(),
        presets: args.preset.clone(),
        file,
        overrides,
    })
}

/// Task, method and seed have arguments of their own, which no setting changes.
fn refuse_identity(setting: &str) -> Result<(), BadInput> {
    let instead = match identity(setting) {
        None => return Ok(()),
        Some("task") => "name the task by itself: stair train TASK",
        Some("method") => "use --method",
        Some(_) => "use --seed",
    };
    Err(BadInput(format!("--set {setting}: {instead}")))
}

/// The scripted teacher of that name.
///
/// # Errors
/// [`BadInput`] names the nearest right one.
pub(super) fn judge(
    name: &str,
    seed: u64,
    settings: &TeacherSettings,
) -> anyhow::Result<Box<dyn Judge>> {
    scripted_teacher(name, seed, settings).map_err(BadInput::from_error)
}

/// Ctrl-C, or the end of stdin where that is asked for, leaves a checkpoint.
fn stop_when_told(sender: Sender<Command>, until_eof: bool) -> anyhow::Result<()> {
    if until_eof {
        let sender = sender.clone();
        std::thread::spawn(move || {
            let _ = std::io::copy(&mut std::io::stdin(), &mut std::io::sink()); // to its end, however it comes
            let _ = sender.send(Command::Stop); // a run that is over needs no telling
        });
    }
    on_interrupt(move || {
        eprintln!("Stopping; a checkpoint is being written.");
        let _ = sender.send(Command::Stop); // a run that is over needs no telling
    })
}

/// A line in the terminal that says where the run is.
struct Progress {
    bar: ProgressBar,
    labels: u32,
    task_return: f64,
    success: f64,
}

impl Progress {
    fn new(run: &Run, is_quiet: bool) -> Self {
        let bar = ProgressBar::new(run.config().training.total_steps).with_position(run.step());
        if is_quiet {
            bar.set_draw_target(ProgressDrawTarget::hidden());
        }
        let style = ProgressStyle::with_template(
            "{bar:30} {pos}/{len} steps  {per_sec}  {msg}  {eta} left",
        );
        bar.set_style(style.unwrap_or_else(|_| ProgressStyle::default_bar()));
        bar.enable_steady_tick(Duration::from_millis(500));
        bar.reset_eta();
        Self {
            bar,
            labels: 0,
            task_return: 0.0,
            success: 0.0,
        }
    }

    fn show(&mut self, event: &Event) {
        match event {
            Event::Phase(phase) => self.bar.set_position(phase.step),
            Event::Metrics(row) => {
                self.labels = row.labels;
                self.task_return = row.return_mean.unwrap_or(self.task_return);
                self.bar.set_position(row.step);
            }
            Event::Evaluation(evaluation) => {
                self.success = evaluation.success_rate;
                if !self.bar.is_hidden() {
                    self.bar.suspend(|| {
                        println!(
                            "step {:>7}  labels {:>5}  success {:.2}  return {:>7.1}",
                            evaluation.step,
                            evaluation.labels,
                            evaluation.success_rate,
                            evaluation.return_mean
                        );
                    });
                }
            }
            _ => {}
        }
        let (labels, task_return, success) = (self.labels, self.task_return, self.success);
        self.bar.set_message(format!(
            "labels {labels}  return {task_return:.0}  success {success:.2}"
        ));
    }
}
