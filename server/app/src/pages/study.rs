//! `/studies/{id}`: how far a study is, whom to invite, and what came out.

use askama::Template;
use axum::extract::State;
use axum::http::HeaderMap;
use axum::response::{IntoResponse as _, Redirect, Response};
use serde::Deserialize;
use store::{ItemLine, LabelsOf, StudyRow};

use super::run::N_PASSED_OVER;
use super::studies::{message, question_words};
use super::{show, title};
use crate::api::studies::{self as api, DAYS, SeatView};
use crate::extract::{Form, Study};
use crate::live::parse_study;
use crate::problem::Problem;
use crate::state::AppState;
use crate::study_results::{self, Measure};
use crate::worker::in_worker;

#[derive(Template)]
#[template(path = "study.html")]
struct StudyPage {
    id: String,
    title: String,
    asks: &'static str,
    state: String,
    message: String,
    n_drawn: u32,
    n_items: u32,
    tasks: Vec<TaskLine>,
    seats: Vec<SeatLine>,
    /// Places that are left.
    n_free: u32,
    /// Links that were made by this request; shown once.
    links: Vec<LinkLine>,
    days: u32,
    /// Counted answers.
    n_answers: usize,
    /// Addresses of the figures with what they show.
    figures: Vec<FigureLine>,
    measures: Vec<Measure>,
    /// Pairs that cannot be drawn.
    broken: Vec<String>,
}

/// How far the pairs of a task are.
struct TaskLine {
    title: &'static str,
    n_pairs: usize,
    n_answers: u32,
    n_wanted: u32,
    /// In an order that tells nothing of how they were chosen.
    pairs: Vec<PairCell>,
}

/// How far a pair is.
struct PairCell {
    n_answers: u32,
    is_full: bool,
}

/// A place.
struct SeatLine {
    number: u32,
    words: &'static str,
    state: &'static str,
    answered: u32,
    budget: u32,
    answers: String,
}

/// A link that works once.
struct LinkLine {
    seat: u32,
    link: String,
}

/// A figure.
struct FigureLine {
    address: String,
    caption: &'static str,
}

/// `GET /studies/{id}`
///
/// # Errors
/// A study that does not exist; a store that cannot be read.
pub async fn page(State(app): State<AppState>, Study(study): Study) -> Result<Response, Problem> {
    filled_in(&app, study, Vec::new()).await
}

/// `POST /studies/{id}/retry`
///
/// # Errors
/// A study that did not fail.
pub async fn retry(State(app): State<AppState>, study: Study) -> Result<Response, Problem> {
    let id = study.0.id;
    let _ = api::retry(State(app), study).await?; // its view is for programs
    Ok(Redirect::to(&format!("/studies/{id}")).into_response())
}

/// `POST /studies/{id}/open`
///
/// # Errors
/// A study that is not ready.
pub async fn open(State(app): State<AppState>, study: Study) -> Result<Response, Problem> {
    let id = study.0.id;
    let _ = api::open(State(app), study).await?;
    Ok(Redirect::to(&format!("/studies/{id}")).into_response())
}

/// `POST /studies/{id}/close`
///
/// # Errors
/// A study that was never open.
pub async fn close(State(app): State<AppState>, study: Study) -> Result<Response, Problem> {
    let id = study.0.id;
    let _ = api::close(State(app), study).await?;
    Ok(Redirect::to(&format!("/studies/{id}")).into_response())
}

/// How many new places, or which one again.
#[derive(Deserialize)]
pub struct InviteForm {
    #[serde(default)]
    count: Option<u32>,
    #[serde(default)]
    seat: Option<u32>,
}

