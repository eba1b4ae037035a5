//! `stair experiment check` and `list`: which runs a file stands for, and what they cost.

use std::process::ExitCode;
use std::time::Duration;

use lab::config::find_task;
use lab::cost::{core_time_here, on_cores};
use lab::experiment::grid::{self, Grid, GridRun, SHIPPED};
use lab::words::counted;

use super::{Chosen, in_words};
use crate::cli::say;

/// The machine for which costs are told.
const CORES: usize = 2;

/// List the runs of a grid with what they cost, and run none
#[derive(Debug, clap::Args)]
pub(super) struct Args {
    /// A TOML file, or the name of one that comes with the program
    file: String,
    /// The small variant: the same figure from few runs
    #[arg(long)]
    small: bool,
}

/// List the grids that come with the program, with what each costs on two cores like these
#[derive(Debug, clap::Args)]
pub(super) struct ListArgs {}

pub(super) fn run(args: &Args) -> anyhow::Result<ExitCode> {
    let chosen = Chosen::open(&args.file, args.small)?;
    let line = |run: &GridRun| {
        format!(
            "{:60} {:>9} steps  {:>6} answers  {:>9}\n",
            run.key.name(),
            run.config.training.total_steps,
            run.config.feedback.budget,
            in_words(time(run))
        )
    };
    let grid = &chosen.grid;
    let lines: String = grid.runs.iter().map(line).collect();
    let (title, about) = (&grid.title, &grid.about);
    say(&format!("{title}\n{about}\n\n{lines}\n{}\n", cost(grid)))?;
    Ok(ExitCode::SUCCESS)
}

pub(super) fn list() -> anyhow::Result<ExitCode> {
    for shipped in SHIPPED {
        let resolved = |is_small| grid::resolve(shipped.source(), is_small);
        let (Ok(whole), Ok(small)) = (resolved(false), resolved(true)) else {
            continue; // a test resolves them all
        };
        say(&format!(
            "{}: {}\n  {}\n  {}\n  --small: {}\n\n",
            shipped.name,
            whole.title,
            whole.about.replace('\n', "\n  "),
            cost(&whole),
            cost(&small)
        ))?;
    }
    Ok(ExitCode::SUCCESS)
}

/// `12 runs, about 3 h on 2 cores like this machine's`
fn cost(grid: &Grid) -> String {
    let whole = on_cores(grid.runs.iter().map(time), CORES);
    format!(
        "{}, about {} on {CORES} cores like this machine's",
        counted(grid.runs.len() as u64, "run", "runs"),
        in_words(whole)
    )
}

/// About how long a run takes on a core of its own.
pub(super) fn time(run: &GridRun) -> Duration {
    find_task(&run.config.task).map_or(Duration::ZERO, |task| {
        core_time_here(&run.config, &(task.spec)())
    })
}
