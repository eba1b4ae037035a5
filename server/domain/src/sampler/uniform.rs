//! Every candidate is as good as any other.

use super::{Beliefs, QuerySampler};
use crate::query::Query;
use crate::random::Rng;

/// Asks about random candidates. The first session of every method.
#[derive(Debug, Clone, Copy)]
pub struct Uniform;

impl QuerySampler for Uniform {
    fn rank(&self, candidates: &[Query], _beliefs: &mut dyn Beliefs, rng: &mut Rng) -> Vec<usize> {
        rng.permutation(candidates.len())
    }
}
