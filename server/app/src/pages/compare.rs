//! `/compare`: a few runs side by side, their numbers in a table and their learning curves in one
//! figure each.

use askama::Template;
use axum::extract::State;
use axum::http::{StatusCode, header};
use axum::response::{IntoResponse as _, Response};
use lab::words::thousands;
use serde_json::Value;
use store::RunId;

use super::home::method_name;
use super::{percent, show, title};
use crate::api::runs::{self, RunView};
use crate::extract::{Path, Query};
use crate::live::{HTTP, HUMAN};
use crate::problem::Problem;
use crate::state::AppState;
use crate::worker::in_worker;
use curves::{PLOTS, Plot, draw};

mod curves;

/// Fewer are on a page of their own.
const LEAST: usize = 2;
/// More lines than these nobody tells apart.
const MOST: usize = 8;

/// What stands in the address, in its order: forms send a name again for each box that is ticked.
type Asked = Vec<(String, String)>;

#[derive(Template)]
#[template(path = "compare.html")]
struct ComparePage {
    /// In the order of the address.
    lines: Vec<Line>,
    /// As addresses name them: `1,2`.
    numbers: String,
    plots: Vec<&'static Plot>,
    /// What the curves leave out, in words.
    left_out: Vec<String>,
}

/// A run in the table.
struct Line {
    id: i64,
    /// The task as people read it.
    title: &'static str,
    method: String,
    size: String,
    seed: u64,
    answerer: String,
    /// Kind of state, for colour.
    state: String,
    /// State in a few words.
    message: String,
    /// `12,000 of 48,000`
    steps: String,
    /// `20 of 80`
    answers: String,
    /// Of the last trial: `35 %`.
    success: String,
}

/// A run with its trials.
struct Compared {
    run: RunView,
    /// As the run told them, one JSON object a line; empty before the first.
    trials: String,
    /// Success rate of the last one.
    success: Option<f64>,
}

/// `GET /compare`
///
/// # Errors
/// Too few runs or too many, one twice, one that does not exist or is a study's, or no number.
pub async fn page(
    State(app): State<AppState>,
    Query(asked): Query<Asked>,
) -> Result<Response, Problem> {
    let runs = compared(&app, &asked).await?;
    let numbers: Vec<String> = runs.iter().map(|one| one.run.id.to_string()).collect();
    Ok(show(&ComparePage {
        numbers: numbers.join(","),
        plots: plots(&runs),
        left_out: left_out(&runs),
        lines: runs.into_iter().map(line).collect(),
    }))
}

/// `GET /compare/{file}`: one figure, such as `success-by-steps.svg`.
///
/// # Errors
/// As for the page; a figure that does not exist, that these runs cannot share, or that has nothing
/// to show yet.
pub async fn picture(
    State(app): State<AppState>,
    Path(file): Path<String>,
    Query(asked): Query<Asked>,
) -> Result<Response, Problem> {
    let is_asked = |plot: &&Plot| file.strip_suffix(".svg") == Some(plot.name);
    let Some(plot) = PLOTS.iter().find(is_asked) else {
        return Err(Problem::no_such_page(&format!("/compare/{file}")));
    };
    let runs = compared(&app, &asked).await?;
    if plot.is_of_one_task && are_of_several_tasks(&runs) {
        return Err(refused(SEVERAL_TASKS.to_owned()));
    }
    if !runs.iter().any(Compared::is_tried) {
        return Err(Problem::no_trial(NO_TRIAL));
    }
    let drawn = in_worker(move || draw(&runs, plot)).await?;
    let svg = drawn.map_err(|error| Problem::unreadable_results(error.to_string()))?;
    Ok(([(header::CONTENT_TYPE, "image/svg+xml")], svg).into_response())
}

const NO_TRIAL: &str =
    "None of these runs has been tried yet. Curves are drawn after the first trial.";

