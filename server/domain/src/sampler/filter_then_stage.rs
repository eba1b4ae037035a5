//! Queries within one stage, among those on which the reward ensemble is divided.

use super::{Beliefs, QuerySampler, ascending, descending};
use crate::query::Query;
use crate::random::Rng;

/// Keeps the half of the candidates with the larger disagreement and asks where their stage gap
/// is smallest; the other half follows, the most divided first.
///
/// Source: STAIR's released code, sampler `tcd`.
#[derive(Debug, Clone, Copy)]
pub struct FilterThenStage;

impl QuerySampler for FilterThenStage {
    fn rank(&self, candidates: &[Query], beliefs: &mut dyn Beliefs, _rng: &mut Rng) -> Vec<usize> {
        let by_disagreement = descending(&beliefs.disagreement(candidates));
        let (divided, others) = by_disagreement.split_at(candidates.len().div_ceil(2));
        let queries: Vec<Query> = divided.iter().map(|&i| candidates[i]).collect();
        let by_gap = ascending(&beliefs.stage_gap(&queries));
        let divided = by_gap.into_iter().map(|place| divided[place]);
        divided.chain(others.iter().copied()).collect()
    }

    fn needs_stage_gap(&self) -> bool {
        true
    }
}
