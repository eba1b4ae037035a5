//! How well the step at which a state was seen can be told from the state, and what that says
//! about stages.
//!
//! A classifier gives each state a probability for every step of an episode. Steps in a row make
//! a chain of stages, so that the better steps are told apart, the better the task can be cut:
//! with m(s) the probability of the most likely step and a calibrated classifier,
//! **acc² ≤ E\[m²\] ≤ F**, F being the multi-stage measure.
//!
//! Source: STAIR, the proposition on the timestep classifier. Differs from the paper, whose
//! proof multiplies acc with E\[m\] as if they were independent and takes merged steps for never
//! harder to tell apart. Neither is needed: to follow the clock is one way through the stages, so
//! F ≥ E\[p(true step)\] ≥ E\[m where m's step is right\], with any classifier. Calibration makes
//! of the latter E\[m²\] and of E\[m\] the accuracy; E\[m²\] ≥ E\[m\]² always.

use serde::{Deserialize, Serialize};

use super::{StageProbabilities, best_segmentation, merged_stage};

/// Numbers of stages that are reported, where an episode has more steps; the last one reported
/// is the number of steps, each a stage of its own.
pub const STAGES: [usize; 6] = [2, 5, 10, 20, 50, 100];
/// How many steps a guess may be off, where an episode has more.
pub const OFF_BY: [usize; 12] = [0, 1, 2, 3, 5, 10, 15, 20, 30, 50, 75, 100];
/// Bins of the calibration: m in (b/15, (b + 1)/15].
///
/// Source: Guo et al., "On calibration of modern neural networks" (2017), who also use 15.
pub const N_BINS: usize = 15;
/// Of the rows that the released script trains on and judges, the share that is filled.
const RELEASED_FILLED: f64 = 0.1;

/// Adds up trajectories, one at a time: their tables need not be in memory together.
#[derive(Debug, Clone)]
pub struct TimestepTally {
    n_steps: usize,
    /// States by how many steps the guess was off, `[T]`.
    off_by: Vec<usize>,
    /// States that were taken for the first of an episode.
    n_guessed_first: usize,
    bins: [BinSum; N_BINS],
    stages: Vec<StageSum>,
}

#[derive(Debug, Clone, Copy, Default)]
struct BinSum {
    n: usize,
    n_right: usize,
    confidence: f64,
}

/// Sums over states.
#[derive(Debug, Clone, Copy)]
struct StageSum {
    n_stages: usize,
    right: f64,
    confidence: f64,
    confidence_squared: f64,
    right_confidence: f64,
    segmented: f64,
}

/// What a classifier of steps came to, over the states of trajectories that it was not fitted
/// to.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct TimestepReport {
    /// Steps that are told apart, `T`; a guess at random is right once in `T`.
    pub n_steps: usize,
    /// States that were judged.
    pub n_states: usize,
    /// How often the most likely step is the true one, or near it.
    pub within: Vec<Within>,
    /// Whether the classifier is as sure as it is right.
    pub calibration: Calibration,
    /// By number of stages, fewest first; in the last, each step is a stage.
    pub stages: Vec<StageMeasures>,
    /// What the released script would print as the accuracy of this classifier. Its buffer is
    /// empty in nine rows of ten (state 0, step 0, taken to be guessed as such), and it compares
    /// every guess with every label: about 0.81, whatever the accuracy is.
    pub as_released: f64,
}

/// Share of the states whose most likely step is off by at most some steps.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Within {
    /// How many steps a guess may be off, `k`.
    pub k: usize,
    /// In [0, 1]; at `k` = 0 the accuracy.
    pub accuracy: f64,
}

/// How sure the classifier is of the most likely step, against how often it is right.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Calibration {
    /// Expected calibration error: Σ n_b/n · |accuracy − confidence| over the bins, in [0, 1].
    pub ece: f64,
    /// Of [`N_BINS`] of equal width, those that hold states, least confident first.
    pub bins: Vec<Bin>,
}

/// States of which the classifier is about equally sure.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Bin {
    /// How many.
    pub n: usize,
    /// Mean probability of the most likely step.
    pub confidence: f64,
    /// How often it is the true one.
    pub accuracy: f64,
}

/// The multi-stage measure and what bounds it from below, with consecutive steps merged into
/// stages ([`StageProbabilities::merged`]). m is the probability of the most likely stage.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct StageMeasures {
    /// Stages, `N`.
    pub n_stages: usize,
    /// acc: how often the most likely stage is that of the true step.
    pub accuracy: f64,
    /// E\[m\]; the accuracy, of a calibrated classifier.
    pub confidence: f64,
    /// acc²: at most F, of a calibrated classifier.
    pub accuracy_squared: f64,
    /// E\[m²\]: at most F, of a calibrated classifier.
    pub confidence_squared: f64,
    /// E\[m where the most likely stage is right\]: at most F, of any classifier.
    pub right_confidence: f64,
    /// F, exactly: the mean over all states of their probability along the best segmentation of
    /// their trajectory.
    pub measure: f64,
}