const SEVERAL_TASKS: &str = "These runs are of different tasks. What two tasks give as reward \
    cannot be compared, so there is no curve of the return.";

/// The runs that an address names, with their trials.
async fn compared(app: &AppState, asked: &[(String, String)]) -> Result<Vec<Compared>, Problem> {
    let mut all = Vec::new();
    for id in chosen(asked)? {
        let row = app.store.run(id).await?;
        let row = row.ok_or_else(|| Problem::run_not_found(id))?;
        if let Some(study) = row.study {
            return Err(refused(format!(
                "Run {id} is a part of study {study}: no agent learns in a study, so there are no curves."
            )));
        }
        let trials = app.store.events_of(id, &["evaluation"]).await?;
        let trials: Vec<String> = trials.into_iter().map(|event| event.data).collect();
        let last = trials
            .last()
            .and_then(|data| serde_json::from_str::<Value>(data).ok());
        all.push(Compared {
            run: runs::view(app, row).await?,
            success: last.and_then(|trial| trial["success_rate"].as_f64()),
            trials: trials.join("\n"),
        });
    }
    Ok(all)
}

/// The runs that an address names, as forms do (`run=1&run=2`) or as links do (`runs=1,2`).
fn chosen(asked: &[(String, String)]) -> Result<Vec<RunId>, Problem> {
    let mut runs = Vec::new();
    for (name, text) in asked {
        if !matches!(name.as_str(), "run" | "runs") {
            return Err(refused(format!(
                "`{name}` is not known here; runs are chosen as in /compare?runs=1,2."
            )));
        }
        let parts = text.split(',').map(str::trim);
        for part in parts.filter(|part| !part.is_empty()) {
            runs.push(number(part)?);
        }
    }
    if !(LEAST..=MOST).contains(&runs.len()) {
        return Err(refused(format!(
            "{LEAST} to {MOST} runs can be compared, and {} were chosen. Tick them in the list of runs at /, or write /compare?runs=1,2.",
            runs.len()
        )));
    }
    let again = (1..runs.len()).find(|n| runs[..*n].contains(&runs[*n]));
    match again {
        Some(n) => Err(refused(format!("Run {} is chosen twice.", runs[n]))),
        None => Ok(runs),
    }
}

fn number(text: &str) -> Result<RunId, Problem> {
    let found = text.parse::<i64>().ok().filter(|number| *number > 0);
    found.map(RunId).ok_or_else(|| {
        refused(format!(
            "A run is chosen by its number, a whole one from 1 on; '{text}' is none."
        ))
    })
}

fn refused(detail: String) -> Problem {
    Problem::bad_request(StatusCode::UNPROCESSABLE_ENTITY, detail)
}

impl Compared {
    fn is_tried(&self) -> bool {
        !self.trials.is_empty()
    }
}

fn are_of_several_tasks(runs: &[Compared]) -> bool {
    let mut tasks = runs.iter().map(|one| &one.run.task);
    let first = tasks.next();
    tasks.any(|task| Some(task) != first)
}

/// The figures that these runs can share; none before the first trial.
fn plots(runs: &[Compared]) -> Vec<&'static Plot> {
    let is_drawn = |plot: &&Plot| !plot.is_of_one_task || !are_of_several_tasks(runs);
    if runs.iter().any(Compared::is_tried) {
        PLOTS.iter().filter(is_drawn).collect()
    } else {
        Vec::new()
    }
}

fn left_out(runs: &[Compared]) -> Vec<String> {
    let untried: Vec<String> = runs
        .iter()
        .filter(|one| !one.is_tried())
        .map(|one| one.run.id.to_string())
        .collect();
    let untried = match untried.as_slice() {
        [] => None,
        all if all.len() == runs.len() => return vec![NO_TRIAL.to_owned()],
        [one] => Some(format!(
            "Run {one} has not been tried yet, so it has no curve."
        )),
        several => Some(format!(
            "Runs {} have not been tried yet, so they have no curves.",
            several.join(", ")
        )),
    };
    let no_return = are_of_several_tasks(runs).then(|| SEVERAL_TASKS.to_owned());
    untried.into_iter().chain(no_return).collect()
}

