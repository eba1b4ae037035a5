//! `/api/v1/leases`: questions to a labeler, and their answers.

use axum::Json;
use axum::extract::State;
use axum::http::StatusCode;
use axum::response::{IntoResponse, Response};
use domain::query::Question;
use lab::message::{Activity, Phase};
use serde::{Deserialize, Serialize};
use store::{Lease, LeaseClip, NewAnswer, Progress, Queue, RunRow, Timing, now_ms, rfc3339};
use utoipa::ToSchema;

use super::clips;
use crate::extract::{Answerer, Body, Path, Run};
use crate::problem::Problem;
use crate::state::AppState;

/// Leases at most: for a person's page, and for a program.
const MOST: [u32; 2] = [20, 200];

/// How many leases to hold.
#[derive(Deserialize, ToSchema)]
#[serde(deny_unknown_fields)]
pub struct LeaseRequest {
    /// Open leases to top up to.
    count: u32,
}

/// Open leases, and what the labeler should know when there are none.
#[derive(Serialize, ToSchema)]
pub struct LeasesView {
    /// In the order of asking.
    leases: Vec<LeaseView>,
    /// Why there are or are not any.
    state: QueueView,
    /// How far the asking is.
    progress: ProgressView,
}

/// A question in a labeler's hands. Nothing in it tells which method made the query.
#[derive(Serialize, ToSchema)]
pub struct LeaseView {
    /// Where the answer goes.
    lease_id: String,
    /// The query.
    query_id: i64,
    /// `preference` or `same_stage`.
    #[schema(value_type = String)]
    question: Question,
    /// On the left.
    left: ClipView,
    /// On the right.
    right: ClipView,
    /// RFC 3339; a heartbeat moves it.
    expires_at: String,
    /// What to tell after the answer, where this is practice.
    #[serde(skip_serializing_if = "Option::is_none")]
    practice: Option<PracticeView>,
}

/// What a labeler who practises is told after the answer.
#[derive(Serialize, ToSchema)]
pub struct PracticeView {
    /// The right answer: `left`, `right`, `equal`, `same` or `different`.
    expects: String,
    /// Why.
    because: String,
}

/// A clip to show.
#[derive(Serialize, ToSchema)]
pub struct ClipView {
    /// Its address; null where clips are not drawn.
    clip: Option<String>,
    /// Pictures.
    n_frames: u32,
    /// Pictures a second.
    fps: u32,
}

/// What stands between a labeler and the next question.
#[derive(Serialize, ToSchema)]
pub struct QueueView {
    /// `open`, `waiting`, `held`, `done`, `paused`, `failed`, `drawing`.
    kind: &'static str,
    /// In words.
    message: String,
    /// When others' questions may come back, RFC 3339.
    until: Option<String>,
    /// What the agent is doing.
    phase: Option<PhaseView>,
}

/// What the agent is doing.
#[derive(Serialize, ToSchema)]
pub struct PhaseView {
    /// `exploring`, `asking`, `learning`, `paused`.
    #[schema(value_type = String)]
    activity: Activity,
    /// Environment steps taken.
    step: u64,
    /// Environment steps in all.
    total_steps: u64,
    /// Step at which the activity ends, where it is known.
    until_step: Option<u64>,
    /// How much of the way there, 0 to 1.
    progress: Option<f64>,
}

/// How far the asking is.
#[derive(Serialize, ToSchema)]
pub struct ProgressView {
    /// Answers received, skips not counted; in a study skips count and practice does not.
    answered: u32,
    /// Answers in all.
    budget: u32,
    /// The newest session, from 0.
    session: Option<u32>,
    /// Answers received in it.
    session_answered: u32,
    /// Answers it needs.
    session_size: u32,
}

/// The labeler's open leases, topped up; asked again they are the same.
///
/// # Errors
/// An unknown run; nobody has said who answers; questions that are another's; a study that is not
/// open.
#[utoipa::path(post, path = "/api/v1/runs/{id}/leases", tag = "leases", operation_id = "createLeases",
    params(("id" = i64, Path)), request_body = LeaseRequest,
    security(("teacherToken" = []), ("labelerCookie" = [])),
    responses((status = 200, body = LeasesView),
        (status = 403, description = "Questions that are another labeler's, or of another run than the token's."),
        (status = 409, description = "The study is not open.")))]
pub async fn create(
    State(app): State<AppState>,
    who: Answerer,
    Run(run): Run,
    Body(request): Body<LeaseRequest>,
) -> Result<Json<LeasesView>, Problem> {
    if who.teaches.is_some_and(|taught| taught != run.id) {
        return Err(Problem::teachers_only());
    }
    let is_person = who.teaches.is_none();
    let count = request.count.min(MOST[usize::from(!is_person)]);
    let is_open = !matches!(run.state.kind.as_str(), "paused" | "failed" | "stopped");
    let count = if is_open { count } else { 0 };
    let leases = app
        .store
        .lease(run.id, who.labeler.id, count, is_person, now_ms())
        .await?;
    let queue = app.store.queue(run.id, who.labeler.id).await?;
    let progress = app.store.progress(run.id).await?;
    let state = queue_view(&app, &run, !leases.is_empty(), queue, progress);
    let progress = progress_view(progress);
    Ok(Json(LeasesView {
        leases: leases.into_iter().map(lease_view).collect(),
        state,
        progress,
    }))
}

