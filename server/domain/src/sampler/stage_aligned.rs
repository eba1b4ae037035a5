//! Queries within one stage of the task, on which the reward ensemble is divided: STAIR.

use serde::{Deserialize, Serialize};

use super::{Beliefs, QuerySampler, descending, min_max};
use crate::query::Query;
use crate::random::Rng;

/// How much each part of the score weighs.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct StageCoefficients {
    /// c_stage in Eq. 9; larger makes alignment matter less.
    pub stage: f32,
    /// c_state in Eq. 9; larger makes disagreement matter less.
    pub state: f32,
}

impl Default for StageCoefficients {
    /// The authors' released settings.
    fn default() -> Self {
        Self {
            stage: 2.0,
            state: 0.1,
        }
    }
}

/// Asks where segments show the same stage and the ensemble is unsure.
#[derive(Debug, Clone, Copy)]
pub struct StageAligned {
    /// Weights of the score.
    pub coefficients: StageCoefficients,
}

impl QuerySampler for StageAligned {
    fn rank(&self, candidates: &[Query], beliefs: &mut dyn Beliefs, _rng: &mut Rng) -> Vec<usize> {
        let disagreement = beliefs.disagreement(candidates);
        let stage_gap = beliefs.stage_gap(candidates);
        descending(&stage_aligned_score(
            &disagreement,
            &stage_gap,
            self.coefficients,
        ))
    }

    fn needs_stage_gap(&self) -> bool {
        true
    }
}

/// Prefers queries the ensemble is unsure about and whose segments show the same stage.
///
/// `score = (c_stage − d) · (c_state + u)`, with `u`, `d` min-max scaled over the candidates.
///
/// * `disagreement` – `[N]`, std over members of P(second ≻ first)
/// * `stage_gap`    – `[N]`, in any unit; smaller is better aligned
///
/// All-equal inputs scale to zero. Higher is better.
///
/// Source: STAIR, Eq. 9. Differs from the paper: the printed disagreement is a variance, the
/// released code's and ours a standard deviation (after scaling they rank differently).
///
/// ```
/// use domain::sampler::{StageCoefficients, stage_aligned_score};
/// let score = stage_aligned_score(&[0.0, 0.2], &[3.0, 1.0], StageCoefficients::default());
/// assert_eq!(score, [(2.0 - 1.0) * 0.1, 2.0 * (0.1 + 1.0)]);
/// ```
pub fn stage_aligned_score(
    disagreement: &[f32],
    stage_gap: &[f32],
    c: StageCoefficients,
) -> Vec<f32> {
    let (u, d) = (min_max(disagreement), min_max(stage_gap));
    u.iter()
        .zip(&d)
        .map(|(u, d)| (c.stage - d) * (c.state + u))
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn equal_disagreement_leaves_the_stage_gap_to_decide() {
        let score = stage_aligned_score(&[0.3; 3], &[5.0, 1.0, 3.0], StageCoefficients::default());
        assert_eq!(descending(&score), [1, 2, 0]);
    }

    #[test]
    fn shifting_and_stretching_the_beliefs_changes_no_rank() {
        let (u, d) = ([0.1, 0.4, 0.25, 0.0], [2.0, 7.0, 3.5, 0.5]);
        let rank = |u: &[f32], d: &[f32]| {
            descending(&stage_aligned_score(u, d, StageCoefficients::default()))
        };
        let stretched: Vec<f32> = d.iter().map(|d| 4.0 * d + 1.0).collect();
        assert_eq!(rank(&u, &d), rank(&u, &stretched));
    }

    /// Candidates of a wide gap with doubt, a narrow one with half of it, and in the middle: the
    /// paper's other coefficients let the gap weigh more.
    #[test]
    fn coefficients_decide_between_a_wide_gap_in_doubt_and_a_narrow_one_in_less() {
        let rank = |stage, state| {
            let c = StageCoefficients { stage, state };
            descending(&stage_aligned_score(&[1.0, 0.5, 0.0], &[0.8, 0.0, 1.0], c))
        };
        assert_eq!(rank(2.0, 0.1), [0, 1, 2]); // 1.2 · 1.1, 2 · 0.6, 1 · 0.1
        assert_eq!(rank(1.0, 0.5), [1, 0, 2]); // 0.2 · 1.5, 1 · 1, 0
    }

    #[test]
    fn no_candidates_no_scores() {
        assert!(stage_aligned_score(&[], &[], StageCoefficients::default()).is_empty());
    }
}
