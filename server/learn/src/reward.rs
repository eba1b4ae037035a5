//! The reward ensemble: per-step rewards learned from preferences between segments.

use domain::answer::Preference;
use domain::query::Query;
use domain::random::{Rng, Stream};
use serde::{Deserialize, Serialize};
use tch::{Kind, Tensor};

use crate::checkpoint::Archive;
use crate::device::Device;
use crate::error::LearnError;
use crate::init;
use crate::net::{Net, NetShape, Parameters, matrix, to_vec};
use crate::precision::Precision;
use crate::replay::Replay;

mod chunk;
mod denoise;
mod inputs;
mod learner;
mod meta;
mod semi;

use chunk::{Chunk, longest};
use inputs::{Inputs, Moments};

pub use denoise::{Denoising, DenoisingConfig};
pub use learner::{Lesson, RewardLearner, Supervised};
pub use meta::SteeringConfig;
pub use semi::{SemiSupervised, SemiSupervisedConfig};

/// Settings of the ensemble. Defaults: the released settings for MetaWorld.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct RewardConfig {
    /// Members, `M`.
    pub members: usize,
    /// Hidden layers of each.
    pub hidden: Vec<i64>,
    /// Adam's rate.
    ///
    /// Differs from the paper: its table says 1e-4, the released code uses 3e-4.
    pub learning_rate: f64,
    /// Pairs in a minibatch.
    pub batch: usize,
    /// Passes over all preferences after a session, at most.
    pub max_epochs: u32,
    /// Fitting stops after a pass in which this share of the preferences was right, mean over
    /// members.
    pub stop_accuracy: f32,
    /// How far a preference is trained from certainty, in [0, ½): towards P = 1 − margin instead
    /// of 1. Without it, few answers that are passed over often saturate the tanh, and later
    /// answers can no longer move the reward there. B-Pref's `label_margin`.
    pub label_margin: f64,
    /// Divides the difference of two segments' sums in P = σ(Δ / temperature), above 0.
    ///
    /// At 1 a preference between segments of 50 steps is certain once they differ by a tenth a
    /// step, and nothing drives learned rewards further apart. Higher ones do spread them, but
    /// let them drift together to one end of (−1, 1): with 10 window-open was not learned.
    ///
    /// Differs from the paper: its Eq. 1 has none, which is 1.
    pub temperature: f64,
    /// Standard deviation that learned rewards have over the whole replay, their mean being 0;
    /// relabelling sees to it. 0 leaves them as the members say, as the released code does.
    ///
    /// Preferences say nothing about how high all rewards lie and little about how far apart:
    /// each fit moves both, and with them every value that the critics know.
    /// Source: Christiano et al. (2017), 2.2.3, who normalise the rewards of their ensemble.
    pub normalized_std: f64,
    /// Whether each number of a state is brought to mean 0 and standard deviation 1 over the
    /// replay, anew before each fit, and cut off at 5; the released code takes them as they are.
    ///
    /// What decides a preference late in a task is often a centimetre, and networks that see
    /// metres are slow to tell it.
    pub normalized_inputs: bool,
    /// `f32`, or `bf16` for faster and coarser fitting and relabelling.
    pub precision: Precision,
}

impl Default for RewardConfig {
    fn default() -> Self {
        Self {
            members: 3,
            hidden: vec![256; 3],
            learning_rate: 3e-4,
            batch: 128,
            max_epochs: 10,
            stop_accuracy: 0.97,
            label_margin: 0.0,
            temperature: 1.0,
            normalized_std: 0.0,
            normalized_inputs: false,
            precision: Precision::F32,
        }
    }
}

impl RewardConfig {
    /// All members, for states and actions of so many numbers.
    fn shape(&self, sizes: (usize, usize)) -> NetShape {
        let columns = (sizes.0 + sizes.1) as i64;
        NetShape {
            slope: SLOPE,
            precision: self.precision,
            ..NetShape::new(self.members as i64, columns, &self.hidden, 1)
        }
    }

    /// Bytes that an ensemble and its fitting hold, whatever the number of preferences.
    pub fn bytes(&self, observation_size: usize, action_size: usize) -> u64 {
        let shape = self.shape((observation_size, action_size));
        shape.trained_bytes() + shape.pass_bytes(CHUNK_ROWS)
    }
}

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
    /// Cross-entropy of the last pass, nats, mean over members.
    pub loss: f32,
    /// Share that was right during the last pass, mean over members; equal preferences, which
    /// cannot be right, are left out.
    pub accuracy: f32,
}

