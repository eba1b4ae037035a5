//! `stair experiment`: grids of runs, their reports, and the paper's smaller experiments.

use std::fmt::Write as _;
use std::num::NonZeroUsize;
use std::path::{Path, PathBuf};
use std::process::ExitCode;

use clap::Subcommand;
use lab::experiment::grid::{self, Grid, GridText, SHIPPED};
use lab::experiment::{self, EXPERIMENTS, Settings};

use super::figure::{Format, encode};
use super::{BadInput, number, out};
use crate::provenance::processors;

mod check;
mod pool;
mod report;
mod run;
mod timestep_classifier;

/// Run an experiment, as far as it has not run yet, and report what came out
#[derive(Debug, clap::Args)]
#[command(after_help = after_help())]
#[command(args_conflicts_with_subcommands = true, subcommand_negates_reqs = true)]
pub struct Args {
    #[command(subcommand)]
    command: Option<Command>,
    /// An experiment that needs no simulation
    #[arg(required = true)]
    name: Option<String>,
    /// Folder for what it makes
    #[arg(long, value_name = "DIR", required = true)]
    out: Option<PathBuf>,
    /// Independent repetitions
    #[arg(long, default_value_t = 20, value_parser = clap::value_parser!(u32).range(1..=10_000))]
    #[arg(allow_negative_numbers = true)]
    seeds: u32,
    /// Threads [default: one for each processor]; changes no number
    #[arg(long, value_parser = number::at_least_one, allow_negative_numbers = true)]
    threads: Option<NonZeroUsize>,
}

#[derive(Debug, Subcommand)]
enum Command {
    Run(run::Args),
    Check(check::Args),
    List(check::ListArgs),
    Report(report::Args),
    TimestepClassifier(timestep_classifier::Args),
}

fn after_help() -> String {
    let mut text = "Experiments without simulation:\n".to_owned();
    for experiment in EXPERIMENTS {
        // Further in than its name: a line that is too long goes on as far in as it began.
        writeln!(text, "  {}\n      {}", experiment.name, experiment.summary)
            .expect("writing to a string cannot fail");
    }
    let names: Vec<&str> = SHIPPED.iter().map(|shipped| shipped.name).collect();
    writeln!(
        text,
        "\nGrids of runs that come with the program (or a FILE.toml of your own):\n  {}",
        names.join(", ")
    )
    .expect("writing to a string cannot fail");
    text.push_str(
        "\nExamples:
  stair experiment list                        what each grid costs on this machine
  stair experiment run go-fetch-return --small --out results/small
  stair experiment report results/small
  stair experiment abstract-mdp --out results/abstract-mdp",
    );
    text
}

/// Runs the command.
///
/// # Errors
/// [`BadInput`] for an unknown experiment or a file that does not fit; a folder that cannot be
/// written.
pub fn run(args: Args) -> anyhow::Result<ExitCode> {
    match args.command {
        Some(Command::Run(args)) => run::run(&args),
        Some(Command::Check(args)) => check::run(&args),
        Some(Command::List(_)) => check::list(),
        Some(Command::Report(args)) => report::run(&args),
        Some(Command::TimestepClassifier(args)) => timestep_classifier::run(&args),
        None => without_simulation(&args),
    }
}

fn without_simulation(args: &Args) -> anyhow::Result<ExitCode> {
    let (Some(name), Some(out)) = (&args.name, &args.out) else {
        return Err(BadInput("name an experiment and its --out".into()).into());
    };
    if grid::shipped(name).is_ok() {
        let told = format!("'{name}' is a grid of runs: stair experiment run {name}");
        return Err(BadInput(told).into());
    }
    let experiment = experiment::find(name).map_err(BadInput::from_error)?;
    let settings = Settings {
        n_seeds: args.seeds.into(),
        n_threads: args.threads.unwrap_or_else(processors),
    };
    out::folder(out)?;
    for artifact in (experiment.run)(settings)? {
        write_with_picture(&out.join(artifact.name), artifact.text)?;
    }
    Ok(ExitCode::SUCCESS)
}

