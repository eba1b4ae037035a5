//! Settings of the ensemble.

use serde::{Deserialize, Serialize};

use super::{CHUNK_ROWS, SLOPE};
use crate::net::NetShape;
use crate::precision::Precision;

/// Settings of the ensemble. Defaults: the released settings for MetaWorld.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct RewardConfig {
    /// Members, `M`.
    pub members: usize,
    /// Hidden layers of each.
    pub hidden: Vec<i64>,
    /// Adam's rate.
    ///
    /// Differs from the paper: its table says 1e-4, the released code uses 3e-4.
    pub learning_rate: f64,
    /// Share of the rate that is left at the end of a fit that takes all its passes, falling
    /// evenly from its start, in (0, 1]; 1 keeps it constant, as the released code does.
    pub final_rate: f64,
    /// Pairs in a minibatch.
    pub batch: usize,
    /// Passes over all preferences after a session, at most.
    pub max_epochs: u32,
    /// Fitting stops after a pass in which this share of the preferences was right, mean over
    /// members.
    pub stop_accuracy: f32,
    /// How far a preference is trained from certainty, in [0, ½): towards P = 1 − margin instead
    /// of 1. Without it, few answers that are passed over often saturate the tanh, and later
    /// answers can no longer move the reward there. B-Pref's `label_margin`.
    pub label_margin: f64,
    /// Divides the difference of two segments' sums in P = σ(Δ / temperature), above 0.
    ///
    /// At 1 a preference between segments of 50 steps is certain once they differ by a tenth a
    /// step, and nothing drives learned rewards further apart. Higher ones do spread them, but
    /// let them drift together to one end of (−1, 1): with 10 window-open was not learned.
    ///
    /// Differs from the paper: its Eq. 1 has none, which is 1.
    pub temperature: f64,
    /// Standard deviation that learned rewards have over the whole replay, their mean being 0;
    /// relabelling sees to it. 0 leaves them as the members say, as the released code does.
    ///
    /// Preferences say nothing about how high all rewards lie and little about how far apart:
    /// each fit moves both, and with them every value that the critics know.
    /// Source: Christiano et al. (2017), 2.2.3, who normalise the rewards of their ensemble.
    pub normalized_std: f64,
    /// `f32`, or `bf16` for faster and coarser fitting and relabelling.
    pub precision: Precision,
}

impl Default for RewardConfig {
    fn default() -> Self {
        Self {
            members: 3,
            hidden: vec![256; 3],
            learning_rate: 3e-4,
            final_rate: 1.0,
            batch: 128,
            max_epochs: 10,
            stop_accuracy: 0.97,
            label_margin: 0.0,
            temperature: 1.0,
            normalized_std: 0.0,
            precision: Precision::F32,
        }
    }
}

impl RewardConfig {
    /// Share of the rate in each of a fit's `n` passes or minibatches.
    pub(super) fn rates(&self, n: usize) -> impl Iterator<Item = f64> + use<> {
        let (left, last) = (self.final_rate, n.saturating_sub(1).max(1) as f64);
        (0..n).map(move |index| 1.0 + index as f64 / last * (left - 1.0))
    }

    /// All members, for states and actions of so many numbers.
    pub(super) fn shape(&self, sizes: (usize, usize)) -> NetShape {
        let columns = (sizes.0 + sizes.1) as i64;
        NetShape {
            slope: SLOPE,
            precision: self.precision,
            ..NetShape::new(self.members as i64, columns, &self.hidden, 1)
        }
    }

    /// Bytes that an ensemble and its fitting hold, whatever the number of preferences.
    pub fn bytes(&self, observation_size: usize, action_size: usize) -> u64 {
        let shape = self.shape((observation_size, action_size));
        shape.trained_bytes() + shape.pass_bytes(CHUNK_ROWS)
    }
}
