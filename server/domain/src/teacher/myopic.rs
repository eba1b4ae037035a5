//! The teacher who has half forgotten how a segment began.

use super::{Judge, prefer_larger};
use crate::answer::Preference;
use crate::episode::SegmentRecord;
use crate::query::OfferedQuery;

/// Prefers the larger sum of task rewards in which step `t` of `H` counts `γ^(H − 1 − t)`.
///
/// Source: B-Pref's `myopic` teacher.
#[derive(Debug, Clone, Copy)]
pub struct Myopic {
    /// γ, (0, 1]; 1 is the oracle.
    pub discount: f64,
}

impl Judge for Myopic {
    fn judge(&self, query: &OfferedQuery) -> Option<Preference> {
        let late_sum = |segment: &SegmentRecord| {
            let rewards = segment.task_rewards.iter();
            rewards.fold(0.0, |sum, reward| self.discount * sum + reward.0)
        };
        Some(prefer_larger(
            late_sum(&query.first),
            late_sum(&query.second),
        ))
    }
}
