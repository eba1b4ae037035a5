//! `/seat`: what is left to do for a labeler of a study, and thanks at the end.

use askama::Template;
use axum::extract::State;
use axum::http::{HeaderMap, StatusCode};
use axum::response::Response;
use store::Part;

use super::join::nobody_here;
use super::{show, title};
use crate::extract::labeler;
use crate::problem::Problem;
use crate::state::AppState;

#[derive(Template)]
#[template(path = "seat.html")]
struct SeatPage {
    title: String,
    parts: Vec<PartLine>,
    /// The run to go on with; empty when all is answered.
    next: String,
    next_title: &'static str,
    has_begun: bool,
    is_done: bool,
    is_closed: bool,
}

/// The questions about one task.
struct PartLine {
    title: &'static str,
    answers: String,
    answered: u32,
    budget: u32,
}

/// `GET /seat`
///
/// In a browser whose labeler sits in no study, the way back in.
///
/// # Errors
/// A store that cannot be read.
pub async fn page(State(app): State<AppState>, headers: HeaderMap) -> Result<Response, Problem> {
    let seat = match labeler(&app, &headers).await? {
        Some(labeler) => app.store.seat_of(labeler.id).await?,
        None => None,
    };
    let Some((study, _, parts)) = seat else {
        return Ok(nobody_here(StatusCode::NOT_FOUND));
    };
    let next = parts.iter().find(|part| !part.is_done);
    Ok(show(&SeatPage {
        title: study.title,
        next: next.map_or_else(String::new, |part| part.run.to_string()),
        next_title: next.map_or("", |part| title(&part.task)),
        has_begun: parts.iter().any(|part| part.answered > 0 || part.is_done),
        is_done: next.is_none(),
        is_closed: study.state == "closed",
        parts: parts.iter().map(part_line).collect(),
    }))
}

fn part_line(part: &Part) -> PartLine {
    PartLine {
        title: title(&part.task),
        answers: format!("{} of {}", part.answered, part.budget),
        answered: part.answered,
        budget: part.budget.max(1),
    }
}
