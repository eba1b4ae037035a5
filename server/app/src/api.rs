//! The API under `/api/v1`: one file per resource; bodies are their own small structs.

use utoipa::OpenApi;

use self::description::Shared;
use crate::problem::Problem;

pub mod clips;
mod description;
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

/// OpenAPI 3.1, generated from the handlers. They say what is their own; what all of them have in
/// common is added in `description.rs`.
#[derive(OpenApi)]
#[openapi(
    info(
        title = "STAIR",
        description = "Train agents from human preferences. Problems are RFC 9457."
    ),
    modifiers(&Shared),
    components(schemas(Problem)),
    tags(
        (name = "tasks", description = "What can be learned, and by which methods."),
        (name = "runs", description = "Start agents and command them."),
        (name = "leases", description = "Questions to whoever answers, and their answers."),
        (name = "queries", description = "Ground truth for programs that answer."),
        (name = "clips", description = "Pictures of segments."),
        (name = "events", description = "What a run says, live and from the start."),
        (name = "labels", description = "All answers, for statistics elsewhere."),
        (name = "labelers", description = "Who answers."),
        (name = "studies", description = "The same pairs for invited people."),
        (name = "health", description = "For whoever watches the server."),
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
