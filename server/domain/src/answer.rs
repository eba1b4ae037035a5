//! What labelers do, and what of it a learner may train on.

use serde::{Deserialize, Serialize};

/// One of a query's two segments.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Which {
    /// σ₀.
    First,
    /// σ₁.
    Second,
}

impl Which {
    /// The other one.
    #[must_use]
    pub fn other(self) -> Self {
        match self {
            Self::First => Self::Second,
            Self::Second => Self::First,
        }
    }
}

/// What a labeler may say to "which is better?".
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Answer {
    /// The left clip is better.
    Left,
    /// The right clip is better.
    Right,
    /// They cannot be told apart.
    Equal,
    /// No judgement: a bad clip, or it cannot be told. Uses no budget, unless a run is told so.
    Skip,
}

/// What a labeler may say to "same stage?".
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum StageJudgement {
    /// Both segments show the same stage of the task.
    Same,
    /// They show different stages.
    Different,
    /// No judgement.
    Skip,
}

/// An answer that a learner may train on.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Preference {
    /// This segment is better.
    Prefer(Which),
    /// Indistinguishable.
    Equal,
}

impl Preference {
    /// The opposite; equal stays equal.
    #[must_use]
    pub fn flipped(self) -> Self {
        match self {
            Self::Prefer(which) => Self::Prefer(which.other()),
            Self::Equal => Self::Equal,
        }
    }

    /// Target of P(second ≻ first): 0, 1 or ½.
    pub fn target(self) -> f32 {
        match self {
            Self::Prefer(Which::First) => 0.0,
            Self::Prefer(Which::Second) => 1.0,
            Self::Equal => 0.5,
        }
    }
}
