//! `/api/v1/studies`: prepare, look at, open, invite, close.

use axum::Json;
use axum::extract::State;
use axum::http::{HeaderMap, StatusCode, header};
use axum::response::{IntoResponse as _, Response};
use domain::query::Question;
use lab::study::{READY, StudyFile};
use serde::{Deserialize, Serialize};
use store::{LabelsOf, NewStudy, Seat, Secret, StoreError, StudyId, StudyRow, now_ms, rfc3339};
use utoipa::ToSchema;

use super::labels::{Format, exported};
use crate::extract::{Body, Path, Query, Study};
use crate::live::parse_study;
use crate::problem::Problem;
use crate::state::AppState;
use crate::study_results;
use crate::worker::in_worker;

const DAY_MS: i64 = 24 * 60 * 60 * 1000;
/// Days for which a link works, unless said otherwise, and at most.
pub const DAYS: (u32, u32) = (14, 365);

/// A study to be prepared: a ready one, or a file's text.
#[derive(Debug, Default, Deserialize, ToSchema)]
#[serde(deny_unknown_fields, default)]
pub struct StudyRequest {
    /// The name of a study that comes with the program: `task-1`.
    name: Option<String>,
    /// The text of a study's file.
    text: Option<String>,
    /// Where the file lies on the server's machine; query sets are named from there.
    folder: Option<String>,
}

/// A study as programs and pages see it.
#[derive(Debug, Serialize, ToSchema)]
pub struct StudyView {
    /// Number.
    pub id: i64,
    /// For people.
    pub title: String,
    /// `preference` or `same_stage`.
    #[schema(value_type = String)]
    pub question: Question,
    /// `preparing`, `ready`, `open`, `closed` or `failed`.
    pub state: String,
    /// In words.
    pub message: String,
    /// Since when, RFC 3339.
    pub since: String,
    /// Pairs, practice and checks among them.
    pub n_items: u32,
    /// Pairs whose clips are drawn.
    pub n_drawn: u32,
    /// Pairs whose clips cannot be drawn.
    pub n_bad: u32,
    /// RFC 3339.
    pub created_at: String,
    /// Places that were given out.
    pub seats: Vec<SeatView>,
}

/// A place for a labeler.
#[derive(Debug, Serialize, ToSchema)]
pub struct SeatView {
    /// From 1.
    pub number: u32,
    /// `invited`, `expired`, `answering` or `done`.
    pub state: &'static str,
    /// Until when its link works, RFC 3339.
    pub expires_at: String,
    /// Answers, practice not counted.
    pub answered: u32,
    /// Questions, practice not counted; 0 before somebody sits down.
    pub budget: u32,
    /// When the newest answer came, RFC 3339.
    pub answered_at: Option<String>,
}

/// All studies, newest first.
///
/// # Errors
/// The database cannot be read.
#[utoipa::path(get, path = "/api/v1/studies", tag = "studies", operation_id = "listStudies",
    responses((status = 200, body = Vec<StudyView>)))]
pub async fn list(State(app): State<AppState>) -> Result<Json<Vec<StudyView>>, Problem> {
    let mut views = Vec::new();
    for row in app.store.studies().await? {
        views.push(view(&app, row).await?);
    }
    Ok(Json(views))
}

/// Begins to prepare a study: its segments are chosen and its clips drawn, in the background.
///
/// # Errors
/// Mistakes in the file, each with its line; an unknown name.
#[utoipa::path(post, path = "/api/v1/studies", tag = "studies", operation_id = "createStudy", request_body = StudyRequest,
    responses((status = 201, body = StudyView, headers(("Location" = String, description = "Where the study is."))),
        (status = 422, description = "Mistakes in the file, each with its line; an unknown name; neither or both of a name and a text.")))]
pub async fn create(
    State(app): State<AppState>,
    Body(request): Body<StudyRequest>,
) -> Result<Response, Problem> {
    let (name, text) = file_of(&request)?;
    let folder = match request.text {
        Some(_) => request.folder.unwrap_or_default(),
        None => String::new(), // its sets are in the program
    };
    let id = begin(&app, &name, text, folder).await?;
    let view = view(&app, app.store.study(id).await?).await?;
    let address = format!("/api/v1/studies/{id}");
    let located = [(header::LOCATION, address)];
    Ok((StatusCode::CREATED, located, Json(view)).into_response())
}