/// Keeps a lease for another ten minutes.
///
/// # Errors
/// An unknown lease, another labeler's, or one that somebody else has taken.
#[utoipa::path(post, path = "/api/v1/leases/{id}/heartbeat", tag = "leases", operation_id = "heartbeat",
    params(("id" = String, Path)), security(("teacherToken" = []), ("labelerCookie" = [])),
    responses((status = 200, body = HeartbeatView), (status = 403, description = "Another labeler's lease."),
        (status = 410, description = "Somebody else has the question now.")))]
pub async fn heartbeat(
    State(app): State<AppState>,
    who: Answerer,
    Path(lease): Path<String>,
) -> Result<Json<HeartbeatView>, Problem> {
    let until = app
        .store
        .heartbeat(&lease, who.labeler.id, now_ms())
        .await?;
    Ok(Json(HeartbeatView {
        expires_at: rfc3339(until),
    }))
}

/// A lease that goes on.
#[derive(Serialize, ToSchema)]
pub struct HeartbeatView {
    /// RFC 3339.
    expires_at: String,
}

/// An answer.
#[derive(Deserialize, ToSchema)]
#[serde(deny_unknown_fields)]
pub struct AnswerRequest {
    /// `left`, `right`, `equal` or `skip`; `same`, `different` or `skip`. `pressed` in tables of
    /// answers.
    answer: String,
    /// Why; needed for a skip.
    #[serde(default)]
    reason: Option<String>,
    /// The answer of this lease that this one replaces.
    #[serde(default)]
    supersedes: Option<String>,
    /// Of the guidance that was shown.
    #[serde(default)]
    guidance_sha256: Option<String>,
    /// How the labeler came to it.
    #[serde(default)]
    timing: Option<TimingRequest>,
}

/// How a labeler came to an answer.
#[derive(Deserialize, ToSchema)]
#[serde(deny_unknown_fields, default)]
#[derive(Default)]
pub struct TimingRequest {
    /// From the first frame of both clips to the key while the page was visible and no dialog lay
    /// over them, milliseconds.
    visible_ms: Option<f64>,
    /// While it was hidden, milliseconds.
    hidden_ms: Option<f64>,
    /// Loops watched.
    loops: Option<f64>,
    /// Jumps in time.
    seeks: Option<u32>,
    /// Playback speed at the end.
    speed: Option<f64>,
    /// Frames that were not shown in time.
    dropped_frames: Option<u32>,
    /// `key` or `pointer`; null where the page itself passed the pair over.
    input: Option<String>,
}

/// An answer that is kept.
#[derive(Serialize, ToSchema)]
pub struct AnswerView {
    /// Name of the answer; what an undo supersedes.
    answer_id: String,
    /// Gap-free number in the run and kind of question.
    sequence: u64,
    /// RFC 3339.
    stored_at: String,
}

/// Stores an answer, once however often it is sent.
///
/// The reply comes after the commit.
///
/// # Errors
/// 403 another labeler's lease · 404 an unknown lease · 409 another answer exists, or the study
/// takes none (kept aside) · 410 somebody else has the question, or its pair was skipped (kept
/// aside) · 422 not an answer to this question, a skip without a reason, or an answer that cannot be
/// replaced.
#[utoipa::path(put, path = "/api/v1/leases/{id}/answer", tag = "leases", operation_id = "answer",
    params(("id" = String, Path)), request_body = AnswerRequest,
    security(("teacherToken" = []), ("labelerCookie" = [])),
    responses((status = 201, body = AnswerView, description = "The answer is stored."),
        (status = 200, body = AnswerView, description = "The same answer was stored before."),
        (status = 403, description = "Another labeler's lease."),
        (status = 409, description = "Another answer exists, which `existing` tells; or the study takes none, and this one is kept aside."),
        (status = 410, description = "Somebody else has the question, or its pair was skipped; the answer is kept aside."),
        (status = 422, description = "Not an answer to this question, a skip without a reason, or an answer that cannot be replaced.")))]
pub async fn answer(
    State(app): State<AppState>,
    who: Answerer,
    Path(lease): Path<String>,
    Body(request): Body<AnswerRequest>,
) -> Result<Response, Problem> {
    let stored = app
        .store
        .answer(&lease, who.labeler.id, request.into_answer())
        .await?;
    let status = if stored.is_new {
        StatusCode::CREATED
    } else {
        StatusCode::OK
    };
    let view = AnswerView {
        answer_id: stored.id,
        sequence: stored.sequence,
        stored_at: rfc3339(stored.stored_at_ms),
    };
    Ok((status, Json(view)).into_response())
}

