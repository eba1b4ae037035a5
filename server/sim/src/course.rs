//! The course of an episode, the same in every task: its steps, its time limit, and its end
//! where the numbers stop being finite.

use domain::environment::{EnvError, EpisodeEnd, Step, checked_action};
use serde::{Deserialize, Serialize};

/// How far an episode has come.
///
/// An episode that has left the finite numbers is lost: every later step is refused with the
/// same error. Rapier alone would put the broken body aside and go on with the others. A
/// snapshot remembers the loss; a reset begins another course.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
pub struct Course {
    seed: u64,
    n_steps: u32,
    is_lost: bool,
}

impl Course {
    /// Before the first step of the episode of `seed`.
    pub fn new(seed: u64) -> Self {
        Self {
            seed,
            n_steps: 0,
            is_lost: false,
        }
    }

    /// Reads a step's action and counts the step.
    ///
    /// # Errors
    /// An action that does not fit makes no step; nor does any in an episode that is lost.
    pub fn begin_step<const A: usize>(
        &mut self,
        task: &str,
        action: &[f32],
    ) -> Result<[f64; A], EnvError> {
        self.go_on(task)?;
        let action = checked_action(task, action)?;
        self.n_steps += 1;
        Ok(action)
    }

    /// Looks at the state after a step before anybody judges it, which takes finite numbers.
    ///
    /// * `is_finite` – what the physics says of itself
    ///
    /// # Errors
    /// [`EnvError::NotFinite`]: the episode is lost.
    pub fn check_state(
        &mut self,
        task: &str,
        is_finite: bool,
        pose: &[f32],
    ) -> Result<(), EnvError> {
        self.is_lost |= !(is_finite && are_finite(pose));
        self.go_on(task)
    }

    /// Looks at what a step brought before it leaves.
    ///
    /// # Errors
    /// [`EnvError::NotFinite`]: the episode is lost.
    pub fn checked_step(&mut self, task: &str, step: Step) -> Result<Step, EnvError> {
        self.is_lost |= !(are_finite(&step.observation) && step.task_reward.0.is_finite());
        self.go_on(task)?;
        Ok(step)
    }

    /// The time limit, once `episode_len` steps are made.
    pub fn end(&self, episode_len: u32) -> Option<EpisodeEnd> {
        (self.n_steps >= episode_len).then_some(EpisodeEnd::TimeLimit)
    }

    fn go_on(&self, task: &str) -> Result<(), EnvError> {
        if !self.is_lost {
            return Ok(());
        }
        Err(EnvError::NotFinite {
            task: task.into(),
            seed: self.seed,
            step: self.n_steps,
        })
    }
}

fn are_finite(numbers: &[f32]) -> bool {
    numbers.iter().all(|x| x.is_finite())
}

#[cfg(test)]
pub(crate) mod tests {
    use domain::environment::{Environment, TaskReward};
    use rapier3d::prelude::Vector;

    use super::*;
    use crate::world::World;

    /// Lets `spoil` put into the state what is no finite number, or soon will be none, two steps
    /// into the episode of seed 7: that episode is over for good, others are not.
    pub(crate) fn assert_loses_the_episode<E: Environment>(
        mut environment: E,
        spoil: impl FnOnce(&mut E),
    ) {
        let spec = environment.spec().clone();
        let action = vec![0.5; spec.action_size];
        environment.reset(7);
        for _ in 0..2 {
            environment.step(&action).expect("a sound state");
        }
        let sound = environment.snapshot();
        spoil(&mut environment);
        let lost = Err(EnvError::NotFinite {
            task: spec.task,
            seed: 7,
            step: 3,
        });
        for _ in 0..3 {
            assert_eq!(environment.step(&action), lost);
        }
        let snapshot = environment.snapshot();

        environment.reset(8);
        environment.step(&action).expect("another episode");
        environment.restore(&snapshot).expect("its own snapshot");
        assert_eq!(environment.step(&action), lost);
        environment.restore(&sound).expect("its own snapshot");
        environment.step(&action).expect("the step before the loss");
    }

    /// Gives a body that hangs on nothing a velocity that is no number.
    pub(crate) fn spoil_a_free_body(world: &mut World) {
        let physics = &mut world.physics;
        let joints = &physics.multibody_joints;
        let (_, body) = physics
            .bodies
            .iter_mut()
            .filter(|(handle, body)| body.is_dynamic() && joints.rigid_body_link(*handle).is_none())
            .last()
            .expect("every world has a free body");
        body.set_linvel(Vector::new(f32::NAN, 0.0, 0.0), true);
    }

    fn step(observation: f32, reward: f64) -> Step {
        Step {
            observation: vec![0.0, observation],
            task_reward: TaskReward(reward),
            success: false,
            end: None,
            stage: None,
        }
    }

    #[test]
    fn each_number_that_leaves_has_to_be_finite() {
        let sound = step(1.0, 1.0);
        let mut course = Course::new(3);
        assert_eq!(course.check_state("task", true, &[0.5]), Ok(()));
        assert_eq!(course.checked_step("task", sound.clone()), Ok(sound));
        for bad in [f32::NAN, f32::INFINITY, f32::NEG_INFINITY] {
            let is_lost = |check: fn(&mut Course, f32) -> bool| check(&mut Course::new(3), bad);
            assert!(is_lost(|c, x| c
                .check_state("task", true, &[0.0, x])
                .is_err()));
            assert!(is_lost(|c, x| c
                .checked_step("task", step(x, 0.0))
                .is_err()));
            assert!(is_lost(|c, x| c
                .checked_step("task", step(0.0, f64::from(x)))
                .is_err()));
        }
        assert!(Course::new(3).check_state("task", false, &[]).is_err());
    }

    #[test]
    fn a_lost_episode_names_its_last_step_and_makes_no_other() {
        let mut course = Course::new(3);
        for _ in 0..4 {
            course.begin_step::<1>("task", &[0.0]).expect("it fits");
        }
        course.begin_step::<1>("task", &[]).expect_err("too short");
        let lost = course.check_state("task", false, &[]);
        let error = lost.clone().expect_err("it is lost").to_string();
        assert!(error.contains("task") && error.contains("step 4") && error.contains("seed 3"));
        for action in [&[0.0][..], &[]] {
            assert_eq!(course.begin_step::<1>("task", action).map(|_| ()), lost);
        }
        assert_eq!(course.check_state("task", true, &[]), lost);
    }

    #[test]
    fn the_time_limit_comes_with_the_last_step() {
        let mut course = Course::new(3);
        course.begin_step::<1>("task", &[0.0]).expect("it fits");
        assert_eq!(course.end(2), None);
        course.begin_step::<1>("task", &[0.0]).expect("it fits");
        assert_eq!(course.end(2), Some(EpisodeEnd::TimeLimit));
    }
}
