//! `stair experiment run`: every run of a grid that is not there yet, several at once.

use std::num::NonZeroUsize;
use std::path::PathBuf;
use std::process::ExitCode;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, Instant};

use anyhow::Context as _;
use lab::experiment::results::GridFolder;
use lab::words::counted;
use learn::device::Device;

use super::Chosen;
use super::pool::{Pool, Tally};
use crate::cli::interrupt::on_interrupt;
use crate::cli::{BadInput, number, out};
use crate::provenance::{REVISION, processors};

/// How long to wait for runs of an earlier start to leave their checkpoints.
const PATIENCE: Duration = Duration::from_mins(1);

/// Run a grid: whatever is finished is kept, whatever was started goes on
#[derive(Debug, clap::Args)]
#[command(after_help = "Examples:
  stair experiment run go-fetch-return --small
  stair experiment run my-grid.toml --jobs 8 --out results/my-grid

Ctrl-C leaves checkpoints; the same command goes on. A run that fails is marked with its reason,
does not stop the others, and is tried again at the next start.")]
pub(super) struct Args {
    /// A TOML file, or the name of one that comes with the program
    file: String,
    /// The small variant: the same figure from few runs
    #[arg(long)]
    small: bool,
    /// Runs at once [default: one for each processor]
    #[arg(long, value_parser = number::at_least_one, allow_negative_numbers = true)]
    jobs: Option<NonZeroUsize>,
    /// Where all runs learn, cpu or cuda, whatever the file says
    #[arg(long)]
    device: Option<String>,
    /// The experiment's folder [default: data/experiments/NAME, with --small NAME-small; NAME is
    /// that of the file, or of the folder of an experiment.toml]
    #[arg(long, value_name = "DIR")]
    out: Option<PathBuf>,
    /// Go on although finished runs are of another revision of the program
    #[arg(long)]
    mixed: bool,
}

pub(super) fn run(args: &Args) -> anyhow::Result<ExitCode> {
    let mut chosen = Chosen::open(&args.file, args.small)?;
    if let Some(device) = &args.device {
        Device::open(device).map_err(BadInput::from_error)?;
        for run in &mut chosen.grid.runs {
            run.config.device.clone_from(device);
        }
    }
    let named = || PathBuf::from("data/experiments").join(&chosen.stem);
    let out = args.out.clone().unwrap_or_else(named);
    out::folder(&out)?;
    let folder = GridFolder::at(&out);
    let revision = (!args.mixed).then_some(REVISION);
    folder
        .check_experiment(&chosen.grid)
        .map_err(BadInput::from_error)?;
    folder.create().map_err(BadInput::from_error)?;
    let log = folder.log_file()?;
    hold(&log, &out)?;
    let results = folder.results().map_err(BadInput::from_error)?;
    folder
        .check(&chosen.grid.runs, &results, revision)
        .map_err(BadInput::from_error)?;
    folder.keep_file(&chosen.text, args.small)?;

    let is_told = Arc::new(AtomicBool::new(false));
    let hears = Arc::clone(&is_told);
    on_interrupt(move || hears.store(true, Ordering::SeqCst))?;
    let jobs = args.jobs.unwrap_or_else(processors).get();
    let pool = Pool::new(&folder, log, jobs);
    let tally = pool.work(&chosen.grid.runs, &results, &is_told)?;
    Ok(tell(&tally, &out))
}

/// Nobody else works in the folder, not even a run that an earlier start left behind.
fn hold(log: &std::fs::File, out: &std::path::Path) -> anyhow::Result<()> {
    let began = Instant::now();
    while let Err(error) = log.try_lock() {
        if let std::fs::TryLockError::Error(error) = error {
            return Err(error).with_context(|| format!("cannot lock {}", out.display()));
        }
        if began.elapsed() > PATIENCE {
            let told = format!(
                "{} is in use by another start of the experiment",
                out.display()
            );
            return Err(BadInput(told).into());
        }
        std::thread::sleep(Duration::from_millis(100)); // the lock's holder says nothing when it goes
    }
    Ok(())
}

fn tell(tally: &Tally, out: &std::path::Path) -> ExitCode {
    println!(
        "{} of {} finished, {} of them before this start.",
        tally.n_finished + tally.n_before,
        counted(tally.n_runs as u64, "run is", "runs are"),
        tally.n_before
    );
    for (name, reason) in &tally.failed {
        println!("Failed: {name}: {reason}");
    }
    if tally.n_finished + tally.n_before + tally.failed.len() < tally.n_runs {
        println!("Stopped. The same command goes on.");
    } else {
        println!("Report: stair experiment report {}", out.display());
    }
    ExitCode::from(u8::from(!tally.failed.is_empty()))
}
