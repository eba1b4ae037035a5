//! `stair study pack`: the queries of a finished run in one file.

use std::path::PathBuf;

use lab::study::{DEFAULT_QUERIES, PackedQueries};
use lab::words::counted;

use crate::cli::{BadInput, number, out, say};
use crate::provenance::REVISION;

#[derive(Debug, clap::Args)]
#[command(after_help = "Examples:
  stair train door-open --method stair --preset quick
  stair study pack data/train/door-open-stair-1 --out door-open-stair.queries")]
pub(super) struct Args {
    /// The folder of a finished run: what `stair train --out` wrote
    #[arg(value_name = "RUN_FOLDER")]
    folder: PathBuf,
    /// Where to write them
    #[arg(long, value_name = "FILE")]
    out: PathBuf,
    /// How many queries, spread evenly over sessions and over places in them
    #[arg(long, default_value_t = DEFAULT_QUERIES, value_parser = number::whole::<usize>)]
    #[arg(allow_negative_numbers = true)]
    n: usize,
}

/// Runs the command.
///
/// # Errors
/// [`BadInput`] for a folder without a finished run or with too few queries, and for a name that
/// is not one of a query set; a file that cannot be written.
pub(super) fn run(args: &Args) -> anyhow::Result<()> {
    if args
        .out
        .extension()
        .is_none_or(|ending| ending != "queries")
    {
        let told = format!("{} must end in .queries", args.out.display());
        return Err(BadInput(told).into());
    }
    out::file(&args.out)?;
    let packed = PackedQueries::of_run(&args.folder, Some(args.n), REVISION)
        .map_err(BadInput::from_error)?;
    let bytes = packed.pack();
    out::write(&args.out, &bytes)?;
    say(&format!(
        "{}: {} of {} on {}, {} each, {} kB\nMade by: {}\n",
        args.out.display(),
        counted(packed.queries.len() as u64, "query", "queries"),
        packed.method,
        packed.task,
        counted(packed.segment_len.into(), "step", "steps"),
        bytes.len().div_ceil(1000),
        packed.command,
    ))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn told(folder: &str, out: &str) -> String {
        let error = run(&Args {
            folder: folder.into(),
            out: out.into(),
            n: 3,
        })
        .unwrap_err();
        assert!(error.is::<BadInput>(), "{error:#}");
        error.to_string()
    }

    #[test]
    fn a_folder_without_a_run_and_another_ending_are_bad_input() {
        let folder = tempfile::tempdir().unwrap();
        let out = folder.path().join("mine.queries");
        let (folder, out) = (
            folder.path().display().to_string(),
            out.display().to_string(),
        );
        assert!(told(&folder, &out).contains("holds no run"));
        assert!(!std::path::Path::new(&out).exists());
        assert!(told(&folder, "mine.png").contains("must end in .queries"));
    }
}
