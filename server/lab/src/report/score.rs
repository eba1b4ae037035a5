//! What one run came to.

use domain::agreement::mean;

use crate::grid::RunResult;
use crate::message::Evaluation;

/// The score of a run is a mean over so many of its last evaluations (the paper's tables).
const LAST: usize = 10;

/// Success rates whose first time is told.
pub(super) const LEVELS: [f64; 3] = [0.5, 0.8, 0.95];

/// Figures of one run.
#[derive(Debug, Clone, PartialEq)]
pub struct Score {
    /// Mean success rate of the last ten evaluations, [0, 1].
    pub success: f64,
    /// Mean task return of the same.
    pub task_return: f64,
    /// Mean success rate over the steps from the first evaluation to the last, [0, 1]: the area
    /// under the curve, straight lines between evaluations.
    pub area: f64,
    /// Steps and answers at the first evaluation with a success rate of 0.5, 0.8 and 0.95.
    pub reached: [Option<Reached>; 3],
    /// Mean over sessions of the stage gap of chosen queries over that of all candidates.
    pub stage_gap_ratio: Option<f64>,
    /// Mean share of chosen queries in one true stage over the sessions after the first.
    pub same_stage: Option<f64>,
}

/// When a level was first reached.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Reached {
    /// Environment steps.
    pub step: u64,
    /// Answers.
    pub labels: u32,
}

impl Score {
    /// Of a run's evaluations and sessions.
    pub fn of(result: &RunResult) -> Self {
        let evaluations = &result.evaluations;
        let last = &evaluations[evaluations.len().saturating_sub(LAST)..];
        let of_last = |of: fn(&Evaluation) -> f64| mean(&last.iter().map(of).collect::<Vec<_>>());
        // the first session is drawn at random by every method
        let chosen = || result.sessions.iter().filter(|s| s.session > 0);
        let ratio = |s: &crate::message::SessionOffered| {
            let pool = s.stage_gap_pool.filter(|gap| *gap > 0.0)?;
            Some(s.stage_gap_chosen? / pool)
        };
        Self {
            success: of_last(|e| e.success_rate),
            task_return: of_last(|e| e.return_mean),
            area: area(evaluations),
            reached: LEVELS.map(|level| {
                let first = evaluations.iter().find(|e| e.success_rate >= level)?;
                Some(Reached {
                    step: first.step,
                    labels: first.labels,
                })
            }),
            stage_gap_ratio: mean_of(chosen().filter_map(ratio)),
            same_stage: mean_of(chosen().filter_map(|s| s.same_stage_chosen)),
        }
    }
}

fn mean_of(values: impl Iterator<Item = f64>) -> Option<f64> {
    let values: Vec<f64> = values.collect();
    (!values.is_empty()).then(|| mean(&values))
}

fn area(evaluations: &[Evaluation]) -> f64 {
    let (Some(first), Some(last)) = (evaluations.first(), evaluations.last()) else {
        return f64::NAN;
    };
    if first.step == last.step {
        return last.success_rate;
    }
    let trapezoids = evaluations.windows(2).map(|pair| {
        let width = (pair[1].step - pair[0].step) as f64;
        width * f64::midpoint(pair[0].success_rate, pair[1].success_rate)
    });
    trapezoids.sum::<f64>() / (last.step - first.step) as f64
}
