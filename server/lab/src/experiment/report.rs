//! What a grid came to: curves, tables and differences between methods, from rows alone.
//!
//! Pure: the same rows give the same bytes.

use domain::teacher::SCRIPTED;

use super::Artifact;
use super::grid::RunKey;
use super::results::{Content, Results, Row, RunResult};
use crate::config::ConfigError;
use crate::figure::{self, Between, CurveRow, FigureError, Request, Source};
use crate::message::SessionOffered;

mod budgets;
mod comparable;
mod csv;
mod differences;
mod group;
mod markdown;
mod numbers;
mod score;

use budgets::Budgets;
pub use score::{Learned, Reached, Score, area, learned, reached, score};

/// A file of rows.
#[derive(Debug, Clone)]
pub struct RowFile {
    /// What to call it when something is wrong with it.
    pub name: String,
    /// JSON Lines.
    pub text: String,
    /// Settings in the order in which tables and keys are to name them; others come after these.
    pub settings: Vec<String>,
}

/// Why there is no report.
#[derive(Debug, thiserror::Error)]
pub enum ReportError {
    /// A file that is none of rows.
    #[error(transparent)]
    Text(#[from] ConfigError),
    /// A figure that cannot be drawn.
    #[error(transparent)]
    Figure(#[from] FigureError),
    /// Nothing is finished yet.
    #[error("{files} has no finished run to report{failed}")]
    Nothing {
        /// The files.
        files: String,
        /// Runs that failed, in words; empty where none did.
        failed: String,
    },
    /// Files whose runs share no task.
    #[error(
        "{first} is of {first_tasks} and {second} of {second_tasks}: runs of different tasks cannot be compared; report them apart"
    )]
    OtherTasks {
        /// A file.
        first: String,
        /// Its tasks.
        first_tasks: String,
        /// Another file.
        second: String,
        /// Its tasks.
        second_tasks: String,
    },
    /// Runs that should differ by their method or seed alone.
    #[error(
        "{first} has {what} {there}, but {second} has {here}: they cannot be compared; give them settings with different names, or report them apart"
    )]
    OtherTerms {
        /// A run.
        first: String,
        /// Another.
        second: String,
        /// In what they differ.
        what: String,
        /// Of the first.
        there: String,
        /// Of the second.
        here: String,
    },
    /// The same run from two files.
    #[error("{run} is in {first} and in {second}")]
    Twice {
        /// The run.
        run: String,
        /// A file.
        first: String,
        /// Another file.
        second: String,
    },
    /// Rows of more than one revision.
    #[error(
        "the rows are of different revisions: {0}; their numbers may differ for that alone. Allow it with --mixed"
    )]
    MixedRevisions(String),
}

/// Runs that may be told together.
struct Runs {
    runs: Vec<RunResult>,
    failed: Vec<(RunKey, String)>,
}

/// Makes a report of rows.
///
/// * `may_mix` – whether rows of different revisions may stand side by side; the report names
///   them then
///
/// # Errors
/// [`ReportError`] names the runs that cannot be compared, and in what they differ.
pub fn make(files: &[RowFile], may_mix: bool) -> Result<Vec<Artifact>, ReportError> {
    let mut read = Vec::with_capacity(files.len());
    for file in files {
        read.push((file.name.as_str(), Results::parse(&file.name, &file.text)?));
    }
    comparable::check(&read, may_mix)?;
    // Failed in one file, a run may be finished in another.
    let is_finished = |key: &RunKey| read.iter().any(|(_, results)| results.run(key).is_some());
    let failed = read
        .iter()
        .flat_map(|(_, results)| &results.failed)
        .filter(|(key, _)| !is_finished(key))
        .cloned()
        .collect();
    let mut runs: Vec<RunResult> = read
        .into_iter()
        .flat_map(|(_, results)| results.runs)
        .collect();
    // By what they are, not by which came to its end first.
    let settings: Vec<&String> = files.iter().flat_map(|file| &file.settings).collect();
    runs.sort_by_cached_key(|run| place(&run.key, &settings));
    let runs = Runs { runs, failed };
    let mut artifacts = vec![
        Artifact::new("report.md", markdown::report(&runs)),
        Artifact::new("scores.csv", csv::scores(&runs)),
    ];
    for kind in [true, false] {
        let of_kind: Vec<&RunResult> = runs
            .runs
            .iter()
            .filter(|run| run.end.has_success == kind)
            .collect();
        if of_kind.is_empty() {
            continue;
        }
        let y = if kind { "success_rate" } else { "return_mean" };
        let names = if kind {
            [
                ("success.svg", "success.csv"),
                ("success-by-budget.svg", "success-by-budget.csv"),
            ]
        } else {
            [
                ("return.svg", "return.csv"),
                ("return-by-budget.svg", "return-by-budget.csv"),
            ]
        };
        artifacts.extend(curves(
            names[0],
            &evaluation_rows(&of_kind),
            ("step", y),
            Between::Line,
        )?);
        let by_budget = budget_rows(&of_kind);
        if !by_budget.is_empty() {
            artifacts.extend(curves(
                names[1],
                &by_budget,
                ("budget", y),
                Between::Nothing,
            )?);
        }
    }
    artifacts.extend(stage_gaps(&runs)?);
    Ok(artifacts)
}

