//! The temporal distance: how long it takes, under the present policy, from one state to another.

use domain::episode::{EpisodeId, Segment};
use domain::query::Query;
use domain::random::{Rng, Stream};
use serde::{Deserialize, Serialize};
use tch::{Kind, Tensor};

use crate::checkpoint::Archive;
use crate::device::Device;
use crate::error::LearnError;
use crate::init;
use crate::net::{Net, NetShape, Parameters, matrix, read, to_vec};
use crate::replay::Replay;

mod pairwise;

use pairwise::Pairwise;

/// Settings of the temporal distance. Defaults: the released settings for MetaWorld, except for
/// [`loss`](Self::loss).
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct TemporalConfig {
    /// Hidden layers of the trunk.
    pub hidden: Vec<i64>,
    /// Numbers in a latent state, `D`: half of them asymmetric, half symmetric.
    pub latent: i64,
    /// Adam's rate.
    pub learning_rate: f64,
    /// Pairs in a step.
    ///
    /// Differs from the paper (512): the released code computes all minibatches of a block
    /// and steps on the last, partial one, which has 416.
    pub batch: usize,
    /// Complete episodes in a block; the last closed block is what is learned from.
    pub block_episodes: usize,
    /// Environment steps between two steps, the paper's K_SD.
    pub update_every: u64,
    /// How far ahead positives lie: geometric with this rate.
    pub discount: f64,
    /// The gradient's norm is scaled down to this.
    pub max_gradient_norm: f64,
    /// Which softmax is trained. Symmetric, as the paper says; the released code trains the forward
    /// one alone.
    pub loss: ContrastiveLoss,
}

impl Default for TemporalConfig {
    fn default() -> Self {
        Self {
            hidden: vec![256; 3],
            latent: 64,
            learning_rate: 3e-4,
            batch: 416,
            block_episodes: 8,
            update_every: 1,
            discount: 0.99,
            max_gradient_norm: 0.5,
            loss: ContrastiveLoss::Symmetric,
        }
    }
}

impl TemporalConfig {
    /// Trunk, encoder and potential for states of so many numbers.
    fn shapes(&self, observation_size: usize) -> [NetShape; 3] {
        let (s, d) = (observation_size as i64, self.latent);
        [
            NetShape::new(1, s, &self.hidden, d),
            NetShape::new(1, d, &[d], d),
            NetShape::new(1, d, &[d], 1),
        ]
    }

    /// Bytes that the distance and its steps hold: nets, both ends of each pair on their way
    /// through them, and a few numbers for each two pairs of a step.
    pub fn bytes(&self, observation_size: usize) -> u64 {
        let net = |shape: &NetShape| shape.trained_bytes() + shape.pass_bytes(2 * self.batch);
        let nets: u64 = self.shapes(observation_size).iter().map(net).sum();
        let two_pairs = 4 * 4;
        nets + two_pairs * (self.batch as u64).pow(2)
    }
}

/// Which softmax tells the positive from the other states of the batch.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum ContrastiveLoss {
    /// Over later states, for each earlier one. What the released code does; it leaves the
    /// distance open up to a function of each end.
    Forward,
    /// Over earlier states, for each later one.
    Backward,
    /// Mean of both: what the paper says, and what pins the distance down.
    Symmetric,
}

impl ContrastiveLoss {
    /// Weights of the forward and the backward softmax.
    fn weights(self) -> (f64, f64) {
        match self {
            Self::Forward => (1.0, 0.0),
            Self::Backward => (0.0, 1.0),
            Self::Symmetric => (0.5, 0.5),
        }
    }
}

/// What one step looked like.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct TemporalMetrics {
    /// InfoNCE, nats.
    pub loss: f32,
    /// Share of earlier states whose positive was the likeliest later one.
    pub accuracy: f32,
    /// The gradient's norm before it was scaled.
    pub gradient_norm: f32,
}

