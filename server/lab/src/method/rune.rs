//! RUNE: PEBBLE with a bonus for doubtful rewards.

use super::{Method, pebble::pebble};
use crate::config::RunConfig;

/// Adds the members' standard deviation about a reward, weighed less and less, to it.
pub(crate) fn rune(config: &RunConfig) -> Method {
    Method {
        bonus: Some(config.bonus),
        ..pebble(config)
    }
}
