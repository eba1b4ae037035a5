//! The teacher who is the less sure, the closer two segments are.

use super::{Judge, rng, task_return};
use crate::answer::{Preference, Which};
use crate::query::OfferedQuery;

/// Prefers the second segment with probability σ(β · (Σ r(second) − Σ r(first))): Boltzmann.
///
/// Source: B-Pref's `noisy` teacher, β = 1.
#[derive(Debug, Clone, Copy)]
pub struct Noisy {
    /// β, above 0: how much a difference in task return counts.
    pub rationality: f64,
    /// Of the run.
    pub seed: u64,
}

impl Judge for Noisy {
    fn judge(&self, query: &OfferedQuery) -> Option<Preference> {
        let difference = task_return(&query.second) - task_return(&query.first);
        let probability = 1.0 / (1.0 + (-self.rationality * difference).exp());
        let is_second = rng(self.seed, query.key).chance(probability);
        Some(Preference::Prefer(if is_second {
            Which::Second
        } else {
            Which::First
        }))
    }
}
