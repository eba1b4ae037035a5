//! `/api/v1/clips`: the bytes of a clip, and a run's clips to look at.

use axum::Json;
use axum::extract::{Request, State};
use axum::http::{HeaderValue, StatusCode, header};
use axum::response::{IntoResponse as _, Response};
use serde::Serialize;
use store::AnsweredPair;
use tower::ServiceExt as _;
use tower_http::services::ServeFile;
use utoipa::ToSchema;

use crate::extract::{Path, Run};
use crate::problem::Problem;
use crate::state::AppState;

/// A clip by the SHA-256 of its bytes: it never changes, so it is kept for a year.
///
/// # Errors
/// An unknown clip; a clip whose bytes are gone from the server's data folder, which asking again
/// does not bring back.
#[utoipa::path(get, path = "/api/v1/clips/{name}", tag = "clips", operation_id = "readClip",
    params(("name" = String, Path, description = "64 hexadecimal digits and `.mp4`."),
        ("Range" = Option<String>, Header, description = "The part that is wanted: `bytes=0-1023`.", nullable = false),
        ("If-None-Match" = Option<String>, Header, description = "The `ETag` of a copy that is there already.", nullable = false)),
    security((), ("accessToken" = []), ("accessCookie" = []), ("teacherToken" = []), ("labelerCookie" = [])),
    responses((status = 200, content_type = "video/mp4"), (status = 206, content_type = "video/mp4"), (status = 304),
        (status = 410, description = "The clip is known and its bytes are gone; asking again does not bring them back."),
        (status = 416, description = "The range lies outside the clip, or is more than one.")))]
pub async fn file(
    State(app): State<AppState>,
    Path(name): Path<String>,
    mut request: Request,
) -> Result<Response, Problem> {
    let sha256 = name.strip_suffix(".mp4").unwrap_or(&name);
    let (clip, path) = app.store.clip(sha256).await?;
    let tag =
        HeaderValue::from_str(&format!("\"{}\"", clip.sha256)).map_err(|_| Problem::internal())?;
    if request.headers().get(header::IF_NONE_MATCH) == Some(&tag) {
        return Ok((StatusCode::NOT_MODIFIED, [(header::ETAG, tag)]).into_response());
    }
    // A clip is named by its bytes: when its file was written says nothing about it.
    request.headers_mut().remove(header::IF_MODIFIED_SINCE);
    request.headers_mut().remove(header::IF_UNMODIFIED_SINCE);
    let Ok(served) = ServeFile::new(path).oneshot(request).await;
    let mut response = served.into_response();
    if response.status() == StatusCode::NOT_FOUND {
        tracing::error!(
            "the bytes of clip {} are gone from the data folder",
            clip.sha256
        );
        return Err(Problem::clip_gone());
    }
    if response.status() == StatusCode::RANGE_NOT_SATISFIABLE {
        let length = response.headers_mut().remove(header::CONTENT_RANGE);
        let mut refusal = Problem::no_such_range().into_response();
        refusal
            .headers_mut()
            .extend(length.map(|length| (header::CONTENT_RANGE, length)));
        return Ok(refusal);
    }
    let headers = response.headers_mut();
    headers.insert(
        header::CACHE_CONTROL,
        HeaderValue::from_static("private, max-age=31536000, immutable"),
    );
    headers.insert(header::CONTENT_TYPE, HeaderValue::from_static("video/mp4"));
    headers.insert(header::ETAG, tag);
    headers.remove(header::LAST_MODIFIED);
    Ok(response)
}

/// What there is to look at.
#[derive(Serialize, ToSchema)]
pub struct ClipsView {
    /// The newest answered pairs, newest first.
    pairs: Vec<PairView>,
    /// "How it does now", oldest first.
    demonstrations: Vec<DemonstrationView>,
    /// Queries whose clips cannot be drawn, newest first.
    bad: Vec<BadView>,
}

/// An answered pair.
#[derive(Serialize, ToSchema)]
pub struct PairView {
    /// Query.
    query_id: i64,
    /// Round of asking, from 0.
    session: u32,
    /// What was pressed.
    answer: String,
    /// Address of the left clip.
    left: String,
    /// Address of the right clip.
    right: String,
    /// RFC 3339.
    stored_at: String,
}

/// An episode of the policy.
#[derive(Serialize, ToSchema)]
pub struct DemonstrationView {
    /// The session that was about to be asked; null at the end.
    session: Option<u32>,
    /// Environment steps taken.
    step: u64,
    /// Whether it succeeded.
    success: bool,
    /// Its task return.
    task_return: f64,
    /// Address of the clip.
    clip: String,
    /// Pictures.
    n_frames: u32,
    /// Pictures a second.
    fps: u32,
}

/// A query that cannot be shown.
#[derive(Serialize, ToSchema)]
pub struct BadView {
    /// Query.
    query_id: i64,
    /// Round of asking, from 0.
    session: u32,
    /// What went wrong.
    trouble: String,
}

/// A run's newest clips.
///
/// # Errors
/// An unknown run.
#[utoipa::path(get, path = "/api/v1/runs/{id}/clips", tag = "clips", operation_id = "listRunClips",
    params(("id" = i64, Path)), responses((status = 200, body = ClipsView)))]
pub async fn of_run(
    State(app): State<AppState>,
    Run(run): Run,
) -> Result<Json<ClipsView>, Problem> {
    let pairs = app
        .store
        .newest_pairs(run.id, 12)
        .await?
        .into_iter()
        .map(pair_view)
        .collect();
    let demonstrations = app
        .store
        .demonstrations(run.id)
        .await?
        .into_iter()
        .map(|row| DemonstrationView {
            session: row.shows.session,
            step: row.shows.step,
            success: row.shows.success,
            task_return: row.shows.task_return,
            clip: address(&row.clip),
            n_frames: row.n_frames,
            fps: row.fps,
        });
    let bad = app.store.bad_queries(run.id).await?.into_iter();
    let bad = bad.map(|row| BadView {
        query_id: row.query.0,
        session: row.session,
        trouble: row.trouble,
    });
    Ok(Json(ClipsView {
        pairs,
        demonstrations: demonstrations.collect(),
        bad: bad.collect(),
    }))
}

fn pair_view(pair: AnsweredPair) -> PairView {
    PairView {
        query_id: pair.query_id,
        session: pair.session,
        answer: pair.answer,
        left: address(&pair.left),
        right: address(&pair.right),
        stored_at: pair.stored_at,
    }
}

/// Where a clip is.
pub fn address(sha256: &str) -> String {
    format!("/api/v1/clips/{sha256}.mp4")
}