/// MRN-POT: d(x, y) = max_i relu(φ_i(x) − φ_i(y)) + ‖φ(x) − φ(y)‖ over the two halves of a
/// latent state, trained as the energy c(y) − d(x, y) of a contrastive loss.
///
/// It obeys the triangle inequality by construction and approaches the successor distance
/// (nats). Source: STAIR, §4.2, and ETD, whose code it is.
pub struct TemporalDistance {
    config: TemporalConfig,
    seed: u64,
    options: (Kind, tch::Device),
    observation_size: i64,
    parameters: Parameters,
    nets: Nets,
    gradients: Nets,
    n_updates: u64,
}

/// Trunk (shared), encoder φ and potential c over one flat vector.
struct Nets {
    trunk: Net,
    encoder: Net,
    potential: Net,
}

impl Nets {
    fn over(shapes: &[NetShape; 3], flat: &Tensor) -> Self {
        let mut offset = 0;
        let [trunk, encoder, potential] = [0, 1, 2].map(|i| {
            let net = Net::over(&shapes[i], flat, offset);
            offset += shapes[i].n_values();
            net
        });
        Self {
            trunk,
            encoder,
            potential,
        }
    }

    /// Latent states `[n × D]`.
    fn encode(&self, states: &Tensor) -> Tensor {
        self.encoder
            .forward(&self.trunk.forward(states))
            .squeeze_dim(0)
    }
}

impl TemporalDistance {
    /// Fresh weights that follow from `seed`.
    pub fn new(
        config: &TemporalConfig,
        observation_size: usize,
        seed: u64,
        device: Device,
    ) -> Self {
        Self::with_kind(config, observation_size, seed, (Kind::Float, device.0))
    }

    fn with_kind(
        config: &TemporalConfig,
        observation_size: usize,
        seed: u64,
        options: (Kind, tch::Device),
    ) -> Self {
        crate::device::init();
        let shapes = config.shapes(observation_size);
        let n_values = shapes.iter().map(NetShape::n_values).sum();
        let parameters = Parameters::new(n_values, config.learning_rate, options);
        let mut nets = Nets::over(&shapes, &parameters.values);
        let mut rng = Rng::new(seed, Stream::Weights, FIRST_KEY);
        for net in [&mut nets.trunk, &mut nets.encoder, &mut nets.potential] {
            init::uniform(net, &mut rng);
        }
        Self {
            config: config.clone(),
            seed,
            options,
            observation_size: observation_size as i64,
            gradients: Nets::over(&shapes, &parameters.gradient),
            parameters,
            nets,
            n_updates: 0,
        }
    }

    /// One gradient step on pairs of the last closed block of episodes; `None` before the
    /// first block closes.
    ///
    /// Differs from the code: positives are drawn anew for each batch, not once for a block,
    /// and only the minibatch that is stepped on is computed.
    pub fn update(&mut self, replay: &Replay) -> Option<TemporalMetrics> {
        let complete = replay.complete_episodes();
        let n_closed = complete.len() / self.config.block_episodes * self.config.block_episodes;
        let block = &complete[n_closed.checked_sub(self.config.block_episodes)?..n_closed];
        let mut rng = Rng::new(self.seed, Stream::Temporal, self.n_updates);
        let pairs = draw_pairs(
            replay,
            block,
            self.config.batch,
            self.config.discount,
            &mut rng,
        );
        let states = |end: fn(&Pair) -> u32| -> Vec<f32> {
            let state = |p: &Pair| replay.observation(p.episode, end(p) as usize);
            pairs.iter().flat_map(state).copied().collect()
        };
        let (earlier, later) = (states(|p| p.earlier), states(|p| p.later));
        Some(self.step(&earlier, &later))
    }

