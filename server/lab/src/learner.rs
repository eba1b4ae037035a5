//! The parts that learn, and how their work is spread over two threads.

use domain::environment::EnvSpec;
use domain::query::Query;
use domain::random::{Rng, Stream};
use learn::LearnError;
use learn::checkpoint::Archive;
use learn::device::Device;
use learn::exploration::StateEntropy;
use learn::replay::{Batch, BatchRule, Replay, RewardSource};
use learn::reward::{Labeled, Lesson, RewardEnsemble, RewardFit, RewardLearner, SteeringConfig};
use learn::sac::{Act, Sac, SacMetrics};
use learn::temporal::{TemporalDistance, TemporalMetrics};

use crate::config::RunConfig;
use crate::method::Method;

/// Agent, reward, temporal distance and exploration of one run.
pub(crate) struct Learner {
    /// Trained on preferences.
    pub reward: RewardEnsemble,
    /// Learned where the method asks for it.
    pub temporal: Option<TemporalDistance>,
    fitting: Box<dyn RewardLearner>,
    agent: Sac,
    exploration: StateEntropy,
    batch: usize,
    task_reward_scale: f32,
    seed: u64,
}

/// Updates that are due beside one round of control steps.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Due {
    /// SAC updates.
    pub n_updates: u64,
    /// Whether they train on novelty instead of reward.
    pub is_exploring: bool,
    /// What they train on otherwise.
    pub batches: BatchRule,
    /// Steps of the temporal distance.
    pub n_temporal: u64,
}

/// What the updates of one round said.
#[derive(Debug, Default)]
pub(crate) struct Updates {
    /// Of each SAC update.
    pub agent: Vec<SacMetrics>,
    /// Of each step of the temporal distance.
    pub temporal: Vec<TemporalMetrics>,
}

impl Learner {
    /// Fresh weights that follow from the run's seed.
    pub(crate) fn new(config: &RunConfig, spec: &EnvSpec, method: &Method, device: Device) -> Self {
        let (s, a, seed) = (spec.observation_size, spec.action_size, config.seed);
        Self {
            reward: RewardEnsemble::new(&config.reward, s, a, seed, device),
            temporal: method
                .learns_temporal_distance()
                .then(|| TemporalDistance::new(&config.temporal, s, seed, device)),
            fitting: (method.reward_learner)(config),
            agent: Sac::new(&config.agent, s, a, seed, device),
            exploration: StateEntropy::new(&config.exploration),
            batch: config.agent.batch,
            task_reward_scale: config.training.task_reward_scale,
            seed,
        }
    }

    /// Does the due updates beside `simulate` and the temporal distance, on two threads of the
    /// present rayon pool; whichever is done first helps the other's networks along. All of them
    /// read the replay as it was before, so the result does not depend on who is faster.
    pub(crate) fn work<S: Send, R: Send>(
        &mut self,
        due: &Due,
        replay: &Replay,
        simulate: impl FnOnce(&RewardEnsemble) -> (S, R) + Send,
    ) -> (Updates, S, R) {
        let n_updates_before = self.agent.n_updates();
        let Self {
            reward,
            temporal,
            agent,
            exploration,
            batch,
            task_reward_scale,
            seed,
            ..
        } = self;
        let (batch, reward_scale, seed) = (*batch, *task_reward_scale, *seed);
        let update_agent = || -> Vec<SacMetrics> {
            learn::device::init();
            (0..due.n_updates)
                .map(|_| {
                    let mut rng = Rng::new(seed, Stream::Batch, agent.n_updates());
                    let mut sample = replay.draw(batch, &mut rng, &due.batches);
                    if due.is_exploring {
                        sample.reward = exploration.intrinsic(&sample.observation, replay);
                    } else {
                        scale(&mut sample, &due.batches, reward_scale);
                    }
                    agent.update(&sample)
                })
                .collect()
        };
        let go_on = move || {
            learn::device::init();
            let (steps, rewards) = simulate(reward);
            let temporal: Vec<_> = match temporal {
                Some(temporal) => (0..due.n_temporal)
                    .filter_map(|_| temporal.update(replay))
                    .collect(),
                None => Vec::new(),
            };
            (steps, rewards, temporal)
        };
        let (agent, (steps, rewards, temporal)) = rayon::join(update_agent, go_on);
        let updates = Updates { agent, temporal };
        if due.is_exploring {
            self.warm_start(n_updates_before, replay);
        }
        (updates, steps, rewards)
    }

