//! The teacher that sometimes says the opposite of what is true.

use super::{Judge, Oracle, rng};
use crate::answer::Preference;
use crate::query::OfferedQuery;

/// The oracle's answer, flipped with a fixed probability.
///
/// Source: B-Pref's `mistake` teacher; the paper's "Error" teacher at 0.1.
#[derive(Debug, Clone, Copy)]
pub struct Mistaken {
    /// Chance of a flip, [0, 1]; ½ makes answers worthless.
    pub probability: f64,
    /// Of the run.
    pub seed: u64,
}

impl Judge for Mistaken {
    fn judge(&self, query: &OfferedQuery) -> Option<Preference> {
        let is_flipped = rng(self.seed, query.key).chance(self.probability);
        let preference = Oracle.judge(query)?;
        Some(if is_flipped {
            preference.flipped()
        } else {
            preference
        })
    }
}
