//! `/experiments/{name}`: how far an experiment is, its curves and its tables.

use askama::Template;
use axum::extract::State;
use axum::http::{HeaderValue, header};
use axum::response::{IntoResponse as _, Response};
use lab::experiment::Artifact;
use lab::words::thousands;

use super::experiments::state;
use super::markdown::to_html;
use super::show;
use crate::experiments::{self, Experiment, Running};
use crate::extract::Path;
use crate::problem::Problem;
use crate::state::AppState;
use crate::worker::in_worker;

#[derive(Template)]
#[template(path = "experiment.html")]
struct ExperimentPage {
    /// Of its folder.
    name: String,
    title: String,
    about: String,
    /// `4 of 12 runs, working`
    state: String,
    /// Whether somebody works on it now, so that the page looks again.
    is_up: bool,
    /// `about 3 hours left`
    left: String,
    /// Runs over and in all, for the bar; 0 in all where it is not known.
    n_over: usize,
    n_runs: usize,
    running: Vec<RunLine>,
    /// Runs that could not go on, with why, while no report tells them.
    failed: Vec<(String, String)>,
    figures: Vec<Figure>,
    /// HTML.
    tables: String,
    has_report: bool,
}

/// A run under way.
struct RunLine {
    name: String,
    step: u64,
    total_steps: u64,
    /// `12,000 of 48,000 steps`
    words: String,
}

/// A picture with its points.
struct Figure {
    svg: &'static str,
    csv: String,
    title: &'static str,
}

/// Files of a report that are pictures, with their headings.
const FIGURES: &[(&str, &str)] = &[
    ("success.svg", "Success over environment steps"),
    ("success-by-budget.svg", "Success by the budget of answers"),
    ("return.svg", "Return over environment steps"),
    ("return-by-budget.svg", "Return by the budget of answers"),
    (
        "stage-gaps.svg",
        "Stage gap of chosen pairs and of all candidates",
    ),
    (
        "stage-gap-ratios.svg",
        "Stage gap of chosen pairs by that of all candidates",
    ),
];

/// `GET /experiments/{name}`
///
/// # Errors
/// An experiment that does not exist; rows that cannot be reported.
pub async fn page(
    State(app): State<AppState>,
    Path(name): Path<String>,
) -> Result<Response, Problem> {
    in_worker(move || {
        let experiment = find(&app, &name)?;
        let report = experiment.report().map_err(Problem::unreadable_results)?;
        Ok(show(&filled(&experiment, &report)))
    })
    .await?
}

/// `GET /experiments/{name}/{file}`: a file of the report, or the rows.
///
/// # Errors
/// A file that the report does not have.
pub async fn file(
    State(app): State<AppState>,
    Path((name, file)): Path<(String, String)>,
) -> Result<Response, Problem> {
    in_worker(move || {
        let experiment = find(&app, &name)?;
        if file == "results.jsonl" {
            return Ok(as_file(&file, experiment.rows));
        }
        let report = experiment.report().map_err(Problem::unreadable_results)?;
        let found = report.iter().find(|artifact| artifact.name == file);
        let artifact =
            found.ok_or_else(|| Problem::experiment_not_found(&format!("{name}/{file}")))?;
        Ok(as_file(&file, artifact.text.clone()))
    })
    .await?
}

fn find(app: &AppState, name: &str) -> Result<Experiment, Problem> {
    let found = experiments::find(app.store.folder(), name);
    found.ok_or_else(|| Problem::experiment_not_found(name))
}

fn as_file(name: &str, text: String) -> Response {
    let kind = match name.rsplit_once('.').map(|(_, ending)| ending) {
        Some("svg") => "image/svg+xml",
        Some("csv") => "text/csv; charset=utf-8",
        Some("md") => "text/markdown; charset=utf-8",
        _ => "application/jsonl; charset=utf-8",
    };
    (
        [(header::CONTENT_TYPE, HeaderValue::from_static(kind))],
        text,
    )
        .into_response()
}

fn filled(experiment: &Experiment, report: &[Artifact]) -> ExperimentPage {
    let progress = experiment.progress.as_ref();
    let up = progress.filter(|progress| progress.is_up);
    let text = |name: &str| report.iter().find(|artifact| artifact.name == name);
    let figures = FIGURES.iter().filter(|(svg, _)| text(svg).is_some());
    ExperimentPage {
        name: experiment.name.clone(),
        title: experiment.title.clone(),
        about: experiment.about.clone(),
        state: state(experiment),
        is_up: up.is_some(),
        left: up.map_or_else(String::new, |progress| left(progress.left_s)),
        n_over: progress.map_or(0, |progress| progress.n_over),
        n_runs: progress.map_or(0, |progress| progress.n_runs),
        running: up.map_or_else(Vec::new, |progress| {
            progress.running.iter().map(run_line).collect()
        }),
        failed: match &experiment.results {
            Ok(results) if report.is_empty() => {
                let failed = results.failed.iter();
                failed.map(|(key, why)| (key.name(), why.clone())).collect()
            }
            _ => Vec::new(),
        },
        figures: figures
            .map(|(svg, title)| Figure {
                svg,
                csv: svg.replace(".svg", ".csv"),
                title,
            })
            .collect(),
        tables: text("report.md").map_or_else(String::new, |report| to_html(&report.text)),
        has_report: !report.is_empty(),
    }
}

fn run_line(run: &Running) -> RunLine {
    RunLine {
        name: run.name.clone(),
        step: run.step,
        total_steps: run.total_steps,
        words: format!(
            "{} of {} steps",
            thousands(run.step),
            thousands(run.total_steps)
        ),
    }
}

fn left(seconds: f64) -> String {
    match seconds / 60.0 {
        minutes if minutes < 1.5 => "about a minute left".into(),
        minutes if minutes < 90.0 => format!("about {minutes:.0} minutes left"),
        minutes if minutes < 48.0 * 60.0 => format!("about {:.0} hours left", minutes / 60.0),
        minutes => format!("about {:.0} days left", minutes / 1_440.0),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use lab::experiment::results::Results;

    #[test]
    fn links_lead_to_a_folder_whose_name_has_other_uses_in_addresses() {
        let experiment = Experiment {
            name: "c#2".into(),
            title: "Three of them".into(),
            about: String::new(),
            rows: String::new(),
            results: Ok(Results::default()),
            settings: Vec::new(),
            progress: None,
            is_shipped: false,
        };
        let report = [Artifact {
            name: "success.svg".into(),
            text: String::new(),
        }];
        let html = filled(&experiment, &report).render().unwrap();
        for file in ["success.svg", "success.csv", "report.md", "results.jsonl"] {
            let link = format!("\"/experiments/c%232/{file}\"");
            assert!(html.contains(&link), "{link} is not in: {html}");
        }
        assert!(!html.contains("c#2/"), "{html}");
    }

    #[test]
    fn the_time_left_is_told_in_a_unit_that_fits() {
        assert_eq!(left(80.0), "about a minute left");
        assert_eq!(left(300.0), "about 5 minutes left");
        assert_eq!(left(7_200.0), "about 2 hours left");
        assert_eq!(left(259_200.0), "about 3 days left");
    }
}
