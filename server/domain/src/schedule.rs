//! When to ask, how much, and until when.

use serde::{Deserialize, Serialize};

/// When sessions happen and what they may spend.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct FeedbackSchedule {
    /// Environment step of the first session, which is also the end of unsupervised
    /// pre-training.
    pub first_step: u64,
    /// Environment steps between sessions, the paper's K.
    pub every: u64,
    /// Queries a session, the paper's M.
    pub queries_per_session: u32,
    /// Answers in all, the paper's N_total.
    pub budget: u32,
}

impl Default for FeedbackSchedule {
    /// STAIR's released script for window-open.
    fn default() -> Self {
        Self {
            first_step: 10_000,
            every: 5_000,
            queries_per_session: 50,
            budget: 2_000,
        }
    }
}

impl FeedbackSchedule {
    /// Environment step at which session `index` (from 0) is due.
    pub fn step_of(&self, index: u32) -> u64 {
        self.first_step + u64::from(index) * self.every
    }

    /// Whether session `index` is due at `step`, with `n_answers` of the budget spent.
    pub fn is_due(&self, index: u32, step: u64, n_answers: u32) -> bool {
        n_answers < self.budget && step >= self.step_of(index)
    }

    /// Queries that a session may ask with `n_answers` of the budget spent.
    pub fn session_size(&self, n_answers: u32) -> u32 {
        self.queries_per_session
            .min(self.budget.saturating_sub(n_answers))
    }
}

/// Something that happens every so many steps.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(transparent)]
pub struct Every(pub u64);

impl Every {
    /// Whether a multiple of the period lies in (before, now].
    pub fn is_crossed(self, before: u64, now: u64) -> bool {
        self.n_crossed(before, now) > 0
    }

    /// How many multiples of the period lie in (before, now]; none for a period of zero.
    pub fn n_crossed(self, before: u64, now: u64) -> u64 {
        let multiples = |step: u64| step.checked_div(self.0).unwrap_or(0);
        multiples(now) - multiples(before)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_last_session_asks_only_for_what_is_left() {
        let schedule = FeedbackSchedule {
            budget: 120,
            ..FeedbackSchedule::default()
        };
        assert_eq!(schedule.session_size(100), 20);
        assert!(schedule.is_due(2, 20_000, 100));
        assert!(!schedule.is_due(3, 25_000, 120));
    }

    #[test]
    fn several_environments_cannot_step_over_a_multiple() {
        assert!(Every(5_000).is_crossed(4_996, 5_004));
        assert!(!Every(5_000).is_crossed(5_000, 5_008));
        assert_eq!(Every(2).n_crossed(0, 8), 4);
    }
}
