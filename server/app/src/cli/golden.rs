//! `stair golden`: replays recordings of the original environments and prints the errors.

use std::path::PathBuf;
use std::process::ExitCode;

use sim::golden::{FieldReport, Replay, Report, find_recordings};

use super::BadInput;

/// Replay recordings of the original environments through this program's observation, reward
/// and success functions.
///
/// Prints the largest error of each field. Ends with code 1 when a field is past its tolerance
/// (rewards 1e-6, observations 1e-5, success exact) and 2 when a line or a path cannot be read.
#[derive(Debug, clap::Args)]
#[command(after_help = "Examples:
  stair golden tests/golden
  stair golden recordings/window-open_v2.jsonl more-recordings/")]
pub struct Args {
    /// Files of JSON Lines, or folders to search for *.jsonl.
    #[arg(required = true, value_name = "PATH")]
    paths: Vec<PathBuf>,
}

/// How many unreadable lines are printed before the rest is only counted.
const N_MALFORMED_SHOWN: usize = 10;

/// Replays and prints.
///
/// # Errors
/// A path that is not there or cannot be read, or folders without a recording.
pub fn run(args: &Args) -> anyhow::Result<ExitCode> {
    let files = find_recordings(&args.paths).map_err(BadInput::from_error)?;
    if files.is_empty() {
        return Err(BadInput("no *.jsonl file was found in these folders".into()).into());
    }
    let mut replay = Replay::new();
    for file in &files {
        replay.file(file).map_err(BadInput::from_error)?;
    }
    let report = replay.finish();
    print!("{}", table(&report.fields));
    for (reason, n_lines) in &report.skipped {
        println!("skipped {n_lines} lines: {reason}");
    }
    for line in report.malformed.iter().take(N_MALFORMED_SHOWN) {
        eprintln!("stair: {line}");
    }
    println!("{}", verdict(&report, files.len()));
    Ok(exit_code(&report))
}

fn exit_code(report: &Report) -> ExitCode {
    if !report.malformed.is_empty() {
        ExitCode::from(2)
    } else if report.is_within_tolerance() {
        ExitCode::SUCCESS
    } else {
        ExitCode::FAILURE
    }
}

fn verdict(report: &Report, n_files: usize) -> String {
    let mut said = vec![format!(
        "{} lines of {n_files} files compared",
        report.n_checked
    )];
    let n_past = report
        .fields
        .iter()
        .filter(|f| !f.is_within_tolerance())
        .count();
    if n_past > 0 {
        said.push(format!("{n_past} fields past their tolerance"));
    } else if report.n_checked > 0 {
        said.push("all within tolerance".into());
    }
    match report.malformed.len() {
        0 => {}
        1 => said.push("1 line could not be read".into()),
        n => said.push(format!("{n} lines could not be read")),
    }
    said.join(", ")
}

/// Recording, field, lines, largest error, tolerance, verdict; aligned.
fn table(fields: &[FieldReport]) -> String {
    const HEAD: [&str; 6] = [
        "recording",
        "field",
        "lines",
        "largest error",
        "tolerance",
        "",
    ];
    if fields.is_empty() {
        return String::new();
    }
    let mut rows = vec![HEAD.map(String::from)];
    rows.extend(fields.iter().map(row));
    let width = |column: usize| rows.iter().map(|r| r[column].chars().count()).max();
    let widths: [usize; 5] = std::array::from_fn(|column| width(column).unwrap_or(0));
    let line = |r: &[String; 6]| {
        let [a, b, c, d, e] = widths;
        let text = format!(
            "{:a$}  {:b$}  {:>c$}  {:>d$}  {:>e$}  {}",
            r[0], r[1], r[2], r[3], r[4], r[5]
        );
        format!("{}\n", text.trim_end())
    };
    rows.iter().map(line).collect()
}

fn row(field: &FieldReport) -> [String; 6] {
    let is_flag = field.tolerance == 0.0;
    let verdict = if field.is_within_tolerance() {
        "ok".into()
    } else {
        format!("PAST, {}", field.worst)
    };
    [
        field.recording.clone(),
        field.field.into(),
        field.n_lines.to_string(),
        if is_flag {
            format!("{} differ", field.largest_error)
        } else {
            format!("{:.1e}", field.largest_error)
        },
        if is_flag {
            "exact".into()
        } else {
            format!("{:.0e}", field.tolerance)
        },
        verdict,
    ]
}

#[cfg(test)]
mod tests {
    use super::*;

    fn report_of(text: &str) -> Report {
        let mut replay = Replay::new();
        replay.text("recording.jsonl", text.as_bytes());
        replay.finish()
    }

    #[test]
    fn a_line_that_makes_no_sense_is_counted_in_the_verdict() {
        let report = report_of("{\n");
        assert_eq!(
            verdict(&report, 1),
            "0 lines of 1 files compared, 1 line could not be read"
        );
        assert_eq!(exit_code(&report), ExitCode::from(2));
    }

    #[test]
    fn a_field_past_its_tolerance_is_marked_with_its_place() {
        let field = FieldReport {
            recording: "window-open v2 transitions".into(),
            field: "reward",
            n_lines: 3,
            largest_error: 2e-3,
            tolerance: 1e-6,
            worst: "recording.jsonl:2".into(),
        };
        let table = table(&[field]);
        assert!(table.contains("2.0e-3"), "{table}");
        assert!(table.contains("PAST, recording.jsonl:2"), "{table}");
    }
}
