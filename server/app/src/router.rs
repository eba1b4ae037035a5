//! Every address of the server, one line each.

use axum::Router;
use axum::http::Uri;
use axum::routing::get;

use crate::assets;
use crate::problem::Problem;
use crate::state::AppState;

/// The whole server as a service.
pub fn router(state: AppState) -> Router {
    Router::new()
        .route("/livez", get(|| async { "ok\n" }))
        .route("/static/{*path}", get(assets::file))
        .fallback(|uri: Uri| async move { Problem::no_such_page(uri.path()) })
        .with_state(state)
}
