//! Soft actor-critic with every gradient written out.

use domain::random::{Rng, Stream};
use tch::{Kind, Tensor};

use crate::checkpoint::Archive;
use crate::device::Device;
use crate::error::LearnError;
use crate::init;
use crate::kernel;
use crate::net::{
    Net, NetShape, Parameters, Tape, load_tensor, matrices, matrix, read, save_tensor, to_vec,
};
use crate::replay::Batch;
use crate::threads::{self, Readable, Reading};

mod config;
mod outer;
mod policy;

pub use config::SacConfig;
pub(crate) use outer::FirstSteps;
use policy::Gaussian;

/// How the agent chooses.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Act {
    /// The mean action of the policy, averaged over updates where the settings say so: for
    /// evaluation.
    Mean,
    /// A sample, keyed by the environment step.
    Sample {
        /// Environment step.
        step: u64,
    },
}

/// What one update looked like.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct SacMetrics {
    /// Sum over both critics of the mean squared error.
    pub critic_loss: f32,
    /// mean(α log π − min Q).
    pub actor_loss: f32,
    /// Mean of both critics on the batch.
    pub q_mean: f32,
    /// Temperature before the update.
    pub alpha: f32,
    /// mean(−log π), nats.
    pub entropy: f32,
}

/// The agent.
pub struct Sac {
    config: SacConfig,
    seed: u64,
    options: (Kind, tch::Device),
    observation_size: i64,
    action_size: i64,
    actor: Trained,
    critic: Trained,
    critic_shape: NetShape,
    target_values: Tensor,
    target: Net,
    average: Option<Average>,
    temperature: Temperature,
    /// Part of the run that is behind, [0, 1].
    done: f64,
    n_updates: u64,
    n_critic_resets: u64,
}

/// A net with its gradient.
struct Trained {
    parameters: Parameters,
    net: Net,
    gradient: Net,
}

impl Trained {
    fn new(shape: &NetShape, learning_rate: f64, options: (Kind, tch::Device)) -> Self {
        let parameters = Parameters::new(shape.n_values(), learning_rate, options);
        let net = Net::over(shape, &parameters.values, 0);
        let gradient = Net::over(shape, &parameters.gradient, 0);
        Self {
            parameters,
            net,
            gradient,
        }
    }
}

/// A moving average of the actor.
struct Average {
    values: Tensor,
    net: Net,
}

/// log α with its Adam, one number each.
#[derive(Debug, Clone, Copy)]
struct Temperature {
    log_alpha: f64,
    first: f64,
    second: f64,
    n_steps: u64,
}

impl Temperature {
    fn alpha(&self) -> f64 {
        self.log_alpha.exp()
    }

    fn step(&mut self, gradient: f64, learning_rate: f64) {
        let (decay_1, decay_2, epsilon) = kernel::ADAM;
        self.n_steps += 1;
        let n = i32::try_from(self.n_steps).unwrap_or(i32::MAX);
        self.first = decay_1 * self.first + (1.0 - decay_1) * gradient;
        self.second = decay_2 * self.second + (1.0 - decay_2) * gradient * gradient;
        let first = self.first / (1.0 - decay_1.powi(n));
        let second = self.second / (1.0 - decay_2.powi(n));
        self.log_alpha -= learning_rate * first / (second.sqrt() + epsilon);
    }
}

/// A batch on the device.
struct Rows {
    observation: Tensor,
    state_action: Tensor,
    next_observation: Tensor,
    reward: Tensor,
    not_terminal: Tensor,
}

impl Readable for Sac {}
impl Readable for Rows {}

/// Outputs, and what the way back needs.
struct Passes {
    /// Of the critics on the batch.
    critic: (Tensor, Tape),
    /// Of the actor on its states.
    actor: (Tensor, Tape),
}

impl Sac {
    /// Fresh weights that follow from `seed`.
    pub fn new(
        config: &SacConfig,
        observation_size: usize,
        action_size: usize,
        seed: u64,
        device: Device,
    ) -> Self {
        Self::with_kind(
            config,
            (observation_size, action_size),
            seed,
            (Kind::Float, device.0),
        )
    }