/// What the members say about steps.
#[derive(Debug, Clone, PartialEq)]
pub struct Estimate {
    /// Mean over members, in (−1, 1) unless it is normalised, `[n]`.
    pub rewards: Vec<f32>,
    /// std over members (their number in the denominator), `[n]`.
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
    inputs: Option<Inputs>,
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
}

/// One member's order of the preferences in an epoch, and how it did.
struct Pass {
    order: Vec<usize>,
    n_seen: usize,
    loss: f64,
    n_right: u32,
    n_judged: u32,
}

impl Pass {
    fn new(order: Vec<usize>) -> Self {
        Self {
            order,
            n_seen: 0,
            loss: 0.0,
            n_right: 0,
            n_judged: 0,
        }
    }

    /// Equal preferences count for the loss alone.
    fn record(&mut self, example: &Example, logit: f64) {
        self.n_seen += 1;
        self.loss += softplus(logit) - example.target * logit;
        let side = example.target - 0.5;
        if side.abs() > f64::EPSILON {
            self.n_judged += 1;
            self.n_right += u32::from((logit > 0.0) == (side > 0.0));
        }
    }
}

/// What the members' passes say together.
fn summary(passes: &[Pass], n_epochs: u32) -> RewardFit {
    let mean =
        |value: &dyn Fn(&Pass) -> f64| passes.iter().map(value).sum::<f64>() / passes.len() as f64;
    RewardFit {
        n_epochs,
        loss: mean(&|p| p.loss / p.n_seen.max(1) as f64) as f32,
        accuracy: mean(&|p| f64::from(p.n_right) / f64::from(p.n_judged.max(1))) as f32,
    }
}

