//! The reward ensemble: per-step rewards learned from preferences between segments.

use domain::answer::Preference;
use domain::query::Query;
use domain::random::{Rng, Stream};
use tch::{Kind, Tensor};

use crate::checkpoint::Archive;
use crate::device::Device;
use crate::error::LearnError;
use crate::init;
use crate::net::{Net, Parameters, matrix, to_vec};
use crate::replay::Replay;

mod chunk;
mod config;
mod denoise;
mod fit;
mod learner;
mod meta;
mod semi;

use chunk::{Chunk, longest};
use fit::{Example, Pass, summary};

pub use config::RewardConfig;
pub use denoise::{Denoising, DenoisingConfig};
pub use learner::{Lesson, RewardLearner, Supervised};
pub use meta::SteeringConfig;
pub use semi::{SemiSupervised, SemiSupervisedConfig};

/// A query with what was preferred.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Labeled {
    /// References into the replay.
    pub query: Query,
    /// Of the two segments.
    pub preference: Preference,
}

/// What fitting did.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct RewardFit {
    /// Passes over all preferences.
    pub n_epochs: u32,
    /// Cross-entropy of the last pass, nats, mean over members; SURF's of all passes, with its
    /// crops.
    pub loss: f32,
    /// Share that was right during the same, mean over members; equal preferences, which cannot be
    /// right, are left out.
    pub accuracy: f32,
}

/// What the members say about steps.
#[derive(Debug, Clone, PartialEq)]
pub struct Estimate {
    /// Mean over members, in (−1, 1) unless it is normalised, `[n]`.
    pub rewards: Vec<f32>,
    /// std over members (their number in the denominator) of what is in `rewards`, `[n]`.
    pub disagreements: Vec<f32>,
}

impl Estimate {
    /// Nothing is known of `n` steps: zeros.
    pub fn unknown(n: usize) -> Self {
        Self {
            rewards: vec![0.0; n],
            disagreements: vec![0.0; n],
        }
    }
}

/// Of `LeakyReLU`, as PyTorch's default.
const SLOPE: f64 = 0.01;
/// Rows that are computed at once, per member: their hidden layers stay in the cache.
const CHUNK_ROWS: usize = 2_048;

/// Rewards that vary less are not normalised: there is nothing to be told apart.
const LEAST_VARIANCE: f64 = 1e-8;

/// Several reward models of one form, trained side by side on the same preferences.
pub struct RewardEnsemble {
    config: RewardConfig,
    seed: u64,
    options: (Kind, tch::Device),
    columns: i64,
    parameters: Parameters,
    net: Net,
    gradient: Net,
    scale: Scale,
    n_epochs: u64,
}

/// From what the members say to the reward that is learned from: `factor · (r − offset)`.
#[derive(Debug, Clone, Copy, PartialEq)]
struct Scale {
    offset: f64,
    factor: f64,
}

impl Scale {
    const NONE: Self = Self {
        offset: 0.0,
        factor: 1.0,
    };

    fn apply(self, rewards: &mut [f32]) {
        if self != Self::NONE {
            for reward in rewards {
                *reward = (self.factor * (f64::from(*reward) - self.offset)) as f32;
            }
        }
    }

    /// The same to a spread, which has no level.
    fn stretch(self, spreads: &mut [f32]) {
        if self != Self::NONE {
            for spread in spreads {
                *spread = (self.factor * f64::from(*spread)) as f32;
            }
        }
    }
}

impl RewardEnsemble {
    /// Fresh weights that follow from `seed`.
    pub fn new(
        config: &RewardConfig,
        observation_size: usize,
        action_size: usize,
        seed: u64,
        device: Device,
    ) -> Self {
        let sizes = (observation_size, action_size);
        Self::with_kind(config, sizes, seed, (Kind::Float, device.0))
    }

    fn with_kind(
        config: &RewardConfig,
        sizes: (usize, usize),
        seed: u64,
        options: (Kind, tch::Device),
    ) -> Self {
        crate::device::init();
        let shape = config.shape(sizes);
        let parameters = Parameters::new(shape.n_values(), config.learning_rate, options);
        let mut net = Net::over(&shape, &parameters.values, 0);
        init::uniform(&mut net, &mut Rng::new(seed, Stream::Weights, FIRST_KEY));
        Self {
            config: config.clone(),
            seed,
            options,
            columns: (sizes.0 + sizes.1) as i64,
            gradient: Net::over(&shape, &parameters.gradient, 0),
            parameters,
            net,
            scale: Scale::NONE,
            n_epochs: 0,
        }
    }

