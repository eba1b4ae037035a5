//! Queries whose segments show the same stage, whatever the ensemble thinks of them.

use super::{Beliefs, QuerySampler, ascending};
use crate::query::Query;
use crate::random::Rng;

/// Asks where the stage gap is smallest.
///
/// Source: STAIR's released code, sampler `tc`.
#[derive(Debug, Clone, Copy)]
pub struct StageGap;

impl QuerySampler for StageGap {
    fn rank(&self, candidates: &[Query], beliefs: &mut dyn Beliefs, _rng: &mut Rng) -> Vec<usize> {
        ascending(&beliefs.stage_gap(candidates))
    }

    fn needs_stage_gap(&self) -> bool {
        true
    }
}
