//! `/api/v1/labelers`: who answers.

use axum::Json;
use axum::extract::State;
use axum::http::{HeaderMap, StatusCode, header};
use axum::response::{IntoResponse, Redirect, Response};
use serde::{Deserialize, Serialize};
use store::{Secret, TokenKind};
use utoipa::ToSchema;

use crate::extract::{Body, Cookie, Query};
use crate::problem::Problem;
use crate::state::AppState;

/// Who wants to answer.
#[derive(Deserialize, ToSchema)]
#[serde(deny_unknown_fields)]
pub struct NewLabeler {
    /// 1 to 80 letters; the same name from another browser is the same labeler.
    name: String,
}

/// Who answers.
#[derive(Serialize, ToSchema)]
pub struct LabelerView {
    /// Number.
    id: i64,
    /// As they typed it.
    name: String,
}

/// Says who answers in this browser; the reply sets a cookie.
///
/// # Errors
/// A name that is none, or that the server keeps for itself.
#[utoipa::path(post, path = "/api/v1/labelers", tag = "labelers", operation_id = "createLabeler", request_body = NewLabeler,
    responses((status = 201, body = LabelerView, headers(("Set-Cookie" = String, description = "The labeler's cookie."))),
        (status = 422, description = "A name of no or more than 80 letters, or one that the server keeps for itself.")))]
pub async fn create(
    State(app): State<AppState>,
    headers: HeaderMap,
    Body(new): Body<NewLabeler>,
) -> Result<Response, Problem> {
    let (cookie, view) = sign_in(&app, &headers, &new.name).await?;
    Ok((
        StatusCode::CREATED,
        [(header::SET_COOKIE, cookie)],
        Json(view),
    )
        .into_response())
}

/// The cookie for the browser that asks, whose labeler has this name.
///
/// # Errors
/// A name that is none, or that the server keeps for itself.
pub async fn sign_in(
    app: &AppState,
    headers: &HeaderMap,
    name: &str,
) -> Result<(String, LabelerView), Problem> {
    let (labeler, secret) = app.store.sign_in(name).await?;
    let view = LabelerView {
        id: labeler.id.0,
        name: labeler.name,
    };
    Ok((Cookie::Labeler.set(headers, &secret), view))
}

/// `?token=…`
#[derive(Deserialize)]
pub struct Entrance {
    token: String,
}

/// `GET /enter?token=…`: lets a browser use a server that listens on a network.
///
/// # Errors
/// No token, or one that was never given out.
pub async fn enter(
    State(app): State<AppState>,
    headers: HeaderMap,
    Query(entrance): Query<Entrance>,
) -> Result<Response, Problem> {
    let secret = Secret::brought(entrance.token);
    match app.store.bearer(&secret).await? {
        Some(bearer) if bearer.kind == TokenKind::Access => Ok((
            [(header::SET_COOKIE, Cookie::Access.set(&headers, &secret))],
            Redirect::to("/"),
        )
            .into_response()),
        _ => Err(Problem::token_needed()),
    }
}