    /// Each member's logits of its own queries, `[M][n]`.
    fn member_logits(&self, replay: &Replay, queries: &[Query]) -> Vec<f64> {
        let n = queries.len() / self.config.members;
        let longest = queries.iter().map(longest).max().unwrap_or(1);
        let pairs_at_once = (CHUNK_ROWS / (2 * longest)).max(1);
        let mut all_logits = vec![0.0; queries.len()];
        for start in (0..n).step_by(pairs_at_once) {
            let end = n.min(start + pairs_at_once);
            let own = |member: usize| member * n + start..member * n + end;
            let pairs = (0..self.config.members).flat_map(|member| &queries[own(member)]);
            let chunk = self.chunk(replay, pairs, longest);
            let input =
                self.input(&chunk.rows)
                    .view([self.config.members as i64, -1, self.columns]);
            let logits = chunk.logits(&to_vec(&self.net.forward(&input).tanh()));
            for (member, logits) in logits.chunks(end - start).enumerate() {
                all_logits[own(member)].copy_from_slice(logits);
            }
        }
        all_logits
    }

    /// Each step's reward, `[n]`, for rows `[n × S]`, `[n × A]`: the mean over members, in
    /// (−1, 1) unless it is normalised.
    pub fn predict(&self, observations: &[f32], actions: &[f32]) -> Vec<f32> {
        self.estimate(observations, actions).rewards
    }

    /// The same with the members' disagreement about each.
    pub fn estimate(&self, observations: &[f32], actions: &[f32]) -> Estimate {
        let mut estimate = Estimate::unknown(0);
        if actions.is_empty() {
            return estimate;
        }
        let n_numbers = observations.len() + actions.len();
        let n_rows = (n_numbers as i64 / self.columns) as usize;
        let rows = joined(observations, actions, n_rows);
        for rows in rows.chunks(CHUNK_ROWS * self.columns as usize) {
            let mut own = self.moments(rows);
            self.scale.apply(&mut own.rewards);
            self.scale.stretch(&mut own.disagreements);
            estimate.rewards.extend(own.rewards);
            estimate.disagreements.extend(own.disagreements);
        }
        estimate
    }

    /// Rewrites the learned reward of every transition, and the members' disagreement about it
    /// where the replay keeps it; brings the rewards to [`RewardConfig::normalized_std`], here
    /// and in what is predicted until the next relabelling.
    pub fn relabel(&mut self, replay: &mut Replay) {
        let mut rows = Vec::new();
        let (mut n, mut sum, mut squares) = (0.0, 0.0, 0.0);
        for lane in 0..replay.n_lanes() {
            let n_steps = replay.lane_len(lane);
            for start in (0..n_steps).step_by(CHUNK_ROWS) {
                let end = n_steps.min(start + CHUNK_ROWS);
                rows.clear();
                replay.append_lane_rows(lane, start..end, &mut rows);
                let own = self.moments(&rows);
                for reward in own.rewards.iter().copied().map(f64::from) {
                    n += 1.0;
                    sum += reward;
                    squares += reward * reward;
                }
                replay.learned_rewards_mut(lane)[start..end].copy_from_slice(&own.rewards);
                if replay.keeps_disagreement() {
                    replay.disagreements_mut(lane)[start..end].copy_from_slice(&own.disagreements);
                }
            }
        }
        let variance: f64 = squares / n - (sum / n) * (sum / n);
        self.scale = Scale::NONE;
        if self.config.normalized_std > 0.0 && variance > LEAST_VARIANCE {
            self.scale = Scale {
                offset: sum / n,
                factor: self.config.normalized_std / variance.sqrt(),
            };
            for lane in 0..replay.n_lanes() {
                self.scale.apply(replay.learned_rewards_mut(lane));
                if replay.keeps_disagreement() {
                    self.scale.stretch(replay.disagreements_mut(lane));
                }
            }
        }
    }