fn line(compared: Compared) -> Line {
    let run = compared.run;
    Line {
        id: run.id,
        title: title(&run.task),
        method: method_name(&run.method),
        size: size(&run),
        seed: run.seed,
        answerer: answerer(&run),
        steps: of(run.step, run.total_steps),
        answers: of(run.labels.into(), run.budget.into()),
        success: compared
            .success
            .map_or_else(|| "not tried yet".to_owned(), percent),
        state: run.state.kind,
        message: run.state.message,
    }
}

/// `20 of 80`
fn of(so_far: u64, in_all: u64) -> String {
    format!("{} of {}", thousands(so_far), thousands(in_all))
}

/// The presets, in words where there is none.
fn size(run: &RunView) -> String {
    if run.preset.is_empty() {
        "full size".to_owned()
    } else {
        run.preset.clone()
    }
}

/// Who answers the run's queries.
fn answerer(run: &RunView) -> String {
    match run.teacher.as_str() {
        HUMAN => "people".to_owned(),
        HTTP => "a program".to_owned(),
        script => format!("the script {script}"),
    }
}

#[cfg(test)]
mod tests {
    use super::curves::tests::run;
    use super::*;

    fn read(fields: &[(&str, &str)]) -> Result<Vec<i64>, String> {
        let owned = |(name, text): &(&str, &str)| ((*name).to_owned(), (*text).to_owned());
        let asked: Asked = fields.iter().map(owned).collect();
        let told = |problem: Problem| {
            assert_eq!(problem.status, 422);
            problem.detail
        };
        let chosen = chosen(&asked).map_err(told)?;
        Ok(chosen.into_iter().map(|run| run.0).collect())
    }

    #[test]
    fn runs_are_named_by_ticked_boxes_or_in_one_list() {
        assert_eq!(read(&[("run", "3"), ("run", "1")]), Ok(vec![3, 1]));
        assert_eq!(read(&[("runs", "3,1, 2")]), Ok(vec![3, 1, 2]));
    }

    #[test]
    fn what_cannot_be_compared_is_told_in_words() {
        for (fields, told) in [
            (vec![], "and 0 were chosen"),
            (vec![("runs", "")], "and 0 were chosen"),
            (vec![("run", "1")], "and 1 were chosen"),
            (vec![("runs", "1,2,3,4,5,6,7,8,9")], "and 9 were chosen"),
            (vec![("run", "4"), ("run", "4")], "Run 4 is chosen twice."),
            (vec![("runs", "1,two")], "'two' is none"),
            (vec![("runs", "1,0")], "'0' is none"),
            (
                vec![("runs", "1,2"), ("seed", "1")],
                "`seed` is not known here",
            ),
        ] {
            let refused = read(&fields).expect_err(told);
            assert!(refused.contains(told), "{refused}");
        }
    }

    #[test]
    fn a_return_is_left_out_between_tasks_and_a_run_before_its_first_trial() {
        let told = left_out(&[run(1, 2), run(2, 0)]);
        assert_eq!(told, ["Run 2 has not been tried yet, so it has no curve."]);

        let mut other = run(2, 2);
        other.run.task = "window-open".into();
        let runs = [run(1, 2), other];
        assert_eq!(left_out(&runs), [SEVERAL_TASKS]);
        let names: Vec<&str> = plots(&runs).iter().map(|plot| plot.name).collect();
        assert_eq!(names, ["success-by-steps", "success-by-answers"]);

        let untried = [run(1, 0), run(2, 0)];
        assert_eq!(left_out(&untried), [NO_TRIAL]);
        assert!(plots(&untried).is_empty());
    }
}
