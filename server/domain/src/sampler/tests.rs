use super::*;
use crate::episode::{EpisodeId, Segment};
use crate::random::Stream;

/// Beliefs that are written down: about the candidate with number `i` at place `i`.
struct Written {
    disagreement: [f32; 4],
    entropy: [f32; 4],
    stage_gap: [f32; 4],
    states: [f32; 4],
    asked: Vec<f32>,
}

const BELIEFS: Written = Written {
    disagreement: [0.1, 0.4, 0.3, 0.0],
    entropy: [0.6, 0.2, 0.3, 0.7],
    stage_gap: [3.0, 9.0, 1.0, 2.0],
    states: [0.0, 1.0, 5.0, 10.0],
    asked: Vec::new(),
};

fn of(values: [f32; 4], candidates: &[Query]) -> Vec<f32> {
    let value = |query: &Query| values[query.first.episode.0 as usize];
    candidates.iter().map(value).collect()
}

impl Beliefs for Written {
    fn disagreement(&mut self, candidates: &[Query]) -> Vec<f32> {
        of(self.disagreement, candidates)
    }
    fn entropy(&mut self, candidates: &[Query]) -> Vec<f32> {
        of(self.entropy, candidates)
    }
    fn states(&mut self, candidates: &[Query]) -> Vec<Vec<f32>> {
        let states = of(self.states, candidates).into_iter();
        states.map(|x| vec![x, 0.0]).collect()
    }
    fn asked_states(&mut self) -> Vec<Vec<f32>> {
        self.asked.iter().map(|&x| vec![x, 0.0]).collect()
    }
    fn stage_gap(&mut self, candidates: &[Query]) -> Vec<f32> {
        of(self.stage_gap, candidates)
    }
}

fn rank(name: &str, asked: &[f32]) -> Vec<usize> {
    let segment = |episode| Segment {
        episode: EpisodeId(episode),
        start: 0,
        len: 5,
    };
    let query = |i| Query {
        first: segment(i),
        second: segment(9),
    };
    let candidates: Vec<Query> = (0..4).map(query).collect();
    let mut beliefs = Written {
        asked: asked.to_vec(),
        ..BELIEFS
    };
    let rng = &mut Rng::new(1, Stream::Test, 0);
    named(name).rank(&candidates, &mut beliefs, rng)
}

fn named(name: &str) -> Box<dyn QuerySampler> {
    let settings = SamplerSettings {
        coefficients: StageCoefficients::default(),
        near_policy_episodes: 10,
    };
    sampler(name, &settings).expect("a name of the registry")
}

#[test]
fn every_sampler_of_the_registry_ranks_each_candidate_once() {
    for (name, _) in SAMPLERS {
        let mut order = rank(name, &[2.0]);
        order.sort_unstable();
        assert_eq!(order, [0, 1, 2, 3], "{name}");
    }
}

#[test]
fn doubt_is_ranked_by_entropy_and_division_by_disagreement() {
    assert_eq!(rank("entropy", &[]), [3, 0, 2, 1]);
    assert_eq!(rank("disagreement", &[]), [1, 2, 0, 3]);
}

/// The states lie at 0, 1, 5 and 10. From 0: 10 is farthest, then 5, then 1. With 9 asked, 0 is
/// farthest, then 5 (4 from 9), then the ends' neighbours.
#[test]
fn k_center_goes_where_nothing_was_asked_or_chosen() {
    assert_eq!(rank("k_center", &[0.0]), [3, 2, 1, 0]);
    assert_eq!(rank("k_center", &[9.0]), [0, 2, 1, 3]);
}

#[test]
fn the_mixes_of_k_center_look_at_the_better_half_first() {
    // divided: 1 and 2 at 1 and 5; unsure: 3 and 0 at 10 and 0
    assert_eq!(rank("k_center_disagreement", &[0.0]), [2, 1, 0, 3]);
    assert_eq!(rank("k_center_entropy", &[9.0]), [0, 3, 2, 1]);
}

#[test]
fn the_stage_decides_alone_or_within_the_divided_half() {
    assert_eq!(rank("stage_gap", &[]), [2, 3, 0, 1]);
    assert_eq!(rank("filter_then_stage", &[]), [2, 1, 0, 3]);
    let needy = |name| named(name).needs_stage_gap();
    assert!(needy("stage_gap") && needy("filter_then_stage") && needy("stage_aligned"));
    assert!(!needy("disagreement"));
}

#[test]
fn near_the_policy_means_the_newest_episodes() {
    assert_eq!(named("near_policy").newest_episodes(), Some(10));
    assert_eq!(named("uniform").newest_episodes(), None);
    assert_eq!(rank("near_policy", &[]), rank("uniform", &[]));
}
