//! `/api/v1/runs`: start, look at, pause, resume, stop.

use axum::Json;
use axum::extract::State;
use axum::http::{StatusCode, header};
use axum::response::{IntoResponse, Response};
use domain::teacher::TeacherSettings;
use lab::config::{Layers, RunConfig, find_teacher};
use serde::{Deserialize, Serialize};
use serde_json::{Map, Value};
use store::{NewRun, RunId, RunRow, rfc3339};
use utoipa::ToSchema;

use crate::extract::{Body, Run};
use crate::live::{HTTP, HUMAN};
use crate::problem::Problem;
use crate::state::AppState;

/// A run to be started.
#[derive(Debug, Default, Deserialize, ToSchema)]
#[serde(deny_unknown_fields, default)]
pub struct RunRequest {
    /// The task's name.
    #[schema(required = true)]
    pub task: String,
    /// The method's name; STAIR unless said otherwise.
    pub method: Option<String>,
    /// A preset on top of the task's and the method's own: `quick`.
    pub preset: Option<String>,
    /// Of every random stream.
    pub seed: Option<u64>,
    /// `human`, `http` (a program answers; clips are not drawn), or a scripted teacher.
    pub teacher: Option<String>,
    /// Whether clips are drawn although a program answers.
    pub draw_clips: Option<bool>,
    /// Settings, nested or with dotted keys.
    #[schema(value_type = Object)]
    pub settings: Map<String, Value>,
}

/// A run as programs and pages see it.
#[derive(Debug, Serialize, ToSchema)]
pub struct RunView {
    /// Number.
    pub id: i64,
    /// Task.
    pub task: String,
    /// Method.
    pub method: String,
    /// Preset, where there is one.
    pub preset: String,
    /// Of every random stream.
    pub seed: u64,
    /// Who answers.
    pub teacher: String,
    /// How irregular scripted teachers are to be in this run, as its settings `[teacher]` say; null
    /// where this version of the program cannot read them.
    #[schema(value_type = Option<Object>)]
    pub teacher_settings: Option<TeacherSettings>,
    /// What it is doing.
    pub state: StateView,
    /// Environment steps taken.
    pub step: u64,
    /// Environment steps in all.
    pub total_steps: u64,
    /// Answers received, skips not counted.
    pub labels: u32,
    /// Answers in all.
    pub budget: u32,
    /// The newest session, from 0.
    pub session: Option<u32>,
    /// Answers received in it.
    pub session_answered: u32,
    /// Answers it needs.
    pub session_size: u32,
    /// RFC 3339.
    pub created_at: String,
}

/// A run's state in one line.
#[derive(Debug, Serialize, ToSchema)]
pub struct StateView {
    /// `training`, `waiting_for_labels`, `paused`, `finished`, `stopped`, `failed`.
    pub kind: String,
    /// What it is doing.
    pub message: String,
    /// Since when, RFC 3339.
    pub since: String,
    /// What comes next; empty where nothing does.
    pub next: String,
}

impl RunView {
    /// Whether a person can answer this run now.
    pub fn can_label(&self) -> bool {
        let is_up = matches!(self.state.kind.as_str(), "training" | "waiting_for_labels");
        self.teacher == HUMAN && is_up && self.labels < self.budget
    }
}

/// All runs, newest first.
///
/// # Errors
/// The database cannot be read.
#[utoipa::path(get, path = "/api/v1/runs", tag = "runs", operation_id = "listRuns",
    responses((status = 200, body = [RunView])))]
pub async fn list(State(app): State<AppState>) -> Result<Json<Vec<RunView>>, Problem> {
    let mut views = Vec::new();
    for run in app.store.runs().await? {
        views.push(view(&app, run).await?);
    }
    Ok(Json(views))
}

/// Starts a run.
///
/// # Errors
/// An unknown task, method, preset, teacher or setting, with the nearest right name.
#[utoipa::path(post, path = "/api/v1/runs", tag = "runs", operation_id = "createRun", request_body = RunRequest,
    responses((status = 201, body = RunView, headers(("Location" = String, description = "Where the run is."))),
        (status = 422, description = "An unknown task, method, preset, teacher or setting, with the nearest right name.")))]
