//! `stair experiment timestep-classifier`: how well an expert's states tell their steps.

use std::num::NonZeroUsize;
use std::path::PathBuf;
use std::process::ExitCode;

use lab::experiment::timestep_classifier::{
    N_EPISODES, Played, Progress, Settings, TASKS, run as watch,
};
use learn::timestep::TimestepConfig;

use super::write_with_picture;
use crate::cli::{BadInput, number, out};
use crate::provenance::processors;

/// Tell from a scripted expert's states at which step they were seen: the paper's evidence that
/// tasks have stages
#[derive(Debug, clap::Args)]
#[command(after_help = "Examples:
  stair experiment timestep-classifier --out results/timestep-classifier
  stair experiment timestep-classifier --task go-fetch-return --episodes 200 --out results/gfr")]
pub(super) struct Args {
    /// Tasks, of those with a scripted expert
    #[arg(long, value_name = "NAME", num_args = 1.., default_values = TASKS)]
    task: Vec<String>,
    /// Episodes of each task, half of them held out [default: the paper's million steps]
    #[arg(long, default_value_t = N_EPISODES, hide_default_value = true)]
    #[arg(value_parser = clap::value_parser!(u32).range(2..=20_000))]
    #[arg(allow_negative_numbers = true)]
    episodes: u32,
    /// Of the episodes, the initial weights and the order of states
    #[arg(long, default_value_t = 1, value_parser = number::whole::<u64>)]
    #[arg(allow_negative_numbers = true)]
    seed: u64,
    /// Threads, each at one task [default: one for each processor]; changes no number
    #[arg(long, value_parser = number::at_least_one, allow_negative_numbers = true)]
    threads: Option<NonZeroUsize>,
    /// Folder for what it makes
    #[arg(long, value_name = "DIR")]
    out: PathBuf,
}

pub(super) fn run(args: &Args) -> anyhow::Result<ExitCode> {
    let mut names: Vec<&String> = Vec::new();
    for name in &args.task {
        if !names.contains(&name) {
            names.push(name);
        }
    }
    let tasks = names.iter().map(|name| Played::find(name));
    let settings = Settings {
        tasks: tasks
            .collect::<Result<_, _>>()
            .map_err(BadInput::from_error)?,
        seed: args.seed,
        n_episodes: args.episodes,
        n_threads: args.threads.unwrap_or_else(processors),
        classifier: TimestepConfig::default(),
    };
    out::folder(&args.out)?;
    let n_epochs = settings.classifier.epochs;
    let tell = |progress: Progress| {
        eprintln!(
            "{}: pass {} of {n_epochs}, cross-entropy {:.3} nats, right {:.1} %",
            progress.task,
            progress.n_epochs,
            progress.fit.loss,
            100.0 * progress.fit.accuracy
        );
    };
    for artifact in watch(&settings, &tell)? {
        write_with_picture(&args.out.join(artifact.name), artifact.text)?;
    }
    Ok(ExitCode::SUCCESS)
}
