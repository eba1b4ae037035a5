//! `stair golden`: replays recordings of the original environments and prints the errors.

use std::path::PathBuf;
use std::process::ExitCode;

use sim::golden::trajectory::{DynamicsReport, HAND_TOLERANCE_M, OBJECT_TOLERANCE};
use sim::golden::{FieldReport, Replay, Report, find_recordings};

use super::BadInput;

/// Replay recordings of the original environments through this program's observation, reward
/// and success functions.
///
/// Prints the largest error of each field, and for whole trajectories how our physics follows the
/// recorded actions: the hand until it touches something (10 mm), the object at the end of an
/// expert's episode (15 % of its travel). Ends with code 1 when a field is past the tolerance that
/// stands beside it (observations 1e-5, success exact, rewards 1e-6 or, where the recording is
/// rounded, 2e-5, poses and inertias 1e-4, gravity and other bias forces 1e-3; the physics are
/// only told) and 2 when a line or a path cannot be read.
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
    print!("{}", dynamics_table(&report.dynamics));
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
    aligned(HEAD, fields.iter().map(row).collect())
}

/// Trajectory, steps and error of the free hand, object here and there, error, verdict; aligned.
fn dynamics_table(reports: &[DynamicsReport]) -> String {
    const HEAD: [&str; 6] = [
        "trajectory",
        "object here (there)",
        "free steps",
        "hand rms",
        "object off",
        "",
    ];
    aligned(HEAD, reports.iter().map(dynamics_row).collect())
}

fn dynamics_row(report: &DynamicsReport) -> [String; 6] {
    let [here, there] = report.object;
    let verdict = if report.is_within_tolerance() {
        "ok".into()
    } else {
        let (hand_mm, share) = (1e3 * HAND_TOLERANCE_M, 100.0 * OBJECT_TOLERANCE);
        format!("further than {hand_mm:.0} mm or {share:.0} %")
    };
    [
        report.recording.clone(),
        format!("{here:.3} ({there:.3})"),
        report.n_free.to_string(),
        format!("{:.1} mm", 1e3 * report.hand_rms_m),
        format!("{:.1} %", 100.0 * report.object_error()),
        verdict,
    ]
}

/// Rows under a head, two columns to the left and three to the right, the last as it comes.
fn aligned(head: [&str; 6], rows: Vec<[String; 6]>) -> String {
    if rows.is_empty() {
        return String::new();
    }
    let mut lines = vec![head.map(String::from)];
    lines.extend(rows);
    let width = |column: usize| lines.iter().map(|r| r[column].chars().count()).max();
    let widths: [usize; 5] = std::array::from_fn(|column| width(column).unwrap_or(0));
    let line = |r: &[String; 6]| {
        let [a, b, c, d, e] = widths;
        let text = format!(
            "{:a$}  {:b$}  {:>c$}  {:>d$}  {:>e$}  {}",
            r[0], r[1], r[2], r[3], r[4], r[5]
        );
        format!("{}\n", text.trim_end())
    };
    lines.iter().map(line).collect()
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
    fn a_trajectory_that_our_physics_does_not_follow_is_marked() {
        let report = DynamicsReport {
            recording: "door-open v2 expert, seed 300".into(),
            is_expert: true,
            n_free: 20,
            hand_rms_m: 0.004,
            object: [-1.0, -2.0],
            travel: 2.0,
        };
        let table = dynamics_table(&[report]);
        assert!(table.contains("-1.000 (-2.000)"), "{table}");
        assert!(
            table.contains("50.0 %  further than 10 mm or 15 %"),
            "{table}"
        );
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
