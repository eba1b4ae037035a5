//! What goes wrong, told over HTTP: RFC 9457 problems.

use axum::Json;
use axum::http::{StatusCode, header};
use axum::response::{IntoResponse, Response};
use lab::config::ConfigError;
use serde::Serialize;
use serde_json::{Value, json};
use store::{StoreError, rfc3339};

use crate::live::LiveError;

mod rejection;

// Constructors are named by meaning.
/// What went wrong, `application/problem+json`.
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
    pub existing: Option<Box<Value>>,
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
        let detail = format!("{path} is not an address of this server. The list of runs is at /.");
        Self::new(
            StatusCode::NOT_FOUND,
            "/problems/no-such-page",
            "There is nothing here",
            detail,
        )
    }

    /// 405: the address takes other methods.
    pub fn wrong_method(path: &str) -> Self {
        let detail =
            format!("{path} does not take this method; /api/v1/openapi.json says what it takes.");
        Self::new(
            StatusCode::METHOD_NOT_ALLOWED,
            "/problems/wrong-method",
            "Not this way",
            detail,
        )
    }

    /// 404: no run has this number.
    pub fn run_not_found(id: impl std::fmt::Display) -> Self {
        let detail = format!("There is no run {id}. The list of runs is at /.");
        Self::new(
            StatusCode::NOT_FOUND,
            "/problems/run-not-found",
            "There is no such run",
            detail,
        )
    }

    /// 404: no study has this number.
    pub fn study_not_found(id: impl std::fmt::Display) -> Self {
        let detail = format!("There is no study {id}. The list of studies is at /studies.");
        Self::new(
            StatusCode::NOT_FOUND,
            "/problems/study-not-found",
            "There is no such study",
            detail,
        )
    }

    /// 404: the labeler takes part in no study.
    pub fn no_seat() -> Self {
        let detail = "You take part in no study in this browser. Open the link that you were sent, or enter your return code at /join.";
        Self::new(
            StatusCode::NOT_FOUND,
            "/problems/no-seat",
            "No study to take part in",
            detail,
        )
    }

    /// 422: a study's file with mistakes.
    pub fn unusable_study(detail: impl Into<String>) -> Self {
        Self::new(
            StatusCode::UNPROCESSABLE_ENTITY,
            "/problems/unusable-study",
            "This study cannot be used",
            detail,
        )
    }

    /// 404: no experiment has this name, or none of its files.
    pub fn experiment_not_found(name: &str) -> Self {
        let detail =
            format!("There is no experiment or file {name}. All of them are at /experiments.");
        Self::new(
            StatusCode::NOT_FOUND,
            "/problems/experiment-not-found",
            "There is no such experiment",
            detail,
        )
    }

    /// 500: results that cannot be read or compared.
    pub fn unreadable_results(detail: impl Into<String>) -> Self {
        Self::new(
            StatusCode::INTERNAL_SERVER_ERROR,
            "/problems/unreadable-results",
            "These results cannot be shown",
            detail,
        )
    }

    /// 404: the run has no temporal map, or none that can be drawn now.
    pub fn no_map(detail: impl Into<String>) -> Self {
        Self::new(
            StatusCode::NOT_FOUND,
            "/problems/no-temporal-map",
            "This run has no temporal map",
            detail,
        )
    }

    /// 401: nobody has said who answers.
    pub fn who_are_you() -> Self {
        let detail =
            "Say who answers first: POST /api/v1/labelers with a name, or send a teacher token.";
        Self::new(
            StatusCode::UNAUTHORIZED,
            "/problems/labeler-unknown",
            "Who is answering?",
            detail,
        )
    }

    /// 401: a token that is no program's, or that was never given out here.
    pub fn token_unknown() -> Self {
        let detail = "This token is not one of a teacher on this server: it was mistyped, or made elsewhere. POST /api/v1/runs/{run}/teacher-tokens makes one.";
        Self::new(
            StatusCode::UNAUTHORIZED,
            "/problems/token-unknown",
            "This token is not known here",
            detail,
        )
    }

    /// 401: the server listens on more than its own machine, and the request brought no token.
    pub fn token_needed() -> Self {
        let detail = "This server needs a token: open /enter?token=… once, or send it as Authorization: Bearer.";
        Self::new(
            StatusCode::UNAUTHORIZED,
            "/problems/token-needed",
            "This server needs a token",
            detail,
        )
    }

    /// 403: the token is not for this.
    pub fn teachers_only() -> Self {
        let detail =
            "Only a program with a teacher token of this run may do this; labelers never may.";
        Self::new(
            StatusCode::FORBIDDEN,
            "/problems/teachers-only",
            "Not for labelers",
            detail,
        )
    }

    /// 403: a teacher token is for the researcher to make.
    pub fn researchers_only() -> Self {
        let detail = "A teacher token is made by the researcher: send the server's token, without a labeler's cookie.";
        Self::new(
            StatusCode::FORBIDDEN,
            "/problems/researchers-only",
            "Not for labelers or teachers",
            detail,
        )
    }

    /// 410: the bytes of a known clip are gone; asking again does not bring them back.
    pub fn clip_gone() -> Self {
        let detail = "The file of this clip is gone from the server's data folder. Pass the pair over as a broken clip; whoever runs the server can put the file back from a copy of the folder.";
        Self::new(
            StatusCode::GONE,
            "/problems/clip-gone",
            "This clip is gone",
            detail,
        )
    }

    /// 404: curves of runs that were not tried yet.
    pub fn no_trial(detail: impl Into<String>) -> Self {
        Self::new(
            StatusCode::NOT_FOUND,
            "/problems/no-trial",
            "There is nothing to draw yet",
            detail,
        )
    }

    /// 416: a part that a clip does not have.
    pub fn no_such_range() -> Self {
        Self::new(
            StatusCode::RANGE_NOT_SATISFIABLE,
            "/problems/no-such-range",
            "The clip has no such part",
            "Ask for one range within the clip's length, which `Content-Range` tells.",
        )
    }

    /// 403: a teacher token is for less than this.
    pub fn beyond_teaching() -> Self {
        let detail = "A teacher token is for answering its own run's queries: the run, its leases and answers, the queries' task rewards, and clips. Everything else needs the server's token.";
        Self::new(
            StatusCode::FORBIDDEN,
            "/problems/beyond-teaching",
            "Not for a teacher token",
            detail,
        )
    }

    /// 403: the request comes from another site.
    pub fn foreign(detail: impl Into<String>) -> Self {
        Self::new(
            StatusCode::FORBIDDEN,
            "/problems/foreign-request",
            "Refused: it comes from elsewhere",
            detail,
        )
    }

    /// 400 or 415 or 422: a body or parameter that is not what the address takes.
    pub fn bad_request(status: StatusCode, detail: impl Into<String>) -> Self {
        Self::new(
            status,
            "/problems/bad-request",
            "The request cannot be read",
            detail,
        )
    }

    /// 422: settings that cannot be used.
    pub fn unusable_settings(detail: impl Into<String>) -> Self {
        Self::new(
            StatusCode::UNPROCESSABLE_ENTITY,
            "/problems/unusable-settings",
            "These settings cannot be used",
            detail,
        )
    }

    /// 500: a page could not be written.
    pub fn page_failed() -> Self {
        Self::internal()
    }

    /// 500: a bug, or a machine in trouble; the log has the rest.
    pub fn internal() -> Self {
        let detail = "The server could not do it; its log says why, under the id of this request.";
        Self::new(
            StatusCode::INTERNAL_SERVER_ERROR,
            "/problems/internal",
            "The server failed",
            detail,
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

impl From<StoreError> for Problem {
    fn from(error: StoreError) -> Self {
        if let Some(problem) = crate::api::studies::problem(&error) {
            return problem;
        }
        let detail = error.to_string();
        let problem = |status, kind, title| Self::new(status, kind, title, detail.clone());
        match error {
            StoreError::Missing { what: "run", id } => Self::run_not_found(id),
            StoreError::Missing { .. } => problem(
                StatusCode::NOT_FOUND,
                "/problems/not-found",
                "There is no such thing",
            ),
            StoreError::NotYours => problem(
                StatusCode::FORBIDDEN,
                "/problems/not-your-lease",
                "Not your lease",
            ),
            StoreError::WrongQuestion { .. } => problem(
                StatusCode::UNPROCESSABLE_ENTITY,
                "/problems/wrong-question",
                "Not an answer to this question",
            ),
            StoreError::NoReason => problem(
                StatusCode::UNPROCESSABLE_ENTITY,
                "/problems/reason-needed",
                "A skip needs a reason",
            ),
            StoreError::NotSupersedable(_) => problem(
                StatusCode::UNPROCESSABLE_ENTITY,
                "/problems/not-supersedable",
                "That answer cannot be replaced here",
            ),
            StoreError::Different(existing) => Self {
                existing: Some(Box::new(json!({
                    "answer_id": existing.id, "answer": existing.pressed, "sequence": existing.sequence,
                    "stored_at": rfc3339(existing.stored_at_ms),
                }))),
                ..problem(
                    StatusCode::CONFLICT,
                    "/problems/already-answered",
                    "Already answered differently",
                )
            },
            StoreError::Taken => problem(
                StatusCode::GONE,
                "/problems/lease-taken",
                "Somebody else has this question now",
            ),
            StoreError::Withdrawn => problem(
                StatusCode::GONE,
                "/problems/question-withdrawn",
                "This is not asked any more",
            ),
            StoreError::NameKept(_) => problem(
                StatusCode::UNPROCESSABLE_ENTITY,
                "/problems/name-kept",
                "This name is not free",
            ),
            StoreError::Rule(rule) if rule.contains("labeler_name_not_empty") => Self::bad_request(
                StatusCode::UNPROCESSABLE_ENTITY,
                "A name has at least one and at most 80 letters.",
            ),
            StoreError::Full | StoreError::ReadOnly => problem(
                StatusCode::INSUFFICIENT_STORAGE,
                "/problems/storage",
                "The answer could not be stored",
            ),
            StoreError::Closed => problem(
                StatusCode::SERVICE_UNAVAILABLE,
                "/problems/closing",
                "The server is closing",
            ),
            other => {
                tracing::error!("{other}");
                Self::internal()
            }
        }
    }
}

impl From<LiveError> for Problem {
    fn from(error: LiveError) -> Self {
        let detail = error.to_string();
        match error {
            LiveError::Store(error) => error.into(),
            LiveError::Closing => Self::new(
                StatusCode::SERVICE_UNAVAILABLE,
                "/problems/closing",
                "The server is closing",
                detail,
            ),
            LiveError::Thread(_) => {
                tracing::error!("{detail}");
                Self::internal()
            }
            _ => Self::new(
                StatusCode::CONFLICT,
                "/problems/run-state",
                "The run cannot do that now",
                detail,
            ),
        }
    }
}

impl From<ConfigError> for Problem {
    fn from(error: ConfigError) -> Self {
        Self::unusable_settings(error.to_string())
    }
}
