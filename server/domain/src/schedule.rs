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
    /// Whether later sessions are smaller, larger, or of M queries too.
    pub session_sizes: SessionSizes,
    /// Answers in all, the paper's N_total.
    pub budget: u32,
}

/// How the size of a session follows the run's step t of T (B-Pref's `reward_schedule`).
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum SessionSizes {
    /// M, the paper's.
    #[default]
    Constant,
    /// M (T − t) / T: most is asked while least is known.
    Decreasing,
    /// M T / (T − t + 1).
    Increasing,
}

impl SessionSizes {
    /// Factor on M at step `t` of `total`; `Decreasing` reaches 0 at its end.
    fn factor(self, t: u64, total: u64) -> f64 {
        let (total, left) = (total as f64, total.saturating_sub(t) as f64);
        match self {
            Self::Constant => 1.0,
            Self::Decreasing => left / total,
            Self::Increasing => total / (left + 1.0),
        }
    }
}

impl Default for FeedbackSchedule {
    /// STAIR's released script for window-open.
    fn default() -> Self {
        Self {
            first_step: 10_000,
            every: 5_000,
            queries_per_session: 50,
            session_sizes: SessionSizes::Constant,
            budget: 2_000,
        }
    }
}

impl FeedbackSchedule {
    /// Environment step at which session `index` (from 0) is due.
    pub fn step_of(&self, index: u32) -> u64 {
        self.first_step + u64::from(index) * self.every
    }

    /// Queries of session `index` in a run of `total_steps`, whatever is left of the budget: M in
    /// the first, later at least one, and at most the whole budget.
    ///
    /// Differs from B-Pref: t is the step at which the session is due, also if it had to wait.
    pub fn full_size(&self, index: u32, total_steps: u64) -> u32 {
        if index == 0 {
            return self.queries_per_session.min(self.budget);
        }
        let factor = self.session_sizes.factor(self.step_of(index), total_steps);
        let size = f64::from(self.queries_per_session) * factor;
        (size as u32).min(self.budget).max(1) // rounded down, as there
    }

    /// Queries that session `index` may ask with `n_answers` of the budget spent.
    pub fn session_size(&self, index: u32, total_steps: u64, n_answers: u32) -> u32 {
        let left = self.budget.saturating_sub(n_answers);
        self.full_size(index, total_steps).min(left)
    }

    /// Every session's step and size, as a run of `total_steps` plans them.
    pub fn sessions(&self, total_steps: u64) -> impl Iterator<Item = (u64, u32)> + '_ {
        let mut asked = 0;
        (0..)
            .map(|index| (index, self.step_of(index)))
            .take_while(move |(_, step)| *step < total_steps)
            .map_while(move |(index, step)| {
                let size = self.session_size(index, total_steps, asked);
                asked += size;
                (size > 0).then_some((step, size))
            })
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
        assert_eq!(schedule.session_size(2, 1_000_000, 100), 20);
        assert_eq!(schedule.session_size(3, 1_000_000, 120), 0);
        assert_eq!((schedule.step_of(2), schedule.step_of(3)), (20_000, 25_000));
    }

    /// M = 80, first after 4,000 of 160,000 steps, then every 6,000.
    fn with_sizes(session_sizes: SessionSizes) -> FeedbackSchedule {
        FeedbackSchedule {
            first_step: 4_000,
            every: 6_000,
            queries_per_session: 80,
            session_sizes,
            budget: 100_000,
        }
    }

    #[test]
    fn decreasing_sessions_shrink_with_what_is_left_of_the_run() {
        let schedule = with_sizes(SessionSizes::Decreasing);
        let sizes: Vec<_> = schedule.sessions(160_000).collect();
        assert_eq!(sizes[0], (4_000, 80));
        assert_eq!(sizes[1], (10_000, 75)); // 80 · 150/160
        assert_eq!(sizes[13], (82_000, 39)); // 80 · 78/160
        assert_eq!(sizes[25], (154_000, 3)); // 80 · 6/160
        assert_eq!(sizes.len(), 26);
    }

    #[test]
    fn increasing_sessions_grow_and_never_beyond_the_budget() {
        let mut schedule = with_sizes(SessionSizes::Increasing);
        assert_eq!(schedule.full_size(0, 160_000), 80);
        assert_eq!(schedule.full_size(12, 160_000), 152); // 80 · 160,000/84,001
        assert_eq!(schedule.full_size(25, 160_000), 2_132); // 80 · 160,000/6,001
        schedule.budget = 200;
        assert_eq!(schedule.full_size(25, 160_000), 200);
        let sizes: Vec<_> = schedule.sessions(160_000).map(|(_, size)| size).collect();
        assert_eq!(sizes, [80, 85, 35]);
    }

    #[test]
    fn a_session_that_is_due_asks_at_least_once() {
        let schedule = with_sizes(SessionSizes::Decreasing);
        assert_eq!(schedule.full_size(26, 160_000), 1);
        assert_eq!(schedule.session_size(26, 160_000, 100_000), 0);
    }

    #[test]
    fn several_environments_cannot_step_over_a_multiple() {
        assert!(Every(5_000).is_crossed(4_996, 5_004));
        assert!(!Every(5_000).is_crossed(5_000, 5_008));
        assert_eq!(Every(2).n_crossed(0, 8), 4);
    }
}
