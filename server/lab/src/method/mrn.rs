//! MRN: PEBBLE with a bilevel step of the rewards through the critics now and then.

use super::{Method, pebble::pebble};
use crate::config::RunConfig;

/// Steers the rewards by the critics' own preferences.
pub(crate) fn mrn(config: &RunConfig) -> Method {
    Method {
        steering: Some(config.steering),
        ..pebble(config)
    }
}
