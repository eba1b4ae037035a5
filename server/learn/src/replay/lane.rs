//! The rows of one environment, column by column.

use domain::environment::EpisodeEnd;
use domain::episode::EpisodeId;

use super::ReplayShape;

/// Stage byte of a state whose task does not know its stages.
pub(super) const NO_STAGE: u8 = u8::MAX;

/// One environment's rows. States have one row more per episode than steps.
#[derive(Debug, Default)]
pub(super) struct Lane {
    pub(super) observations: Vec<f32>,
    pub(super) poses: Vec<f32>,
    pub(super) stages: Vec<u8>,
    pub(super) actions: Vec<f32>,
    pub(super) learned_rewards: Vec<f32>,
    /// As long as the rewards where it is kept, else empty.
    pub(super) disagreements: Vec<f32>,
    pub(super) task_rewards: Vec<f64>,
    pub(super) marks: Vec<StepMark>,
    /// Which episode each step belongs to.
    pub(super) episode_of: Vec<u32>,
    pub(super) running: Option<EpisodeId>,
}

impl Lane {
    pub(super) fn push_state(
        &mut self,
        shape: ReplayShape,
        observation: &[f32],
        pose: &[f32],
        stage: Option<u8>,
    ) {
        assert_eq!(
            observation.len(),
            shape.observation,
            "size of an observation"
        );
        assert_eq!(pose.len(), shape.pose, "size of a pose");
        self.observations.extend_from_slice(observation);
        self.poses.extend_from_slice(pose);
        self.stages.push(stage.unwrap_or(NO_STAGE));
    }
}

/// Success and end of a step in one byte.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct StepMark(pub(super) u8);

impl StepMark {
    pub(super) fn new(success: bool, end: Option<EpisodeEnd>) -> Self {
        let end = match end {
            None => 0,
            Some(EpisodeEnd::Terminal) => 2,
            Some(EpisodeEnd::TimeLimit) => 4,
        };
        Self(u8::from(success) | end)
    }

    pub(super) fn success(self) -> bool {
        self.0 & 1 != 0
    }

    pub(super) fn end(self) -> Option<EpisodeEnd> {
        match self.0 & 6 {
            2 => Some(EpisodeEnd::Terminal),
            4 => Some(EpisodeEnd::TimeLimit),
            _ => None,
        }
    }
}

/// Row `index` of rows that have `size` numbers each.
pub(super) fn row(values: &[f32], index: usize, size: usize) -> &[f32] {
    &values[index * size..(index + 1) * size]
}
