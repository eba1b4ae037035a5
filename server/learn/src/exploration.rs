//! Novelty as a reward, for exploring before anybody has been asked.

use serde::{Deserialize, Serialize};
use tch::Tensor;

use crate::checkpoint::Archive;
use crate::error::LearnError;
use crate::kernel;
use crate::replay::Replay;

/// Settings of unsupervised exploration.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct ExplorationConfig {
    /// Whether the agent learns from novelty until the first session.
    pub is_unsupervised: bool,
    /// Which nearest neighbour the novelty is measured to, not counting the state itself.
    pub neighbours: usize,
    /// How novelty becomes a reward.
    pub novelty: Novelty,
    /// Whether the running standard deviation carries the slip of all BPref forks: the mean
    /// moves by δ + n_b/n instead of δ·n_b/n, which shrinks early novelty several times.
    pub bpref_running_std: bool,
}

impl Default for ExplorationConfig {
    fn default() -> Self {
        Self {
            is_unsupervised: true,
            neighbours: 5,
            novelty: Novelty::Scaled,
            bpref_running_std: false,
        }
    }
}

/// How the distance h to a neighbour becomes a reward; μ and σ are its running moments.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Novelty {
    /// h/σ. PEBBLE's.
    Scaled,
    /// (h − μ)/3σ, cut to [−1, 1]: on the scale of learned rewards. RIME's.
    Centred,
}

/// A bonus for steps whose reward the ensemble's members disagree about, fading with time:
/// β₀ (1 − ρ)ᵗ. Defaults: RUNE's released settings.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct BonusConfig {
    /// β₀.
    pub initial: f64,
    /// ρ, of each environment step.
    ///
    /// Differs from the paper: STAIR's comparison has 1e-3, with which nothing is left of the
    /// bonus at the first session (2.3e-6 after 10,000 steps).
    pub decay: f64,
}

impl Default for BonusConfig {
    fn default() -> Self {
        Self {
            initial: 0.05,
            decay: 1e-5,
        }
    }
}

impl BonusConfig {
    /// β at an environment step.
    ///
    /// ```
    /// let rune = learn::exploration::BonusConfig::default();
    /// assert_eq!(rune.weight(0), 0.05);
    /// assert!((rune.weight(100_000) - 0.018_394).abs() < 1e-6); // 0.05/e, nearly
    /// ```
    pub fn weight(&self, step: u64) -> f64 {
        self.initial * (step as f64 * (-self.decay).ln_1p()).exp()
    }
}

/// States compared at once: their distances stay in the cache.
const CHUNK_STATES: usize = 512;

/// Distance to the k-th nearest visited state over its running standard deviation.
///
/// Source: PEBBLE, §4.1, as in BPref's code: no logarithm, no mean subtracted.
pub struct StateEntropy {
    config: ExplorationConfig,
    running: RunningStd,
    /// Smallest and largest distance seen.
    range: (f64, f64),
}

impl StateEntropy {
    /// With nothing seen.
    pub fn new(config: &ExplorationConfig) -> Self {
        crate::device::init();
        Self {
            config: config.clone(),
            running: RunningStd::new(),
            range: (f64::INFINITY, f64::NEG_INFINITY),
        }
    }

    /// Novelty of a batch of states `[B × S]` from the replay against all states in it, `[B]`.
    pub fn intrinsic(&mut self, batch_observations: &[f32], replay: &Replay) -> Vec<f32> {
        let distances = self.distances(batch_observations, replay);
        self.running
            .update(&distances, self.config.bpref_running_std);
        let seen = distances.iter().copied().map(f64::from);
        self.range.0 = seen.clone().fold(self.range.0, f64::min);
        self.range.1 = seen.fold(self.range.1, f64::max);
        let (mean, std) = (self.running.mean, self.running.variance.sqrt());
        let reward = |d: &f32| match self.config.novelty {
            Novelty::Scaled => f64::from(*d) / std,
            Novelty::Centred => ((f64::from(*d) - mean) / (3.0 * std)).clamp(-1.0, 1.0),
        };
        distances.iter().map(|d| reward(d) as f32).collect()
    }

    /// What a reward model is warm-started on: (h − μ)/σ over its largest magnitude so far, in
    /// [−1, 1] for all distances seen, `[B]`. Changes nothing.
    ///
    /// Source: RIME, §4.3, as in its released code.
    pub fn warm_targets(&self, batch_observations: &[f32], replay: &Replay) -> Vec<f32> {
        let mean = self.running.mean;
        let reach = (self.range.0 - mean).abs().max((self.range.1 - mean).abs());
        let reach = if reach.is_finite() && reach > 0.0 {
            reach
        } else {
            1.0
        };
        let distances = self.distances(batch_observations, replay);
        distances
            .iter()
            .map(|d| ((f64::from(*d) - mean) / reach) as f32)
            .collect()
    }

    fn distances(&self, batch_observations: &[f32], replay: &Replay) -> Vec<f32> {
        neighbour_distances(
            batch_observations,
            replay.shape().observation,
            replay.visited_states(),
            self.config.neighbours,
        )
    }

