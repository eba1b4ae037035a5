//! What one run came to, as single numbers.

use domain::agreement::{Bootstrap, Estimate, mean};

use crate::experiment::results::RunResult;
use crate::message::{Evaluation, SessionOffered};

/// Evaluations at the end of which the mean is a run's score.
const N_LAST: usize = 10;

/// How well a run ended.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Score {
    /// Mean of the last ten evaluations: success in [0, 1], or the task return where a task is
    /// not solved but done better or worse.
    pub value: f64,
    /// Evaluations that it is the mean of; fewer than ten where there were fewer.
    pub n_evaluations: usize,
}

/// Steps and labels at the first evaluation that reached something.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Reached {
    /// Environment steps.
    pub step: u64,
    /// Answers.
    pub labels: u32,
}

/// The run's score; NaN for a run that was never tried after it began.
pub fn score(run: &RunResult) -> Score {
    let tried = run.evaluations.iter().filter(|e| e.step > 0);
    let mut last: Vec<f64> = tried.map(|e| value(run, e)).collect();
    last.drain(..last.len().saturating_sub(N_LAST));
    Score {
        value: mean(&last),
        n_evaluations: last.len(),
    }
}

/// Task returns of the same held-out episodes, before the first step and after the last.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Learned {
    /// Mean over episodes, of fresh weights.
    pub before: f64,
    /// Mean over episodes, of the weights that the run left.
    pub after: f64,
    /// Of the episodes' differences, with the interval of their mean.
    pub difference: Estimate,
    /// Episodes.
    pub n_episodes: usize,
}

/// What the run learned; `None` where its rows do not tell single episodes or the beginning.
pub fn learned(run: &RunResult) -> Option<Learned> {
    let first = run.evaluations.iter().find(|e| e.step == 0)?;
    let last = run.evaluations.last().filter(|e| e.step > 0)?;
    if first.returns.len() != last.returns.len() {
        return None;
    }
    let pairs = last.returns.iter().zip(&first.returns);
    let pairs: Vec<(f64, f64)> = pairs.map(|(after, before)| (*after, *before)).collect();
    Some(Learned {
        before: mean(&first.returns),
        after: mean(&last.returns),
        difference: Bootstrap::default().paired_difference(&pairs)?,
        n_episodes: pairs.len(),
    })
}

/// When success first was at least a share.
pub fn reached(run: &RunResult, share: f64) -> Option<Reached> {
    let first = run.evaluations.iter().find(|e| e.success_rate >= share)?;
    Some(Reached {
        step: first.step,
        labels: first.labels,
    })
}

/// Mean height of the run's curve, straight lines between evaluations, from the first to the
/// last: the area under it by its width. That of the one evaluation where there is one.
pub fn area(run: &RunResult) -> f64 {
    let points: Vec<(f64, f64)> = run
        .evaluations
        .iter()
        .map(|e| (e.step as f64, value(run, e)))
        .collect();
    let (Some(first), Some(last)) = (points.first(), points.last()) else {
        return f64::NAN;
    };
    let width = last.0 - first.0;
    if width <= 0.0 {
        return last.1;
    }
    let trapezoids = points
        .windows(2)
        .map(|pair| (pair[1].0 - pair[0].0) * f64::midpoint(pair[0].1, pair[1].1));
    trapezoids.sum::<f64>() / width
}

/// Share of chosen pairs within one true stage, mean over the sessions in which the method chose;
/// `None` where the task has no stages or the method had no choice.
pub(super) fn same_stage(run: &RunResult) -> Option<f64> {
    mean_of(chosen_in(run).map(|s| s.same_stage_chosen))
}

/// The same of all candidates; `None` also in rows of before it stood in them.
pub(super) fn same_stage_pool(run: &RunResult) -> Option<f64> {
    mean_of(chosen_in(run).map(|s| s.same_stage_pool))
}

/// Stage gap of chosen pairs by that of all candidates, mean over the same sessions.
pub(super) fn gap_ratio(run: &RunResult) -> Option<f64> {
    mean_of(chosen_in(run).map(|s| ratio(s.stage_gap_chosen, s.stage_gap_pool)))
}

/// The same with the gap of both directions; `None` also in rows of before it stood in them.
pub(super) fn symmetric_gap_ratio(run: &RunResult) -> Option<f64> {
    mean_of(chosen_in(run).map(|s| ratio(s.symmetric_gap_chosen, s.symmetric_gap_pool)))
}

fn ratio(chosen: Option<f64>, pool: Option<f64>) -> Option<f64> {
    Some(chosen? / pool.filter(|pool| *pool > 0.0)?)
}

