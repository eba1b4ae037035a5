//! STAIR with time for a stage: no temporal distance is learned.

use learn::stage::StageApproximator;

use super::{Method, stair::stair};
use crate::config::RunConfig;

/// Measures stages by the step of the episode.
pub(crate) fn timestep(config: &RunConfig) -> Method {
    Method {
        stage: Some(StageApproximator::Timestep),
        ..stair(config)
    }
}