/// Writes a text, and beside an SVG the same as PNG; says what is there now.
fn write_with_picture(path: &Path, text: String) -> anyhow::Result<()> {
    out::write(path, text.as_bytes())?;
    println!("{}", path.display());
    if Format::of(path).ok() == Some(Format::Svg) {
        let picture = path.with_extension("png");
        out::write(&picture, &encode(text, Format::Png, 2.0)?)?;
        println!("{}", picture.display());
    }
    Ok(())
}

/// A grid as the command line names it, with its text and a short name for its folder.
struct Chosen {
    grid: Grid,
    text: String,
    stem: String,
}

impl Chosen {
    /// A file, or the name of one that comes with the program.
    fn open(name: &str, is_small: bool) -> anyhow::Result<Self> {
        let path = Path::new(name);
        let (text, stem) = if is_path(path) {
            let text = std::fs::read_to_string(path)
                .map_err(|error| BadInput(format!("cannot read {name}: {error}")))?;
            (text, stem(path))
        } else {
            let shipped = grid::shipped(name).map_err(BadInput::from_error)?;
            (shipped.text.to_owned(), name.to_owned())
        };
        let source = GridText { name, text: &text };
        let grid = grid::resolve(source, is_small).map_err(BadInput::from_error)?;
        let stem = if is_small {
            format!("{stem}-small")
        } else {
            stem
        };
        Ok(Self { grid, text, stem })
    }
}

/// What the folder for a file's results is called. An `experiment.toml` lies in a folder whose name
/// tells it from others.
fn stem(path: &Path) -> String {
    let folder = path.parent().filter(|folder| *folder != Path::new(""));
    let folder = folder.unwrap_or(Path::new(".")).canonicalize().ok();
    let folder = folder.as_deref().and_then(Path::file_name);
    let telling = folder.filter(|_| path.ends_with("experiment.toml"));
    let name = telling.or(path.file_stem()).unwrap_or_default();
    name.to_string_lossy().into_owned()
}

/// Whether a file is meant, there or not, and no name of one that comes with the program. A folder
/// hides no such name: `--out` may have made it.
fn is_path(path: &Path) -> bool {
    path.is_file()
        || path.extension().is_some_and(|ending| ending == "toml")
        || path.components().count() > 1
}

/// `3 h 20 min`, for people who plan their week.
fn in_words(time: std::time::Duration) -> String {
    let minutes = time.as_secs().div_ceil(60);
    match (minutes / 1440, minutes / 60 % 24, minutes % 60) {
        (0, 0, minutes) => format!("{minutes} min"),
        (0, hours, minutes) => format!("{hours} h {minutes} min"),
        (days, hours, _) => format!("{days} d {hours} h"),
    }
}

#[cfg(test)]
mod tests {
    use std::path::Path;
    use std::time::Duration;

    use super::{in_words, stem};

    #[test]
    fn times_are_told_as_coarsely_as_they_are_known() {
        let words =
            [40, 3_600 + 1_200, 2 * 86_400 + 3_600 * 5].map(|s| in_words(Duration::from_secs(s)));
        assert_eq!(words, ["1 min", "1 h 20 min", "2 d 5 h"]);
    }

    #[test]
    fn results_are_called_as_their_file_or_as_the_folder_of_a_kept_one() {
        let here = tempfile::tempdir().unwrap();
        std::fs::create_dir(here.path().join("walker-run")).unwrap();
        let of = |name: &str| stem(&here.path().join(name));
        assert_eq!(of("walker-run/experiment.toml"), "walker-run");
        assert_eq!(of("walker-run/../walker-run/experiment.toml"), "walker-run");
        assert_eq!(of("walker-run/mine.toml"), "mine");
        assert_eq!(stem(Path::new("mine.toml")), "mine");
    }
}
