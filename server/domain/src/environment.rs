//! What a task is to everybody outside the physics: observations in, actions out.

use serde::{Deserialize, Serialize};

/// Sizes and names that do not change while a task runs.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct EnvSpec {
    /// The task's name as users type it: `window-open`.
    pub task: String,
    /// Numbers in an observation, `S`.
    pub observation_size: usize,
    /// Numbers in an action, `A`; each in [−1, 1].
    pub action_size: usize,
    /// Numbers in a recorded pose.
    pub pose_size: usize,
    /// Control steps in an episode, `T`.
    pub episode_len: u32,
    /// Steps in a segment unless a run says otherwise, `H`.
    pub segment_len: u32,
    /// Seconds of simulated time in one control step.
    pub control_period_s: f64,
    /// Whether an episode can succeed; else it only goes better or worse, as running does.
    pub has_success: bool,
    /// Names of the true stages in order, empty where the task does not know them.
    pub stages: Vec<String>,
}

/// Ground truth from the environment: for evaluators, scripted teachers and the upper bound (SAC),
/// for no other learner.
#[derive(Debug, Clone, Copy, PartialEq, PartialOrd, Default, Serialize, Deserialize)]
#[serde(transparent)]
pub struct TaskReward(pub f64);

/// Why an episode is over.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum EpisodeEnd {
    /// The state itself is final: nothing follows it, values do not bootstrap.
    Terminal,
    /// The clock ran out: values bootstrap from the next state.
    TimeLimit,
}

/// What one control step brought.
#[derive(Debug, Clone, PartialEq)]
pub struct Step {
    /// The state after the step, `[S]`.
    pub observation: Vec<f32>,
    /// Ground truth for this step.
    pub task_reward: TaskReward,
    /// Whether the task counts as solved at this step.
    pub success: bool,
    /// Set on an episode's last step.
    pub end: Option<EpisodeEnd>,
    /// Index into [`EnvSpec::stages`] of the state after the step, where the task knows it.
    /// For evaluation, and for the method `true_stage`.
    pub stage: Option<u8>,
}

/// A simulation of one task.
///
/// Deterministic: the same seed and actions give the same numbers, bit for bit, on one machine.
pub trait Environment: Send {
    /// Sizes and names.
    fn spec(&self) -> &EnvSpec;

    /// Starts an episode whose random pose follows from `seed` alone; returns its first
    /// observation, `[S]`.
    fn reset(&mut self, seed: u64) -> Vec<f32>;

    /// Advances one control step. Components outside [−1, 1] are clamped.
    ///
    /// # Errors
    /// An action of the wrong length or not finite leaves the state unchanged. A simulation
    /// that leaves the finite numbers ends the episode: every later step says the same, until a
    /// reset or until a state from before is put back.
    fn step(&mut self, action: &[f32]) -> Result<Step, EnvError>;

    /// What it takes to draw the present state later without physics, `[pose_size]`.
    fn pose(&self) -> Vec<f32>;

    /// True stage of the present state, for evaluation and for the method `true_stage`.
    fn stage(&self) -> Option<u8> {
        None
    }

    /// The whole state as bytes; bound to this version of the program.
    fn snapshot(&self) -> Vec<u8>;

    /// Puts a state back that [`Environment::snapshot`] gave.
    ///
    /// # Errors
    /// Bytes of another task or version leave the state unchanged.
    fn restore(&mut self, snapshot: &[u8]) -> Result<(), EnvError>;
}

/// What an environment refuses.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum EnvError {
    /// The caller sent an action that does not fit.
    #[error("{task} takes actions of {expected} numbers, got {got}")]
    ActionSize {
        /// The task.
        task: String,
        /// What it takes.
        expected: usize,
        /// What came.
        got: usize,
    },
    /// The caller sent a number that is none.
    #[error("component {index} of the action for {task} is {value}, not a finite number")]
    ActionNotFinite {
        /// The task.
        task: String,
        /// Which component.
        index: usize,
        /// Its value.
        value: f32,
    },
    /// The physics left the finite numbers.
    #[error("{task} left the finite numbers at step {step} of the episode with seed {seed}")]
    NotFinite {
        /// The task.
        task: String,
        /// Seed of the episode.
        seed: u64,
        /// Control step, from 1.
        step: u32,
    },
    /// Bytes that are no snapshot of this task and version.
    #[error("this is no snapshot of {task} from this version of the program: {reason}")]
    Snapshot {
        /// The task.
        task: String,
        /// What did not fit.
        reason: String,
    },
}

/// Refuses actions of the wrong length or with numbers that are none; clamps the rest to [−1, 1].
///
/// # Errors
/// [`EnvError::ActionSize`] and [`EnvError::ActionNotFinite`].
pub fn checked_action<const A: usize>(task: &str, action: &[f32]) -> Result<[f64; A], EnvError> {
    if action.len() != A {
        return Err(EnvError::ActionSize {
            task: task.into(),
            expected: A,
            got: action.len(),
        });
    }
    if let Some((index, &value)) = action.iter().enumerate().find(|(_, a)| !a.is_finite()) {
        return Err(EnvError::ActionNotFinite {
            task: task.into(),
            index,
            value,
        });
    }
    Ok(std::array::from_fn(|i| {
        f64::from(action[i]).clamp(-1.0, 1.0)
    }))
}