/// `POST /studies/{id}/invitations`: the study's page with the new links, which are shown once.
///
/// # Errors
/// Clips that are missing; more labelers than the study has room for.
pub async fn invite(
    State(app): State<AppState>,
    Study(study): Study,
    headers: HeaderMap,
    Form(form): Form<InviteForm>,
) -> Result<Response, Problem> {
    let until = api::until(DAYS.0);
    let made = match form.seat {
        Some(seat) => vec![(seat, app.store.invite_again(study.id, seat, until).await?)],
        None => api::invitations(&app, &study, form.count.unwrap_or(1).min(1_000), until).await?,
    };
    let links = made.iter().map(|(seat, secret)| LinkLine {
        seat: *seat,
        link: api::link(&headers, secret),
    });
    filled_in(&app, study, links.collect()).await
}

async fn filled_in(
    app: &AppState,
    study: StudyRow,
    links: Vec<LinkLine>,
) -> Result<Response, Problem> {
    let file = parse_study(&study).map_err(|error| Problem::unusable_study(error.to_string()))?;
    let items = app.store.items(study.id).await?;
    let view = api::view(app, study.clone()).await?;
    let is = |state: &str| study.state == state;
    let results = if is("open") || is("closed") {
        let labels = study_results::labels(&app.store, study.id).await?;
        in_worker(move || study_results::results(&labels)).await?
    } else {
        study_results::Results::default()
    };
    let figures = results.figures.iter().map(|figure| FigureLine {
        address: format!("/api/v1/studies/{}/figures/{}.svg", study.id, figure.name),
        caption: figure.caption,
    });
    let tasks = file.tasks.iter().enumerate().map(|(number, name)| {
        let own = |item: &&ItemLine| item.task == number as u32 && item.role == "counted";
        let mut own: Vec<&ItemLine> = items.iter().filter(own).collect();
        // By what their pictures hash to: in studies that earlier versions prepared their own
        // order tells one method from another.
        own.sort_by(|a, b| a.clips.cmp(&b.clips));
        let cell = |item: &&ItemLine| PairCell {
            n_answers: item.n_answers,
            is_full: item.n_answers >= file.labelers_per_item,
        };
        TaskLine {
            pairs: own.iter().map(cell).collect(),
            title: title(name),
            n_pairs: own.len(),
            n_answers: own.iter().map(|item| item.n_answers).sum(),
            n_wanted: own.len() as u32 * file.labelers_per_item,
        }
    });
    let passed_over = app
        .store
        .passed_over(LabelsOf::Study(study.id), N_PASSED_OVER)
        .await?;
    let passed_over = passed_over.iter().map(|pair| {
        format!(
            "pair {}: could not be shown to {} and was passed over: {}",
            pair.query_id, pair.labeler, pair.reason
        )
    });
    let broken: Vec<String> = items.iter().filter_map(broken).chain(passed_over).collect();
    let seats: Vec<SeatLine> = view.seats.iter().map(seat_line).collect();
    Ok(show(&StudyPage {
        id: study.id.to_string(),
        asks: question_words(study.question),
        message: message(&study),
        n_drawn: study.n_drawn,
        n_items: study.n_items,
        tasks: tasks.collect(),
        n_free: file.labelers_per_item.saturating_sub(seats.len() as u32),
        seats,
        links,
        days: DAYS.0,
        n_answers: results.n_answers,
        figures: figures.collect(),
        measures: results.measures,
        broken,
        title: study.title,
        state: study.state,
    }))
}

fn broken(item: &ItemLine) -> Option<String> {
    let trouble = item.trouble.as_ref()?;
    Some(format!("pair {}: {trouble}", item.query.0))
}

fn seat_line(seat: &SeatView) -> SeatLine {
    let words = match seat.state {
        "done" => "done",
        "answering" => "answering",
        "expired" => "the link ran out",
        _ => "invited",
    };
    let state = match seat.state {
        "done" => "finished",
        "answering" => "training",
        "expired" => "failed",
        _ => "paused",
    };
    SeatLine {
        number: seat.number,
        words,
        state,
        answered: seat.answered,
        budget: seat.budget.max(1),
        // Nothing is asked of anybody until they sit down.
        answers: match seat.budget {
            0 => String::new(),
            budget => format!("{} of {budget}", seat.answered),
        },
    }
}