/// Where a run stands: tasks and teachers in the registries' order, settings as their file says.
fn place(key: &RunKey, settings: &[&String]) -> impl Ord + use<> {
    let among = |found: Option<usize>| found.unwrap_or(usize::MAX);
    let task = sim::tasks::tasks().iter().position(|t| t.name == key.task);
    let setting = settings.iter().position(|known| **known == key.setting);
    let teacher = SCRIPTED.iter().position(|(name, _)| *name == key.teacher);
    (
        among(task),
        among(setting),
        among(teacher),
        key.clone(), // settings that no file names by name, then method and seed
    )
}

/// A figure of curves, the interquartile mean over seeds, with all its points.
fn curves(
    (svg, csv): (&'static str, &'static str),
    rows: &[CurveRow],
    (x, y): (&str, &str),
    between: Between,
) -> Result<[Artifact; 2], FigureError> {
    let sources = [Source {
        name: svg.to_owned(),
        text: super::json_lines(rows),
    }];
    let request = Request {
        sources: &sources,
        x: Some(x),
        y: Some(y),
        center: Some("iqm"),
        between,
    };
    Ok([
        Artifact::new(svg, figure::make(figure::find("curves")?, &request)?),
        Artifact::new(csv, figure::curve_points(&request)?),
    ])
}

fn evaluation_rows(runs: &[&RunResult]) -> Vec<CurveRow> {
    let of_run = |run: &&RunResult| {
        let (key, setting) = (run.key.clone(), run.key.shown_setting());
        let rows = run.evaluations.iter().map(move |e| CurveRow {
            task: key.task.clone(),
            method: key.method.clone(),
            seed: key.seed,
            setting: setting.clone(),
            teacher: String::new(), // the setting tells it
            step: e.step,
            labels: e.labels,
            budget: None,
            success_rate: e.success_rate,
            return_mean: e.return_mean,
            wall_s: None,
        });
        rows.collect::<Vec<_>>()
    };
    runs.iter().flat_map(of_run).collect()
}

/// Each run's score at its budget, where a figure has a place for it.
fn budget_rows(runs: &[&RunResult]) -> Vec<CurveRow> {
    let row = |run: &&RunResult| CurveRow {
        task: run.key.task.clone(),
        method: run.key.method.clone(),
        seed: run.key.seed,
        setting: run.key.shown_teacher().to_owned(),
        teacher: String::new(), // the setting tells it
        // What tells the points of a seed apart.
        step: u64::from(run.end.budget),
        labels: run.end.labels,
        budget: Some(run.end.budget),
        success_rate: score(run).value,
        return_mean: score(run).value,
        wall_s: None,
    };
    Budgets::of(runs).shown.iter().map(row).collect()
}

/// The figures of stage gaps, where any method has them.
fn stage_gaps(runs: &Runs) -> Result<Vec<Artifact>, FigureError> {
    let sessions = runs.runs.iter().flat_map(|run| {
        let row = |session: &SessionOffered| Row {
            key: run.key.clone(),
            content: Content::Session(session.clone()),
        };
        run.sessions.iter().map(row)
    });
    let sources = [Source {
        name: "results".to_owned(),
        text: super::json_lines(&sessions.collect::<Vec<_>>()),
    }];
    let request = Request {
        sources: &sources,
        ..Request::default()
    };
    let mut artifacts = Vec::new();
    for (figure, svg, csv) in [
        (figure::GAPS, "stage-gaps.svg", "stage-gaps.csv"),
        (
            figure::RATIOS,
            "stage-gap-ratios.svg",
            "stage-gap-ratios.csv",
        ),
    ] {
        match figure.draw(&request) {
            Ok(drawn) => {
                artifacts.push(Artifact::new(svg, drawn));
                artifacts.push(Artifact::new(csv, figure.points(&request)?));
            }
            Err(FigureError::NoRows { .. }) => {}
            Err(error) => return Err(error),
        }
    }
    Ok(artifacts)
}

#[cfg(test)]
mod tests;
#[cfg(test)]
mod told;
