//! QPA: PEBBLE near the policy, in what it asks and in what its critics learn from.
//!
//! Without its crops of segments and with PEBBLE's ensemble, as in STAIR's comparison.

use domain::sampler::NearPolicy;

use super::{Method, pebble::pebble};
use crate::config::RunConfig;

/// Asks about the newest episodes and draws half of each batch from them.
pub(crate) fn qpa(config: &RunConfig) -> Method {
    let episodes = config.queries.near_policy_episodes;
    Method {
        sampler: Some(Box::new(NearPolicy { episodes })),
        recent_episodes: Some(episodes),
        ..pebble(config)
    }
}