/// Says whether a study was made from this file.
///
/// A study stays as its file was: what is drawn and answered belongs to that. The same file again
/// changes nothing.
///
/// # Errors
/// Another file, which makes a study of its own.
#[utoipa::path(put, path = "/api/v1/studies/{id}", tag = "studies", operation_id = "keepStudy",
    params(("id" = i64, Path)), request_body = StudyRequest,
    responses((status = 200, body = StudyView, description = "It was."),
        (status = 409, description = "Another file, which makes a study of its own."),
        (status = 422, description = "An unknown name; neither or both of a name and a text.")))]
pub async fn keep(
    State(app): State<AppState>,
    Study(study): Study,
    Body(request): Body<StudyRequest>,
) -> Result<Json<StudyView>, Problem> {
    let (_, text) = file_of(&request)?;
    if text != study.file {
        let told = "its pairs and answers belong to its file; prepare a copy with the changes, which is a study of its own";
        let state = study.state;
        return Err(StoreError::StudyState { state, told }.into());
    }
    Ok(Json(view(&app, study).await?))
}

/// What to call the file of a request, and its text.
///
/// # Errors
/// Neither or both of a name and a text; an unknown name.
fn file_of(request: &StudyRequest) -> Result<(String, String), Problem> {
    match (&request.name, &request.text) {
        (Some(name), None) => Ok((name.clone(), ready(name)?.to_owned())),
        (None, Some(text)) => Ok(("the study's file".to_owned(), text.clone())),
        _ => Err(Problem::unusable_study(
            "Send either the name of a ready study or the text of a file.",
        )),
    }
}

/// The text of a study that comes with the program.
///
/// # Errors
/// A name that none has.
pub fn ready(name: &str) -> Result<&'static str, Problem> {
    let found = READY.iter().find(|(known, _)| *known == name);
    found.map(|(_, text)| *text).ok_or_else(|| {
        let known: Vec<&str> = READY.iter().map(|(name, _)| *name).collect();
        Problem::unusable_study(format!(
            "There is no ready study '{name}'; there are {}.",
            known.join(", ")
        ))
    })
}

/// Checks a study's file, keeps it and begins to prepare it.
///
/// # Errors
/// Mistakes in the file, each with its line.
pub async fn begin(
    app: &AppState,
    name: &str,
    text: String,
    folder: String,
) -> Result<StudyId, Problem> {
    let study = StudyFile::parse(name, &text, std::path::Path::new(&folder))
        .map_err(|mistakes| Problem::unusable_study(mistakes.to_string()))?;
    let new = NewStudy {
        title: study.title,
        question: study.question,
        file: text,
        folder,
    };
    let id = app.store.add_study(new).await?;
    app.live.prepare(id)?;
    Ok(id)
}

/// One study.
///
/// # Errors
/// An unknown study.
#[utoipa::path(get, path = "/api/v1/studies/{id}", tag = "studies", operation_id = "readStudy",
    params(("id" = i64, Path)), responses((status = 200, body = StudyView)))]
pub async fn read(
    State(app): State<AppState>,
    Study(study): Study,
) -> Result<Json<StudyView>, Problem> {
    Ok(Json(view(&app, study).await?))
}

/// Takes up a preparation that failed.
///
/// # Errors
/// An unknown study, or one that did not fail.
#[utoipa::path(post, path = "/api/v1/studies/{id}/retry", tag = "studies", operation_id = "retryStudy",
    params(("id" = i64, Path)),
    responses((status = 200, body = StudyView), (status = 409, description = "The study did not fail.")))]
pub async fn retry(
    State(app): State<AppState>,
    Study(study): Study,
) -> Result<Json<StudyView>, Problem> {
    app.store.retry_study(study.id).await?;
    app.live.prepare(study.id)?;
    read(State(app.clone()), Study(app.store.study(study.id).await?)).await
}

/// Lets labelers answer.
///
/// # Errors
/// An unknown study, or one that is not ready.
#[utoipa::path(post, path = "/api/v1/studies/{id}/open", tag = "studies", operation_id = "openStudy",
    params(("id" = i64, Path)),
    responses((status = 200, body = StudyView), (status = 409, description = "The study is not ready.")))]
pub async fn open(
    State(app): State<AppState>,
    Study(study): Study,
) -> Result<Json<StudyView>, Problem> {
    app.store.open_study(study.id).await?;
    read(State(app.clone()), Study(app.store.study(study.id).await?)).await
}

