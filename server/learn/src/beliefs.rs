//! What the learners believe about queries, as the samplers ask for it.

use domain::query::Query;
use domain::sampler::Beliefs;

use crate::replay::Replay;
use crate::reward::{RewardEnsemble, disagreement};
use crate::temporal::TemporalDistance;

/// Beliefs of the present networks about segments of one replay; each is computed when asked.
pub struct LearnedBeliefs<'a> {
    /// Where the segments are.
    pub replay: &'a Replay,
    /// States the disagreement.
    pub reward: &'a RewardEnsemble,
    /// States the stage gap; without one there is none to state.
    pub temporal: Option<&'a TemporalDistance>,
}

impl Beliefs for LearnedBeliefs<'_> {
    fn disagreement(&mut self, candidates: &[Query]) -> Vec<f32> {
        disagreement(&self.reward.probabilities(self.replay, candidates))
    }

    /// Empty for methods that learn no temporal distance.
    fn stage_gap(&mut self, candidates: &[Query]) -> Vec<f32> {
        self.temporal
            .map_or_else(Vec::new, |t| t.stage_gap(self.replay, candidates))
    }
}
