//! For whoever watches the server: `/livez`, `/readyz`, `/metrics`.

use axum::extract::State;
use axum::http::header;
use axum::response::{IntoResponse, Response};

use crate::guard;
use crate::problem::Problem;
use crate::state::AppState;

/// Whether the process answers.
#[utoipa::path(get, path = "/livez", tag = "health", operation_id = "checkAlive", security(()),
    responses((status = 200, body = String, description = "It does.")))]
pub async fn livez() -> &'static str {
    "ok\n"
}

/// Whether answers can be stored now.
///
/// # Errors
/// The database cannot be read or written.
#[utoipa::path(get, path = "/readyz", tag = "health", operation_id = "checkReady",
    responses((status = 200, body = String, description = "They can."),
        (status = 507, description = "The disk is full or cannot be written.")))]
pub async fn readyz(State(app): State<AppState>) -> Result<&'static str, Problem> {
    app.store.check().await?;
    Ok("ok\n")
}

/// Counters in Prometheus' text format.
///
/// # Errors
/// The database cannot be read.
#[utoipa::path(get, path = "/metrics", tag = "health", operation_id = "readMetrics",
    responses((status = 200, body = String)))]
pub async fn metrics(State(app): State<AppState>) -> Result<Response, Problem> {
    use std::fmt::Write as _;
    let mut text = String::from("# TYPE stair_http_requests_total counter\n");
    let _ = writeln!(text, "stair_http_requests_total {}", guard::n_requests()); // a string takes all
    for (name, what) in [
        ("stair_run_step", "environment steps taken"),
        ("stair_run_labels", "answers, skips not counted"),
    ] {
        let _ = writeln!(text, "# HELP {name} {what}\n# TYPE {name} gauge"); // the same
        for run in app.store.runs().await? {
            let value = if name == "stair_run_step" {
                run.step
            } else {
                u64::from(run.n_labels)
            };
            let _ = writeln!(
                text,
                "{name}{{run=\"{}\",state=\"{}\"}} {value}",
                run.id, run.state.kind
            ); // the same
        }
    }
    Ok(([(header::CONTENT_TYPE, "text/plain; version=0.0.4")], text).into_response())
}
