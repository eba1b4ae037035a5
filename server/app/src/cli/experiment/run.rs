//! `stair experiment run`: every run of a grid, several at once, each in a process of its own.
//!
//! Processes, because a run that dies takes nothing with it, gives all its memory back, and can
//! be told to stop at a checkpoint. A run keeps one core busy and a second one now and then, so
//! as many run at once as there are cores.

use std::fs::File;
use std::num::NonZeroUsize;
use std::path::{Path, PathBuf};
use std::process::{Child, Command, ExitCode, Stdio};
use std::sync::mpsc::{Receiver, channel};
use std::time::Duration;

use anyhow::Context as _;
use lab::grid::{Ended, PlannedRun};

use super::check::cost;
use super::folder::{ExperimentFolder, Standing, read, read_plan, steps_taken};
use super::progress::Progress;
use crate::cli::figure::write;
use crate::cli::train::stop_on_interrupt;

/// How often running processes are looked at.
const LOOK: Duration = Duration::from_millis(300);

/// Run every run of an experiment's file; finished ones are kept, started ones go on
#[derive(Debug, clap::Args)]
#[command(after_help = "Examples:
  stair experiment run assets/experiments/go-fetch-return.toml --small
  stair experiment run my.toml --jobs 1 --out results/mine")]
pub(super) struct Args {
    /// The experiment's file
    file: PathBuf,
    /// Its small variant: the same figure from few runs
    #[arg(long)]
    small: bool,
    /// Runs at once [default: one for each processor]
    #[arg(long)]
    jobs: Option<NonZeroUsize>,
    /// The experiment's folder [default: data/experiments/NAME, or NAME-small]
    #[arg(long, value_name = "DIR")]
    out: Option<PathBuf>,
    /// Keep results of other revisions of this program
    #[arg(long)]
    mix_revisions: bool,
}

/// A run under way.
struct Job {
    index: usize,
    child: Child,
}

pub(super) fn run(args: &Args) -> anyhow::Result<ExitCode> {
    let (file, plan) = read_plan(&args.file, args.small)?;
    let folder = ExperimentFolder::at(&args.out.clone().unwrap_or_else(|| default_out(args)));
    let standings = plan
        .iter()
        .map(|run| folder.standing(run, args.mix_revisions))
        .collect::<anyhow::Result<Vec<_>>>()?;
    folder.claim(&read(&args.file)?)?;
    let waiting: Vec<usize> = (0..plan.len())
        .filter(|&i| !matches!(standings[i], Standing::Finished))
        .collect();
    println!("{}: {}", file.title, cost(&plan));
    if waiting.is_empty() {
        println!("all of them are finished already: nothing to do");
        return Ok(success(&folder));
    }
    if waiting.len() < plan.len() {
        println!("{} are finished already", plan.len() - waiting.len());
    }
    let done = plan.iter().zip(&standings).map(|(run, standing)| {
        let steps = || steps_taken(&folder.run_folder(run)) as f64;
        match standing {
            Standing::Finished => 1.0,
            Standing::Started => steps() / run.config.training.total_steps as f64,
            Standing::New => 0.0,
        }
    });
    let mut progress = Progress::new(&plan, done.collect());
    let (sender, interrupt) = channel();
    stop_on_interrupt(sender)?;
    let n_jobs = args
        .jobs
        .unwrap_or_else(|| std::thread::available_parallelism().unwrap_or(NonZeroUsize::MIN));
    let (failed, is_stopped) = work(&folder, &plan, waiting, n_jobs, &interrupt, &mut progress)?;
    progress.clear();
    if is_stopped {
        eprintln!("Stopped; every run is at a checkpoint. The same command goes on with them.");
        return Ok(ExitCode::from(130));
    }
    if failed.is_empty() {
        return Ok(success(&folder));
    }
    eprintln!("{} of {} runs failed:", failed.len(), plan.len());
    for (name, reason) in &failed {
        eprintln!("  {name}: {reason}");
    }
    eprintln!("The same command tries them again.");
    Ok(ExitCode::FAILURE)
}

