//! Queries about what the present policy does.

use super::{Beliefs, QuerySampler};
use crate::query::Query;
use crate::random::Rng;

/// Asks at random about the newest episodes only.
///
/// Source: QPA, §4.1: its episode store holds N episodes, and queries are drawn from it uniformly.
#[derive(Debug, Clone, Copy)]
pub struct NearPolicy {
    /// N, complete episodes.
    pub episodes: usize,
}

impl QuerySampler for NearPolicy {
    fn rank(&self, candidates: &[Query], _beliefs: &mut dyn Beliefs, rng: &mut Rng) -> Vec<usize> {
        rng.permutation(candidates.len())
    }

    fn newest_episodes(&self) -> Option<usize> {
        Some(self.episodes)
    }
}