/// How well the stage gap tells candidates within a true stage from the others, mean over the same
/// sessions.
pub(super) fn gap_auc(run: &RunResult) -> Option<f64> {
    mean_of(chosen_in(run).map(|s| s.stage_gap_auc))
}

/// The same with the gap of both directions; `None` also in rows of before it stood in them.
pub(super) fn symmetric_gap_auc(run: &RunResult) -> Option<f64> {
    mean_of(chosen_in(run).map(|s| s.symmetric_gap_auc))
}

/// Sessions in which the method chose: all but the first, which is random.
fn chosen_in(run: &RunResult) -> impl Iterator<Item = &SessionOffered> {
    run.sessions.iter().filter(|s| s.session > 0)
}

/// Share of answers that the task reward gives too, mean over sessions; `None` where no session
/// had an answer that could be held against it, and in rows of before it stood in them.
pub(super) fn oracle_agreement(run: &RunResult) -> Option<f64> {
    mean_of(run.answered.iter().map(|s| s.oracle_agreement))
}

fn mean_of(values: impl Iterator<Item = Option<f64>>) -> Option<f64> {
    let values: Vec<f64> = values.flatten().collect();
    (!values.is_empty()).then(|| mean(&values))
}

fn value(run: &RunResult, evaluation: &Evaluation) -> f64 {
    if run.end.has_success {
        evaluation.success_rate
    } else {
        evaluation.return_mean
    }
}

#[cfg(test)]
mod tests {
    use super::super::told::{STAIR, Told, run_from};
    use super::*;

    fn close(found: f64, expected: f64) {
        assert!((found - expected).abs() < 1e-12, "{found} for {expected}");
    }

    #[test]
    fn learning_is_the_difference_of_the_same_episodes() {
        let found = learned(&run_from(&[1.0, 2.0, 6.0], &[11.0, 12.0, 16.0])).unwrap();
        close(found.before, 3.0);
        close(found.after, 13.0);
        close(found.difference.value, 10.0);
        close(found.difference.interval.lo, 10.0); // though the episodes differ
        assert_eq!(found.n_episodes, 3);

        let unsure = learned(&run_from(&[1.0, 5.0, 3.0], &[5.0, 1.0, 4.0])).unwrap();
        assert!(unsure.difference.interval.contains(0.0));

        assert_eq!(learned(&STAIR.run()), None); // not tried before it began
        assert_eq!(learned(&run_from(&[], &[])), None); // rows of an older program
        assert_eq!(learned(&run_from(&[1.0], &[1.0, 2.0])), None);
    }

    #[test]
    fn a_score_leaves_out_what_was_before_the_first_step() {
        let (with, without) = (score(&run_from(&[1.0], &[2.0])), score(&STAIR.run()));
        assert_eq!(with, without);
    }

    #[test]
    fn a_score_is_the_mean_of_the_last_ten_evaluations() {
        const RISING: &[f64] = &[0.0, 0.0, 0.1, 0.2, 0.3, 0.4, 0.5, 0.6, 0.7, 0.8, 0.9, 1.0];
        let found = score(
            &Told {
                success: RISING,
                ..STAIR
            }
            .run(),
        );
        close(found.value, 0.55);
        assert_eq!(found.n_evaluations, 10);
        let few = score(&STAIR.run());
        close(few.value, 0.5);
        assert_eq!(few.n_evaluations, 3);
    }

    #[test]
    fn the_area_is_that_of_trapezoids_by_the_width() {
        // 1000 × 0.25 + 1000 × 0.75 over 2000 steps
        close(area(&STAIR.run()), 0.5);
        close(
            area(
                &Told {
                    success: &[0.2, 0.2, 0.8, 0.8],
                    ..STAIR
                }
                .run(),
            ),
            (0.2 + 0.5 + 0.8) / 3.0,
        );
        close(
            area(
                &Told {
                    success: &[0.4],
                    ..STAIR
                }
                .run(),
            ),
            0.4,
        );
    }

    #[test]
    fn a_share_of_success_is_reached_at_the_first_evaluation_with_it() {
        let run = STAIR.run();
        assert_eq!(
            reached(&run, 0.5),
            Some(Reached {
                step: 2_000,
                labels: 20
            })
        );
        assert_eq!(
            reached(&run, 0.8),
            Some(Reached {
                step: 3_000,
                labels: 30
            })
        );
        assert_eq!(
            reached(
                &Told {
                    success: &[0.7],
                    ..STAIR
                }
                .run(),
                0.8
            ),
            None
        );
    }
}
