//! `/api/v1/tasks`: what can be learned, and by which methods.

use axum::Json;
use serde::Serialize;
use utoipa::ToSchema;

/// What a run can be started with.
#[derive(Serialize, ToSchema)]
pub struct Registry {
    /// Tasks.
    tasks: Vec<Named>,
    /// Methods.
    methods: Vec<Named>,
    /// Scripted teachers; besides them there are `human` and `http`.
    teachers: Vec<Named>,
}

/// A name with a sentence.
#[derive(Serialize, ToSchema)]
pub struct Named {
    /// As one types it.
    name: &'static str,
    /// What it is.
    summary: &'static str,
}

/// Tasks, methods and teachers.
#[utoipa::path(get, path = "/api/v1/tasks", tag = "tasks", operation_id = "listTasks",
    responses((status = 200, body = Registry)))]
pub async fn list() -> Json<Registry> {
    let named = |(name, summary)| Named { name, summary };
    Json(Registry {
        tasks: sim::tasks::tasks()
            .iter()
            .map(|task| named((task.name, task.summary)))
            .collect(),
        methods: lab::method::METHODS
            .iter()
            .map(|method| named((method.name, method.summary)))
            .collect(),
        teachers: domain::teacher::SCRIPTED
            .iter()
            .copied()
            .map(named)
            .collect(),
    })
}
