//! STAIR: PEBBLE with stage-aligned queries.

use domain::sampler::StageAligned;
use learn::stage::StageApproximator;

use super::{Method, pebble::pebble};
use crate::config::RunConfig;

/// Asks within a stage, where the ensemble disagrees.
pub(crate) fn stair(config: &RunConfig) -> Method {
    Method {
        sampler: Some(Box::new(StageAligned {
            coefficients: config.queries.coefficients,
        })),
        stage: Some(gap(config)),
        ..pebble(config)
    }
}

/// The quadrilateral distance, one way as in the paper or both ways.
pub(super) fn gap(config: &RunConfig) -> StageApproximator {
    if config.queries.symmetric_gap {
        StageApproximator::SymmetricQuadrilateral
    } else {
        StageApproximator::Quadrilateral
    }
}
