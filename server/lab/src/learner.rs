//! The parts that learn, and how their work is spread over two threads.

use domain::environment::EnvSpec;
use domain::random::{Rng, Stream};
use learn::LearnError;
use learn::checkpoint::Archive;
use learn::device::Device;
use learn::exploration::StateEntropy;
use learn::replay::{Replay, RewardSource};
use learn::reward::RewardEnsemble;
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
    agent: Sac,
    exploration: StateEntropy,
    batch: usize,
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
    pub reward: RewardSource,
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
            agent: Sac::new(&config.agent, s, a, seed, device),
            exploration: StateEntropy::new(&config.exploration),
            batch: config.agent.batch,
            seed,
        }
    }

    /// Does the due updates on a second thread while `simulate` and the temporal distance run
    /// on this one. All of them read the replay as it was before, so the result does not
    /// depend on who is faster.
    pub(crate) fn work<S, R>(
        &mut self,
        due: &Due,
        replay: &Replay,
        simulate: impl FnOnce(&RewardEnsemble) -> (S, R),
    ) -> (Updates, S, R) {
        let Self {
            reward,
            temporal,
            agent,
            exploration,
            batch,
            seed,
        } = self;
        let (batch, seed) = (*batch, *seed);
        let update_agent = || -> Vec<SacMetrics> {
            learn::device::init();
            (0..due.n_updates)
                .map(|_| {
                    let mut rng = Rng::new(seed, Stream::Batch, agent.n_updates());
                    if due.is_exploring {
                        let mut sample = replay.sample(batch, &mut rng);
                        sample.reward = exploration.intrinsic(&sample.observation, replay);
                        agent.update(&sample)
                    } else {
                        agent.update(&replay.sample_with(batch, &mut rng, due.reward))
                    }
                })
                .collect()
        };
        std::thread::scope(|scope| {
            let updating = (due.n_updates > 0).then(|| scope.spawn(update_agent));
            let (steps, rewards) = simulate(reward);
            let temporal = match temporal {
                Some(temporal) => (0..due.n_temporal)
                    .filter_map(|_| temporal.update(replay))
                    .collect(),
                None => Vec::new(),
            };
            let agent = updating.map(|thread| {
                thread
                    .join()
                    .unwrap_or_else(|panic| std::panic::resume_unwind(panic))
            });
            (
                Updates {
                    agent: agent.unwrap_or_default(),
                    temporal,
                },
                steps,
                rewards,
            )
        })
    }

    /// The end of pre-training: a fresh critic on relabelled experience, and a head start.
    pub(crate) fn begin_preference_learning(&mut self, config: &RunConfig, replay: &Replay) {
        if config.training.reset_critic {
            self.agent.reset_critic();
        }
        for _ in 0..config.training.updates_after_reset {
            let mut rng = Rng::new(self.seed, Stream::Batch, self.agent.n_updates());
            self.agent.update(&replay.sample(self.batch, &mut rng));
        }
    }

    /// Actions sampled from the policy, `[n × A]`.
    pub(crate) fn act_exploring(&self, observations: &[f32], step: u64) -> Vec<f32> {
        self.agent.act(observations, Act::Sample { step })
    }

    /// Mean actions, `[n × A]`.
    pub(crate) fn act_mean(&self, observations: &[f32]) -> Vec<f32> {
        self.agent.act(observations, Act::Mean)
    }

    /// Weights, moments and counters of all parts.
    pub(crate) fn save(&self, archive: &mut Archive) {
        self.agent.save(archive);
        self.reward.save(archive);
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