    pub(crate) fn with_kind(
        config: &SacConfig,
        sizes: (usize, usize),
        seed: u64,
        options: (Kind, tch::Device),
    ) -> Self {
        crate::device::init();
        let (s, a) = (sizes.0 as i64, sizes.1 as i64);
        let (actor_shape, critic_shape) = config.shapes(s, a);
        let critic = Trained::new(&critic_shape, config.critic_learning_rate, options);
        let target_values = critic.parameters.values.zeros_like();
        let actor = Trained::new(&actor_shape, config.actor_learning_rate, options);
        let average = (config.actor_ema > 0.0).then(|| {
            let values = actor.parameters.values.zeros_like();
            let net = Net::over(&actor_shape, &values, 0);
            Average { values, net }
        });
        let mut sac = Self {
            config: config.clone(),
            seed,
            options,
            observation_size: s,
            action_size: a,
            actor,
            critic,
            target: Net::over(&critic_shape, &target_values, 0),
            average,
            done: 0.0,
            critic_shape,
            target_values,
            temperature: Temperature {
                log_alpha: config.initial_temperature.ln(),
                first: 0.0,
                second: 0.0,
                n_steps: 0,
            },
            n_updates: 0,
            n_critic_resets: 0,
        };
        init::orthogonal(
            &mut sac.actor.net,
            &mut Rng::new(seed, Stream::Weights, ACTOR),
        );
        if let Some(average) = &mut sac.average {
            average.values.copy_(&sac.actor.parameters.values);
        }
        sac.init_critic();
        sac
    }

    fn init_critic(&mut self) {
        let key = FIRST_CRITIC + self.n_critic_resets;
        init::orthogonal(
            &mut self.critic.net,
            &mut Rng::new(self.seed, Stream::Weights, key),
        );
        self.target_values.copy_(&self.critic.parameters.values);
    }

    /// Actions in [−1, 1], `[n × A]`, for states `[n × S]`.
    pub fn act(&self, observations: &[f32], how: Act) -> Vec<f32> {
        let states = matrix(observations, self.observation_size, self.options);
        let net = match (how, &self.average) {
            (Act::Mean, Some(average)) => &average.net,
            _ => &self.actor.net,
        };
        let policy = Gaussian::new(&net.forward(&states), self.action_size);
        to_vec(&match how {
            Act::Mean => policy.mean_action(),
            Act::Sample { step } => {
                let noise = self.noise(
                    states.size()[0],
                    &mut Rng::new(self.seed, Stream::Action, step),
                );
                policy.sample(&noise).action
            }
        })
    }

    /// One update of critics, actor, temperature and (every few) target, in this order.
    ///
    /// Source: BPref's `update`; targets y = r + γ (min Q̄(s′, a′) − α log π(a′|s′)) where
    /// anything follows; without the last term where [`SacConfig::backup_entropy`] says so.
    pub fn update(&mut self, batch: &Batch) -> SacMetrics {
        let rows = self.rows(batch);
        let mut rng = Rng::new(self.seed, Stream::Policy, self.n_updates);
        let n = batch.len() as i64;
        let both = self.noise(2 * n, &mut rng);
        let (next_noise, noise) = (both.narrow(0, 0, n), both.narrow(0, n, n));
        let alpha = self.temperature.alpha();

        let (target, passes) = self.passes(&rows, &next_noise, alpha);
        let [critic_loss, q_mean] = self.critic_gradient(passes.critic, &target);
        self.critic.parameters.step_at(self.rate());
        let [log_probability, value] = self.actor_gradient(&rows, passes.actor, &noise, alpha);
        self.actor.parameters.step_at(self.rate());
        if let Some(average) = &mut self.average {
            let weight = self.config.actor_ema;
            kernel::lerp(&mut average.values, &self.actor.parameters.values, weight);
        }
        let [critic_loss, q_mean, log_probability, value] =
            read([critic_loss, q_mean, log_probability, value]);
        let (actor_loss, entropy) = (alpha * log_probability - value, -log_probability);
        self.temperature.step(
            alpha * (entropy - self.wanted_entropy()),
            self.rate() * self.config.alpha_learning_rate,
        );
        if self
            .n_updates
            .is_multiple_of(self.config.target_every.max(1))
        {
            let tau = self.critic_ema();
            kernel::lerp(&mut self.target_values, &self.critic.parameters.values, tau);
        }
        self.n_updates += 1;
        SacMetrics {
            critic_loss: critic_loss as f32,
            actor_loss: actor_loss as f32,
            q_mean: q_mean as f32,
            alpha: alpha as f32,
            entropy: entropy as f32,
        }
    }

