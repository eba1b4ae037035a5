//! What the running and walking tasks of DeepMind's control suite share.
//!
//! 1,000 control steps an episode, the time limit its only end; rewards in [0, 1]; **no success**:
//! the suite knows none for them, so [`Step::success`] stays false and runs are judged by their
//! return. The suite has no scripted experts for them either.
//!
//! # Picture
//! Frames ride along with the robot: every body is placed against the point of the ground under
//! the whole robot's centre of mass, and the chequered floor slides back below it, so a fixed camera
//! keeps the robot in sight and the floor shows its speed. The originals' cameras follow the
//! centre of mass up and down as well; here the horizon stays where it is.

use domain::environment::{EnvError, EnvSpec, Environment, Step, TaskReward};
use serde::{Deserialize, Serialize, de::DeserializeOwned};

use crate::course::Course;
use crate::world;

pub mod picture;

/// Control steps in an episode.
pub const EPISODE_LEN: u32 = 1000;
/// Control steps in a segment shown to people.
pub const SEGMENT_LEN: u32 = 50;

/// Constants of a task.
#[derive(Debug, Clone, Copy)]
pub struct Sizes {
    /// The task's name.
    pub name: &'static str,
    /// Numbers in an observation.
    pub observation_size: usize,
    /// Numbers in an action.
    pub action_size: usize,
    /// Numbers in a pose: the robot's configuration.
    pub pose_size: usize,
    /// Seconds of a control step.
    pub control_period_s: f64,
}

impl Sizes {
    /// As the rest of the program takes them.
    pub fn spec(&self) -> EnvSpec {
        EnvSpec {
            task: self.name.into(),
            observation_size: self.observation_size,
            action_size: self.action_size,
            pose_size: self.pose_size,
            episode_len: EPISODE_LEN,
            segment_len: SEGMENT_LEN,
            control_period_s: self.control_period_s,
            has_success: false,
            stages: Vec::new(),
        }
    }
}

/// A robot in an episode of its task; `A` numbers in an action.
pub trait Gait<const A: usize>: Serialize + DeserializeOwned + Send {
    /// Its task.
    const SIZES: Sizes;

    /// The start of the episode of `seed`.
    fn begin(seed: u64) -> Self;

    /// Moves by one control step; `action` is in [−1, 1].
    fn advance(&mut self, action: &[f64; A]);

    /// The present observation and the reward for being there.
    fn judge(&mut self) -> (Vec<f64>, f64);

    /// The robot's configuration.
    fn configuration(&self) -> &[f64];

    /// Whether all of the state are numbers.
    fn is_finite(&self) -> bool;
}

/// The simulation of one of these tasks.
pub struct Locomotion<G, const A: usize> {
    spec: EnvSpec,
    state: State<G>,
}

/// Everything a snapshot holds.
#[derive(Serialize, Deserialize)]
struct State<G> {
    gait: G,
    course: Course,
}

impl<G> State<G> {
    fn new(gait: G, seed: u64) -> Self {
        Self {
            gait,
            course: Course::new(seed),
        }
    }
}

impl<G: Gait<A>, const A: usize> Locomotion<G, A> {
    /// In the episode of seed 0, before its first step.
    pub fn new() -> Self {
        Self {
            spec: G::SIZES.spec(),
            state: State::new(G::begin(0), 0),
        }
    }

    /// The robot, for a test to break.
    #[cfg(test)]
    pub(super) fn gait(&mut self) -> &mut G {
        &mut self.state.gait
    }
}

impl<G: Gait<A>, const A: usize> Default for Locomotion<G, A> {
    fn default() -> Self {
        Self::new()
    }
}

impl<G: Gait<A>, const A: usize> Environment for Locomotion<G, A> {
    fn spec(&self) -> &EnvSpec {
        &self.spec
    }

    fn reset(&mut self, seed: u64) -> Vec<f32> {
        self.state = State::new(G::begin(seed), seed);
        single(&self.state.gait.judge().0)
    }

    fn step(&mut self, action: &[f32]) -> Result<Step, EnvError> {
        let name = G::SIZES.name;
        let State { gait, course } = &mut self.state;
        let action = course.begin_step(name, action)?;
        gait.advance(&action);
        course.check_state(name, gait.is_finite(), &single(gait.configuration()))?;
        let (observation, reward) = gait.judge();
        let step = Step {
            observation: single(&observation),
            task_reward: TaskReward(reward),
            success: false,
            end: course.end(EPISODE_LEN),
            stage: None,
        };
        course.checked_step(name, step)
    }

    fn pose(&self) -> Vec<f32> {
        single(self.state.gait.configuration())
    }

    fn snapshot(&self) -> Vec<u8> {
        world::snapshot(G::SIZES.name, &self.state)
    }

    fn restore(&mut self, snapshot: &[u8]) -> Result<(), EnvError> {
        self.state = world::restore(G::SIZES.name, snapshot)?;
        Ok(())
    }
}

fn single(numbers: &[f64]) -> Vec<f32> {
    numbers.iter().map(|x| *x as f32).collect()
}
