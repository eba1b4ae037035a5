//! RIME: PEBBLE for doubtful answers. Its preset keeps the critics and centres novelty.

use learn::reward::Denoising;

use super::{Method, pebble::pebble};
use crate::config::RunConfig;

/// Warm-starts the rewards on novelty and fits them to believable answers.
pub(crate) fn rime(config: &RunConfig) -> Method {
    Method {
        reward_learner: |config| {
            let feedback = &config.feedback;
            let n_sessions = f64::from(feedback.budget) / f64::from(feedback.queries_per_session);
            Box::new(Denoising::new(&config.denoising, n_sessions))
        },
        ..pebble(config)
    }
}
