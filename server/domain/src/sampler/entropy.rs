//! Queries of whose answer the reward ensemble is unsure.

use super::{Beliefs, QuerySampler, descending};
use crate::query::Query;
use crate::random::Rng;

/// Asks where the entropy of the preference probability, mean over members, is highest.
///
/// Source: PEBBLE's released code, sampler `e`. Differs from disagreement: members that all say ½
/// agree, and are unsure.
#[derive(Debug, Clone, Copy)]
pub struct Entropy;

impl QuerySampler for Entropy {
    fn rank(&self, candidates: &[Query], beliefs: &mut dyn Beliefs, _rng: &mut Rng) -> Vec<usize> {
        descending(&beliefs.entropy(candidates))
    }
}
