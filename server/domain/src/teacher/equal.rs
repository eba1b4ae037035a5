//! The teacher who cannot tell close segments apart.

use super::{Judge, Oracle, Threshold, task_return};
use crate::answer::Preference;
use crate::query::OfferedQuery;

/// Calls segments equal whose sums of task rewards differ by less than a threshold; otherwise
/// the oracle.
///
/// Source: B-Pref's `equal` teacher. Where it is not known how the agent does, nothing is equal.
#[derive(Debug, Clone, Copy)]
pub struct Equal {
    /// Of the difference.
    pub threshold: Threshold,
}

impl Judge for Equal {
    fn judge(&self, query: &OfferedQuery) -> Option<Preference> {
        let difference = (task_return(&query.first) - task_return(&query.second)).abs();
        match self.threshold.of(query) {
            Some(threshold) if difference < threshold => Some(Preference::Equal),
            _ => Oracle.judge(query),
        }
    }
}