    /// Fresh critics, their target and their moments; actor and temperature stay.
    pub fn reset_critic(&mut self) {
        self.n_critic_resets += 1;
        self.init_critic();
        self.critic.parameters.reset_moments();
    }

    /// Leads the learning rates to [`SacConfig::final_rate`], the policy's entropy to
    /// [`SacConfig::final_entropy`] and τ to [`SacConfig::final_critic_ema`]; `done` is the part of the run that is behind, [0, 1]. It
    /// follows from the step, so no checkpoint holds it.
    pub fn anneal(&mut self, done: f64) {
        self.done = done.clamp(0.0, 1.0);
    }

    /// Share of the learning rates that is left.
    fn rate(&self) -> f64 {
        1.0 + self.done * (self.config.final_rate - 1.0)
    }

    /// τ by now.
    fn critic_ema(&self) -> f64 {
        let (first, last) = (self.config.critic_ema, self.config.final_critic_ema);
        if last == 0.0 {
            return first;
        }
        first * (last / first).powf(self.done)
    }

    /// Entropy towards which α leads the policy, nats.
    fn wanted_entropy(&self) -> f64 {
        let (first, last) = (self.config.initial_entropy, self.config.final_entropy);
        let each = first + self.done * (last - first);
        each * self.action_size as f64
    }

    /// Updates so far.
    pub fn n_updates(&self) -> u64 {
        self.n_updates
    }

    /// How often critics were made anew.
    pub fn n_critic_resets(&self) -> u64 {
        self.n_critic_resets
    }

    /// The weights that [`Act::Mean`] acts with, alone.
    pub fn save_policy(&self, archive: &mut Archive) {
        match &self.average {
            Some(average) => save_tensor(&average.values, AVERAGE_SECTION, archive),
            None => save_tensor(&self.actor.parameters.values, ACTOR_SECTION, archive),
        }
    }

    /// What [`Sac::save_policy`] or [`Sac::save`] wrote of them; all else stays as it is.
    ///
    /// # Errors
    /// When the section is missing or of another network.
    pub fn load_policy(&mut self, archive: &Archive) -> Result<(), LearnError> {
        match &mut self.average {
            Some(average) => load_tensor(&mut average.values, AVERAGE_SECTION, archive),
            None => load_tensor(&mut self.actor.parameters.values, ACTOR_SECTION, archive),
        }
    }

    /// Weights, moments, temperature and counters.
    pub fn save(&self, archive: &mut Archive) {
        self.actor.parameters.save(ACTOR_SECTION, archive);
        if let Some(average) = &self.average {
            save_tensor(&average.values, AVERAGE_SECTION, archive);
        }
        self.critic.parameters.save("sac.critic", archive);
        save_tensor(&self.target_values, "sac.target", archive);
        let t = &self.temperature;
        archive.put_f64("sac.temperature", &[t.log_alpha, t.first, t.second]);
        archive.put_json(
            "sac.counters",
            &(t.n_steps, self.n_updates, self.n_critic_resets),
        );
    }

    /// What [`Sac::save`] wrote, from any device.
    ///
    /// # Errors
    /// When a section is missing or of another network; part of the agent may then be loaded.
    pub fn load(&mut self, archive: &Archive) -> Result<(), LearnError> {
        self.actor.parameters.load(ACTOR_SECTION, archive)?;
        if let Some(average) = &mut self.average {
            load_tensor(&mut average.values, AVERAGE_SECTION, archive)?;
        }
        self.critic.parameters.load("sac.critic", archive)?;
        load_tensor(&mut self.target_values, "sac.target", archive)?;
        let [log_alpha, first, second] = archive.f64("sac.temperature")?;
        let (n_steps, n_updates, n_critic_resets) = archive.json("sac.counters")?;
        self.temperature = Temperature {
            log_alpha,
            first,
            second,
            n_steps,
        };
        (self.n_updates, self.n_critic_resets) = (n_updates, n_critic_resets);
        Ok(())
    }

