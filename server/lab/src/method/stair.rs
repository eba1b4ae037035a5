//! STAIR: PEBBLE with stage-aligned queries.

use domain::sampler::StageAligned;

use super::{Method, pebble::pebble};
use crate::config::RunConfig;

/// Asks within a stage, where the ensemble disagrees.
pub(crate) fn stair(config: &RunConfig) -> Method {
    Method {
        sampler: Some(Box::new(StageAligned {
            coefficients: config.queries.coefficients,
        })),
        learns_temporal_distance: true,
        ..pebble(config)
    }
}
