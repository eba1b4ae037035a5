//! SAC on the task reward: what a perfect reward model could reach.

use learn::replay::RewardSource;

use super::{Method, pebble::pebble};
use crate::config::RunConfig;

/// Never asks; the critics see the task reward.
pub(crate) fn sac(config: &RunConfig) -> Method {
    Method {
        sampler: None,
        reward: RewardSource::Task,
        ..pebble(config)
    }
}