impl AnswerRequest {
    fn into_answer(self) -> NewAnswer {
        let timing = self.timing.unwrap_or_default();
        let whole = |ms: Option<f64>| {
            ms.filter(|ms| ms.is_finite())
                .map(|ms| ms.clamp(0.0, f64::from(u32::MAX)) as u32)
        };
        NewAnswer {
            pressed: self.answer,
            reason: self.reason,
            supersedes: self.supersedes,
            guidance_sha256: self.guidance_sha256,
            timing: Timing {
                visible_ms: whole(timing.visible_ms),
                hidden_ms: whole(timing.hidden_ms),
                loops: timing.loops,
                seeks: timing.seeks,
                speed: timing.speed,
                dropped_frames: timing.dropped_frames,
                input: timing.input,
            },
        }
    }
}

fn lease_view(lease: Lease) -> LeaseView {
    LeaseView {
        lease_id: lease.id,
        query_id: lease.query.0,
        question: lease.question,
        left: clip_view(lease.left),
        right: clip_view(lease.right),
        expires_at: rfc3339(lease.expires_at_ms),
        practice: lease.practice.map(|practice| PracticeView {
            expects: practice.expects,
            because: practice.because,
        }),
    }
}

fn clip_view(clip: Option<LeaseClip>) -> ClipView {
    match clip {
        Some(clip) => ClipView {
            clip: Some(clips::address(&clip.sha256)),
            n_frames: clip.n_frames,
            fps: clip.fps,
        },
        None => ClipView {
            clip: None,
            n_frames: 0,
            fps: 0,
        },
    }
}

/// Different words for different reasons to wait.
fn queue_view(
    app: &AppState,
    run: &RunRow,
    has_leases: bool,
    queue: Queue,
    progress: Progress,
) -> QueueView {
    let phase = app.live.phase(run.id).map(|phase| phase_view(&phase));
    let is_asking = phase
        .as_ref()
        .is_some_and(|phase| phase.activity == Activity::Asking);
    let view = |kind, message: &str, until| QueueView {
        kind,
        message: message.to_owned(),
        until,
        phase,
    };
    let line = app
        .live
        .state(run.id)
        .map_or_else(|| run.state.message.clone(), |line| line.message);
    match run.state.kind.as_str() {
        "failed" => view("failed", &line, None),
        "paused" => view(
            "paused",
            "The researcher lets this run stand still; your answers are kept.",
            None,
        ),
        "stopped" => view(
            "paused",
            "The researcher has stopped this run; it can be resumed, and your answers are kept.",
            None,
        ),
        _ if has_leases => view("open", "Questions are waiting for you.", None),
        "finished" => view(
            "done",
            "The agent is trained; the run's page shows what it can do.",
            None,
        ),
        _ if queue.n_drawing > 0 => match app.live.clip_trouble() {
            Some(trouble) => view(
                "drawing",
                &format!("There are no clips to show: {trouble}"),
                None,
            ),
            None => view("drawing", "The next clips are being drawn.", None),
        },
        _ if queue.n_held > 0 => {
            let message = "Other labelers hold the questions that are left.";
            view("held", message, queue.held_until_ms.map(rfc3339))
        }
        _ if progress.answered >= progress.budget => view(
            "done",
            "All questions are answered. The agent trains on for a while; see the run's page.",
            None,
        ),
        _ if !run.is_trained => view("done", "All questions are answered.", None),
        // Everything is answered and the run has not noticed yet.
        _ if is_asking => view("waiting", "Your answers are being taken in.", None),
        _ => view("waiting", &line, None),
    }
}

fn phase_view(phase: &Phase) -> PhaseView {
    PhaseView {
        activity: phase.activity,
        step: phase.step,
        total_steps: phase.total_steps,
        until_step: phase.until_step,
        progress: progress_of(phase),
    }
}

/// How much of the way from the activity's first step, or first answer, to its last, 0 to 1.
fn progress_of(phase: &Phase) -> Option<f64> {
    match (phase.until_step, phase.session_answers) {
        (Some(until), _) if until > phase.from_step => {
            let (done, all) = (
                phase.step.saturating_sub(phase.from_step),
                until - phase.from_step,
            );
            Some((done as f64 / all as f64).min(1.0))
        }
        (_, Some((got, needed))) if needed > 0 => Some(f64::from(got) / f64::from(needed)),
        _ => None,
    }
}

fn progress_view(progress: Progress) -> ProgressView {
    ProgressView {
        answered: progress.answered,
        budget: progress.budget,
        session: progress.session,
        session_answered: progress.session_answered,
        session_size: progress.session_size,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_bar_of_a_wait_runs_from_its_first_step_to_its_last() {
        let progress = |step| {
            progress_of(&Phase {
                activity: Activity::Learning,
                step,
                total_steps: 40_000,
                from_step: 12_000,
                until_step: Some(14_000),
                session_answers: None,
            })
        };
        assert_eq!(
            [12_000, 13_000, 14_000, 14_008].map(progress),
            [Some(0.0), Some(0.5), Some(1.0), Some(1.0)]
        );
    }
}
