//! `stair experiment NAME`: the paper's experiments that need no simulation.

use std::num::NonZeroUsize;
use std::path::PathBuf;
use std::process::ExitCode;

use lab::experiment::{self, Settings};

use crate::cli::BadInput;
use crate::cli::figure::{Format, encode, write};

/// An experiment that needs no simulation.
#[derive(Debug, clap::Args)]
#[group(id = "pure")]
pub(super) struct Args {
    /// Which experiment
    name: String,
    /// Folder for what it makes
    #[arg(long, value_name = "DIR")]
    out: PathBuf,
    /// Independent repetitions
    #[arg(long, default_value_t = 20, value_parser = clap::value_parser!(u64).range(1..=10_000))]
    seeds: u64,
    /// Threads [default: one for each processor]; changes no number
    #[arg(long)]
    threads: Option<NonZeroUsize>,
}

/// Runs the command.
///
/// # Errors
/// [`BadInput`] for an unknown experiment; a folder that cannot be written.
pub(super) fn run(args: &Args) -> anyhow::Result<ExitCode> {
    let experiment = experiment::find(&args.name).map_err(BadInput::from_error)?;
    let processors = || std::thread::available_parallelism().unwrap_or(NonZeroUsize::MIN);
    let settings = Settings {
        n_seeds: args.seeds,
        n_threads: args.threads.unwrap_or_else(processors),
    };
    for artifact in (experiment.run)(settings)? {
        let path = args.out.join(artifact.name);
        write(&path, artifact.text.as_bytes())?;
        println!("{}", path.display());
        if Format::of(&path).ok() == Some(Format::Svg) {
            let picture = path.with_extension("png");
            write(&picture, &encode(artifact.text, Format::Png, 2.0)?)?;
            println!("{}", picture.display());
        }
    }
    Ok(ExitCode::SUCCESS)
}
