//! All that passes between a run and whoever started it: commands in, events out.
//!
//! Together with [`domain::teacher::Teacher`] this is everything a run knows about the world.

use serde::{Deserialize, Serialize};

/// What one may tell a run while it is driven.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Command {
    /// Stop taking environment steps until resumed; answers are still collected.
    Pause,
    /// Go on after a pause.
    Resume,
    /// Write a checkpoint and return; the run can be taken up again later.
    Stop,
}

/// What a run says while it is driven, in order.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(tag = "kind", rename_all = "snake_case")]
pub enum Event {
    /// What the run is doing now; sent when it changes and about once a second while it lasts.
    Phase(Phase),
    /// One row about training, every `metrics_every` environment steps.
    Metrics(Metrics),
    /// A session's queries were put to the teacher.
    SessionOffered(SessionOffered),
    /// A session is complete; the reward was fitted and the replay relabelled.
    SessionClosed(SessionClosed),
    /// Answers came when no session was to come any more; the reward was fitted once more and the
    /// replay relabelled.
    Refitted(Refitted),
    /// The policy was tried on held-out episodes.
    Evaluation(Evaluation),
    /// One episode of the present policy to look at: "how it does now".
    Demonstration(Demonstration),
    /// Everything up to here survives the end of the process.
    Checkpointed(Checkpointed),
    /// The last environment step was taken.
    Finished(Finished),
}

/// What a run is doing.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Phase {
    /// The activity.
    pub activity: Activity,
    /// Environment steps taken.
    pub step: u64,
    /// Environment steps in all.
    pub total_steps: u64,
    /// Environment step at which the activity began: that of the session before, or 0.
    pub from_step: u64,
    /// Environment step at which the activity ends, where it is known.
    pub until_step: Option<u64>,
    /// Answers received in the open session and answers it needs, while asking.
    pub session_answers: Option<(u32, u32)>,
}

/// The kinds of activity of a run.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Activity {
    /// Collecting varied experience before the first question.
    Exploring,
    /// Waiting for answers.
    Asking,
    /// Training on the answers so far.
    Learning,
    /// Paused by a command.
    Paused,
}

/// Training as it goes. Means are over the interval since the row before; a value that does
/// not exist yet is `None`.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, Default)]
pub struct Metrics {
    /// Environment steps taken.
    pub step: u64,
    /// Answers trained on or trainable, skips not counted.
    pub labels: u32,
    /// Complete training episodes.
    pub episodes: u32,
    /// Mean task return of the last 10 training episodes.
    pub return_mean: Option<f64>,
    /// Share of successes among the last 10 training episodes.
    pub success_rate: Option<f64>,
    /// Mean loss of both critics.
    pub critic_loss: Option<f64>,
    /// Mean loss of the actor.
    pub actor_loss: Option<f64>,
    /// Mean value that the critics give to the batch.
    pub q_mean: Option<f64>,
    /// Temperature α.
    pub alpha: Option<f64>,
    /// Mean −log π of the policy on the batch, nats.
    pub entropy: Option<f64>,
    /// `InfoNCE` loss of the temporal distance.
    pub temporal_loss: Option<f64>,
    /// Environment steps per second of wall time in the interval, pauses and waiting for answers
    /// left out. `None` in the first row since a start, whose interval is not known.
    pub steps_per_s: Option<f64>,
}

