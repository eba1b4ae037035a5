//! `stair experiment run`: every run of a grid that is not there yet, several at once.

use std::num::NonZeroUsize;
use std::path::PathBuf;
use std::process::ExitCode;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, Instant};

use anyhow::Context as _;
use lab::experiment::results::{GridFolder, Provenance};
use learn::device::Device;

use super::pool::{Pool, Tally};
use super::{Chosen, processors};
use crate::cli::BadInput;
use crate::cli::interrupt::on_interrupt;

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
    #[arg(long)]
    jobs: Option<NonZeroUsize>,
    /// Where all runs learn, cpu or cuda, whatever the file says
    #[arg(long)]
    device: Option<String>,
    /// The experiment's folder [default: data/experiments/NAME]
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
    let uses_card = chosen.grid.runs.iter().any(|r| r.config.device != "cpu");
    let named = || PathBuf::from("data/experiments").join(&chosen.stem);
    let out = args.out.clone().unwrap_or_else(named);
    let folder = GridFolder::at(&out);
    let provenance = Provenance {
        revision: env!("STAIR_REVISION").into(),
        machine: machine(uses_card),
    };
    let revision = (!args.mixed).then_some(provenance.revision.as_str());
    let results = folder.results().map_err(BadInput::from_error)?;
    folder
        .check(&chosen.grid.runs, &results, revision)
        .map_err(BadInput::from_error)?;
    folder.create(&chosen.text)?;
    let log = folder.log_file()?;
    hold(&log, &out)?;

    let is_told = Arc::new(AtomicBool::new(false));
    let hears = Arc::clone(&is_told);
    on_interrupt(move || hears.store(true, Ordering::SeqCst))?;
    let jobs = args.jobs.unwrap_or_else(processors).get();
    let results = folder.results().map_err(BadInput::from_error)?; // another start may have added some
    let pool = Pool::new(&folder, log, provenance, jobs);
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
        "{} of {} runs are finished, {} of them before this start.",
        tally.n_finished + tally.n_before,
        tally.n_runs,
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

/// `AMD EPYC 9R45, 2 cores`, with the graphics cards where runs use them.
fn machine(uses_card: bool) -> String {
    let cpus = std::fs::read_to_string("/proc/cpuinfo").unwrap_or_default();
    let model = cpus.lines().find(|line| line.starts_with("model name"));
    let model = model
        .and_then(|line| line.split_once(": "))
        .map(|(_, name)| name.trim());
    let cores = processors();
    let mut machine = format!("{}, {cores} cores", model.unwrap_or("unknown processor"));
    if uses_card {
        for card in cards() {
            machine.push_str(", ");
            machine.push_str(&card);
        }
    }
    machine
}

/// `NVIDIA H100 80GB HBM3`, as the driver tells; none where it does not.
fn cards() -> Vec<String> {
    let Ok(folders) = std::fs::read_dir("/proc/driver/nvidia/gpus") else {
        return Vec::new();
    };
    let told = folders.flatten().filter_map(|card| {
        let told = std::fs::read_to_string(card.path().join("information")).ok()?;
        let model = told.lines().find_map(|line| line.strip_prefix("Model:"))?;
        Some(model.trim().to_owned())
    });
    told.collect()
}
