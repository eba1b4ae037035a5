//! `stair experiment check`: whether a file is right, and what it would cost.

use std::path::PathBuf;
use std::process::ExitCode;
use std::time::Duration;

use lab::grid::{self, PlannedRun};

use super::folder::read_plan;

/// Check an experiment's file: its runs, and about how long they take here
#[derive(Debug, clap::Args)]
pub(super) struct Args {
    /// The experiment's file
    file: PathBuf,
    /// Its small variant
    #[arg(long)]
    small: bool,
    /// List every run
    #[arg(long)]
    list: bool,
}

pub(super) fn run(args: &Args) -> anyhow::Result<ExitCode> {
    let (file, plan) = read_plan(&args.file, args.small)?;
    println!("{}\n{}", file.title, file.summary);
    if args.list {
        for run in &plan {
            println!("  {}", run.name);
        }
    }
    println!("{}", cost(&plan));
    Ok(ExitCode::SUCCESS)
}

/// "12 runs, about 25 minutes on 2 cores of this machine".
pub(super) fn cost(plan: &[PlannedRun]) -> String {
    let n_cores = std::thread::available_parallelism().map_or(1, usize::from);
    let time = shown(grid::time_here(plan, n_cores.min(plan.len())));
    let runs = if plan.len() == 1 { "run" } else { "runs" };
    format!(
        "{} {runs}, about {time} on {n_cores} cores of this machine",
        plan.len()
    )
}

/// "25 minutes", "3 hours", "4 days".
pub(super) fn shown(time: Duration) -> String {
    let minutes = time.as_secs_f64() / 60.0;
    let (number, unit) = match minutes {
        m if m < 90.0 => (m.max(1.0), "minute"),
        m if m < 48.0 * 60.0 => (m / 60.0, "hour"),
        m => (m / (24.0 * 60.0), "day"),
    };
    let number = format!("{number:.0}");
    let plural = if number == "1" { "" } else { "s" };
    format!("{number} {unit}{plural}")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn durations_are_told_in_their_unit() {
        for (seconds, expected) in [
            (1, "1 minute"),
            (25 * 60, "25 minutes"),
            (3 * 3600, "3 hours"),
            (4 * 86_400, "4 days"),
        ] {
            assert_eq!(shown(Duration::from_secs(seconds)), expected);
        }
    }
}
