//! Plays a policy for one episode: what experts, tests and the command line have in common.

use domain::environment::{EnvError, Environment};

/// What came of one episode.
#[derive(Debug, Clone, PartialEq)]
pub struct Rollout {
    /// Sum of the task rewards, undiscounted.
    pub task_return: f64,
    /// Whether the task counted as solved at any step.
    pub success: bool,
    /// The first step that counted as solved, from 1.
    pub first_success: Option<u32>,
    /// Poses of the states, the one before the first step included, `[T + 1][pose_size]`.
    pub poses: Vec<Vec<f32>>,
    /// True stage of the state after each step, `[T]`, empty where the task does not know.
    pub stages: Vec<u8>,
    /// Task reward of each step, `[T]`.
    pub task_rewards: Vec<f64>,
}

/// Plays `policy` in the episode of `seed` from its start to its end.
///
/// `policy` sees the observation and nothing else; it may keep a state of its own.
///
/// # Errors
/// What [`Environment::step`] refuses.
pub fn rollout(
    environment: &mut dyn Environment,
    seed: u64,
    policy: &mut dyn FnMut(&[f32]) -> Vec<f32>,
) -> Result<Rollout, EnvError> {
    let mut observation = environment.reset(seed);
    let mut rollout = Rollout {
        task_return: 0.0,
        success: false,
        first_success: None,
        poses: vec![environment.pose()],
        stages: Vec::new(),
        task_rewards: Vec::new(),
    };
    for index in 1.. {
        let step = environment.step(&policy(&observation))?;
        rollout.task_return += step.task_reward.0;
        rollout.task_rewards.push(step.task_reward.0);
        rollout.poses.push(environment.pose());
        rollout.stages.extend(step.stage);
        if step.success {
            rollout.success = true;
            rollout.first_success.get_or_insert(index);
        }
        if step.end.is_some() {
            break;
        }
        observation = step.observation;
    }
    Ok(rollout)
}
