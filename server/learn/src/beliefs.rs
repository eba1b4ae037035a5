//! What the learners believe about queries, as the samplers ask for it.

use domain::query::Query;
use domain::sampler::Beliefs;

use crate::replay::Replay;
use crate::reward::{RewardEnsemble, disagreement, entropy};
use crate::stage::StageApproximator;
use crate::temporal::TemporalDistance;

/// Beliefs of the present networks about segments of one replay; each is computed when asked.
pub struct LearnedBeliefs<'a> {
    /// Where the segments are.
    pub replay: &'a Replay,
    /// States disagreement and entropy.
    pub reward: &'a RewardEnsemble,
    /// What the stage gap is measured with, where it is learned.
    pub temporal: Option<&'a TemporalDistance>,
    /// How it is measured; without it there is no gap to state.
    pub stage: Option<StageApproximator>,
    /// Queries that were asked before.
    pub asked: &'a [Query],
}

impl Beliefs for LearnedBeliefs<'_> {
    fn disagreement(&mut self, candidates: &[Query]) -> Vec<f32> {
        disagreement(&self.reward.probabilities(self.replay, candidates))
    }

    fn entropy(&mut self, candidates: &[Query]) -> Vec<f32> {
        entropy(&self.reward.probabilities(self.replay, candidates))
    }

    fn states(&mut self, candidates: &[Query]) -> Vec<Vec<f32>> {
        let states = |query: &Query| {
            [query.first, query.second]
                .into_iter()
                .flat_map(|s| (s.start..s.start + s.len).map(move |t| (s.episode, t as usize)))
                .flat_map(|(episode, t)| self.replay.observation(episode, t))
                .copied()
                .collect()
        };
        candidates.iter().map(states).collect()
    }

    fn asked_states(&mut self) -> Vec<Vec<f32>> {
        self.states(self.asked)
    }

    /// Empty for methods without a notion of stages.
    fn stage_gap(&mut self, candidates: &[Query]) -> Vec<f32> {
        self.stage.map_or_else(Vec::new, |stage| {
            stage.gap(self.replay, self.temporal, candidates)
        })
    }
}
