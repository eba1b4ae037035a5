//! Tells from a state alone at which step of its episode it was seen.
//!
//! How far that is possible says how many stages a task has; [`domain::stage::TimestepTally`]
//! judges it. The stage approximator [`crate::stage::StageApproximator::Timestep`] is another
//! thing: it knows the steps and learns nothing.

use domain::random::{Rng, Stream};
use serde::{Deserialize, Serialize};
use tch::{Kind, Tensor};

use crate::device::Device;
use crate::init;
use crate::net::{Net, NetShape, Parameters, matrix, to_vec};

/// Settings of the classifier. Defaults: the paper's table.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct TimestepConfig {
    /// Hidden layers.
    pub hidden: Vec<i64>,
    /// Adam's rate.
    pub learning_rate: f64,
    /// States in a minibatch.
    pub batch: usize,
    /// Passes over all states.
    pub epochs: u32,
}

impl Default for TimestepConfig {
    fn default() -> Self {
        Self {
            hidden: vec![256; 3],
            learning_rate: 1e-4,
            batch: 256,
            epochs: 20,
        }
    }
}

/// States with the steps at which they were seen.
#[derive(Debug, Clone, PartialEq)]
pub struct TimedStates {
    observation_size: usize,
    /// `[n × S]`.
    observations: Vec<f32>,
    /// `[n]`, from 0.
    steps: Vec<i64>,
}

impl TimedStates {
    /// None yet, of so many numbers each.
    pub fn new(observation_size: usize) -> Self {
        Self {
            observation_size,
            observations: Vec::new(),
            steps: Vec::new(),
        }
    }

    /// Adds an episode's states from its first one on, `[T × S]`.
    pub fn push_episode(&mut self, observations: &[f32]) {
        let n_states = observations.len() / self.observation_size;
        self.observations.extend_from_slice(observations);
        self.steps.extend(0..n_states as i64);
    }

    /// States, `n`.
    pub fn len(&self) -> usize {
        self.steps.len()
    }

    /// Whether there are none.
    pub fn is_empty(&self) -> bool {
        self.steps.is_empty()
    }
}

/// What a pass over all states came to, each judged just before it was learned from.
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct TimestepFit {
    /// Mean cross-entropy, nats; a guess at random has ln T.
    pub loss: f64,
    /// Share of the states whose most likely step was the true one.
    pub accuracy: f64,
}

/// States whose probabilities are computed at once.
const CHUNK_STATES: usize = 512;

/// From a state to how likely it was seen at each step of an episode.
pub struct TimestepClassifier {
    config: TimestepConfig,
    seed: u64,
    options: (Kind, tch::Device),
    observation_size: i64,
    parameters: Parameters,
    net: Net,
    gradient: Net,
    n_epochs: u64,
}

impl TimestepClassifier {
    /// Fresh weights that follow from `seed`, for states of so many numbers out of episodes of
    /// `n_steps` steps.
    pub fn new(
        config: &TimestepConfig,
        observation_size: usize,
        n_steps: usize,
        seed: u64,
        device: Device,
    ) -> Self {
        let sizes = (observation_size, n_steps);
        Self::with_kind(config, sizes, seed, (Kind::Float, device.0))
    }

    fn with_kind(
        config: &TimestepConfig,
        (observation_size, n_steps): (usize, usize),
        seed: u64,
        options: (Kind, tch::Device),
    ) -> Self {
        crate::device::init();
        let observation_size = observation_size as i64;
        let shape = NetShape::new(1, observation_size, &config.hidden, n_steps as i64);
        let parameters = Parameters::new(shape.n_values(), config.learning_rate, options);
        let mut net = Net::over(&shape, &parameters.values, 0);
        init::uniform(&mut net, &mut Rng::new(seed, Stream::Weights, FIRST_KEY));
        Self {
            config: config.clone(),
            seed,
            options,
            observation_size,
            gradient: Net::over(&shape, &parameters.gradient, 0),
            parameters,
            net,
            n_epochs: 0,
        }
    }

    /// Learns from all states as often as the settings say, in a new order each time, and tells
    /// after each pass how it went; returns the last pass.
    ///
    /// The loss is the cross-entropy of the true step, mean over a minibatch.
    ///
    /// # Panics
    /// When a state is of a step that the classifier does not know.
    pub fn fit(&mut self, states: &TimedStates, mut tell: impl FnMut(TimestepFit)) -> TimestepFit {
        let mut last = TimestepFit::default();
        if states.is_empty() {
            return last;
        }
        let observations = self.rows(&states.observations);
        let steps = Tensor::from_slice(&states.steps).to_device(self.options.1);
        for _ in 0..self.config.epochs {
            last = self.epoch(&observations, &steps);
            tell(last);
        }
        last
    }

    /// How likely each state, `[n × S]`, was seen at each step, `[n × T]`.
    pub fn probabilities(&self, observations: &[f32]) -> Vec<f32> {
        let rows = CHUNK_STATES * self.observation_size as usize;
        let softmax = |rows: &[f32]| {
            let logits = self.net.forward(&self.rows(rows));
            to_vec(&logits.softmax(-1, None::<Kind>))
        };
        observations.chunks(rows).flat_map(softmax).collect()
    }

    fn epoch(&mut self, observations: &Tensor, steps: &Tensor) -> TimestepFit {
        let n_states = steps.size()[0] as usize;
        let mut rng = Rng::new(self.seed, Stream::TimestepFit, self.n_epochs);
        self.n_epochs += 1;
        let order: Vec<i64> = rng
            .permutation(n_states)
            .iter()
            .map(|&i| i as i64)
            .collect();
        let (mut loss, mut n_right) = (0.0, 0);
        for batch in order.chunks(self.config.batch) {
            let rows = Tensor::from_slice(batch).to_device(self.options.1);
            let steps = steps.index_select(0, &rows);
            self.parameters.zero_gradient();
            let judged = self.add_gradient(&observations.index_select(0, &rows), &steps);
            self.parameters.step();
            loss += judged.loss * batch.len() as f64;
            n_right += judged.n_right;
        }
        TimestepFit {
            loss: loss / n_states as f64,
            accuracy: n_right as f64 / n_states as f64,
        }
    }

    /// Adds the gradient of a minibatch's loss: softmax less one at the true step, over `B`.
    fn add_gradient(&mut self, observations: &Tensor, steps: &Tensor) -> Judged {
        let (output, tape) = self.net.forward_taped(observations);
        let log_probabilities = output.squeeze_dim(0).log_softmax(-1, None::<Kind>);
        let truth = steps.unsqueeze(1);
        let of_truth = log_probabilities.gather(1, &truth, false);
        let guesses = log_probabilities.argmax(-1, false);
        let mut slope = log_probabilities.exp();
        let _ = slope.scatter_add_(1, &truth, &of_truth.ones_like().neg());
        let slope = (slope / steps.size()[0] as f64).unsqueeze(0);
        self.net
            .backward(&tape, &slope, Some(&mut self.gradient), None);
        Judged {
            loss: -of_truth.mean(Kind::Double).double_value(&[]),
            n_right: guesses.eq_tensor(steps).sum(Kind::Int64).int64_value(&[]),
        }
    }

    fn rows(&self, observations: &[f32]) -> Tensor {
        matrix(observations, self.observation_size, self.options)
    }
}

/// A minibatch before it is learned from.
struct Judged {
    loss: f64,
    n_right: i64,
}

/// Key of the initial weights.
const FIRST_KEY: u64 = 3_000_000;

#[cfg(test)]
mod tests;
