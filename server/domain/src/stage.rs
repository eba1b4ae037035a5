//! A trajectory as a chain of stages, and how well a task can be cut into one.

use thiserror::Error;

mod gap;
mod timestep;

pub use gap::{GapBounds, StageGeometry, n_aligned, stage_gap};
pub use timestep::{
    Bin, Calibration, N_BINS, OFF_BY, STAGES, StageMeasures, TimestepReport, TimestepTally, Within,
};

/// How likely each state of one trajectory belongs to each stage: F(s, ω), `[T × N]`.
#[derive(Debug, Clone, PartialEq)]
pub struct StageProbabilities {
    values: Vec<f32>,
    n_stages: usize,
}

/// Why a table is not one of probabilities.
#[derive(Debug, Clone, PartialEq, Error)]
pub enum StageError {
    /// Nothing to cut.
    #[error("a segmentation needs at least one state and one stage")]
    Empty,
    /// Rows of different lengths.
    #[error("{n_values} probabilities do not make rows of {n_stages} stages")]
    Ragged {
        /// Values given.
        n_values: usize,
        /// Stages in a row.
        n_stages: usize,
    },
    /// Not a probability.
    #[error("the probability of stage {stage} at step {step} is {value}, but must be in [0, 1]")]
    NotAProbability {
        /// Row, from 0.
        step: usize,
        /// Column, from 0.
        stage: usize,
        /// What stands there.
        value: f32,
    },
}

impl StageProbabilities {
    /// Checks the table: `values` is `[T × N]`, a row per state in order of time.
    ///
    /// # Errors
    /// When there is nothing to cut, rows are not whole, or a value is outside [0, 1].
    pub fn new(values: Vec<f32>, n_stages: usize) -> Result<Self, StageError> {
        if values.is_empty() || n_stages == 0 {
            return Err(StageError::Empty);
        }
        if !values.len().is_multiple_of(n_stages) {
            return Err(StageError::Ragged {
                n_values: values.len(),
                n_stages,
            });
        }
        match values.iter().position(|p| !(0.0..=1.0).contains(p)) {
            None => Ok(Self { values, n_stages }),
            Some(at) => Err(StageError::NotAProbability {
                step: at / n_stages,
                stage: at % n_stages,
                value: values[at],
            }),
        }
    }

    /// Stages, `N`.
    pub fn n_stages(&self) -> usize {
        self.n_stages
    }

    /// States, `T`.
    pub fn n_states(&self) -> usize {
        self.values.len() / self.n_stages
    }

    /// The same with stages in a row merged into fewer of about equal length, whose probabilities
    /// add up; stage j of N becomes ⌈(j + 1) · n/N⌉ − 1 of n.
    ///
    /// Source: STAIR, appendix, the aggregated classifier: a step's stage is ⌈t/(T/n)⌉.
    ///
    /// # Panics
    /// When there are to be more stages than there are, or none.
    #[must_use]
    pub fn merged(&self, n_stages: usize) -> Self {
        let mut values = vec![0.0; self.n_states() * n_stages];
        let stages: Vec<usize> = (0..self.n_stages)
            .map(|stage| merged_stage(stage, self.n_stages, n_stages))
            .collect();
        for (row, merged) in self
            .values
            .chunks_exact(self.n_stages)
            .zip(values.chunks_exact_mut(n_stages))
        {
            for (p, &stage) in row.iter().zip(&stages) {
                merged[stage] += p;
            }
            for p in merged {
                *p = p.min(1.0); // rounding may have passed it
            }
        }
        Self { values, n_stages }
    }

    /// The probabilities of one state, `[N]`.
    ///
    /// # Panics
    /// When there is no such step.
    pub fn row(&self, step: usize) -> &[f32] {
        &self.values[step * self.n_stages..][..self.n_stages]
    }
}

/// Which of `n` merged stages one of `n_stages` belongs to, from 0.
fn merged_stage(stage: usize, n_stages: usize, n: usize) -> usize {
    assert!(
        (1..=n_stages).contains(&n),
        "{n_stages} stages cannot be merged into {n}"
    );
    ((stage + 1) * n).div_ceil(n_stages) - 1
}

