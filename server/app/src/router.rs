//! Every address of the server, one line each.

use axum::Router;
use axum::extract::DefaultBodyLimit;
use axum::http::Uri;
use axum::middleware::{from_fn, from_fn_with_state};
use axum::routing::{get, post, put};
use tower_http::compression::CompressionLayer;
use tower_http::compression::predicate::{DefaultPredicate, NotForContentType, Predicate as _};

use crate::api::{
    clips, events, health, labelers, labels, leases, openapi, queries, runs, seats, studies, tasks,
};
use crate::problem::Problem;
use crate::state::AppState;
use crate::{assets, guard, pages};

/// Bytes in a request's body at most.
const BODY_LIMIT: usize = 256 * 1024;

/// The whole server as a service.
pub fn router(state: AppState) -> Router {
    let compression = CompressionLayer::new()
        .compress_when(DefaultPredicate::new().and(NotForContentType::const_new("video/mp4")));
    Router::new()
        .route("/", get(pages::home::page))
        .route("/runs", post(pages::home::start))
        .route("/runs/{id}", get(pages::run::page))
        .route(
            "/runs/{id}/label",
            get(pages::label::page).post(pages::label::sign_in),
        )
        .route("/runs/{id}/pause", post(pages::run::pause))
        .route("/runs/{id}/resume", post(pages::run::resume))
        .route("/runs/{id}/stop", post(pages::run::stop))
        .route("/runs/{id}/temporal-map.svg", get(pages::run::map::picture))
        .route("/compare", get(pages::compare::page))
        .route("/compare/{file}", get(pages::compare::picture))
        .route("/labels", get(pages::labels::page))
        .route("/api", get(pages::api::page))
        .merge(experiments())
        .merge(study_pages())
        .merge(api())
        .route("/enter", get(labelers::enter))
        .route("/static/{*path}", get(assets::file))
        .fallback(|uri: Uri| async move { Problem::no_such_page(uri.path()) })
        .method_not_allowed_fallback(|uri: Uri| async move { Problem::wrong_method(uri.path()) })
        .layer(DefaultBodyLimit::max(BODY_LIMIT))
        .layer(from_fn_with_state(state.clone(), guard::admit))
        .layer(from_fn(pages::problem::as_page))
        .layer(from_fn(guard::number))
        .layer(compression)
        .with_state(state)
}

fn experiments() -> Router<AppState> {
    Router::new()
        .route("/experiments", get(pages::experiments::page))
        .route("/experiments/{name}", get(pages::experiment::page))
        .route("/experiments/{name}/{file}", get(pages::experiment::file))
}

fn study_pages() -> Router<AppState> {
    Router::new()
        .route(
            "/studies",
            get(pages::studies::page).post(pages::studies::prepare),
        )
        .route("/studies/{id}", get(pages::study::page))
        .route("/studies/{id}/retry", post(pages::study::retry))
        .route("/studies/{id}/open", post(pages::study::open))
        .route("/studies/{id}/close", post(pages::study::close))
        .route("/studies/{id}/invitations", post(pages::study::invite))
        .route("/join", get(pages::join::page).post(pages::join::enter))
        .route("/join/return", post(pages::join::come_back))
        .route("/seat", get(pages::seat::page))
}

fn api() -> Router<AppState> {
    Router::new()
        .route("/livez", get(health::livez))
        .route("/readyz", get(health::readyz))
        .route("/metrics", get(health::metrics))
        .route("/api/v1/openapi.json", get(openapi))
        .route("/api/v1/tasks", get(tasks::list))
        .route("/api/v1/labelers", post(labelers::create))
        .route("/api/v1/runs", get(runs::list).post(runs::create))
        .route("/api/v1/runs/{id}", get(runs::read))
        .route("/api/v1/runs/{id}/pause", post(runs::pause))
        .route("/api/v1/runs/{id}/resume", post(runs::resume))
        .route("/api/v1/runs/{id}/stop", post(runs::stop))
        .route("/api/v1/runs/{id}/teacher-tokens", post(runs::create_token))
        .route("/api/v1/runs/{id}/leases", post(leases::create))
        .route("/api/v1/runs/{id}/events", get(events::follow))
        .route("/api/v1/runs/{id}/metrics", get(events::metrics))
        .route("/api/v1/runs/{id}/labels", get(labels::export))
        .route("/api/v1/runs/{id}/clips", get(clips::of_run))
        .route("/api/v1/leases/{id}/heartbeat", post(leases::heartbeat))
        .route("/api/v1/leases/{id}/answer", put(leases::answer))
        .route(
            "/api/v1/queries/{id}/task-rewards",
            get(queries::task_rewards),
        )
        .route("/api/v1/clips/{name}", get(clips::file))
        .route("/api/v1/studies", get(studies::list).post(studies::create))
        .route(
            "/api/v1/studies/{id}",
            get(studies::read).put(studies::keep),
        )
        .route("/api/v1/studies/{id}/retry", post(studies::retry))
        .route("/api/v1/studies/{id}/open", post(studies::open))
        .route("/api/v1/studies/{id}/close", post(studies::close))
        .route("/api/v1/studies/{id}/invitations", post(studies::invite))
        .route("/api/v1/studies/{id}/labels", get(studies::labels))
        .route("/api/v1/studies/{id}/figures/{name}", get(studies::figure))
        .route("/api/v1/join", post(seats::join))
        .route("/api/v1/seat", get(seats::read))
}
