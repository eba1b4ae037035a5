//! `/studies`: every study, and those that come with the program.

use askama::Template;
use axum::extract::State;
use axum::response::{IntoResponse as _, Redirect, Response};
use lab::study::{READY, StudyFile};
use lab::words::thousands;
use serde::Deserialize;
use store::StudyRow;

use super::{show, title};
use crate::api::studies;
use crate::extract::Form;
use crate::problem::Problem;
use crate::state::AppState;

#[derive(Template)]
#[template(path = "studies.html")]
struct StudiesPage {
    /// Newest first.
    lines: Vec<Line>,
    has_lines: bool,
    /// Those that come with the program.
    ready: Vec<Ready>,
}

/// A study.
struct Line {
    id: String,
    title: String,
    state: String,
    message: String,
}

/// A study that comes with the program.
struct Ready {
    name: &'static str,
    title: String,
    /// What it asks, in words.
    asks: &'static str,
    tasks: String,
    /// Pairs that one labeler answers.
    pairs: String,
}

/// `GET /studies`
///
/// # Errors
/// A store that cannot be read.
pub async fn page(State(app): State<AppState>) -> Result<Response, Problem> {
    let lines: Vec<Line> = app.store.studies().await?.into_iter().map(line).collect();
    Ok(show(&StudiesPage {
        has_lines: !lines.is_empty(),
        lines,
        ready: READY.iter().filter_map(ready).collect(),
    }))
}

/// The name of a ready study.
#[derive(Deserialize)]
pub struct PrepareForm {
    name: String,
}

/// `POST /studies`: begins to prepare a ready study.
///
/// # Errors
/// A name that no ready study has.
pub async fn prepare(
    State(app): State<AppState>,
    Form(form): Form<PrepareForm>,
) -> Result<Response, Problem> {
    let text = studies::ready(&form.name)?.to_owned();
    let id = studies::begin(&app, &form.name, text, String::new()).await?;
    Ok(Redirect::to(&format!("/studies/{id}")).into_response())
}

fn line(study: StudyRow) -> Line {
    Line {
        id: study.id.to_string(),
        message: message(&study),
        title: study.title,
        state: study.state,
    }
}

/// How far a study is, in words.
pub(super) fn message(study: &StudyRow) -> String {
    let (n, of) = (study.n_drawn, study.n_items);
    match study.state.as_str() {
        "preparing" if of > 0 => format!("drawing clips: {n} of {of} pairs"),
        "preparing" => study.message.clone(),
        "ready" => "ready to be opened".to_owned(),
        "open" => "labelers can answer".to_owned(),
        "closed" => "closed".to_owned(),
        _ => format!("cannot be prepared: {}", study.message),
    }
}

fn ready((name, text): &(&'static str, &'static str)) -> Option<Ready> {
    let study = StudyFile::parse(name, text, std::path::Path::new("")).ok()?;
    let tasks: Vec<&str> = study.tasks.iter().map(|task| title(task)).collect();
    let (counted, _, extra) = study.n_pairs();
    Some(Ready {
        name,
        asks: question_words(study.question),
        tasks: tasks.join(", "),
        pairs: format!(
            "{} pairs for each labeler",
            thousands((counted + extra).into())
        ),
        title: study.title,
    })
}

/// What a study asks, in words.
pub(super) fn question_words(question: domain::query::Question) -> &'static str {
    match question {
        domain::query::Question::Preference => "Which of two clips is better?",
        domain::query::Question::SameStage => "Do two clips show the same stage of the task?",
    }
}
