//! The teacher who does not compare one failure with another.

use super::{Judge, Oracle, Threshold, task_return};
use crate::answer::Preference;
use crate::query::OfferedQuery;

/// Skips a query unless one of its segments has a sum of task rewards above a threshold;
/// otherwise the oracle.
///
/// Source: B-Pref's `skip` teacher. Where it is not known how the agent does, or it earns nothing,
/// nothing is skipped.
#[derive(Debug, Clone, Copy)]
pub struct Skip {
    /// Of the better segment.
    pub threshold: Threshold,
}

impl Judge for Skip {
    fn judge(&self, query: &OfferedQuery) -> Option<Preference> {
        let better = task_return(&query.first).max(task_return(&query.second));
        match self.threshold.of(query) {
            Some(threshold) if threshold > 0.0 && better <= threshold => None,
            _ => Oracle.judge(query),
        }
    }
}
