//! Queries on which the reward ensemble is divided.

use super::{Beliefs, QuerySampler, descending};
use crate::query::Query;
use crate::random::Rng;

/// Asks where the members' preference probabilities differ most.
///
/// Source: PEBBLE's released code, sampler `d`: std over members.
#[derive(Debug, Clone, Copy)]
pub struct Disagreement;

impl QuerySampler for Disagreement {
    fn rank(&self, candidates: &[Query], beliefs: &mut dyn Beliefs, _rng: &mut Rng) -> Vec<usize> {
        descending(&beliefs.disagreement(candidates))
    }
}