    /// One gradient step on pairs `[B × S]`, `[B × S]`.
    fn step(&mut self, earlier: &[f32], later: &[f32]) -> TemporalMetrics {
        let (loss, accuracy) = self.gradient(earlier, later);
        let norm = self.parameters.step_clipped(self.config.max_gradient_norm);
        self.n_updates += 1;
        TemporalMetrics {
            loss: loss as f32,
            accuracy: accuracy as f32,
            gradient_norm: norm as f32,
        }
    }

    /// Fills the gradient; returns loss and accuracy.
    ///
    /// L_ij = c(y_j) − d(x_i, y_j); the loss's slope in L is (w_f · softmax_j + w_b · softmax_i − δ_ij)/B.
    fn gradient(&mut self, earlier: &[f32], later: &[f32]) -> (f64, f64) {
        let states = matrix(
            &[earlier, later].concat(),
            self.observation_size,
            self.options,
        );
        let n = states.size()[0] / 2;
        let (trunk, trunk_tape) = self.nets.trunk.forward_taped(&states);
        let (latent, encoder_tape) = self.nets.encoder.forward_taped(&trunk);
        let (potential, potential_tape) = self.nets.potential.forward_taped(&trunk.narrow(1, n, n));
        let latent = latent.squeeze_dim(0);
        let pairwise = Pairwise::new(&latent.narrow(0, 0, n), &latent.narrow(0, n, n));
        let logits = potential.view([1, n]) - pairwise.distance();

        let (forward, backward) = self.config.loss.weights();
        let (rows, columns) = (logits.log_softmax(1, None), logits.log_softmax(0, None));
        let trace = |log: &Tensor| log.diagonal(0, 0, 1).sum(None);
        let hits = logits
            .argmax(1, false)
            .eq_tensor(&Tensor::arange(n, (Kind::Int64, self.options.1)));
        let told = [
            trace(&rows),
            trace(&columns),
            hits.to_kind(Kind::Double).mean(None),
        ];
        let probability = |log: &Tensor| log.clamp_min(LEAST_LOG).exp();
        let slope = (probability(&rows) * forward + probability(&columns) * backward) / n as f64;
        let _ = slope.diagonal(0, 0, 1).g_sub_scalar_(1.0 / n as f64);

        self.parameters.zero_gradient();
        let potential_slope = slope
            .sum_dim_intlist([0_i64].as_slice(), false, None)
            .view([1, n, 1]);
        let (x, y) = pairwise.backward(&slope.neg());
        let latent_slope = Tensor::cat(&[x, y], 0).unsqueeze(0);
        let d = 0..self.config.latent;
        let into = &mut self.gradients;
        let encoder = self.nets.encoder.backward(
            &encoder_tape,
            &latent_slope,
            Some(&mut into.encoder),
            Some(d.clone()),
        );
        let potential = self.nets.potential.backward(
            &potential_tape,
            &potential_slope,
            Some(&mut into.potential),
            Some(d),
        );
        let (Some(trunk_slope), Some(later_slope)) = (encoder, potential) else {
            unreachable!("both were asked for the gradient of their input")
        };
        let _ = trunk_slope.narrow(1, n, n).g_add_(&later_slope);
        self.nets
            .trunk
            .backward(&trunk_tape, &trunk_slope, Some(&mut into.trunk), None);
        let [of_rows, of_columns, accuracy] = read(told);
        let loss = -(forward * of_rows + backward * of_columns) / n as f64;
        (loss, accuracy)
    }

    /// Distances in nats, `[n]`, from each earlier to each later state, `[n × S]` each.
    pub fn distance(&self, from: &[f32], to: &[f32]) -> Vec<f32> {
        let rows = CHUNK_STATES * self.observation_size as usize;
        let pairs = from.chunks(rows).zip(to.chunks(rows));
        let distance = |(from, to): (&[f32], &[f32])| {
            to_vec(&pairwise::distance(&self.encode(from), &self.encode(to)))
        };
        pairs.flat_map(distance).collect()
    }

