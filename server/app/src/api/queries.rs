//! `/api/v1/queries`: ground truth for teachers' programs.

use axum::Json;
use axum::extract::State;
use domain::answer::Which;
use serde::Serialize;
use store::QueryId;
use utoipa::ToSchema;

use crate::extract::{Answerer, Path};
use crate::problem::Problem;
use crate::state::AppState;

/// Per-step task rewards of a query, by the sides of the program's own lease.
#[derive(Serialize, ToSchema)]
pub struct TaskRewardsView {
    /// Round of asking, from 0.
    session: u32,
    /// Place in the round, from 0; `position` in tables of answers.
    index: u32,
    /// Of the segment on the left.
    left: Vec<f64>,
    /// Of the segment on the right.
    right: Vec<f64>,
    /// Which segment of the query is on the left: `first` or `second`.
    #[schema(value_type = String)]
    left_is: Which,
    /// Whether all four ends are in one true stage, where the task knows.
    same_stage: Option<bool>,
    /// Mean task reward a step of the agent's newest episodes when the query was asked.
    typical_reward: Option<f64>,
}

/// Task rewards of a query.
///
/// Only for a program with a teacher token of the query's run.
///
/// # Errors
/// 403 for everybody else; 404 for an unknown query.
#[utoipa::path(get, path = "/api/v1/queries/{id}/task-rewards", tag = "queries", operation_id = "readTaskRewards",
    params(("id" = i64, Path)), security(("teacherToken" = [])),
    responses((status = 200, body = TaskRewardsView), (status = 403, description = "A labeler asks, or a teacher of another run.")))]
pub async fn task_rewards(
    State(app): State<AppState>,
    who: Answerer,
    Path(query): Path<i64>,
) -> Result<Json<TaskRewardsView>, Problem> {
    let Some(taught) = who.teaches else {
        return Err(Problem::teachers_only());
    };
    let truth = app.store.task_rewards(QueryId(query)).await?;
    if truth.run != taught {
        return Err(Problem::teachers_only());
    }
    let left_is = app
        .store
        .left_for(QueryId(query), who.labeler.id)
        .await?
        .unwrap_or(Which::First);
    let (left, right) = match left_is {
        Which::First => (truth.first, truth.second),
        Which::Second => (truth.second, truth.first),
    };
    let (session, index) = (truth.key.session, truth.key.index);
    Ok(Json(TaskRewardsView {
        session,
        index,
        left,
        right,
        left_is,
        same_stage: truth.same_stage,
        typical_reward: truth.typical_reward,
    }))
}
