//! Figures and measures of exported answers.

use std::fmt::Write as _;
use std::path::{Path, PathBuf};

use anyhow::Context as _;
use lab::words::counted;

use super::super::figure::{Format, encode};
use super::super::out::{self, write};
use super::super::{BadInput, say};
use crate::label_table::{self, TableFormat};
use crate::study_results::{Results, results};

/// Draw the figures of exported answers and compute their measures
#[derive(Debug, clap::Args)]
#[command(after_help = "Examples:
  stair study export 1 --format parquet --out answers.parquet
  stair study report answers.parquet --out report")]
pub(super) struct Args {
    /// Answers as `stair export` wrote them: .csv, .jsonl or .parquet
    file: PathBuf,
    /// A folder for figures (SVG and PNG), their rows, and measures.json
    #[arg(long, value_name = "DIR")]
    out: PathBuf,
}

pub(super) fn run(args: &Args) -> anyhow::Result<()> {
    let name = args.file.display();
    let ending = args
        .file
        .extension()
        .and_then(|e| e.to_str())
        .unwrap_or_default();
    let format = TableFormat::of(ending)
        .ok_or_else(|| BadInput(format!("{name} must end in .csv, .jsonl or .parquet")))?;
    let bytes = std::fs::read(&args.file)
        .map_err(|error| BadInput(format!("cannot read {name}: {error}")))?;
    let labels = label_table::read(&bytes, format)
        .map_err(|error| BadInput(format!("{name} is no table of answers: {error}")))?;
    out::folder(&args.out)?;
    let results = results(&labels);
    if results.n_answers == 0 {
        let told = format!("{name} holds no answers of a study that count");
        return Err(BadInput(told).into());
    }
    keep(&results, &args.out)?;
    say(&table(&results))
}

fn keep(results: &Results, folder: &Path) -> anyhow::Result<()> {
    for figure in &results.figures {
        let svg = figure.draw().map_err(BadInput::from_error)?;
        let path = folder.join(figure.name);
        write(&path.with_extension("jsonl"), figure.rows.as_bytes())?;
        write(
            &path.with_extension("png"),
            &encode(svg.clone(), Format::Png, 2.0)?,
        )?;
        write(&path.with_extension("svg"), svg.as_bytes())?;
    }
    let measures = serde_json::to_string_pretty(&results.measures).context("measures as JSON")?;
    write(&folder.join("measures.json"), (measures + "\n").as_bytes())
}

fn table(results: &Results) -> String {
    let n_answers = counted(results.n_answers as u64, "answer", "answers");
    let mut text = format!("{n_answers}\n");
    for measure in &results.measures {
        let (value, interval) = (measure.shown_value(), measure.shown_interval());
        // Writing to a String cannot fail.
        let _ = writeln!(
            text,
            "  {:44} {value:>8}  {interval:18} {}",
            measure.name, measure.from
        );
    }
    text
}