    /// Mean of the four distances from an end of the first segment to an end of the second,
    /// nats, `[N]`.
    ///
    /// Source: STAIR, Eq. 8; an end is the state before a segment's first and last step.
    ///
    /// # Panics
    /// When a segment is not in the replay.
    pub fn stage_gap(&self, replay: &Replay, queries: &[Query]) -> Vec<f32> {
        let ends = |s: Segment| {
            let end = |t: u32| replay.observation(s.episode, t as usize);
            [end(s.start), end(s.start + s.len.saturating_sub(1))]
        };
        let gaps = |queries: &[Query]| {
            let states = |which: fn(&Query) -> Segment| -> Tensor {
                let states: Vec<f32> = queries
                    .iter()
                    .flat_map(|q| ends(which(q)))
                    .flatten()
                    .copied()
                    .collect();
                self.encode(&states).view([-1, 2, self.config.latent])
            };
            let (first, second) = (states(|q| q.first), states(|q| q.second));
            let all = pairwise::distance(&first.unsqueeze(2), &second.unsqueeze(1));
            to_vec(&all.mean_dim([1_i64, 2].as_slice(), false, None))
        };
        queries.chunks(CHUNK_STATES / 2).flat_map(gaps).collect()
    }

    /// Gradient steps so far.
    pub fn n_updates(&self) -> u64 {
        self.n_updates
    }

    /// Weights, moments and counters.
    pub fn save(&self, archive: &mut Archive) {
        self.parameters.save("temporal", archive);
        archive.put_json("temporal.updates", &self.n_updates);
    }

    /// What [`TemporalDistance::save`] wrote, from any device.
    ///
    /// # Errors
    /// When a section is missing or of another network; part of it may then be loaded.
    pub fn load(&mut self, archive: &Archive) -> Result<(), LearnError> {
        self.parameters.load("temporal", archive)?;
        self.n_updates = archive.json("temporal.updates")?;
        Ok(())
    }

    fn encode(&self, states: &[f32]) -> Tensor {
        self.nets
            .encode(&matrix(states, self.observation_size, self.options))
    }
}

/// A state and a later one of the same episode.
#[derive(Debug, Clone, Copy)]
struct Pair {
    episode: EpisodeId,
    earlier: u32,
    later: u32,
}

/// `n` different states of the block with a positive each: k steps later, k geometric on
/// {1, …, R} where R steps are left, the last state itself where none is.
fn draw_pairs(
    replay: &Replay,
    block: &[EpisodeId],
    n: usize,
    discount: f64,
    rng: &mut Rng,
) -> Vec<Pair> {
    let with_len = |&id: &EpisodeId| (id, replay.episode(id).len);
    let states: Vec<(EpisodeId, u32, u32)> = block
        .iter()
        .map(with_len)
        .flat_map(|(id, len)| (0..=len).map(move |t| (id, t, len - t)))
        .collect();
    let mut order = rng.permutation(states.len());
    order.truncate(n);
    let mut pair = |index: usize| {
        let (episode, earlier, left) = states[index];
        let later = earlier + steps_ahead(left, discount, rng.uniform());
        Pair {
            episode,
            earlier,
            later,
        }
    };
    order.into_iter().map(&mut pair).collect()
}

/// k ∈ {1, …, left} with P(k) ∝ γᵏ from a uniform `u`; 0 where nothing is left.
fn steps_ahead(left: u32, discount: f64, u: f64) -> u32 {
    if left == 0 {
        return 0;
    }
    let beyond = 1.0 - discount.powi(left as i32);
    let k = ((1.0 - beyond * u).ln() / discount.ln()).ceil();
    (k.max(1.0) as u32).min(left)
}

/// Logarithm of the least probability that a pair is given, still a normal number: below it the
/// exponential takes a slow path for each.
const LEAST_LOG: f64 = -87.0;
/// States encoded at once.
const CHUNK_STATES: usize = 2_048;
/// Key of the initial weights.
const FIRST_KEY: u64 = 2_000_000;

#[cfg(test)]
mod tests;
