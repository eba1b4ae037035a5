//! Two segments put to a labeler.

use serde::{Deserialize, Serialize};

use crate::environment::TaskReward;
use crate::episode::{Segment, SegmentRecord};

/// Two segments to compare. Which one is shown on the left is decided where it is shown.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Serialize, Deserialize)]
pub struct Query {
    /// The paper's σ₀.
    pub first: Segment,
    /// The paper's σ₁.
    pub second: Segment,
}

/// Name of a query inside its run.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, Deserialize)]
pub struct QueryKey {
    /// Round of asking, from 0.
    pub session: u32,
    /// Place in the round, from 0; replacements of skipped queries follow the planned ones.
    pub index: u32,
}

/// What is asked about a query.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Question {
    /// Which segment is better for the task? Trained on.
    Preference,
    /// Do the segments show the same stage of the task? Never trained on.
    SameStage,
}

/// A chosen query with all that a teacher needs to answer it.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct OfferedQuery {
    /// Its name.
    pub key: QueryKey,
    /// σ₀.
    pub first: SegmentRecord,
    /// σ₁.
    pub second: SegmentRecord,
    /// Whether the stage question is asked as well, after the preference.
    pub asks_same_stage: bool,
    /// std over members of P(second ≻ first) when it was chosen, where beliefs were asked.
    pub disagreement: Option<f32>,
    /// Stage gap when it was chosen, in its approximator's unit, where beliefs were asked.
    pub stage_gap: Option<f32>,
    /// Mean task reward of a step over the ten newest complete episodes, where known: what
    /// scripted teachers measure their thresholds by.
    pub typical_reward: Option<TaskReward>,
}

impl OfferedQuery {
    /// The references alone.
    pub fn query(&self) -> Query {
        Query {
            first: self.first.segment,
            second: self.second.segment,
        }
    }
}

impl Query {
    /// The same two segments, the second first.
    #[must_use]
    pub fn swapped(self) -> Self {
        Self {
            first: self.second,
            second: self.first,
        }
    }
}

/// Whether two segments lie within one true stage: whether the stages of their four end states are
/// equal. `None` where the task does not know its stages.
///
/// * `first`, `second` – true stage of each state of a segment, `[H]`
pub fn is_same_stage(first: &[u8], second: &[u8]) -> Option<bool> {
    let ends = |stages: &[u8]| Some((*stages.first()?, *stages.last()?));
    let ((a, b), (c, d)) = (ends(first)?, ends(second)?);
    Some(a == b && b == c && c == d)
}
