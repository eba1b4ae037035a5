//! PEBBLE with random queries.

use domain::sampler::Uniform;

use super::{Method, pebble::pebble};
use crate::config::RunConfig;

/// Asks about random pairs.
pub(crate) fn uniform(config: &RunConfig) -> Method {
    Method {
        sampler: Some(Box::new(Uniform)),
        ..pebble(config)
    }
}