    /// Brings the reward towards novelty beside the exploring updates since `from`, for methods
    /// that start with one.
    fn warm_start(&mut self, from: u64, replay: &Replay) {
        let n_steps = u64::from(self.fitting.warm_start_steps());
        for step in from * n_steps..self.agent.n_updates() * n_steps {
            let mut rng = Rng::new(self.seed, Stream::WarmStart, step);
            let sample = replay.sample(self.batch, &mut rng);
            let targets = self.exploration.warm_targets(&sample.observation, replay);
            self.reward
                .regress(&sample.observation, &sample.action, &targets);
        }
    }

    /// Fits the reward to all answers in the method's way.
    pub(crate) fn fit_reward(
        &mut self,
        replay: &Replay,
        labeled: &[Labeled],
        unlabeled: &[Query],
    ) -> RewardFit {
        let lesson = Lesson {
            replay,
            labeled,
            unlabeled,
        };
        self.fitting.fit(&mut self.reward, &lesson)
    }

    /// Pairs beside the asked ones that a fit wants, for each query of a session.
    pub(crate) fn unlabeled_per_query(&self) -> u32 {
        self.fitting.unlabeled_per_query()
    }

    /// In place of one SAC update: moves the rewards so that critics which learn from them agree
    /// with the latest answers, updates the agent on them, and relabels.
    pub(crate) fn steer(
        &mut self,
        steering: &SteeringConfig,
        latest: &[Labeled],
        replay: &mut Replay,
    ) -> SacMetrics {
        let rule = BatchRule {
            ends_at_time_limit: true,
            ..BatchRule::default()
        };
        let mut rng = Rng::new(self.seed, Stream::Batch, self.agent.n_updates());
        let mut batch = replay.draw(self.batch, &mut rng, &rule);
        self.reward
            .steer(&self.agent, replay, &batch, latest, steering.weight);
        batch.reward = self.reward.predict(&batch.observation, &batch.action);
        let metrics = self.agent.update(&batch);
        self.reward.relabel(replay);
        metrics
    }

    /// The end of pre-training: a fresh critic on relabelled experience, and a head start.
    pub(crate) fn end_exploration(
        &mut self,
        config: &RunConfig,
        replay: &Replay,
        batches: &BatchRule,
    ) {
        if config.training.reset_critic {
            self.agent.reset_critic();
        }
        for _ in 0..config.training.updates_after_reset {
            let mut rng = Rng::new(self.seed, Stream::Batch, self.agent.n_updates());
            let mut sample = replay.draw(self.batch, &mut rng, batches);
            scale(&mut sample, batches, self.task_reward_scale);
            self.agent.update(&sample);
        }
    }

    /// How often critics were made anew.
    #[cfg(test)]
    pub(crate) fn n_critic_resets(&self) -> u64 {
        self.agent.n_critic_resets()
    }

    /// Leads the agent's learning rates and entropy to their last ones with the part of the run
    /// that is behind, [0, 1].
    pub(crate) fn anneal(&mut self, done: f64) {
        self.agent.anneal(done);
    }

    /// Actions sampled from the policy, `[n × A]`.
    pub(crate) fn act_exploring(&self, observations: &[f32], step: u64) -> Vec<f32> {
        self.agent.act(observations, Act::Sample { step })
    }

    /// Mean actions, `[n × A]`.
    pub(crate) fn act_mean(&self, observations: &[f32]) -> Vec<f32> {
        self.agent.act(observations, Act::Mean)
    }

    /// What it takes to act, and nothing of what it takes to learn on.
    pub(crate) fn save_policy(&self, archive: &mut Archive) {
        self.agent.save_policy(archive);
    }

    /// Weights, moments and counters of all parts.
    pub(crate) fn save(&self, archive: &mut Archive) {
        self.agent.save(archive);
        self.reward.save(archive);
        self.fitting.save(archive);
        self.exploration.save(archive);
        if let Some(temporal) = &self.temporal {
            temporal.save(archive);
        }
    }

    /// What [`Learner::save`] wrote.
    ///
    /// # Errors
    /// When the archive is of another network or damaged.
    pub(crate) fn load(&mut self, archive: &Archive) -> Result<(), LearnError> {
        self.agent.load(archive)?;
        self.reward.load(archive)?;
        self.fitting.load(archive)?;
        self.exploration.load(archive)?;
        if let Some(temporal) = &mut self.temporal {
            temporal.load(archive)?;
        }
        Ok(())
    }

    /// Equal for learners whose weights, moments and counters are bit-identical.
    pub(crate) fn fingerprint(&self) -> String {
        let mut archive = Archive::new();
        self.save(&mut archive);
        archive.fingerprint()
    }
}

/// Brings task rewards to the size that learned ones have.
fn scale(sample: &mut Batch, rule: &BatchRule, scale: f32) {
    if rule.reward == RewardSource::Task {
        sample.reward.iter_mut().for_each(|r| *r *= scale);
    }
}
