//! Which candidates are worth asking about.

use crate::query::Query;
use crate::random::Rng;

mod disagreement;
mod entropy;
mod filter_then_stage;
mod k_center;
mod near_policy;
mod stage_aligned;
mod stage_gap;
mod uniform;

pub use disagreement::Disagreement;
pub use entropy::Entropy;
pub use filter_then_stage::FilterThenStage;
pub use k_center::{KCenter, Shortlist};
pub use near_policy::NearPolicy;
pub use stage_aligned::{StageAligned, StageCoefficients, stage_aligned_score};
pub use stage_gap::StageGap;
pub use uniform::Uniform;

/// What the learners believe about candidates, as plain numbers. Each is computed when asked.
pub trait Beliefs {
    /// std over ensemble members of P(second ≻ first), `[N]`.
    fn disagreement(&mut self, candidates: &[Query]) -> Vec<f32>;
    /// Entropy of each ensemble member's preference probability, mean over members, nats, `[N]`.
    fn entropy(&mut self, candidates: &[Query]) -> Vec<f32>;
    /// States of both segments in a row, without actions, `[N][2 · T · S]`.
    fn states(&mut self, candidates: &[Query]) -> Vec<Vec<f32>>;
    /// The same of all queries that were asked before.
    fn asked_states(&mut self) -> Vec<Vec<f32>>;
    /// Stage gap of each query, in its approximator's unit, `[N]`; STAIR's is the mean of the four
    /// temporal distances between the ends of both segments, nats.
    ///
    /// Source: STAIR, Eq. 8 (quadrilateral distance).
    fn stage_gap(&mut self, candidates: &[Query]) -> Vec<f32>;
}

/// A rule for choosing queries.
pub trait QuerySampler: Send {
    /// Indices of all `candidates` worth asking, best first; the caller takes as many as it
    /// needs. Pure: same inputs and generator, same order.
    fn rank(&self, candidates: &[Query], beliefs: &mut dyn Beliefs, rng: &mut Rng) -> Vec<usize>;

    /// How many of the newest complete episodes candidates may come from; `None` leaves it to
    /// the run's settings.
    fn newest_episodes(&self) -> Option<usize> {
        None
    }

    /// Whether it asks for the stage gap, so that somebody has to learn one.
    fn needs_stage_gap(&self) -> bool {
        false
    }
}

/// What samplers are made with.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct SamplerSettings {
    /// c_stage and c_state of `stage_aligned`.
    pub coefficients: StageCoefficients,
    /// N of `near_policy`.
    pub near_policy_episodes: usize,
}

/// Names that the setting `queries.sampler` takes, with where each asks.
pub const SAMPLERS: &[(&str, &str)] = &[
    ("uniform", "random candidates"),
    ("disagreement", "where the members differ most"),
    ("entropy", "where the members are least sure"),
    ("k_center", "where nothing like it was asked"),
    ("k_center_disagreement", "k_center within the divided half"),
    ("k_center_entropy", "k_center within the unsure half"),
    ("near_policy", "about the newest episodes, at random"),
    ("stage_gap", "where both segments show one stage"),
    ("filter_then_stage", "stage_gap within the divided half"),
    ("stage_aligned", "within a stage and divided: STAIR's score"),
];

/// The sampler of that name.
pub fn sampler(name: &str, settings: &SamplerSettings) -> Option<Box<dyn QuerySampler>> {
    Some(match name {
        "uniform" => Box::new(Uniform),
        "disagreement" => Box::new(Disagreement),
        "entropy" => Box::new(Entropy),
        "k_center" => Box::new(KCenter(Shortlist::All)),
        "k_center_disagreement" => Box::new(KCenter(Shortlist::Divided)),
        "k_center_entropy" => Box::new(KCenter(Shortlist::Unsure)),
        "near_policy" => Box::new(NearPolicy {
            episodes: settings.near_policy_episodes,
        }),
        "stage_gap" => Box::new(StageGap),
        "filter_then_stage" => Box::new(FilterThenStage),
        "stage_aligned" => Box::new(StageAligned {
            coefficients: settings.coefficients,
        }),
        _ => return None,
    })
}

/// Indices from the highest score to the lowest; equal scores keep their order.
pub(crate) fn descending(scores: &[f32]) -> Vec<usize> {
    let mut order: Vec<usize> = (0..scores.len()).collect();
    order.sort_by(|&a, &b| scores[b].total_cmp(&scores[a]));
    order
}

/// Indices from the lowest score to the highest; equal scores keep their order.
pub(crate) fn ascending(scores: &[f32]) -> Vec<usize> {
    let mut order: Vec<usize> = (0..scores.len()).collect();
    order.sort_by(|&a, &b| scores[a].total_cmp(&scores[b]));
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

#[cfg(test)]
mod tests;