/// A trajectory cut into consecutive stages.
#[derive(Debug, Clone, PartialEq)]
pub struct Segmentation {
    /// Mean probability of the states under their stages, in [0, 1].
    pub value: f64,
    /// First step of each stage that was reached; the first one starts at 0.
    pub starts: Vec<usize>,
}

impl Segmentation {
    /// The stage of a step, from 0: the paper's G(step) − 1.
    pub fn stage_of(&self, step: usize) -> usize {
        self.starts.partition_point(|&start| start <= step) - 1
    }
}

/// The most likely way through the stages: it begins in the first and goes on by at most one
/// stage a step. The last stage need not be reached. Of equally likely ways, the one that
/// changes stage earliest as seen from the end.
///
/// Dynamic programming over V_t(j) = F(s_t, ω_j) + max(V_{t−1}(j), V_{t−1}(j − 1)): `T·N` time
/// and one bit's worth of memory for each cell.
///
/// Source: STAIR, Eq. 3.
///
/// ```
/// use domain::stage::{StageProbabilities, best_segmentation};
/// let grasp_then_pull = [0.9, 0.1, 0.8, 0.2, 0.1, 0.9];
/// let table = StageProbabilities::new(grasp_then_pull.to_vec(), 2).unwrap();
/// assert_eq!(best_segmentation(&table).starts, [0, 2]);
/// ```
pub fn best_segmentation(table: &StageProbabilities) -> Segmentation {
    let (n_states, n_stages) = (table.n_states(), table.n_stages);
    let mut best = vec![f64::NEG_INFINITY; n_stages];
    let mut next = best.clone();
    let mut advanced = vec![false; n_states * n_stages];
    best[0] = f64::from(table.row(0)[0]);
    for step in 1..n_states {
        let row = table.row(step);
        next[0] = best[0] + f64::from(row[0]);
        let cells = advanced[step * n_stages..][..n_stages].iter_mut();
        let columns = next.iter_mut().zip(cells).zip(row).skip(1);
        for (pair, ((next, advanced), p)) in best.windows(2).zip(columns) {
            *advanced = pair[0] > pair[1];
            *next = f64::from(*p) + pair[0].max(pair[1]);
        }
        std::mem::swap(&mut best, &mut next);
    }
    let last = (0..n_stages).fold(0, |at, j| if best[j] > best[at] { j } else { at });
    Segmentation {
        value: best[last] / n_states as f64,
        starts: starts(&advanced, n_stages, last),
    }
}

/// Reads the way back from its last stage.
fn starts(advanced: &[bool], n_stages: usize, last: usize) -> Vec<usize> {
    let mut stage = last;
    let mut starts = Vec::with_capacity(last + 1);
    for step in (1..advanced.len() / n_stages).rev() {
        if advanced[step * n_stages + stage] {
            starts.push(step);
            stage -= 1;
        }
    }
    starts.push(0);
    starts.reverse();
    starts
}

