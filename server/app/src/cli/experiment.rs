//! `stair experiment`: grids of runs and what they came to, and the paper's experiments that need
//! no simulation.

use std::fmt::Write as _;
use std::process::ExitCode;

use clap::Subcommand;
use lab::experiment::EXPERIMENTS;

mod check;
mod folder;
mod machine;
mod progress;
mod pure;
mod report;
mod run;

/// Run a grid of runs from a file and report on it, or an experiment that needs no simulation
#[derive(Debug, clap::Args)]
#[command(
    args_conflicts_with_subcommands = true,
    subcommand_negates_reqs = true,
    after_help = after_help()
)]
pub struct Args {
    #[command(subcommand)]
    action: Option<Action>,
    #[command(flatten)]
    pure: Option<pure::Args>,
}

#[derive(Debug, Subcommand)]
enum Action {
    Check(check::Args),
    Run(run::Args),
    Report(report::Args),
}

fn after_help() -> String {
    let mut text = "Experiments that need no simulation:\n".to_owned();
    for experiment in EXPERIMENTS {
        writeln!(text, "  {:14} {}", experiment.name, experiment.summary)
            .expect("writing to a string cannot fail");
    }
    text.push_str(
        "\nExamples:
  stair experiment abstract-mdp --out results/abstract-mdp
  stair experiment check assets/experiments/window.toml
  stair experiment run assets/experiments/go-fetch-return.toml --small
  stair experiment report data/experiments/go-fetch-return-small",
    );
    text
}

/// Runs the command.
///
/// # Errors
/// [`BadInput`](super::BadInput) for a file or name that does not fit; a folder that cannot be
/// written.
pub fn run(args: &Args) -> anyhow::Result<ExitCode> {
    match (&args.action, &args.pure) {
        (Some(Action::Check(args)), _) => check::run(args),
        (Some(Action::Run(args)), _) => run::run(args),
        (Some(Action::Report(args)), _) => report::run(args),
        (None, Some(args)) => pure::run(args),
        (None, None) => unreachable!("clap asks for a subcommand or a name"),
    }
}
