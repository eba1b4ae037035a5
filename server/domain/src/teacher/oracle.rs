//! The teacher that knows the task reward and never errs.

use super::Judge;
use crate::answer::{Preference, Which};
use crate::episode::SegmentRecord;
use crate::query::OfferedQuery;

/// Prefers the segment with the larger sum of task rewards; a tie goes to the first, as in
/// B-Pref's released code (β ≤ 0).
#[derive(Debug, Clone, Copy)]
pub struct Oracle;

impl Judge for Oracle {
    fn judge(&self, query: &OfferedQuery) -> Option<Preference> {
        let sum = |s: &SegmentRecord| s.task_rewards.iter().map(|r| r.0).sum::<f64>();
        let is_second = sum(&query.first) < sum(&query.second);
        Some(Preference::Prefer(if is_second {
            Which::Second
        } else {
            Which::First
        }))
    }
}
