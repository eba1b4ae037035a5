//! The API under `/api/v1`: one file per resource; bodies are their own small structs.

use utoipa::OpenApi;

pub mod clips;
pub mod events;
pub mod health;
pub mod labelers;
pub mod labels;
pub mod leases;
pub mod queries;
pub mod runs;
pub mod seats;
pub mod studies;
pub mod tasks;

/// OpenAPI 3.1, generated from the handlers.
#[derive(OpenApi)]
#[openapi(
    info(
        title = "STAIR",
        description = "Train agents from human preferences. Problems are RFC 9457."
    ),
    paths(
        tasks::list,
        runs::list,
        runs::create,
        runs::read,
        runs::pause,
        runs::resume,
        runs::stop,
        runs::create_token,
        leases::create,
        leases::heartbeat,
        leases::answer,
        queries::task_rewards,
        clips::file,
        clips::of_run,
        events::follow,
        events::metrics,
        labels::export,
        studies::list,
        studies::create,
        studies::read,
        studies::keep,
        studies::retry,
        studies::open,
        studies::close,
        studies::invite,
        studies::labels,
        studies::figure,
        seats::join,
        seats::read,
        labelers::create,
        health::livez,
        health::readyz,
        health::metrics,
    )
)]
pub struct Document;

/// `GET /api/v1/openapi.json`
pub async fn openapi() -> axum::Json<utoipa::openapi::OpenApi> {
    axum::Json(Document::openapi())
}
