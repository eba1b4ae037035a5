//! How much task return is next to nothing, by the agent's own standard.

use crate::query::OfferedQuery;

/// A share of what the agent gathers in a segment these days.
///
/// Source: B-Pref, §3: ε · (H / T) · mean return of the ten newest training episodes, so that
/// thresholds grow with the agent.
#[derive(Debug, Clone, Copy)]
pub struct Threshold {
    /// ε, [0, 1].
    pub share: f64,
    /// The slip of all B-Pref forks: they multiply by ε twice from the second session on.
    pub is_squared: bool,
}

impl Threshold {
    /// In units of task return for this query; `None` where it is not known how the agent does.
    pub(super) fn of(self, query: &OfferedQuery) -> Option<f64> {
        let n_steps = query.first.task_rewards.len() as f64;
        let is_squared = self.is_squared && query.key.session > 0;
        let share = if is_squared {
            self.share * self.share
        } else {
            self.share
        };
        Some(share * n_steps * query.typical_reward?.0)
    }
}
