//! STAIR told the true stages: what a gap without errors gives.

use learn::stage::StageApproximator;

use super::{Method, stair::stair};
use crate::config::RunConfig;

/// Measures stages by what the task itself says; no temporal distance is learned.
///
/// Differs from the paper: it has no such comparison.
pub(crate) fn true_stage(config: &RunConfig) -> Method {
    Method {
        stage: Some(StageApproximator::True),
        ..stair(config)
    }
}
