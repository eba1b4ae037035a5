//! What a change of the rewards does to preferences that the critics state after one step on them.

use domain::random::{Rng, Stream};
use tch::Tensor;

use super::{Rows, Sac};
use crate::net::{Net, matrix};
use crate::replay::Batch;

/// First state and action of both segments of answered queries.
#[derive(Debug, Clone, Default, PartialEq)]
pub(crate) struct FirstSteps {
    /// `[2M × (S + A)]`, first then second segment of each query.
    pub(crate) rows: Vec<f32>,
    /// P(second ≻ first) that was answered, `[M]`.
    pub(crate) targets: Vec<f64>,
}

/// The outer loss and its slope in each reward.
pub(crate) struct Outer {
    /// nats.
    pub(crate) loss: f64,
    /// `[B × 1]`.
    pub(crate) reward_slopes: Tensor,
}

impl Sac {
    /// Takes one plain gradient step of the critics on `reward` `[B × 1]`, lets them state
    /// preferences by their values of the first steps, and asks how those err:
    /// `weight` · Σ over critics of the mean cross-entropy.
    ///
    /// The step is θ′ = θ − λ ∇L(θ, r) with L = Σⱼ mean (Qⱼ − r − …)², so that
    /// dθ′/drᵢ = λ (2/B) Σⱼ ∇Qⱼ(i), and the loss's slope in rᵢ is λ (2/B) Σⱼ of the derivative of
    /// Qⱼ(i) along ∇ of the outer loss at θ′: no second derivative is needed, one tangent is.
    ///
    /// The batch's `not_terminal` decides what bootstraps.
    pub(crate) fn outer(
        &self,
        batch: &Batch,
        reward: &Tensor,
        first_steps: &FirstSteps,
        weight: f64,
    ) -> Outer {
        let rows = Rows {
            reward: reward.shallow_clone(),
            ..self.rows(batch)
        };
        let n = batch.len() as f64;
        let mut rng = Rng::new(self.seed, Stream::Steering, self.n_updates);
        let noise = self.noise(batch.len() as i64, &mut rng);
        let target = self.bellman_target(&rows, &noise, self.temperature.alpha());
        let rate = self.config.critic_learning_rate * self.rate();

        let (q, tape) = self.critic.net.forward_taped(&rows.state_action);
        let inner = self.critic.parameters.values.zeros_like();
        let mut into = Net::over(&self.critic_shape, &inner, 0);
        let slopes = (q - target) * (2.0 / n);
        self.critic
            .net
            .backward(&tape, &slopes, Some(&mut into), None);
        let stepped = &self.critic.parameters.values - inner * rate;
        let stepped = Net::over(&self.critic_shape, &stepped, 0);

        let columns = self.observation_size + self.action_size;
        let states_actions = matrix(&first_steps.rows, columns, self.options);
        let (q, tape) = stepped.forward_taped(&states_actions);
        let (loss, slopes) = preference_loss(&q, &first_steps.targets, weight);
        let outer = self.critic.parameters.values.zeros_like();
        let mut into = Net::over(&self.critic_shape, &outer, 0);
        stepped.backward(&tape, &slopes, Some(&mut into), None);

        let tangent = self.critic.net.tangent(&rows.state_action, &into);
        let summed = tangent.sum_dim_intlist([0_i64].as_slice(), false, None);
        Outer {
            loss,
            reward_slopes: summed * (2.0 * rate / n),
        }
    }
}

/// `weight` · Σ over critics of mean cross-entropy, and its slope in each value `[2 × 2M × 1]`.
fn preference_loss(q: &Tensor, targets: &[f64], weight: f64) -> (f64, Tensor) {
    let size = q.size();
    let pairs = q.view([size[0], -1, 2]);
    let logits = pairs.narrow(2, 1, 1) - pairs.narrow(2, 0, 1);
    let targets = Tensor::from_slice(targets)
        .to_kind(q.kind())
        .to_device(q.device())
        .view([1, -1, 1]);
    let weight = weight / targets.numel().max(1) as f64;
    let losses = logits.softplus() - &logits * &targets;
    let slopes = (logits.sigmoid() - targets) * weight;
    let slopes = Tensor::cat(&[slopes.neg(), slopes], 2).view(size.as_slice());
    (
        losses.sum(None).double_value(&[]) * weight,
        slopes.contiguous(),
    )
}
