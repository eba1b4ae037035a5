//! Answers about two segments of an expert's episodes, as the preference figures draw them.

use serde::{Deserialize, Serialize};

/// One answer.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct PreferenceRow {
    /// The task's name.
    pub task: String,
    /// First step of σ₀ in its episode.
    pub t_x: u32,
    /// First step of σ₁ in its episode.
    pub t_y: u32,
    /// What was answered.
    pub preference: Preferred,
}

/// Which segment was better.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Preferred {
    /// σ₀.
    First,
    /// σ₁.
    Second,
    /// Neither: indistinguishable.
    Equal,
}

/// What a file of such rows looks like, as users read it.
pub(super) const INPUT: &str =
    "task, t_x and t_y (first steps of both segments), preference (first, second or equal)";

impl Preferred {
    /// All answers in the order of the key.
    pub(super) const ALL: [Self; 3] = [Self::First, Self::Second, Self::Equal];

    /// As keys have it.
    pub(super) fn name(self) -> &'static str {
        match self {
            Self::First => "σ₀ is better",
            Self::Second => "σ₁ is better",
            Self::Equal => "indistinguishable",
        }
    }
}