pub async fn create(
    State(app): State<AppState>,
    Body(request): Body<RunRequest>,
) -> Result<Response, Problem> {
    let id = start(&app, request).await?;
    let run = app
        .store
        .run(id)
        .await?
        .ok_or_else(|| Problem::run_not_found(id))?;
    let location = [(header::LOCATION, format!("/api/v1/runs/{id}"))];
    Ok((StatusCode::CREATED, location, Json(view(&app, run).await?)).into_response())
}

/// One run.
///
/// # Errors
/// An unknown run.
#[utoipa::path(get, path = "/api/v1/runs/{id}", tag = "runs", operation_id = "readRun", params(("id" = i64, Path)),
    security((), ("accessToken" = []), ("accessCookie" = []), ("teacherToken" = [])),
    responses((status = 200, body = RunView)))]
pub async fn read(State(app): State<AppState>, Run(run): Run) -> Result<Json<RunView>, Problem> {
    Ok(Json(view(&app, run).await?))
}

/// Lets a run stand still; answers are still taken.
///
/// # Errors
/// A run that is not up.
#[utoipa::path(post, path = "/api/v1/runs/{id}/pause", tag = "runs", operation_id = "pauseRun", params(("id" = i64, Path)),
    responses((status = 202), (status = 409, description = "The run is not up, or is stopping.")))]
pub async fn pause(State(app): State<AppState>, Run(run): Run) -> Result<StatusCode, Problem> {
    app.live.pause(run.id)?;
    Ok(StatusCode::ACCEPTED)
}

/// Goes on with a run that is paused, stopped or failed.
///
/// # Errors
/// A run that is finished.
#[utoipa::path(post, path = "/api/v1/runs/{id}/resume", tag = "runs", operation_id = "resumeRun", params(("id" = i64, Path)),
    responses((status = 202), (status = 409, description = "The run is finished, has no agent, or is stopping.")))]
pub async fn resume(State(app): State<AppState>, Run(run): Run) -> Result<StatusCode, Problem> {
    check_resumable(&run)?;
    app.live.resume(run.id)?;
    Ok(StatusCode::ACCEPTED)
}

/// Whether a run can be taken up again.
///
/// # Errors
/// 409 for a run that is finished or that has no agent.
pub fn check_resumable(run: &RunRow) -> Result<(), Problem> {
    let why_not = match (run.is_trained, run.state.kind.as_str()) {
        (false, _) => "No agent learns here: the queries were put in from outside.",
        (_, "finished") => "The run has taken all its steps.",
        _ => return Ok(()),
    };
    Err(Problem::new(
        StatusCode::CONFLICT,
        "/problems/run-state",
        "The run cannot do that now",
        why_not,
    ))
}

/// Ends a run's thread after a checkpoint; it can be taken up again.
///
/// # Errors
/// A run that is not up.
#[utoipa::path(post, path = "/api/v1/runs/{id}/stop", tag = "runs", operation_id = "stopRun", params(("id" = i64, Path)),
    responses((status = 202), (status = 409, description = "The run is not up.")))]
pub async fn stop(State(app): State<AppState>, Run(run): Run) -> Result<StatusCode, Problem> {
    app.live.stop(run.id)?;
    Ok(StatusCode::ACCEPTED)
}

/// A secret that is shown once.
#[derive(Serialize, ToSchema)]
pub struct TokenView {
    /// Send it as `Authorization: Bearer`.
    token: String,
}

/// A token for a program that answers this run's queries and may read their task rewards.
///
/// # Errors
/// A request from a labeler's browser or from another teacher.
#[utoipa::path(post, path = "/api/v1/runs/{id}/teacher-tokens", tag = "runs", operation_id = "createTeacherToken",
    params(("id" = i64, Path)),
    responses((status = 201, body = TokenView), (status = 403, description = "A labeler's browser asks, or another teacher.")))]