    /// P(second ≻ first) of each member for each query, `[M][N]`.
    pub fn probabilities(&self, replay: &Replay, queries: &[Query]) -> Vec<Vec<f32>> {
        let mut probabilities = vec![Vec::with_capacity(queries.len()); self.config.members];
        let longest = queries.iter().map(longest).max().unwrap_or(1);
        for queries in queries.chunks((CHUNK_ROWS / (2 * longest)).max(1)) {
            let chunk = self.chunk(replay, queries.iter(), longest);
            let reward = to_vec(&self.net.forward(&self.input(&chunk.rows)).tanh());
            let own = reward.len() / self.config.members;
            for (member, reward) in probabilities.iter_mut().zip(reward.chunks(own)) {
                member.extend(
                    chunk
                        .logits(reward)
                        .into_iter()
                        .map(|logit| (1.0 / (1.0 + (-logit).exp())) as f32),
                );
            }
        }
        probabilities
    }

    /// Weights, moments and counters.
    pub fn save(&self, archive: &mut Archive) {
        self.parameters.save("reward", archive);
        archive.put_json("reward.epochs", &self.n_epochs);
        archive.put_f64("reward.scale", &[self.scale.offset, self.scale.factor]);
    }

    /// What [`RewardEnsemble::save`] wrote, from any device.
    ///
    /// # Errors
    /// When a section is missing or of another network; part of it may then be loaded.
    pub fn load(&mut self, archive: &Archive) -> Result<(), LearnError> {
        self.parameters.load("reward", archive)?;
        self.n_epochs = archive.json("reward.epochs")?;
        let [offset, factor] = archive.f64("reward.scale")?;
        self.scale = Scale { offset, factor };
        Ok(())
    }

    fn moments(&self, rows: &[f32]) -> Estimate {
        let reward = self.net.forward(&self.input(rows)).tanh();
        let mean = reward.mean_dim([0_i64].as_slice(), false, None);
        let squares = (reward - &mean).square();
        let std = squares.mean_dim([0_i64].as_slice(), false, None).sqrt();
        Estimate {
            rewards: to_vec(&mean),
            disagreements: to_vec(&std),
        }
    }

    fn chunk<'a>(
        &self,
        replay: &Replay,
        queries: impl Iterator<Item = &'a Query>,
        longest: usize,
    ) -> Chunk {
        Chunk::gather(replay, queries, longest, self.config.temperature)
    }

    fn input(&self, rows: &[f32]) -> Tensor {
        matrix(rows, self.columns, self.options)
    }
}

/// Rows of `S + A` from `n_rows` rows of each.
fn joined(observations: &[f32], actions: &[f32], n_rows: usize) -> Vec<f32> {
    let (s, a) = (observations.len() / n_rows, actions.len() / n_rows);
    let rows = observations.chunks_exact(s).zip(actions.chunks_exact(a));
    rows.flat_map(|(s, a)| s.iter().chain(a)).copied().collect()
}

/// std over members (their number in the denominator) of P(second ≻ first), `[N]`.
pub(crate) fn disagreement(probabilities: &[Vec<f32>]) -> Vec<f32> {
    let n_members = probabilities.len() as f32;
    let n_queries = probabilities.first().map_or(0, Vec::len);
    let std = |query: usize| {
        let of = |member: &Vec<f32>| member[query];
        let mean = probabilities.iter().map(of).sum::<f32>() / n_members;
        let squares = probabilities.iter().map(|m| (of(m) - mean).powi(2));
        (squares.sum::<f32>() / n_members).sqrt()
    };
    (0..n_queries).map(std).collect()
}

/// Mean over members of −Σ p ln p of P(second ≻ first) and its opposite, nats, `[N]`.
pub(crate) fn entropy(probabilities: &[Vec<f32>]) -> Vec<f32> {
    let n_members = probabilities.len() as f32;
    let n_queries = probabilities.first().map_or(0, Vec::len);
    let own = |p: f32| {
        let part = |p: f32| if p > 0.0 { -p * p.ln() } else { 0.0 };
        part(p) + part(1.0 - p)
    };
    let mean = |query: usize| probabilities.iter().map(|m| own(m[query])).sum::<f32>() / n_members;
    (0..n_queries).map(mean).collect()
}

/// Key of the ensemble's initial weights.
const FIRST_KEY: u64 = 1_000_000;

#[cfg(test)]
mod tests;
