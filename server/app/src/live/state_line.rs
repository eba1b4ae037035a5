//! A run's state in one line: what it is doing and what comes next.
//!
//! Pure: the words follow from what the run said last.

use lab::config::RunConfig;
use lab::message::{Activity, Finished, Phase};
use lab::words::thousands;

/// What a page shows beside a run's name.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum StateKind {
    /// The agent acts and learns.
    Training,
    /// The agent stands still until people answer.
    WaitingForLabels,
    /// A command stopped it for a while.
    Paused,
    /// All environment steps are taken.
    Finished,
    /// A command ended it; it can be taken up again.
    Stopped,
    /// It cannot go on.
    Failed,
}

impl StateKind {
    /// As the store and the API write it.
    pub fn word(self) -> &'static str {
        match self {
            Self::Training => "training",
            Self::WaitingForLabels => "waiting_for_labels",
            Self::Paused => "paused",
            Self::Finished => "finished",
            Self::Stopped => "stopped",
            Self::Failed => "failed",
        }
    }
}

/// Kind, words for now, words for next.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct StateLine {
    /// For programs.
    pub kind: StateKind,
    /// What it is doing.
    pub message: String,
    /// What comes after; empty where nothing does.
    pub next: String,
}

impl StateLine {
    /// Before the run says anything itself.
    pub fn opening() -> Self {
        Self::of(
            StateKind::Training,
            "getting ready",
            "starts to collect experience",
        )
    }

    /// From what the run says while it is driven.
    pub fn of_phase(phase: &Phase, config: &RunConfig) -> Self {
        let (step, total) = (thousands(phase.step), thousands(phase.total_steps));
        let asks_at = phase
            .until_step
            .filter(|until| *until < phase.total_steps)
            .map(thousands);
        let (got, needed) = phase.session_answers.unwrap_or_default();
        let missing = needed.saturating_sub(got);
        let per_session = config.feedback.queries_per_session;
        match phase.activity {
            Activity::Exploring => {
                let until = thousands(phase.until_step.unwrap_or(phase.total_steps));
                let message = format!("collecting varied experience: step {step} of {until}");
                Self::of(
                    StateKind::Training,
                    message,
                    format!("asks about {per_session} pairs"),
                )
            }
            Activity::Asking => {
                let message = format!(
                    "waiting for {missing} more {}",
                    plural(missing, "answer", "answers")
                );
                Self::of(
                    StateKind::WaitingForLabels,
                    message,
                    "then learns from them and trains on",
                )
            }
            Activity::Learning => {
                let next = asks_at.map_or_else(
                    || format!("finishes at step {total}"),
                    |at| format!("asks again at step {at}"),
                );
                Self::of(
                    StateKind::Training,
                    format!("training: step {step} of {total}"),
                    next,
                )
            }
            Activity::Paused => Self::paused(phase.step, phase.total_steps),
        }
    }

    /// Paused, whether its thread is up or not.
    pub fn paused(step: u64, total_steps: u64) -> Self {
        let message = format!(
            "paused at step {} of {}",
            thousands(step),
            thousands(total_steps)
        );
        Self::of(StateKind::Paused, message, "goes on when resumed")
    }

    /// The last environment step is taken.
    pub fn finished(finished: &Finished) -> Self {
        let (percent, labels) = (100.0 * finished.success_rate, finished.labels);
        let message = format!(
            "finished after {} steps and {labels} {}: succeeds in {percent:.0} % of its episodes",
            thousands(finished.step),
            plural(labels, "answer", "answers")
        );
        Self::of(StateKind::Finished, message, "")
    }

    /// A command ended it.
    pub fn stopped(step: u64) -> Self {
        let message = format!("stopped at step {}; a checkpoint was left", thousands(step));
        Self::of(StateKind::Stopped, message, "goes on when resumed")
    }

    /// It cannot go on.
    pub fn failed(reason: &str) -> Self {
        Self::of(
            StateKind::Failed,
            format!("failed: {reason}"),
            "goes on from its last checkpoint when resumed",
        )
    }

    fn of(kind: StateKind, message: impl Into<String>, next: impl Into<String>) -> Self {
        Self {
            kind,
            message: message.into(),
            next: next.into(),
        }
    }
}

fn plural(n: u32, one: &'static str, many: &'static str) -> &'static str {
    if n == 1 { one } else { many }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn line(
        activity: Activity,
        until_step: Option<u64>,
        session_answers: Option<(u32, u32)>,
    ) -> StateLine {
        let phase = Phase {
            activity,
            step: 12_400,
            total_steps: 40_000,
            from_step: 0,
            until_step,
            session_answers,
        };
        StateLine::of_phase(&phase, &RunConfig::default())
    }

    #[test]
    fn people_read_how_many_answers_are_missing() {
        let waiting = line(Activity::Asking, None, Some((3, 10)));
        assert_eq!(waiting.kind, StateKind::WaitingForLabels);
        assert_eq!(waiting.message, "waiting for 7 more answers");
        assert_eq!(
            line(Activity::Asking, None, Some((9, 10))).message,
            "waiting for 1 more answer"
        );
    }

    #[test]
    fn a_training_run_says_where_it_is_and_when_it_asks_again() {
        let training = line(Activity::Learning, Some(14_000), None);
        assert_eq!(training.message, "training: step 12,400 of 40,000");
        assert_eq!(training.next, "asks again at step 14,000");
        assert_eq!(
            line(Activity::Learning, Some(40_000), None).next,
            "finishes at step 40,000"
        );
    }
}
