//! Which candidates are worth asking about.

use crate::query::Query;
use crate::random::Rng;

mod disagreement;
mod stage_aligned;
mod uniform;

pub use disagreement::Disagreement;
pub use stage_aligned::{StageAligned, StageCoefficients, stage_aligned_score};
pub use uniform::Uniform;

/// What the learners believe about candidates, as plain numbers. Each is computed when asked.
pub trait Beliefs {
    /// std over ensemble members of P(second ≻ first), `[N]`.
    fn disagreement(&mut self, candidates: &[Query]) -> Vec<f32>;
    /// Mean of the four temporal distances between the ends of both segments, nats, `[N]`.
    ///
    /// Source: STAIR, Eq. 8 (quadrilateral distance).
    fn stage_gap(&mut self, candidates: &[Query]) -> Vec<f32>;
}

/// A rule for choosing queries.
pub trait QuerySampler: Send {
    /// Indices of all `candidates` worth asking, best first; the caller takes as many as it
    /// needs. Pure: same inputs and generator, same order.
    fn rank(&self, candidates: &[Query], beliefs: &mut dyn Beliefs, rng: &mut Rng) -> Vec<usize>;
}

/// Indices from the highest score to the lowest; equal scores keep their order.
pub(crate) fn descending(scores: &[f32]) -> Vec<usize> {
    let mut order: Vec<usize> = (0..scores.len()).collect();
    order.sort_by(|&a, &b| scores[b].total_cmp(&scores[a]));
    order
}

/// Min-max scaled to [0, 1]; all-equal inputs scale to zero.
pub(crate) fn min_max(values: &[f32]) -> Vec<f32> {
    let lo = values.iter().copied().fold(f32::INFINITY, f32::min);
    let hi = values.iter().copied().fold(f32::NEG_INFINITY, f32::max);
    let range = hi - lo;
    values
        .iter()
        .map(|v| if range > 0.0 { (v - lo) / range } else { 0.0 })
        .collect()
}
