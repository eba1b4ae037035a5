//! PEBBLE: unsupervised pre-training, disagreement sampling, relabelling.

use domain::sampler::Disagreement;
use learn::replay::RewardSource;
use learn::reward::Supervised;

use super::Method;
use crate::config::RunConfig;

/// Asks where the ensemble disagrees.
pub(crate) fn pebble(_config: &RunConfig) -> Method {
    Method {
        sampler: Some(Box::new(Disagreement)),
        reward: RewardSource::Learned,
        stage: None,
        reward_learner: |_| Box::new(Supervised),
        bonus: None,
        recent_episodes: None,
        steering: None,
    }
}