pub async fn create_token(
    State(app): State<AppState>,
    headers: axum::http::HeaderMap,
    Run(run): Run,
) -> Result<Response, Problem> {
    use crate::extract::{bearer, labeler};
    let is_teacher = match bearer(&headers) {
        Some(secret) => {
            let kind = app.store.bearer(&secret).await?.map(|bearer| bearer.kind);
            matches!(kind, Some(store::TokenKind::Teacher(_)))
        }
        None => false,
    };
    if is_teacher || labeler(&app, &headers).await?.is_some() {
        return Err(Problem::researchers_only());
    }
    let secret = app.store.add_teacher_token(run.id).await?;
    Ok((
        StatusCode::CREATED,
        Json(TokenView {
            token: secret.reveal().to_owned(),
        }),
    )
        .into_response())
}

/// Resolves the settings, keeps the run, and starts its thread.
///
/// # Errors
/// An unknown task, method, preset, teacher or setting.
pub async fn start(app: &AppState, request: RunRequest) -> Result<RunId, Problem> {
    let teacher = request.teacher.unwrap_or_else(|| HUMAN.into());
    find_teacher(&teacher, &[HUMAN, HTTP])?;
    let mut overrides = Vec::new();
    flatten("", &request.settings, &mut overrides);
    overrides.extend(request.seed.map(|seed| format!("seed={seed}")));
    let preset = request.preset.filter(|preset| !preset.is_empty());
    let layers = Layers {
        task: Some(request.task),
        method: Some(request.method.unwrap_or_else(|| "stair".into())),
        presets: preset.iter().cloned().collect(),
        file: None,
        overrides,
    };
    let config = RunConfig::resolve_from("settings", &layers)?;
    let new = NewRun {
        draws_clips: request.draw_clips.unwrap_or(teacher == HUMAN),
        task: config.task.clone(),
        method: config.method.clone(),
        preset: preset.unwrap_or_default(),
        seed: config.seed,
        teacher,
        config: config.to_toml(),
        budget: config.feedback.budget,
        total_steps: config.training.total_steps,
        is_trained: true,
    };
    let id = app.store.add_run(new).await?;
    app.live.spawn(id)?;
    Ok(id)
}

/// `{"a": {"b": 1}}` and `{"a.b": 1}` alike become `a.b=1`, which layers take.
fn flatten(prefix: &str, settings: &Map<String, Value>, overrides: &mut Vec<String>) {
    for (key, value) in settings {
        let path = if prefix.is_empty() {
            key.clone()
        } else {
            format!("{prefix}.{key}")
        };
        match value {
            Value::Object(inner) => flatten(&path, inner, overrides),
            other => overrides.push(format!("{path}={other}")),
        }
    }
}

/// A run with its numbers of the moment.
///
/// # Errors
/// The database cannot be read.
pub async fn view(app: &AppState, run: RunRow) -> Result<RunView, Problem> {
    let progress = app.store.progress(run.id).await?;
    let line = app.live.state(run.id);
    let step = app.live.phase(run.id).map_or(run.step, |phase| phase.step);
    let (message, next) = line.map_or((run.state.message, run.state.next), |line| {
        (line.message, line.next)
    });
    let settings = RunConfig::parse("the run's settings", &run.config);
    Ok(RunView {
        teacher_settings: settings.ok().map(|config| config.teacher),
        id: run.id.0,
        task: run.task,
        method: run.method,
        preset: run.preset,
        seed: run.seed,
        teacher: run.teacher,
        state: StateView {
            kind: run.state.kind,
            message,
            since: rfc3339(run.state.since_ms),
            next,
        },
        step,
        total_steps: run.total_steps,
        labels: progress.answered,
        budget: run.budget,
        session: progress.session,
        session_answered: progress.session_answered,
        session_size: progress.session_size,
        created_at: rfc3339(run.created_at_ms),
    })
}
