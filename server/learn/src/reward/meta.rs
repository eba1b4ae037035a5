//! MRN: the rewards are moved so that critics which learn from them agree with the answers.

use serde::{Deserialize, Serialize};
use tch::Tensor;

use super::{Labeled, RewardEnsemble};
use crate::replay::{Batch, Replay};
use crate::sac::{FirstSteps, Sac};

/// Settings of MRN. Defaults: its released settings for MetaWorld.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct SteeringConfig {
    /// Environment steps between two outer steps, N. 10,000 for door-open, which we take for all
    /// MetaWorld tasks without a value of their own; the paper lists 5,000 for hammer,
    /// button-press and cheetah, 3,000 for quadruped, 1,000 for walker. An outer step takes the
    /// place of one of SAC's; where none is due at that control step (fewer than one update for all
    /// environments, `training.updates_per_step`), it is one more.
    pub every: u64,
    /// What the critics' disagreement with the answers counts.
    pub weight: f64,
}

impl Default for SteeringConfig {
    fn default() -> Self {
        Self {
            every: 10_000,
            weight: 0.1,
        }
    }
}

impl RewardEnsemble {
    /// One outer step on the answers in `latest`: Adam along the gradient that comes back
    /// through one step of the critics on this batch. Returns the outer loss before it.
    ///
    /// Source: MRN, Algorithm 1, as in its released code: plain SGD inside, Adam outside, the
    /// critics' values of each segment's first state and action as preferences.
    ///
    /// # Panics
    /// When a segment is not in the replay.
    pub fn steer(
        &mut self,
        agent: &Sac,
        replay: &Replay,
        batch: &Batch,
        latest: &[Labeled],
        weight: f64,
    ) -> f64 {
        let loss = self.steering_gradient(agent, batch, &first_steps(replay, latest), weight);
        self.parameters.step();
        loss
    }

    /// Fills the gradient; returns the outer loss.
    fn steering_gradient(
        &mut self,
        agent: &Sac,
        batch: &Batch,
        first_steps: &FirstSteps,
        weight: f64,
    ) -> f64 {
        let rows = super::joined(&batch.observation, &batch.action, batch.len());
        let (output, tape) = self.net.forward_taped(&self.input(&rows));
        let rewards = output.tanh();
        let scale = self.scale;
        let reward = (mean_over_members(&rewards) - scale.offset) * scale.factor;
        let outer = agent.outer(batch, &reward, first_steps, weight);
        let share = outer.reward_slopes * (scale.factor / self.config.members as f64);
        let slopes = (1.0 - rewards.square()) * share;
        self.parameters.zero_gradient();
        self.net
            .backward(&tape, &slopes, Some(&mut self.gradient), None);
        outer.loss
    }
}

/// `[M × B × 1]` to `[B × 1]`.
fn mean_over_members(rewards: &Tensor) -> Tensor {
    rewards.mean_dim([0_i64].as_slice(), false, None)
}

fn first_steps(replay: &Replay, labeled: &[Labeled]) -> FirstSteps {
    let mut first_steps = FirstSteps::default();
    for labeled in labeled {
        for segment in [labeled.query.first, labeled.query.second] {
            let first = domain::episode::Segment { len: 1, ..segment };
            replay.append_segment_rows(first, &mut first_steps.rows);
        }
        let target = f64::from(labeled.preference.target());
        first_steps.targets.push(target);
    }
    first_steps
}

#[cfg(test)]
mod tests {
    use domain::random::{Rng, Stream};
    use tch::Kind;

    use super::super::Scale;
    use super::super::tests::{labeled, replay, small};
    use super::*;
    use crate::device::Device;
    use crate::precision::Precision;
    use crate::replay::BatchRule;
    use crate::sac::SacConfig;

    fn agent(layer_norm: bool) -> SacConfig {
        SacConfig {
            hidden: vec![16, 12],
            critic_learning_rate: 0.05, // far enough for the second order to matter
            layer_norm,
            ..SacConfig::default()
        }
    }

    fn batch(replay: &Replay, n: usize) -> Batch {
        let mut rng = Rng::new(3, Stream::Test, 0);
        replay.draw(n, &mut rng, &BatchRule::default())
    }

    /// Central differences of the whole inner step and outer loss in each of the ensemble's
    /// weights, in f64; with rewards as the members say and with normalised ones.
    #[test]
    fn the_bilevel_gradient_agrees_with_finite_differences() {
        let replay = replay(6);
        let labeled = labeled(&replay, 14, |_| 5); // every seventh is equal
        let first_steps = first_steps(&replay, &labeled);
        let batch = batch(&replay, 20);
        let double = (Kind::Double, tch::Device::Cpu);
        let normalized = Scale {
            offset: 0.3,
            factor: 2.5,
        };
        for (layer_norm, scale) in [
            (false, Scale::NONE),
            (true, Scale::NONE),
            (false, normalized),
        ] {
            let agent = Sac::with_kind(&agent(layer_norm), (3, 2), 4, double);
            let mut ensemble = RewardEnsemble::with_kind(&small(), (3, 2), 1, double);
            ensemble.scale = scale;
            ensemble.steering_gradient(&agent, &batch, &first_steps, 0.1);
            let gradient = Vec::<f64>::try_from(&ensemble.parameters.gradient).expect("numbers");
            let largest = gradient.iter().fold(0.0_f64, |m, g| m.max(g.abs()));
            assert!(largest > 1e-7, "something is to be compared: {largest}");
            let mut loss_at = |index: i64, value: f64| {
                let mut weight = ensemble.parameters.values.get(index);
                let _ = weight.fill_(value);
                ensemble.steering_gradient(&agent, &batch, &first_steps, 0.1)
            };
            let base = RewardEnsemble::with_kind(&small(), (3, 2), 1, double);
            let epsilon = 1e-5;
            for index in (0..gradient.len() as i64).step_by(11) {
                let value = base.parameters.values.double_value(&[index]);
                let up = loss_at(index, value + epsilon);
                let down = loss_at(index, value - epsilon);
                loss_at(index, value);
                let difference = (up - down) / (2.0 * epsilon);
                let error = (difference - gradient[index as usize]).abs();
                assert!(
                    error < 1e-4 * largest,
                    "weight {index}: {difference} by differences, {} written out",
                    gradient[index as usize]
                );
            }
        }
    }

    #[test]
    fn steering_brings_the_critics_closer_to_the_answers_whatever_products_are_made_of() {
        let replay = replay(6);
        let labeled = labeled(&replay, 14, |_| 5);
        for precision in [Precision::F32, Precision::Bf16] {
            let agent = SacConfig {
                precision,
                ..agent(false)
            };
            let (agent, mut ensemble) = (
                Sac::new(&agent, 3, 2, 4, Device::CPU),
                RewardEnsemble::new(&small(), 3, 2, 1, Device::CPU),
            );
            let batch = batch(&replay, 60);
            let losses: Vec<f64> = (0..60)
                .map(|_| ensemble.steer(&agent, &replay, &batch, &labeled, 0.1))
                .collect();
            assert!(losses[59] < losses[0], "{} {}", losses[0], losses[59]);
        }
    }
}
