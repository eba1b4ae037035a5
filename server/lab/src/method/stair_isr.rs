//! STAIR with segments as intervals of learned stages: the paper's STAIR (ISR).

use learn::stage::StageApproximator;

use super::{Method, stair::stair};
use crate::config::RunConfig;

/// Measures stages by the distance from the start of the episode.
pub(crate) fn stair_isr(config: &RunConfig) -> Method {
    Method {
        stage: Some(StageApproximator::Intervals),
        ..stair(config)
    }
}
