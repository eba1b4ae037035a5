//! SURF: PEBBLE that also learns from pairs that nobody answered.

use learn::reward::{SemiSupervised, SemiSupervisedConfig};

use super::{Method, pebble::pebble};
use crate::config::RunConfig;

/// With crops of segments, as published.
pub(crate) fn surf(config: &RunConfig) -> Method {
    Method {
        reward_learner: |config| {
            Box::new(SemiSupervised::new(&config.semi_supervised, config.seed))
        },
        ..pebble(config)
    }
}

/// Without crops, as STAIR's comparison has QPA; it has no SURF.
pub(crate) fn surf_whole(config: &RunConfig) -> Method {
    Method {
        reward_learner: |config| {
            let whole = SemiSupervisedConfig {
                is_cropping: false,
                ..config.semi_supervised.clone()
            };
            Box::new(SemiSupervised::new(&whole, config.seed))
        },
        ..pebble(config)
    }
}