fn default_out(args: &Args) -> PathBuf {
    let stem = args.file.file_stem().unwrap_or_default().to_string_lossy();
    let suffix = if args.small { "-small" } else { "" };
    PathBuf::from(format!("data/experiments/{stem}{suffix}"))
}

fn success(folder: &ExperimentFolder) -> ExitCode {
    let folder = folder.root().display();
    println!("Look at it: stair experiment report {folder}");
    ExitCode::SUCCESS
}

/// Name and reason of each run that failed.
type Failures = Vec<(String, String)>;

/// Works through the waiting runs; returns what failed, and whether it was told to stop.
fn work(
    folder: &ExperimentFolder,
    plan: &[PlannedRun],
    waiting: Vec<usize>,
    n_jobs: NonZeroUsize,
    interrupt: &Receiver<lab::message::Command>,
    progress: &mut Progress,
) -> anyhow::Result<(Failures, bool)> {
    let mut waiting = waiting.into_iter();
    let mut jobs: Vec<Job> = Vec::new();
    let mut failed = Vec::new();
    let mut is_stopped = false;
    loop {
        while jobs.len() < n_jobs.get() && !is_stopped {
            let Some(index) = waiting.next() else { break };
            let child = start(folder, &plan[index])?;
            progress.begin(index, &plan[index]);
            jobs.push(Job { index, child });
        }
        if jobs.is_empty() {
            return Ok((failed, is_stopped));
        }
        if interrupt.recv_timeout(LOOK).is_ok() {
            is_stopped = true;
            for job in &mut jobs {
                drop(job.child.stdin.take()); // its end is what they wait for
            }
        }
        let mut running = Vec::new();
        for mut job in jobs {
            let run = &plan[job.index];
            match job.child.try_wait().context("cannot wait for a run")? {
                None => {
                    progress.advance(job.index, steps_taken(&folder.run_folder(run)));
                    running.push(job);
                }
                Some(_) if is_stopped => {}
                Some(status) => {
                    let reason = format!("{}: {status}", last_line(&folder.log(run)));
                    let result = folder.keep(run, &reason)?;
                    let success = result.evaluations.last().map_or(0.0, |e| e.success_rate);
                    let words = match &result.row.ended {
                        Ended::Finished { .. } => format!("{}: success {success:.2}", run.name),
                        Ended::Failed { reason } => {
                            failed.push((run.name.clone(), reason.clone()));
                            format!("{}: failed: {reason}", run.name)
                        }
                    };
                    progress.end(job.index, &words);
                }
            }
        }
        jobs = running;
    }
}

/// Starts or resumes a run; it stops at a checkpoint when its standard input ends, so also when
/// this process dies.
fn start(folder: &ExperimentFolder, run: &PlannedRun) -> anyhow::Result<Child> {
    let settings = folder.settings(run);
    write(&settings, run.config.to_toml().as_bytes())?;
    let log = folder.log(run);
    write(&log, b"")?;
    let log = File::create(&log).with_context(|| format!("cannot write {}", log.display()))?;
    let errors = log.try_clone().context("cannot write a run's log")?;
    let mut command = Command::new(std::env::current_exe().context("cannot find this program")?);
    command.arg("train");
    let run_folder = folder.run_folder(run);
    if lab::run::Run::exists(&run_folder) {
        command.arg("--resume").arg(&run_folder);
    } else {
        command.arg("--config").arg(&settings);
        command.arg("--out").arg(&run_folder);
    }
    command.args(["--teacher", &run.teacher, "--json", "--stop-at-eof"]);
    command.stdin(Stdio::piped()).stdout(log).stderr(errors);
    // Ctrl-C in a terminal reaches a whole process group; runs are told to stop by us alone
    std::os::unix::process::CommandExt::process_group(&mut command, 0);
    command
        .spawn()
        .with_context(|| format!("cannot start the run {}", run.name))
}

fn last_line(path: &Path) -> String {
    let text = std::fs::read_to_string(path).unwrap_or_default();
    let line = text.lines().rev().find(|line| !line.trim().is_empty());
    let line = line.unwrap_or("it said nothing");
    line.strip_prefix("stair: ").unwrap_or(line).to_owned()
}