/// A session as it was put to the teacher; pool values show what choosing did.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct SessionOffered {
    /// Round of asking, from 0.
    pub session: u32,
    /// Environment steps taken.
    pub step: u64,
    /// Queries asked.
    pub n_queries: u32,
    /// Mean disagreement of the chosen queries.
    pub disagreement_chosen: Option<f64>,
    /// Mean disagreement of all candidates.
    pub disagreement_pool: Option<f64>,
    /// Mean stage gap of the chosen queries: nats where it is a temporal distance, stages where these
    /// are known, else in [0, 1].
    pub stage_gap_chosen: Option<f64>,
    /// Mean stage gap of all candidates, in the same unit.
    pub stage_gap_pool: Option<f64>,
    /// Share of chosen queries whose four end states, those after a segment's first and last step,
    /// are in one true stage.
    pub same_stage_chosen: Option<f64>,
    /// The same share of all candidates. `None` where the task does not know its stages, and in rows
    /// of before it stood in them.
    #[serde(default)]
    pub same_stage_pool: Option<f64>,
    /// Probability that of two candidates, one within a true stage and one not, the former has the
    /// smaller stage gap, ties half: 1 where the gap tells them apart, ½ where it says nothing. A
    /// learned gap is of the states before a segment's first and last step (Eq. 8), a true stage of
    /// those after them, so a pair with a change of stage just there counts as the stages say.
    /// `None` without stages or gaps, where all candidates are of one kind, and in rows of before it
    /// stood in them.
    #[serde(default)]
    pub stage_gap_auc: Option<f64>,
    /// Mean stage gap of the chosen queries, mean of both directions. The paper's runs from the first
    /// segment to the second. `None` without gaps and in rows of before it stood in them.
    #[serde(default)]
    pub symmetric_gap_chosen: Option<f64>,
    /// The same of all candidates.
    #[serde(default)]
    pub symmetric_gap_pool: Option<f64>,
    /// As [`Self::stage_gap_auc`], with the gap of both directions.
    #[serde(default)]
    pub symmetric_gap_auc: Option<f64>,
}

/// What a session's answers did to the reward.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct SessionClosed {
    /// Round of asking, from 0.
    pub session: u32,
    /// Environment steps taken.
    pub step: u64,
    /// Answers in all, skips not counted.
    pub labels: u32,
    /// Epochs of the fit.
    pub epochs: u32,
    /// Mean cross-entropy of the last epoch.
    pub loss: f64,
    /// Mean share of answers that the members agree with, last epoch.
    pub accuracy: f64,
    /// Share of this session's answers that the task reward gives too, pairs of equal reward and
    /// answers without a preference left out: how often a scripted teacher really erred, and how
    /// near people are to the task reward. `None` where no pair was left.
    #[serde(default)]
    pub oracle_agreement: Option<f64>,
}

/// What answers did to the reward that came after the last session was over.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Refitted {
    /// Environment steps taken.
    pub step: u64,
    /// Answers in all, skips not counted.
    pub labels: u32,
    /// Those that the fit before had not seen.
    pub n_late: u32,
    /// Number of the fit in its run, from 1, those after sessions among them.
    pub fit: u32,
    /// Epochs of the fit.
    pub epochs: u32,
    /// Mean cross-entropy of the last epoch.
    pub loss: f64,
    /// Mean share of answers that the members agree with, last epoch.
    pub accuracy: f64,
}

/// The policy on held-out episodes, mean action.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Evaluation {
    /// Environment steps taken.
    pub step: u64,
    /// Answers in all, skips not counted.
    pub labels: u32,
    /// Episodes tried.
    pub episodes: u32,
    /// Share of episodes with success at any step.
    pub success_rate: f64,
    /// Mean task return.
    pub return_mean: f64,
    /// Standard deviation of the task return.
    pub return_std: f64,
    /// Pearson correlation of learned and task reward over all steps of these episodes.
    pub reward_correlation: Option<f64>,
    /// Task return of each episode; the same episodes in the same order at every evaluation. Empty
    /// in rows of older programs.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub returns: Vec<f64>,
}

/// An episode to draw.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Demonstration {
    /// The session that is about to be asked; `None` at the end of the run.
    pub session: Option<u32>,
    /// Environment steps taken.
    pub step: u64,
    /// Whether the episode succeeded.
    pub success: bool,
    /// Its task return.
    pub task_return: f64,
    /// Poses after each step, `[T][pose_size]`.
    pub poses: Vec<Vec<f32>>,
}

/// A point to which the run can return.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
pub struct Checkpointed {
    /// Environment steps taken.
    pub step: u64,
    /// Answers up to this sequence number are part of the checkpoint.
    pub consumed_sequence: u64,
}

/// How it ended.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Finished {
    /// Environment steps taken.
    pub step: u64,
    /// Answers in all, skips not counted.
    pub labels: u32,
    /// Success rate of the last evaluation.
    pub success_rate: f64,
    /// Mean return of the last evaluation.
    pub return_mean: f64,
    /// SHA-256-free fingerprint of the final weights: equal for bit-identical runs.
    pub weights: String,
}
