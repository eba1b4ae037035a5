//! The squashed Gaussian: a = tanh(x), x ~ N(μ, σ²).

use std::f64::consts::{LN_2, PI};

use tch::Tensor;

/// Range of log σ in the released code.
const LOG_STD: (f64, f64) = (-5.0, 2.0);

/// The policy at a batch of states, `[B × A]` each.
pub(super) struct Gaussian {
    mean: Tensor,
    log_std: Tensor,
    std: Tensor,
    /// tanh of the raw output behind log σ.
    squashed: Tensor,
}

/// An action of each row and how likely it was.
pub(super) struct Sample {
    /// `[B × A]`.
    pub(super) action: Tensor,
    /// log π, nats, `[B × 1]`.
    pub(super) log_probability: Tensor,
}

impl Gaussian {
    /// From the actor's output `[1 × B × 2A]`: μ, then the raw number behind
    /// log σ = lo + (hi − lo)/2 · (tanh(raw) + 1).
    pub(super) fn new(output: &Tensor, action_size: i64) -> Self {
        let output = output.squeeze_dim(0);
        let squashed = output.narrow(1, action_size, action_size).tanh();
        let log_std = (&squashed + 1.0) * half_range() + LOG_STD.0;
        Self {
            mean: output.narrow(1, 0, action_size),
            std: log_std.exp(),
            log_std,
            squashed,
        }
    }

    /// tanh(μ).
    pub(super) fn mean_action(&self) -> Tensor {
        self.mean.tanh()
    }

    /// tanh(μ + σ·noise) with log π = Σ [log N(x) − 2 (ln 2 − x − softplus(−2x))].
    pub(super) fn sample(&self, noise: &Tensor) -> Sample {
        let x = &self.mean + &self.std * noise;
        let log_normal = noise.square() * -0.5 - &self.log_std - 0.5 * (2.0 * PI).ln();
        let log_slope = ((&x * -2.0).softplus() + &x - LN_2) * -2.0;
        let log_probability =
            (log_normal - log_slope).sum_dim_intlist([1_i64].as_slice(), true, None);
        Sample {
            action: x.tanh(),
            log_probability,
        }
    }

    /// Gradient of the output, `[1 × B × 2A]`, of mean(α log π) + the part that reaches the
    /// action with `action_gradient`; `weight` = α/B.
    ///
    /// With a = tanh(x): ∂log π/∂x = 2a, and ∂log π/∂log σ = −1 beside what goes through x.
    pub(super) fn backward(
        &self,
        sample: &Sample,
        noise: &Tensor,
        action_gradient: &Tensor,
        weight: f64,
    ) -> Tensor {
        let a = &sample.action;
        let x = action_gradient * (1.0 - a.square()) + a * (2.0 * weight);
        let log_std = &x * &self.std * noise - weight;
        let raw = log_std * (1.0 - self.squashed.square()) * half_range();
        Tensor::cat(&[x, raw], 1).unsqueeze(0)
    }
}

fn half_range() -> f64 {
    0.5 * (LOG_STD.1 - LOG_STD.0)
}
