//! Trying a policy on held-out episodes.

use domain::environment::{EnvError, Environment};
use domain::random::{Rng, Stream};
use learn::device::with_denormals;

use crate::stepping::step_all;

/// What `evaluate` saw.
#[derive(Debug, Clone, PartialEq)]
pub struct Trial {
    /// Task return of each episode.
    pub returns: Vec<f64>,
    /// Step of the first success of each episode, from 1; `None` without success.
    pub first_success: Vec<Option<u32>>,
    /// Poses of the first episode, after each step.
    pub poses: Vec<Vec<f32>>,
    /// What was seen and done in the first [`N_KEPT`] episodes: states, actions, task rewards.
    pub kept: Kept,
}

/// Steps kept to compare learned and task reward.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Kept {
    /// States before each step, `[B × S]`.
    pub observations: Vec<f32>,
    /// Actions, `[B × A]`.
    pub actions: Vec<f32>,
    /// Task rewards, `[B]`.
    pub task_rewards: Vec<f64>,
}

/// Episodes whose steps are kept.
pub const N_KEPT: usize = 10;

/// A policy over several states at once: states `[B × S]` and the step of the episode, from 0,
/// to actions `[B × A]`.
pub type Policy<'a> = dyn FnMut(&[f32], u32) -> Vec<f32> + 'a;

impl Trial {
    /// Share of episodes with success at any step.
    pub fn success_rate(&self) -> f64 {
        self.first_success.iter().filter(|s| s.is_some()).count() as f64
            / self.first_success.len() as f64
    }

    /// Mean task return.
    pub fn return_mean(&self) -> f64 {
        self.returns.iter().sum::<f64>() / self.returns.len() as f64
    }

    /// Standard deviation of the task return (n in the denominator).
    pub fn return_std(&self) -> f64 {
        let mean = self.return_mean();
        let square = self.returns.iter().map(|r| (r - mean).powi(2)).sum::<f64>();
        (square / self.returns.len() as f64).sqrt()
    }

    /// Median step of the first success over the episodes that succeed.
    pub fn first_success_median(&self) -> Option<f64> {
        let mut steps: Vec<u32> = self.first_success.iter().flatten().copied().collect();
        steps.sort_unstable();
        let middle = steps.len() / 2;
        match steps.len() {
            0 => None,
            n if n % 2 == 1 => Some(f64::from(steps[middle])),
            _ => Some(f64::midpoint(
                f64::from(steps[middle - 1]),
                f64::from(steps[middle]),
            )),
        }
    }
}

/// Seed of held-out episode `index`; training episodes draw from another stream.
pub fn held_out_seed(seed: u64, index: u32) -> u64 {
    Rng::new(seed, Stream::EvaluationSeed, u64::from(index)).next_u64()
}

/// Runs `n_episodes` side by side, each to its end, on as many threads as there are cores: their
/// number changes no result.
///
/// # Errors
/// Whatever an environment refuses.
pub fn evaluate(
    task: &sim::tasks::Task,
    n_episodes: u32,
    seed: u64,
    policy: &mut Policy<'_>,
) -> Result<Trial, EnvError> {
    let spec = (task.spec)();
    let n = n_episodes as usize;
    let mut envs: Vec<Box<dyn Environment>> = (0..n).map(|_| (task.make)()).collect();
    let mut observations: Vec<f32> = Vec::with_capacity(n * spec.observation_size);
    for (index, env) in envs.iter_mut().enumerate() {
        let seed = held_out_seed(seed, index as u32);
        observations.extend(with_denormals(|| env.reset(seed)));
    }
    let mut trial = Trial {
        returns: vec![0.0; n],
        first_success: vec![None; n],
        poses: Vec::new(),
        kept: Kept::default(),
    };
    let mut is_running = vec![true; n];
    for t in 0..spec.episode_len {
        let actions = policy(&observations, t);
        let act = |index: usize| &actions[index * spec.action_size..][..spec.action_size];
        let running: Vec<usize> = (0..n).filter(|index| is_running[*index]).collect();
        let turns = envs
            .iter_mut()
            .enumerate()
            .filter(|(index, _)| is_running[*index]);
        let turns = turns.map(|(index, env)| (&mut **env as &mut dyn Environment, act(index)));
        let steps = step_all(turns.collect())?;
        for (index, step) in running.into_iter().zip(&steps) {
            let state = &mut observations[index * spec.observation_size..][..spec.observation_size];
            if index < N_KEPT {
                trial.kept.observations.extend_from_slice(state);
                trial.kept.actions.extend_from_slice(act(index));
                trial.kept.task_rewards.push(step.task_reward.0);
            }
            if index == 0 {
                trial.poses.push(envs[0].pose());
            }
            trial.returns[index] += step.task_reward.0;
            if step.success && trial.first_success[index].is_none() {
                trial.first_success[index] = Some(t + 1);
            }
            state.copy_from_slice(&step.observation);
            is_running[index] = step.end.is_none();
        }
    }
    Ok(trial)
}

/// Pearson's correlation, `None` where one side does not vary.
pub fn correlation(x: &[f64], y: &[f64]) -> Option<f64> {
    let n = x.len() as f64;
    let (mean_x, mean_y) = (x.iter().sum::<f64>() / n, y.iter().sum::<f64>() / n);
    let (mut xy, mut xx, mut yy) = (0.0, 0.0, 0.0);
    for (x, y) in x.iter().zip(y) {
        xy += (x - mean_x) * (y - mean_y);
        xx += (x - mean_x).powi(2);
        yy += (y - mean_y).powi(2);
    }
    let scale = (xx * yy).sqrt();
    (scale > 0.0).then(|| xy / scale)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn correlation_knows_its_limits() {
        let x = [1.0, 2.0, 3.0, 4.0];
        assert!((correlation(&x, &[2.0, 4.0, 6.0, 8.0]).unwrap() - 1.0).abs() < 1e-12);
        assert!((correlation(&x, &[4.0, 3.0, 2.0, 1.0]).unwrap() + 1.0).abs() < 1e-12);
        assert_eq!(correlation(&x, &[5.0; 4]), None);
    }

    #[test]
    fn the_median_of_an_even_number_lies_between() {
        let trial = Trial {
            returns: vec![0.0; 3],
            first_success: vec![Some(10), None, Some(20)],
            poses: vec![],
            kept: Kept::default(),
        };
        assert_eq!(trial.first_success_median(), Some(15.0));
    }
}
