//! `/experiments`: every experiment that has results or is under way.

use askama::Template;
use axum::extract::State;
use axum::response::Response;
use lab::words::thousands;

use super::show;
use crate::experiments::{self, Experiment};
use crate::problem::Problem;
use crate::state::AppState;
use crate::worker::in_worker;

#[derive(Template)]
#[template(path = "experiments.html")]
struct ExperimentsPage {
    /// Of the data folder, then of the program.
    lines: Vec<Line>,
    has_lines: bool,
}

/// One experiment.
struct Line {
    name: String,
    title: String,
    /// `12 of 40 runs, working`
    state: String,
    is_up: bool,
    /// Where it is from.
    origin: &'static str,
}

/// `GET /experiments`
///
/// # Errors
/// A worker that cannot be had.
pub async fn page(State(app): State<AppState>) -> Result<Response, Problem> {
    let lines = in_worker(move || {
        experiments::all(app.store.folder())
            .iter()
            .map(line)
            .collect::<Vec<_>>()
    });
    let lines = lines.await?;
    Ok(show(&ExperimentsPage {
        has_lines: !lines.is_empty(),
        lines,
    }))
}

fn line(experiment: &Experiment) -> Line {
    let is_up = experiment.progress.as_ref().is_some_and(|p| p.is_up);
    Line {
        name: experiment.name.clone(),
        title: experiment.title.clone(),
        state: state(experiment),
        is_up,
        origin: if experiment.is_shipped {
            "came with the program"
        } else {
            "in the data folder"
        },
    }
}

/// How many runs are over, in words.
pub(super) fn state(experiment: &Experiment) -> String {
    let Ok(results) = &experiment.results else {
        return "its results cannot be read".to_owned();
    };
    let n = thousands(results.runs.len() as u64);
    let progress = experiment.progress.as_ref();
    let finished = progress.map_or_else(
        || format!("{n} runs"),
        |progress| format!("{n} of {} runs", progress.n_runs),
    );
    let failed = match results.failed.len() {
        0 => String::new(),
        n => format!(", {n} failed"),
    };
    let working = if progress.is_some_and(|progress| progress.is_up) {
        ", working"
    } else {
        ""
    };
    finished + &failed + working
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_line_has_its_folders_name_and_links_that_lead_there() {
        let line = Line {
            name: "c#2".into(),
            title: "Three of them (small variant)".into(),
            state: "3 runs".into(),
            is_up: false,
            origin: "in the data folder",
        };
        let page = ExperimentsPage {
            lines: vec![line],
            has_lines: true,
        };
        let html = page.render().unwrap();
        assert_eq!(html.matches("\"/experiments/c%232\"").count(), 2, "{html}");
        assert!(html.contains("in the data folder"), "{html}");
        assert!(!html.contains("/experiments/c#2"), "{html}");
    }
}
