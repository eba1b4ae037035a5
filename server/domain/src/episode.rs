//! Episodes and the windows of them that people compare.

use serde::{Deserialize, Serialize};

/// Number of an episode in its run, in order of start.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, Deserialize)]
#[serde(transparent)]
pub struct EpisodeId(pub u32);

/// A window of consecutive steps in one episode.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Serialize, Deserialize)]
pub struct Segment {
    /// The episode.
    pub episode: EpisodeId,
    /// First step, from 0.
    pub start: u32,
    /// Steps, `H`.
    pub len: u32,
}

/// Everything about a segment that a teacher may need: references into a run made into values.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct SegmentRecord {
    /// Which window.
    pub segment: Segment,
    /// Poses of the states after each step, `[H][pose_size]`.
    pub poses: Vec<Vec<f32>>,
    /// Ground truth of each step, `[H]`; for scripted teachers.
    pub task_rewards: Vec<crate::environment::TaskReward>,
    /// True stage of each state, `[H]`, empty where the task does not know; for evaluation and
    /// for the method `true_stage`.
    pub stages: Vec<u8>,
}
