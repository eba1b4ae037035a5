//! `stair experiment report`: curves, tables and differences from rows.

use std::path::{Path, PathBuf};
use std::process::ExitCode;

use lab::experiment::grid::{GridText, setting_names};
use lab::experiment::report::{self, RowFile};
use lab::experiment::results::read_rows;

use super::write_with_picture;
use crate::cli::{BadInput, out};

/// Report what a grid came to: curves, tables, differences between methods
#[derive(Debug, clap::Args)]
#[command(after_help = "Examples:
  stair experiment report data/experiments/go-fetch-return
  stair experiment report mine/results.jsonl theirs/results.jsonl --out compared")]
pub(super) struct Args {
    /// Experiments' folders, or their files of rows
    #[arg(required = true, value_name = "DIR|FILE")]
    rows: Vec<PathBuf>,
    /// Folder for the report [default: report, beside the first file of rows]
    #[arg(long, value_name = "DIR")]
    out: Option<PathBuf>,
    /// Compare although rows are of different revisions of the program
    #[arg(long)]
    mixed: bool,
}

pub(super) fn run(args: &Args) -> anyhow::Result<ExitCode> {
    let files = args
        .rows
        .iter()
        .map(|path| read(path))
        .collect::<Result<Vec<_>, _>>()?;
    let beside = || out::parent(&file_of(&args.rows[0])).join("report");
    let out = args.out.clone().unwrap_or_else(beside);
    out::folder(&out)?;
    let artifacts = report::make(&files, args.mixed).map_err(BadInput::from_error)?;
    for artifact in artifacts {
        write_with_picture(&out.join(artifact.name), artifact.text)?;
    }
    Ok(ExitCode::SUCCESS)
}

fn file_of(path: &Path) -> PathBuf {
    if path.is_dir() {
        path.join("results.jsonl")
    } else {
        path.to_owned()
    }
}

fn read(path: &Path) -> Result<RowFile, BadInput> {
    let path = file_of(path);
    let name = path.display().to_string();
    let text =
        read_rows(&path).map_err(|error| BadInput(format!("cannot read {name}: {error}")))?;
    let grid = path.with_file_name("experiment.toml"); // rows alone will do
    let settings = std::fs::read_to_string(&grid).map_or_else(
        |_| Vec::new(),
        |text| {
            setting_names(GridText {
                name: &grid.display().to_string(),
                text: &text,
            })
        },
    );
    Ok(RowFile {
        name,
        text,
        settings,
    })
}
