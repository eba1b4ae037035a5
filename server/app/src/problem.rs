//! What goes wrong, told over HTTP: RFC 9457 problems.

use axum::Json;
use axum::http::{StatusCode, header};
use axum::response::{IntoResponse, Response};
use serde::Serialize;

/// A problem as clients receive it, `application/problem+json`.
///
/// Constructors are named by meaning; `type` is a stable name below `/problems/`.
#[derive(Debug, Clone, Serialize, utoipa::ToSchema)]
pub struct Problem {
    /// Stable name of the kind of problem: `/problems/run-not-found`.
    pub r#type: &'static str,
    /// The kind in a few words.
    pub title: &'static str,
    /// HTTP status.
    pub status: u16,
    /// This case, for the person who reads it.
    pub detail: String,
    /// Path of the request.
    pub instance: String,
    /// Names the request in the server's log.
    pub request_id: String,
    /// The answer that exists already, where that is the problem.
    #[serde(skip_serializing_if = "Option::is_none")]
    #[schema(value_type = Option<Object>)]
    pub existing: Option<serde_json::Value>,
}

impl Problem {
    /// A problem of this kind; where and which request is filled in at the edge.
    pub fn new(
        status: StatusCode,
        kind: &'static str,
        title: &'static str,
        detail: impl Into<String>,
    ) -> Self {
        Self {
            r#type: kind,
            title,
            status: status.as_u16(),
            detail: detail.into(),
            instance: String::new(),
            request_id: String::new(),
            existing: None,
        }
    }

    /// 404: nothing lives at this address.
    pub fn no_such_page(path: &str) -> Self {
        Self::new(
            StatusCode::NOT_FOUND,
            "/problems/no-such-page",
            "There is nothing here",
            format!("{path} is not an address of this server. The list of runs is at /."),
        )
    }
}

impl IntoResponse for Problem {
    fn into_response(self) -> Response {
        let status = StatusCode::from_u16(self.status).unwrap_or(StatusCode::INTERNAL_SERVER_ERROR);
        let mut response = (status, Json(&self)).into_response();
        let content_type = header::HeaderValue::from_static("application/problem+json");
        response
            .headers_mut()
            .insert(header::CONTENT_TYPE, content_type);
        response.extensions_mut().insert(self);
        response
    }
}