/// Takes no more answers, and tells methods from then on; that is logged.
///
/// # Errors
/// An unknown study, or one that was never open.
#[utoipa::path(post, path = "/api/v1/studies/{id}/close", tag = "studies", operation_id = "closeStudy",
    params(("id" = i64, Path)),
    responses((status = 200, body = StudyView), (status = 409, description = "The study was never open.")))]
pub async fn close(
    State(app): State<AppState>,
    Study(study): Study,
) -> Result<Json<StudyView>, Problem> {
    app.store.close_study(study.id).await?;
    read(State(app.clone()), Study(app.store.study(study.id).await?)).await
}

/// Whom to invite.
#[derive(Debug, Deserialize, ToSchema)]
#[serde(deny_unknown_fields)]
pub struct InvitationRequest {
    /// New places.
    #[serde(default = "one")]
    count: u32,
    /// Days for which the links work.
    #[serde(default)]
    days: Option<u32>,
    /// Instead of new places: a new link to the place of this `number`, whoever sits there.
    #[serde(default)]
    seat: Option<u32>,
}

fn one() -> u32 {
    1
}

/// A link that works once.
#[derive(Debug, Serialize, ToSchema)]
pub struct InvitationView {
    /// The place's `number` among the study's seats.
    pub seat: u32,
    /// For one labeler; shown now and never again.
    pub link: String,
    /// RFC 3339.
    pub expires_at: String,
}

/// Places for labelers, each with a link that works once.
///
/// # Errors
/// An unknown study; clips that are missing; more labelers than the study has room for.
#[utoipa::path(post, path = "/api/v1/studies/{id}/invitations", tag = "studies", operation_id = "inviteLabelers",
    params(("id" = i64, Path)), request_body = InvitationRequest,
    responses((status = 201, body = Vec<InvitationView>, description = "A link for each place."),
        (status = 404, description = "The study has no place of this number."),
        (status = 409, description = "Clips are missing, the study is closed, or it has no room for so many labelers."),
        (status = 422, description = "More days or places than are given out at once.")))]
pub async fn invite(
    State(app): State<AppState>,
    Study(study): Study,
    headers: HeaderMap,
    Body(request): Body<InvitationRequest>,
) -> Result<Response, Problem> {
    let days = request.days.unwrap_or(DAYS.0);
    if !(1..=DAYS.1).contains(&days) || request.count > 10_000 {
        let most = DAYS.1;
        let detail =
            format!("Links work for 1 to {most} days, and at most 10000 are made at once.");
        return Err(Problem::bad_request(
            StatusCode::UNPROCESSABLE_ENTITY,
            detail,
        ));
    }
    let expires_at_ms = until(days);
    let made = match request.seat {
        Some(seat) => {
            let secret = app
                .store
                .invite_again(study.id, seat, expires_at_ms)
                .await?;
            vec![(seat, secret)]
        }
        None => invitations(&app, &study, request.count, expires_at_ms).await?,
    };
    let links: Vec<InvitationView> = made
        .into_iter()
        .map(|(seat, secret)| InvitationView {
            seat,
            link: link(&headers, &secret),
            expires_at: rfc3339(expires_at_ms),
        })
        .collect();
    Ok((StatusCode::CREATED, Json(links)).into_response())
}

/// When a link that works for so many days from now on runs out, milliseconds since 1970.
pub fn until(days: u32) -> i64 {
    now_ms() + i64::from(days) * DAY_MS
}

/// New places with their secrets.
///
/// # Errors
/// Clips that are missing; more labelers than the study has room for.
pub async fn invitations(
    app: &AppState,
    study: &StudyRow,
    count: u32,
    expires_at_ms: i64,
) -> Result<Vec<(u32, Secret)>, Problem> {
    let file = parse_study(study).map_err(|error| Problem::unusable_study(error.to_string()))?;
    let most = file.labelers_per_item;
    let made = app.store.invite(study.id, count, most, expires_at_ms).await;
    Ok(made?)
}

/// The address by which a labeler enters, under the name by which the server was asked.
pub fn link(headers: &HeaderMap, secret: &Secret) -> String {
    let text = |name| headers.get(name).and_then(|value| value.to_str().ok());
    let origin = match text(header::ORIGIN) {
        Some(origin) => origin.to_owned(),
        None => format!("http://{}", text(header::HOST).unwrap_or("127.0.0.1")),
    };
    format!("{origin}/join?code={}", secret.reveal())
}

