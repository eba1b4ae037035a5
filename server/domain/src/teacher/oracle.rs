//! The teacher that knows the task reward and never errs.

use super::{Judge, prefer_larger, task_return};
use crate::answer::Preference;
use crate::query::OfferedQuery;

/// Prefers the segment with the larger sum of task rewards.
#[derive(Debug, Clone, Copy)]
pub struct Oracle;

impl Judge for Oracle {
    fn judge(&self, query: &OfferedQuery) -> Option<Preference> {
        Some(prefer_larger(
            task_return(&query.first),
            task_return(&query.second),
        ))
    }
}
