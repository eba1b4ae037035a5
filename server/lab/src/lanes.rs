//! The environments of a run, stepped side by side.

use domain::environment::{EnvError, EnvSpec, Environment, Step};
use domain::random::{Rng, Stream};
use learn::replay::{NewStep, Replay};
use learn::reward::Estimate;
use serde::{Deserialize, Serialize};

/// Environments and the states they are in.
pub(crate) struct Lanes {
    envs: Vec<Box<dyn Environment>>,
    observations: Vec<f32>,
    observation_size: usize,
    action_size: usize,
    seed: u64,
    n_episodes: u64,
}

/// What it takes to go on where the lanes were.
#[derive(Debug, Clone, Serialize, Deserialize)]
pub(crate) struct LanesState {
    snapshots: Vec<Vec<u8>>,
    observations: Vec<f32>,
    n_episodes: u64,
}

impl Lanes {
    /// `n` environments, each at the start of an episode that the replay knows.
    pub(crate) fn start(task: &sim::tasks::Task, n: usize, seed: u64, replay: &mut Replay) -> Self {
        let spec = (task.spec)();
        let mut lanes = Self::unstarted(task, &spec, n, seed);
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
        seed: u64,
        state: LanesState,
    ) -> Result<Self, EnvError> {
        let spec = (task.spec)();
        let mut lanes = Self::unstarted(task, &spec, state.snapshots.len(), seed);
        for (env, snapshot) in lanes.envs.iter_mut().zip(&state.snapshots) {
            env.reset(0);
            env.restore(snapshot)?;
        }
        Ok(Self {
            observations: state.observations,
            n_episodes: state.n_episodes,
            ..lanes
        })
    }

    fn unstarted(task: &sim::tasks::Task, spec: &EnvSpec, n: usize, seed: u64) -> Self {
        Self {
            envs: (0..n).map(|_| (task.make)()).collect(),
            observations: vec![0.0; n * spec.observation_size],
            observation_size: spec.observation_size,
            action_size: spec.action_size,
            seed,
            n_episodes: 0,
        }
    }

    /// What [`Lanes::restore`] takes.
    pub(crate) fn state(&self) -> LanesState {
        LanesState {
            snapshots: self.envs.iter().map(|env| env.snapshot()).collect(),
            observations: self.observations.clone(),
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

    /// One control step in each environment; actions are `[n_envs × A]`.
    ///
    /// # Errors
    /// Whatever an environment refuses.
    pub(crate) fn step(&mut self, actions: &[f32]) -> Result<Vec<Step>, EnvError> {
        let actions = actions.chunks(self.action_size);
        self.envs
            .iter_mut()
            .zip(actions)
            .map(|(env, action)| env.step(action))
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
        let env = &mut self.envs[lane];
        let observation = env.reset(seed);
        replay.begin_episode(lane, seed, &observation, &env.pose(), env.stage());
        self.observations[lane * self.observation_size..][..self.observation_size]
            .copy_from_slice(&observation);
    }
}
