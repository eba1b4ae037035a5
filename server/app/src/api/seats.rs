//! `/api/v1/join` and `/api/v1/seat`: labelers of studies enter, and see what is left to do.

use axum::Json;
use axum::extract::State;
use axum::http::{HeaderMap, StatusCode, header};
use axum::response::{IntoResponse as _, Response};
use serde::{Deserialize, Serialize};
use store::{Entered, Secret, StudyPlan, now_ms};
use utoipa::ToSchema;

use crate::extract::{Answerer, Body, Cookie};
use crate::live::parse_study;
use crate::problem::Problem;
use crate::state::AppState;

/// A labeler at the door.
#[derive(Debug, Deserialize, ToSchema)]
#[serde(deny_unknown_fields)]
pub struct JoinRequest {
    /// The code in the link, or a return code.
    code: String,
    /// Whether the labeler has read the consent text and agrees; not needed for a return code.
    #[serde(default)]
    agrees: bool,
}

/// A labeler who sits.
#[derive(Debug, Serialize, ToSchema)]
pub struct JoinedView {
    /// By which they come back from another machine; null where they came by it.
    return_code: Option<String>,
}

/// Enters a study by a link's code, which is used up, or comes back by a return code.
///
/// The reply sets the labeler's cookie.
///
/// # Errors
/// A code that leads nowhere, was used, has run out, or is of a study that is not open; no
/// agreement.
#[utoipa::path(post, path = "/api/v1/join", tag = "studies", operation_id = "joinStudy", request_body = JoinRequest,
    security(()),
    responses((status = 201, body = JoinedView, description = "The labeler may answer.",
            headers(("Set-Cookie" = String, description = "The labeler's cookie."))),
        (status = 404, description = "A code that leads nowhere."),
        (status = 410, description = "A code that was used or has run out, or of a study that is not open."),
        (status = 422, description = "No agreement to the text about the study.")))]
pub async fn join(
    State(app): State<AppState>,
    headers: HeaderMap,
    Body(request): Body<JoinRequest>,
) -> Result<Response, Problem> {
    let (browser, return_code) = if is_return_code(&request.code) {
        (come_back(&app, &request.code).await?, None)
    } else {
        let entered = enter(&app, &request.code, request.agrees).await?;
        (entered.browser, Some(shown(&entered.return_code)))
    };
    let cookie = [(header::SET_COOKIE, Cookie::Labeler.set(&headers, &browser))];
    let view = Json(JoinedView { return_code });
    Ok((StatusCode::CREATED, cookie, view).into_response())
}

/// Return codes are short, the codes of links are not.
fn is_return_code(code: &str) -> bool {
    code.trim().len() < 32
}

/// Sits down by a link's code.
///
/// # Errors
/// A code that leads nowhere, was used, has run out, or is of a study that is not open; no
/// agreement.
pub async fn enter(app: &AppState, code: &str, agrees: bool) -> Result<Entered, Problem> {
    let secret = Secret::brought(code.trim());
    let entrance = app.store.entrance(&secret, now_ms()).await?;
    if !agrees {
        return Err(Problem::bad_request(
            StatusCode::UNPROCESSABLE_ENTITY,
            "Taking part needs your agreement to the text about this study.",
        ));
    }
    let row = app.store.study(entrance.study).await?;
    let file = parse_study(&row).map_err(|error| Problem::unusable_study(error.to_string()))?;
    let plan = StudyPlan {
        tasks: file.tasks,
        repeats_per_task: file.repeats_per_task,
        seed: file.seed.into(),
    };
    Ok(app.store.enter(&secret, plan, now_ms()).await?)
}

/// A browser's secret for whoever has this return code.
///
/// # Errors
/// A code that is none, or of a closed study.
pub async fn come_back(app: &AppState, code: &str) -> Result<Secret, Problem> {
    Ok(app.store.come_back(&Secret::typed(code)).await?)
}

/// A return code as people read it: in threes.
pub fn shown(code: &Secret) -> String {
    let letters: Vec<char> = code.reveal().chars().collect();
    let groups: Vec<String> = letters.chunks(3).map(|g| g.iter().collect()).collect();
    groups.join("-")
}

/// What one labeler does in a study.
#[derive(Debug, Serialize, ToSchema)]
pub struct SeatPartsView {
    /// The study, as people read it.
    title: String,
    /// The labeler's number in it.
    seat: u32,
    /// Task by task, in their order.
    parts: Vec<PartView>,
}

/// The questions about one task.
#[derive(Debug, Serialize, ToSchema)]
pub struct PartView {
    /// Their run, where leases are had.
    run_id: i64,
    /// The task's name.
    task: String,
    /// Answers, practice not counted.
    answered: u32,
    /// Questions, practice not counted.
    budget: u32,
    /// Whether nothing is left to answer.
    is_done: bool,
}

/// What the labeler who asks has to do.
///
/// # Errors
/// Nobody has said who asks, or they sit in no study.
#[utoipa::path(get, path = "/api/v1/seat", tag = "studies", operation_id = "readSeat", security(("labelerCookie" = [])),
    responses((status = 200, body = SeatPartsView), (status = 404, description = "The labeler sits in no study.")))]
pub async fn read(
    State(app): State<AppState>,
    who: Answerer,
) -> Result<Json<SeatPartsView>, Problem> {
    let seat = app.store.seat_of(who.labeler.id).await?;
    let (study, seat, parts) = seat.ok_or_else(Problem::no_seat)?;
    let parts = parts.into_iter().map(|part| PartView {
        run_id: part.run.0,
        task: part.task,
        answered: part.answered,
        budget: part.budget,
        is_done: part.is_done,
    });
    Ok(Json(SeatPartsView {
        title: study.title,
        seat,
        parts: parts.collect(),
    }))
}