    /// The running moments and the range.
    pub fn save(&self, archive: &mut Archive) {
        let RunningStd {
            mean,
            variance,
            count,
        } = self.running;
        let (lo, hi) = self.range;
        archive.put_f64("exploration", &[mean, variance, count, lo, hi]);
    }

    /// What [`StateEntropy::save`] wrote.
    ///
    /// # Errors
    /// When the section is missing.
    pub fn load(&mut self, archive: &Archive) -> Result<(), LearnError> {
        let [mean, variance, count, lo, hi] = archive.f64("exploration")?;
        self.range = (lo, hi);
        self.running = RunningStd {
            mean,
            variance,
            count,
        };
        Ok(())
    }
}

/// Distance of each of `queries` to its k-th nearest of `states` beside itself (the (k+1)-th
/// smallest distance; 0 while there are fewer states).
///
/// Products find the neighbours (|x|² − 2xy), whose distances are then computed from the
/// differences: near ones lose no digits.
fn neighbour_distances<'a>(
    queries: &[f32],
    size: usize,
    states: impl Iterator<Item = &'a [f32]>,
    k: usize,
) -> Vec<f32> {
    let n_queries = queries.len() / size;
    let mut nearest: Vec<Nearest> = (0..n_queries).map(|_| Nearest::new(k + 1)).collect();
    let doubled: Vec<f32> = queries.iter().map(|x| -2.0 * x).collect();
    let doubled = Tensor::from_slice(&doubled).view([n_queries as i64, size as i64]);
    let mut chunk: Vec<f32> = Vec::with_capacity(CHUNK_STATES * size);
    let mut compare = |chunk: &[f32]| {
        let states = Tensor::from_slice(chunk).view([-1, size as i64]);
        let squares: Vec<f32> = chunk
            .chunks_exact(size)
            .map(|s| s.iter().map(|x| x * x).sum())
            .collect();
        let keys = Tensor::from_slice(&squares).addmm(&doubled, &states.transpose(0, 1));
        let rows = kernel::values::<f32>(&keys).chunks_exact(squares.len());
        for ((nearest, keys), query) in nearest.iter_mut().zip(rows).zip(queries.chunks_exact(size))
        {
            nearest.take(keys, query, chunk);
        }
    };
    for mut episode in states {
        while !episode.is_empty() {
            let room = CHUNK_STATES * size - chunk.len();
            let (own, rest) = episode.split_at(room.min(episode.len()));
            chunk.extend_from_slice(own);
            episode = rest;
            if chunk.len() == CHUNK_STATES * size {
                compare(&chunk);
                chunk.clear();
            }
        }
    }
    if !chunk.is_empty() {
        compare(&chunk);
    }
    nearest.iter().map(Nearest::last_distance).collect()
}

/// The smallest keys of one query so far, ascending, with their true squared distances.
struct Nearest {
    n: usize,
    keys: Vec<(f32, f32)>,
}

impl Nearest {
    fn new(n: usize) -> Self {
        Self {
            n,
            keys: Vec::with_capacity(n + 1),
        }
    }

    fn take(&mut self, keys: &[f32], query: &[f32], states: &[f32]) {
        const STRIP: usize = 16;
        let size = query.len();
        for (strip, own) in keys.chunks(STRIP).enumerate() {
            let mut bound = self.bound();
            if own.iter().all(|key| *key >= bound) {
                continue;
            }
            for (place, &key) in own.iter().enumerate() {
                if key < bound {
                    let at = (strip * STRIP + place) * size;
                    let square = query
                        .iter()
                        .zip(&states[at..at + size])
                        .map(|(a, b)| (a - b) * (a - b))
                        .sum();
                    self.insert(key, square);
                    bound = self.bound();
                }
            }
        }
    }

    fn bound(&self) -> f32 {
        if self.keys.len() < self.n {
            f32::INFINITY
        } else {
            self.keys[self.n - 1].0
        }
    }

    fn insert(&mut self, key: f32, square: f32) {
        let place = self.keys.partition_point(|(other, _)| *other <= key);
        self.keys.insert(place, (key, square));
        self.keys.truncate(self.n);
    }

    fn last_distance(&self) -> f32 {
        if self.keys.len() < self.n {
            return 0.0;
        }
        self.keys
            .iter()
            .map(|(_, square)| *square)
            .fold(0.0, f32::max)
            .sqrt()
    }
}

/// Moments over everything seen (Chan's parallel update), started with a variance of 1 that
/// counts 1e-4.
#[derive(Debug, Clone, Copy)]
struct RunningStd {
    mean: f64,
    variance: f64,
    count: f64,
}

impl RunningStd {
    fn new() -> Self {
        Self {
            mean: 0.0,
            variance: 1.0,
            count: 1e-4,
        }
    }

    fn update(&mut self, values: &[f32], has_bpref_slip: bool) {
        let n = values.len() as f64;
        if values.is_empty() {
            return;
        }
        let mean = values.iter().copied().map(f64::from).sum::<f64>() / n;
        let square = |v: &f32| (f64::from(*v) - mean).powi(2);
        let variance = values.iter().map(square).sum::<f64>() / (n - 1.0).max(1.0);
        let (delta, total) = (mean - self.mean, self.count + n);
        let squares =
            self.variance * self.count + variance * n + delta * delta * self.count * n / total;
        self.mean += if has_bpref_slip {
            delta + n / total
        } else {
            delta * n / total
        };
        self.variance = squares / total;
        self.count = total;
    }
}