    fn rows(&self, batch: &Batch) -> Rows {
        let (s, a) = (self.observation_size, self.action_size);
        let blocks = [
            (&batch.observation[..], s),
            (&batch.action, a),
            (&batch.next_observation, s),
            (&batch.reward, 1),
            (&batch.not_terminal, 1),
        ];
        let [observation, action, next_observation, reward, not_terminal] =
            matrices(blocks, self.options);
        Rows {
            state_action: Tensor::cat(&[&observation, &action], 1),
            observation,
            next_observation,
            reward,
            not_terminal,
        }
    }

    fn noise(&self, n: i64, rng: &mut Rng) -> Tensor {
        let mut noise = vec![0.0; (n * self.action_size) as usize];
        rng.fill_normal(&mut noise);
        matrix(&noise, self.action_size, self.options)
    }

    /// What both gradients start from, as all nets are before the update: the critics' target, and
    /// the passes to go back through.
    fn passes(&self, rows: &Rows, next_noise: &Tensor, alpha: f64) -> (Tensor, Passes) {
        let (me, rows, noise) = (Reading(self), Reading(rows), Reading(next_noise));
        threads::both(
            self.actor.net.is_worth_a_thread(&rows.observation),
            || me.bellman_target(&rows, &noise, alpha),
            || Passes {
                critic: me.critic.net.forward_taped(&rows.state_action),
                actor: me.actor.net.forward_taped(&rows.observation),
            },
        )
    }

    /// `[B × 1]`.
    fn bellman_target(&self, rows: &Rows, noise: &Tensor, alpha: f64) -> Tensor {
        let policy = Gaussian::new(
            &self.actor.net.forward(&rows.next_observation),
            self.action_size,
        );
        let sample = policy.sample(noise);
        let state_action = Tensor::cat(&[&rows.next_observation, &sample.action], 1);
        let (value, _) = self.target.forward(&state_action).min_dim(0, false);
        let value = if self.config.backup_entropy {
            value - sample.log_probability * alpha
        } else {
            value
        };
        &rows.reward + &rows.not_terminal * value * self.config.discount
    }

    /// Fills the critics' gradient; returns loss and mean Q, one number each.
    fn critic_gradient(&mut self, (q, tape): (Tensor, Tape), target: &Tensor) -> [Tensor; 2] {
        let error = &q - target;
        let n = target.numel() as f64;
        self.critic.parameters.zero_gradient();
        self.critic.net.backward(
            &tape,
            &(&error * (2.0 / n)),
            Some(&mut self.critic.gradient),
            None,
        );
        [error.square().sum(None) / n, q.mean(None)]
    }

    /// Fills the actor's gradient; returns mean log π and mean value, one number each.
    fn actor_gradient(
        &mut self,
        rows: &Rows,
        (output, tape): (Tensor, Tape),
        noise: &Tensor,
        alpha: f64,
    ) -> [Tensor; 2] {
        let (s, a) = (self.observation_size, self.action_size);
        let policy = Gaussian::new(&output, a);
        let sample = policy.sample(noise);
        let state_action = Tensor::cat(&[&rows.observation, &sample.action], 1);
        let (q, q_tape) = self.critic.net.forward_taped(&state_action);
        let n = q.size()[1] as f64;
        let (value, which) = q.min_dim(0, true);
        let mut q_gradient = q.zeros_like();
        let _ = q_gradient.scatter_value_(0, &which, -1.0 / n);
        let action_gradient = self
            .critic
            .net
            .backward(&q_tape, &q_gradient, None, Some(s..s + a));
        let action_gradient = action_gradient.expect("the action's columns were asked for");
        let action_gradient = action_gradient.sum_dim_intlist([0_i64].as_slice(), false, None);
        let gradient = policy.backward(&sample, noise, &action_gradient, alpha / n);
        self.actor.parameters.zero_gradient();
        self.actor
            .net
            .backward(&tape, &gradient, Some(&mut self.actor.gradient), None);
        [sample.log_probability.mean(None), value.mean(None)]
    }
}

/// Where the actor's weights lie in an archive.
const ACTOR_SECTION: &str = "sac.actor";
/// Where the averaged actor lies, if there is one.
const AVERAGE_SECTION: &str = "sac.actor.average";
/// Keys of initial weights: the actor, then the critics of each reset.
const ACTOR: u64 = 0;
const FIRST_CRITIC: u64 = 1_000;

#[cfg(test)]
mod tests;