/// A pair as a member's loss sees it.
#[derive(Debug, Clone, Copy)]
struct Example {
    query: Query,
    /// Of P(second ≻ first).
    target: f64,
    /// Of its cross-entropy.
    weight: f64,
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
            inputs: None,
            scale: Scale::NONE,
            n_epochs: 0,
        }
    }

    /// Takes the level and spread of what is in the replay for those of inputs, where
    /// [`RewardConfig::normalized_inputs`] asks for it; what is predicted changes with them, so a
    /// fit comes next.
    pub fn measure_inputs(&mut self, replay: &Replay) {
        if self.config.normalized_inputs {
            let moments = Moments::of(replay);
            self.inputs = moments.map(|moments| Inputs::new(moments, self.options));
        }
    }

    /// Goes on from the present weights, over all preferences so far, until the members are
    /// right often enough or the passes are used up.
    ///
    /// Each member sees the preferences in its own order. The loss is the cross-entropy of
    /// P(second ≻ first) = σ((Σ r(second) − Σ r(first)) / temperature) to 0, 1 (less the label margin), or ½ for
    /// equal, mean over a minibatch, summed over members.
    ///
    /// Source: BPref's `train_soft_reward` without smoothing. Differs from the code: equal
    /// preferences need no global switch.
    ///
    /// # Panics
    /// When a segment is not in the replay.
    pub fn fit(&mut self, replay: &Replay, labeled: &[Labeled]) -> RewardFit {
        let mut fit = RewardFit::default();
        if labeled.is_empty() {
            return fit;
        }
        for n_epochs in 1..=self.config.max_epochs {
            fit = summary(&self.epoch(replay, labeled, 1.0), n_epochs);
            if fit.accuracy > self.config.stop_accuracy {
                break;
            }
        }
        fit
    }

    /// One pass of every member over all preferences, at a share of the learning rate.
    fn epoch(&mut self, replay: &Replay, labeled: &[Labeled], rate: f64) -> Vec<Pass> {
        let mut rng = Rng::new(self.seed, Stream::RewardFit, self.n_epochs);
        self.n_epochs += 1;
        let members = 0..self.config.members;
        let mut passes: Vec<Pass> = members
            .map(|_| Pass::new(rng.permutation(labeled.len())))
            .collect();
        for start in (0..labeled.len()).step_by(self.config.batch) {
            let end = labeled.len().min(start + self.config.batch);
            self.gradient(replay, labeled, &mut passes, start..end);
            self.parameters.step_at(rate);
        }
        passes
    }

    /// Fills the gradient with that of a range of each member's order.
    fn gradient(
        &mut self,
        replay: &Replay,
        labeled: &[Labeled],
        passes: &mut [Pass],
        range: std::ops::Range<usize>,
    ) {
        let weight = 1.0 / range.len() as f64;
        let orders = passes.iter().flat_map(|p| &p.order[range.clone()]);
        let examples: Vec<Example> = orders.map(|&i| self.example(&labeled[i], weight)).collect();
        self.parameters.zero_gradient();
        let logits = self.add_gradient(replay, &examples);
        let own = examples.chunks(range.len()).zip(logits.chunks(range.len()));
        for (pass, (examples, logits)) in passes.iter_mut().zip(own) {
            for (example, logit) in examples.iter().zip(logits) {
                pass.record(example, *logit);
            }
        }
    }

    /// A preference as the loss sees it.
    fn example(&self, labeled: &Labeled, weight: f64) -> Example {
        let certain = f64::from(labeled.preference.target());
        Example {
            query: labeled.query,
            target: certain + self.config.label_margin * (1.0 - 2.0 * certain),
            weight,
        }
    }

    /// One Adam step on examples `[M][n]`; returns their logits before it.
    fn step(&mut self, replay: &Replay, examples: &[Example]) -> Vec<f64> {
        self.parameters.zero_gradient();
        let logits = self.add_gradient(replay, examples);
        self.parameters.step();
        logits
    }

    /// Adds the gradient of examples `[M][n]`; returns their logits. The loss is a sum over
    /// pairs, so a few pairs at a time go forward and back while their hidden layers are in the
    /// cache.
    fn add_gradient(&mut self, replay: &Replay, examples: &[Example]) -> Vec<f64> {
        let n_members = self.config.members;
        let n = examples.len() / n_members;
        let longest = examples
            .iter()
            .map(|e| longest(&e.query))
            .max()
            .unwrap_or(1);
        let pairs_at_once = (CHUNK_ROWS / (2 * longest)).max(1);
        let mut all_logits = vec![0.0; examples.len()];
        for start in (0..n).step_by(pairs_at_once) {
            let end = n.min(start + pairs_at_once);
            let own = |member: usize| member * n + start..member * n + end;
            let pairs: Vec<Example> = (0..n_members)
                .flat_map(|member| &examples[own(member)])
                .copied()
                .collect();
            let queries = pairs.iter().map(|e| &e.query);
            let chunk = self.chunk(replay, queries, longest);
            let input = self
                .input(&chunk.rows)
                .view([n_members as i64, -1, self.columns]);
            let (output, tape) = self.net.forward_taped(&input);
            let reward = output.tanh();
            let logits = chunk.logits(&to_vec(&reward));
            let slope = |(example, logit): (&Example, &f64)| {
                let probability = 1.0 / (1.0 + (-logit).exp());
                (probability - example.target) * example.weight
            };
            let slopes: Vec<f64> = pairs.iter().zip(&logits).map(slope).collect();
            let slopes = matrix(&chunk.row_slopes(&slopes), 1, self.options).view_as(&reward);
            let gradient = slopes * (1.0 - reward.square());
            self.net
                .backward(&tape, &gradient, Some(&mut self.gradient), None);
            for (member, logits) in logits.chunks(end - start).enumerate() {
                all_logits[own(member)].copy_from_slice(logits);
            }
        }
        all_logits
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
        if self.config.normalized_std > 0.0 && variance > LEAST_VARIANCE {
            self.scale = Scale {
                offset: sum / n,
                factor: self.config.normalized_std / variance.sqrt(),
            };
            for lane in 0..replay.n_lanes() {
                self.scale.apply(replay.learned_rewards_mut(lane));
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
        archive.put_json("reward.inputs", &self.inputs.as_ref().map(|i| &i.moments));
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
        let moments: Option<Moments> = archive.json("reward.inputs")?;
        self.inputs = moments.map(|moments| Inputs::new(moments, self.options));
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
        let rows = matrix(rows, self.columns, self.options);
        match &self.inputs {
            Some(inputs) => inputs.apply(&rows),
            None => rows,
        }
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

/// ln(1 + eˣ) without overflow.
fn softplus(x: f64) -> f64 {
    x.max(0.0) + (-x.abs()).exp().ln_1p()
}

/// Key of the ensemble's initial weights.
const FIRST_KEY: u64 = 1_000_000;

#[cfg(test)]
mod tests;