#[cfg(test)]
mod tests {
    use domain::random::{Rng, Stream};

    use super::*;
    use crate::replay::walked::walked;

    fn replay(n_steps: usize) -> Replay {
        let mut rng = Rng::new(1, Stream::Test, 0);
        let mut state = |_| {
            let mut values = vec![0.0; 7];
            rng.fill_normal(&mut values);
            values
        };
        walked(
            7,
            (0..n_steps / 100).map(|_| (0..=100).map(&mut state).collect()),
        )
    }

    #[test]
    fn the_distance_is_to_the_fifth_neighbour_beside_itself() {
        let replay = replay(1_300);
        let batch = replay.sample(20, &mut Rng::new(2, Stream::Test, 0));
        let found = neighbour_distances(&batch.observation, 7, replay.visited_states(), 5);
        let states: Vec<f32> = replay.visited_states().flatten().copied().collect();
        for (query, found) in batch.observation.chunks(7).zip(found) {
            let squares = states.chunks(7).map(|s| {
                s.iter()
                    .zip(query)
                    .map(|(a, b)| (a - b).powi(2))
                    .sum::<f32>()
            });
            let mut distances: Vec<f32> = squares.map(f32::sqrt).collect();
            distances.sort_by(f32::total_cmp);
            assert!(
                (distances[5] - found).abs() < 1e-5,
                "{} {found}",
                distances[5]
            );
        }
    }

    #[test]
    fn the_running_std_follows_the_data_and_the_slip_inflates_it() {
        let std_after = |n: u64, has_slip| {
            let mut running = RunningStd::new();
            for step in 0..n {
                let mut values = vec![0.0; 512];
                Rng::new(1, Stream::Test, step).fill_normal(&mut values);
                for value in &mut values {
                    *value *= 0.1;
                }
                running.update(&values, has_slip);
            }
            running.variance.sqrt()
        };
        assert!((std_after(101, false) - 0.1).abs() < 0.002);
        // emulated with the released code: 0.504 after 2, 0.141 after 101 updates
        assert!((std_after(2, true) - 0.504).abs() < 0.01);
        assert!((std_after(101, true) - 0.141).abs() < 0.005);
    }

    /// RIME's: rewards of a learned reward's scale, and targets that reach −1 or 1.
    #[test]
    fn centred_novelty_and_warm_targets_lie_between_minus_one_and_one() {
        let replay = replay(1_300);
        let config = ExplorationConfig {
            novelty: Novelty::Centred,
            ..ExplorationConfig::default()
        };
        let (mut centred, mut scaled) = (
            StateEntropy::new(&config),
            StateEntropy::new(&ExplorationConfig::default()),
        );
        let batch = replay.sample(200, &mut Rng::new(2, Stream::Test, 0));
        let centred_rewards = centred.intrinsic(&batch.observation, &replay);
        let scaled_rewards = scaled.intrinsic(&batch.observation, &replay);
        let (mean, std) = (centred.running.mean, centred.running.variance.sqrt());
        for (c, s) in centred_rewards.iter().zip(&scaled_rewards) {
            let expected = ((f64::from(*s) - mean / std) / 3.0).clamp(-1.0, 1.0);
            assert!((f64::from(*c) - expected).abs() < 1e-5);
        }
        let targets = centred.warm_targets(&batch.observation, &replay);
        let largest = targets.iter().fold(0.0_f32, |m, t| m.max(t.abs()));
        assert!((largest - 1.0).abs() < 1e-6, "{largest}");
        assert!(targets.iter().any(|t| *t < 0.0) && targets.iter().any(|t| *t > 0.0));
    }

    #[test]
    fn a_bonus_fades_by_a_fixed_share_of_itself_each_step() {
        let rune = BonusConfig::default();
        let ratio = rune.weight(5_001) / rune.weight(5_000);
        assert!((ratio - (1.0 - 1e-5)).abs() < 1e-12);
        let papers = BonusConfig {
            decay: 1e-3,
            ..rune
        };
        assert!((papers.weight(10_000) - 2.26e-6).abs() < 1e-8);
        assert!((rune.weight(10_000) - 0.045_24).abs() < 1e-5);
    }

    #[test]
    fn an_interrupted_explorer_goes_on_bit_for_bit() {
        let replay = replay(300);
        let batch = replay
            .sample(20, &mut Rng::new(2, Stream::Test, 0))
            .observation;
        let config = ExplorationConfig::default();
        let (mut whole, mut resumed) = (StateEntropy::new(&config), StateEntropy::new(&config));
        whole.intrinsic(&batch, &replay);
        let mut archive = Archive::new();
        whole.save(&mut archive);
        resumed.load(&archive).expect("loads");
        assert_eq!(
            whole.intrinsic(&batch, &replay),
            resumed.intrinsic(&batch, &replay)
        );
    }
}