/// All answers of a study, in the order in which they were stored; methods once it is closed.
///
/// # Errors
/// An unknown study or format.
#[utoipa::path(get, path = "/api/v1/studies/{id}/labels", tag = "studies", operation_id = "exportStudyLabels",
    params(("id" = i64, Path), Format),
    responses((status = 200, description = "The table, as a file to keep.",
            content(("text/csv"), ("application/x-ndjson"), ("application/vnd.apache.parquet"))),
        (status = 422, description = "An unknown format.")))]
pub async fn labels(
    State(app): State<AppState>,
    Study(study): Study,
    Query(format): Query<Format>,
) -> Result<Response, Problem> {
    let name = format!("study-{}-labels", study.id);
    exported(&app, LabelsOf::Study(study.id), &name, &format)
}

/// A figure of a study's results, as SVG.
///
/// # Errors
/// An unknown study, or a figure that its answers do not make.
#[utoipa::path(get, path = "/api/v1/studies/{id}/figures/{name}", tag = "studies", operation_id = "readStudyFigure",
    params(("id" = i64, Path), ("name" = String, Path, description = "The figure's name and `.svg`.")),
    responses((status = 200, content_type = "image/svg+xml"),
        (status = 404, description = "A figure that the study's answers do not make.")))]
pub async fn figure(
    State(app): State<AppState>,
    Study(study): Study,
    Path(path): Path<(String, String)>,
) -> Result<Response, Problem> {
    let labels = study_results::labels(&app.store, study.id).await?;
    let name = path.1.strip_suffix(".svg").unwrap_or(&path.1).to_owned();
    let unknown = Problem::no_such_page(&format!("The figure {name}"));
    let drawn = in_worker(move || {
        let figures = study_results::figures(&labels);
        let found = figures.into_iter().find(|figure| figure.name == name);
        found.map(|figure| figure.draw())
    });
    let svg = drawn.await?.ok_or(unknown)?;
    let svg = svg.map_err(|error| Problem::unreadable_results(error.to_string()))?;
    Ok(([(header::CONTENT_TYPE, "image/svg+xml")], svg).into_response())
}

/// A study with its places.
///
/// # Errors
/// The database cannot be read.
pub async fn view(app: &AppState, row: StudyRow) -> Result<StudyView, Problem> {
    let now = now_ms();
    let seats = app.store.seats(row.id).await?;
    Ok(StudyView {
        id: row.id.0,
        title: row.title,
        question: row.question,
        state: row.state,
        message: row.message,
        since: rfc3339(row.since_ms),
        n_items: row.n_items,
        n_drawn: row.n_drawn,
        n_bad: row.n_bad,
        created_at: rfc3339(row.created_at_ms),
        seats: seats.iter().map(|seat| seat_view(seat, now)).collect(),
    })
}

fn seat_view(seat: &Seat, now_ms: i64) -> SeatView {
    let state = match seat.entered_at_ms {
        Some(_) if seat.answered == seat.budget => "done",
        Some(_) => "answering",
        None if seat.expires_at_ms <= now_ms => "expired",
        None => "invited",
    };
    SeatView {
        number: seat.number,
        state,
        expires_at: rfc3339(seat.expires_at_ms),
        answered: seat.answered,
        budget: seat.budget,
        answered_at: seat.answered_at_ms.map(rfc3339),
    }
}

/// Refusals of the store that are about studies.
pub fn problem(error: &StoreError) -> Option<Problem> {
    let detail = error.to_string();
    let new = |status, kind, title| Some(Problem::new(status, kind, title, detail.clone()));
    match error {
        StoreError::Missing { what: "study", id } => Some(Problem::study_not_found(id)),
        StoreError::StudyState { .. } => new(
            StatusCode::CONFLICT,
            "/problems/study-state",
            "The study cannot do that now",
        ),
        StoreError::NoSeatLeft { .. } => new(
            StatusCode::CONFLICT,
            "/problems/no-seat-left",
            "There is no room for more labelers",
        ),
        StoreError::Link(store::LinkTrouble::Unknown) => new(
            StatusCode::NOT_FOUND,
            "/problems/link-unknown",
            "This link leads nowhere",
        ),
        StoreError::Link(_) => new(
            StatusCode::GONE,
            "/problems/link-over",
            "This link does not work now",
        ),
        _ => None,
    }
}
