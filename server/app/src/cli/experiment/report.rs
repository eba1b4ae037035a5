//! `stair experiment report`: figures and tables of an experiment's results.

use std::path::PathBuf;
use std::process::ExitCode;

use lab::grid::FileText;
use lab::report::{Report, ReportSettings};

use super::folder::{ExperimentFolder, read};
use crate::cli::BadInput;
use crate::cli::figure::{Format, encode, write};

/// Curves, stage gaps and tables of an experiment's results, as SVG, PNG, CSV and Markdown
#[derive(Debug, clap::Args)]
pub(super) struct Args {
    /// The experiment's folder
    folder: PathBuf,
    /// Where to write it [default: `report` in the folder]
    #[arg(long, value_name = "DIR")]
    out: Option<PathBuf>,
    /// Put results of several revisions beside one another
    #[arg(long)]
    mix_revisions: bool,
    /// Report although some methods lack runs that others have
    #[arg(long)]
    partial: bool,
}

pub(super) fn run(args: &Args) -> anyhow::Result<ExitCode> {
    let folder = ExperimentFolder::at(&args.folder);
    let path = folder.file();
    let name = path.display().to_string();
    let text = read(&path)?;
    let file = FileText {
        name: &name,
        text: &text,
    };
    let file = file.parse().map_err(BadInput::from_error)?;
    let settings = ReportSettings {
        x: file.x,
        may_mix_revisions: args.mix_revisions,
        may_be_partial: args.partial,
    };
    let report = Report::new(folder.results()?, settings).map_err(BadInput::from_error)?;
    let out = args
        .out
        .clone()
        .unwrap_or_else(|| args.folder.join("report"));
    for file in report.files(&file.title).map_err(BadInput::from_error)? {
        let path = out.join(file.name);
        write(&path, file.text.as_bytes())?;
        if Format::of(&path).ok() == Some(Format::Svg) {
            let picture = path.with_extension("png");
            write(&picture, &encode(file.text, Format::Png, 2.0)?)?;
        } else if file.name == "report.md" {
            println!("{}", file.text);
        }
    }
    println!("Written to {}", out.display());
    Ok(ExitCode::SUCCESS)
}
