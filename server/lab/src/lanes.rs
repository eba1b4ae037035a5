//! The environments of a run, stepped side by side.

use domain::environment::{EnvError, Environment, EpisodeEnd, Step};
use domain::random::{Rng, Stream};
use learn::device::with_denormals;
use learn::replay::{NewStep, Replay};
use learn::reward::Estimate;
use serde::{Deserialize, Serialize};

use crate::config::RunConfig;

/// Environments and the states they are in.
pub(crate) struct Lanes {
    envs: Vec<Box<dyn Environment>>,
    observations: Vec<f32>,
    observation_size: usize,
    action_size: usize,
    /// Steps after which an episode ends, if the task does not end it before.
    episode_len: u32,
    /// Steps that each environment's episode has behind it.
    n_steps: Vec<u32>,
    seed: u64,
    n_episodes: u64,
}

/// What it takes to go on where the lanes were.
#[derive(Debug, Clone, Serialize, Deserialize)]
pub(crate) struct LanesState {
    snapshots: Vec<Vec<u8>>,
    observations: Vec<f32>,
    /// Empty where an older program wrote it, whose episodes only the task ended.
    #[serde(default)]
    n_steps: Vec<u32>,
    n_episodes: u64,
}

impl Lanes {
    /// `n` environments, each at the start of an episode that the replay knows.
    pub(crate) fn start(task: &sim::tasks::Task, config: &RunConfig, replay: &mut Replay) -> Self {
        let n = config.environment.n_envs;
        let mut lanes = Self::unstarted(task, n, config);
        for lane in 0..n {
            lanes.begin_episode(lane, replay);
        }
        lanes
    }

    /// The environments that a checkpoint describes.
    ///
    /// # Errors
    /// When a snapshot is of another task or version.
    pub(crate) fn restore(
        task: &sim::tasks::Task,
        config: &RunConfig,
        state: LanesState,
    ) -> Result<Self, EnvError> {
        let n = state.snapshots.len();
        let mut lanes = Self::unstarted(task, n, config);
        for (env, snapshot) in lanes.envs.iter_mut().zip(&state.snapshots) {
            with_denormals(|| {
                env.reset(0);
                env.restore(snapshot)
            })?;
        }
        if state.n_steps.len() == n {
            lanes.n_steps = state.n_steps;
        }
        Ok(Self {
            observations: state.observations,
            n_episodes: state.n_episodes,
            ..lanes
        })
    }

    fn unstarted(task: &sim::tasks::Task, n: usize, config: &RunConfig) -> Self {
        let spec = (task.spec)();
        Self {
            envs: (0..n).map(|_| (task.make)()).collect(),
            observations: vec![0.0; n * spec.observation_size],
            observation_size: spec.observation_size,
            action_size: spec.action_size,
            episode_len: config.episode_len(&spec),
            n_steps: vec![0; n],
            seed: config.seed,
            n_episodes: 0,
        }
    }

    /// What [`Lanes::restore`] takes.
    pub(crate) fn state(&self) -> LanesState {
        LanesState {
            snapshots: self.envs.iter().map(|env| env.snapshot()).collect(),
            observations: self.observations.clone(),
            n_steps: self.n_steps.clone(),
            n_episodes: self.n_episodes,
        }
    }

    /// Number of environments.
    pub(crate) fn len(&self) -> usize {
        self.envs.len()
    }

    /// Present states, `[n_envs × S]`.
    pub(crate) fn observations(&self) -> &[f32] {
        &self.observations
    }

    /// One control step in each environment; actions are `[n_envs × A]`. An episode that is
    /// as long as the settings want it ends as at a time limit.
    ///
    /// # Errors
    /// Whatever an environment refuses.
    pub(crate) fn step(&mut self, actions: &[f32]) -> Result<Vec<Step>, EnvError> {
        let actions = actions.chunks(self.action_size);
        self.envs
            .iter_mut()
            .zip(&mut self.n_steps)
            .zip(actions)
            .map(|((env, n_steps), action)| {
                let mut step = with_denormals(|| env.step(action))?;
                *n_steps += 1;
                let is_over = *n_steps >= self.episode_len;
                step.end = step.end.or(is_over.then_some(EpisodeEnd::TimeLimit));
                Ok(step)
            })
            .collect()
    }

    /// Hands the steps to the replay and starts new episodes where one ended.
    pub(crate) fn store(
        &mut self,
        actions: &[f32],
        learned: &Estimate,
        steps: &[Step],
        replay: &mut Replay,
    ) {
        for (lane, step) in steps.iter().enumerate() {
            let pose = self.envs[lane].pose();
            replay.push(
                lane,
                NewStep {
                    action: &actions[lane * self.action_size..][..self.action_size],
                    learned_reward: learned.rewards[lane],
                    task_reward: step.task_reward,
                    success: step.success,
                    stage: step.stage,
                    end: step.end,
                    next_observation: &step.observation,
                    next_pose: &pose,
                },
            );
            if replay.keeps_disagreement() {
                replay.note_disagreement(lane, learned.disagreements[lane]);
            }
            self.observations[lane * self.observation_size..][..self.observation_size]
                .copy_from_slice(&step.observation);
            if step.end.is_some() {
                self.begin_episode(lane, replay);
            }
        }
    }

    fn begin_episode(&mut self, lane: usize, replay: &mut Replay) {
        let seed = Rng::new(self.seed, Stream::EpisodeSeed, self.n_episodes).next_u64();
        self.n_episodes += 1;
        self.n_steps[lane] = 0;
        let env = &mut self.envs[lane];
        let observation = with_denormals(|| env.reset(seed));
        replay.begin_episode(lane, seed, &observation, &env.pose(), env.stage());
        self.observations[lane * self.observation_size..][..self.observation_size]
            .copy_from_slice(&observation);
    }
}