impl TimestepTally {
    /// Nothing yet, of episodes with so many steps.
    pub fn new(n_steps: usize) -> Self {
        let fewer = STAGES.into_iter().filter(|&n| n < n_steps);
        Self {
            n_steps,
            off_by: vec![0; n_steps],
            n_guessed_first: 0,
            bins: [BinSum::default(); N_BINS],
            stages: fewer.chain([n_steps]).map(StageSum::new).collect(),
        }
    }

    /// Adds a trajectory: how likely each of its states, in order from step 0 on, is of each
    /// step.
    ///
    /// # Panics
    /// When the table is not of `n_steps` steps or has more states than that.
    pub fn add(&mut self, table: &StageProbabilities) {
        let (n_states, n_steps) = (table.n_states(), table.n_stages());
        assert!(
            n_steps == self.n_steps && n_states <= n_steps,
            "{n_states} states with probabilities of {n_steps} steps are none of an episode of {}",
            self.n_steps
        );
        for step in 0..n_states {
            let (guess, confidence) = most_likely(table.row(step));
            self.off_by[guess.abs_diff(step)] += 1;
            self.n_guessed_first += usize::from(guess == 0);
            self.bins[bin_of(confidence)].add(confidence, guess == step);
        }
        for sum in &mut self.stages {
            sum.add(&table.merged(sum.n_stages), n_steps);
        }
    }

    /// What it came to; `None` without a trajectory.
    pub fn report(&self) -> Option<TimestepReport> {
        let n_states: usize = self.off_by.iter().sum();
        if n_states == 0 {
            return None;
        }
        let share = |n: usize| n as f64 / n_states as f64;
        let allowed = OFF_BY.into_iter().filter(|&k| k < self.n_steps);
        let within = allowed.map(|k| Within {
            k,
            accuracy: share(self.off_by[..=k].iter().sum()),
        });
        Some(TimestepReport {
            n_steps: self.n_steps,
            n_states,
            within: within.collect(),
            calibration: calibration(&self.bins),
            stages: self.stages.iter().map(|s| s.measures(n_states)).collect(),
            as_released: as_released(share(self.n_guessed_first), self.n_steps),
        })
    }
}

impl BinSum {
    fn add(&mut self, confidence: f64, is_right: bool) {
        self.n += 1;
        self.n_right += usize::from(is_right);
        self.confidence += confidence;
    }
}

impl StageSum {
    fn new(n_stages: usize) -> Self {
        Self {
            n_stages,
            right: 0.0,
            confidence: 0.0,
            confidence_squared: 0.0,
            right_confidence: 0.0,
            segmented: 0.0,
        }
    }

    /// Adds a trajectory with its steps merged into stages.
    fn add(&mut self, table: &StageProbabilities, n_steps: usize) {
        for step in 0..table.n_states() {
            let (guess, confidence) = most_likely(table.row(step));
            self.confidence += confidence;
            self.confidence_squared += confidence.powi(2);
            if guess == merged_stage(step, n_steps, self.n_stages) {
                self.right += 1.0;
                self.right_confidence += confidence;
            }
        }
        self.segmented += best_segmentation(table).value * table.n_states() as f64;
    }

    fn measures(&self, n_states: usize) -> StageMeasures {
        let mean = |sum: f64| sum / n_states as f64;
        StageMeasures {
            n_stages: self.n_stages,
            accuracy: mean(self.right),
            confidence: mean(self.confidence),
            accuracy_squared: mean(self.right).powi(2),
            confidence_squared: mean(self.confidence_squared),
            right_confidence: mean(self.right_confidence),
            measure: mean(self.segmented),
        }
    }
}

/// The most likely column, the first of several, with its probability.
fn most_likely(row: &[f32]) -> (usize, f64) {
    let columns = row.iter().copied().enumerate();
    let (at, p) = columns.fold(
        (0, row[0]),
        |best, here| {
            if here.1 > best.1 { here } else { best }
        },
    );
    (at, f64::from(p))
}

fn bin_of(confidence: f64) -> usize {
    let above = (confidence * N_BINS as f64).ceil() as usize;
    above.clamp(1, N_BINS) - 1
}

fn calibration(bins: &[BinSum]) -> Calibration {
    let filled = bins.iter().filter(|bin| bin.n > 0);
    let bins: Vec<Bin> = filled
        .map(|bin| Bin {
            n: bin.n,
            confidence: bin.confidence / bin.n as f64,
            accuracy: bin.n_right as f64 / bin.n as f64,
        })
        .collect();
    let n_states: usize = bins.iter().map(|bin| bin.n).sum();
    let gap = |bin: &Bin| bin.n as f64 * (bin.accuracy - bin.confidence).abs();
    Calibration {
        ece: bins.iter().map(gap).sum::<f64>() / n_states.max(1) as f64,
        bins,
    }
}

/// P(guess = label) of a guess and a label drawn apart from one another out of the released
/// script's buffer, whose filled rows have every step equally often.
fn as_released(guessed_first: f64, n_steps: usize) -> f64 {
    let empty = 1.0 - RELEASED_FILLED;
    let label = RELEASED_FILLED / n_steps as f64;
    let first = (empty + RELEASED_FILLED * guessed_first) * (empty + label);
    first + RELEASED_FILLED * (1.0 - guessed_first) * label
}

#[cfg(test)]
mod tests;
