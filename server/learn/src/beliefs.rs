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

#[cfg(test)]
mod tests {
    use domain::episode::{EpisodeId, Segment};

    use super::*;
    use crate::device::Device;
    use crate::replay::walked::walked;
    use crate::reward::RewardConfig;

    /// Coordinates count on from state to state and from one episode to the next.
    #[test]
    fn the_states_of_a_query_are_those_before_each_step_of_the_first_segment_and_of_the_second() {
        let episode = |from: u8| -> Vec<Vec<f32>> {
            let state = |t: u8| vec![f32::from(from + t), -1.0];
            (0..=6).map(state).collect()
        };
        let replay = walked(2, [episode(0), episode(100)]);
        let config = RewardConfig {
            hidden: vec![4],
            ..RewardConfig::default()
        };
        let segment = |episode, start| Segment {
            episode: EpisodeId(episode),
            start,
            len: 3,
        };
        let query = Query {
            first: segment(1, 0),
            second: segment(0, 3),
        };
        let mut beliefs = LearnedBeliefs {
            replay: &replay,
            reward: &RewardEnsemble::new(&config, 2, 1, 1, Device::CPU),
            temporal: None,
            stage: None,
            asked: &[query],
        };
        let coordinates = [100.0, 101.0, 102.0, 3.0, 4.0, 5.0];
        let expected: Vec<f32> = coordinates.iter().flat_map(|&x| [x, -1.0]).collect();
        assert_eq!(beliefs.asked_states(), [expected]);
        assert_eq!(beliefs.states(&[query, query]).len(), 2);
        assert!(
            beliefs.stage_gap(&[query]).is_empty(),
            "no notion of stages"
        );
        for doubt in [beliefs.disagreement(&[query]), beliefs.entropy(&[query])] {
            assert!(doubt.len() == 1 && doubt[0] > 0.0, "{doubt:?}");
        }
    }
}