/// How well a task can be cut into stages: the mean value of the best segmentation over
/// trajectories of its optimal policy, in [0, 1]; `None` without trajectories.
///
/// Source: STAIR, the multi-stage measure below Eq. 3. With as many stages as steps every
/// trajectory can follow its own clock, so compare tasks at equal numbers of stages.
pub fn multi_stage_measure(trajectories: &[StageProbabilities]) -> Option<f64> {
    let sum: f64 = trajectories
        .iter()
        .map(|table| best_segmentation(table).value)
        .sum();
    (!trajectories.is_empty()).then(|| sum / trajectories.len() as f64)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::random::{Rng, Stream};

    fn random_table(rng: &mut Rng, n_states: usize, n_stages: usize) -> StageProbabilities {
        let values = (0..n_states * n_stages).map(|_| rng.uniform() as f32);
        StageProbabilities::new(values.collect(), n_stages).unwrap()
    }

    /// Value and way of the best of all ways, each tried.
    fn tried_one_by_one(table: &StageProbabilities) -> (f64, Vec<usize>) {
        let n_states = table.n_states();
        let mut best = (f64::NEG_INFINITY, Vec::new());
        for steps_up in 0_u32..1 << (n_states - 1) {
            let way: Vec<usize> = (0..n_states)
                .map(|t| (steps_up & ((1 << t) - 1)).count_ones() as usize)
                .collect();
            if way[n_states - 1] >= table.n_stages() {
                continue;
            }
            let mut sum = 0.0;
            for (t, &stage) in way.iter().enumerate() {
                sum += f64::from(table.row(t)[stage]);
            }
            if sum > best.0 {
                best = (sum, way);
            }
        }
        (best.0 / n_states as f64, best.1)
    }

    #[test]
    fn a_thousand_random_trajectories_are_cut_as_by_trying_every_way() {
        let mut rng = Rng::new(0, Stream::Test, 0);
        for case in 0..1_000 {
            let (n_states, n_stages) = (1 + rng.below(11), 1 + rng.below(7));
            let table = random_table(&mut rng, n_states, n_stages);
            let found = best_segmentation(&table);
            let (value, way) = tried_one_by_one(&table);
            assert_eq!(found.value.to_bits(), value.to_bits(), "case {case}");
            let stages: Vec<usize> = (0..n_states).map(|t| found.stage_of(t)).collect();
            assert_eq!(stages, way, "case {case}");
        }
    }

    #[test]
    fn a_trajectory_that_shows_one_stage_after_the_other_is_cut_where_they_change() {
        let stages = [0, 0, 0, 1, 1, 2, 2, 2];
        let values = stages
            .iter()
            .flat_map(|&s| (0..4).map(move |j| f32::from(u8::from(j == s))));
        let table = StageProbabilities::new(values.collect(), 4).unwrap();
        let found = best_segmentation(&table);
        assert_eq!(found.starts, [0, 3, 5], "the fourth stage is never reached");
        assert!((found.value - 1.0).abs() < 1e-12);
        assert_eq!(multi_stage_measure(&[table]), Some(1.0));
    }

    #[test]
    fn one_stage_leaves_the_mean_of_its_column() {
        let table = StageProbabilities::new(vec![0.25, 0.5, 0.75], 1).unwrap();
        let found = best_segmentation(&table);
        assert_eq!((found.value, found.starts), (0.5, vec![0]));
    }

    /// Seven steps into three stages: ⌈3/7⌉, ⌈6/7⌉ = 1; ⌈9/7⌉, ⌈12/7⌉ = 2; ⌈15/7⌉ … ⌈21/7⌉ = 3.
    #[test]
    fn merged_stages_are_the_papers_and_their_probabilities_add_up() {
        let stages: Vec<usize> = (0..7).map(|step| merged_stage(step, 7, 3)).collect();
        assert_eq!(stages, [0, 0, 1, 1, 2, 2, 2]);
        let row = vec![0.05, 0.1, 0.15, 0.2, 0.25, 0.05, 0.2];
        let table = StageProbabilities::new(row, 7).unwrap();
        let merged = table.merged(3);
        for (found, expected) in merged.row(0).iter().zip([0.15, 0.35, 0.5]) {
            assert!((found - expected).abs() < 1e-6, "{merged:?}");
        }
        assert_eq!(table.merged(7), table);
        assert!((table.merged(1).row(0)[0] - 1.0).abs() < 1e-6);
    }

    #[test]
    fn tables_that_hold_no_probabilities_are_refused_with_their_place() {
        assert_eq!(StageProbabilities::new(vec![], 2), Err(StageError::Empty));
        let ragged = StageProbabilities::new(vec![0.5; 3], 2);
        assert!(matches!(ragged, Err(StageError::Ragged { .. })));
        let told = StageProbabilities::new(vec![0.5, 0.5, f32::NAN, 0.5], 2).unwrap_err();
        assert!(told.to_string().contains("stage 0 at step 1"), "{told}");
        assert_eq!(multi_stage_measure(&[]), None);
    }

    #[test]
    fn a_classifier_of_steps_gives_at_least_the_square_of_its_accuracy() {
        // F(s, t) calibrated and certain half of the time: E[m²] bounds the measure from below.
        let n = 12;
        let values = (0..n).flat_map(|t| {
            let m: f32 = if t % 2 == 0 { 1.0 } else { 0.4 };
            (0..n).map(move |j| {
                if j == t {
                    m
                } else {
                    (1.0 - m) / (n - 1) as f32
                }
            })
        });
        let table = StageProbabilities::new(values.collect(), n).unwrap();
        let (mean, square): (f64, f64) = (0.7, f64::midpoint(1.0, 0.16));
        let measure = multi_stage_measure(&[table]).unwrap();
        assert!(measure >= square && square >= mean.powi(2), "{measure}");
    }
}
