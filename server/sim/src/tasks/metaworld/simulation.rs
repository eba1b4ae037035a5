//! The environment of any MetaWorld task.

use domain::environment::{EnvError, EnvSpec, Environment, Step};
use domain::random::{Rng, Stream};
use serde::{Deserialize, Serialize};

use super::{Episode, Point, Readings, Setup};
use crate::robots::sawyer_hand;
use crate::world;

/// A task's simulation.
pub struct Simulation<S> {
    spec: EnvSpec,
    state: State<S>,
}

/// Everything a snapshot holds.
#[derive(Serialize, Deserialize)]
struct State<S> {
    episode: Episode,
    setup: S,
}

impl<S: Setup> Simulation<S> {
    /// The episode of seed 0, before its first step.
    pub fn new() -> Self {
        Self {
            spec: super::spec::<S>(),
            state: State::new(0),
        }
    }

    /// An episode whose object stands at `root` instead of where a seed would put it.
    pub fn with_root(root: Point) -> Self {
        Self {
            state: State::with_root(0, root),
            ..Self::new()
        }
    }

    /// What the present state says.
    pub fn readings(&self) -> Readings<S::Object> {
        self.state.readings()
    }

    /// Whether the hand is in contact with anything.
    pub fn hand_touches(&self) -> bool {
        let Episode { world, hand, .. } = &self.state.episode;
        hand.touches(&world.physics)
    }
}

impl<S: Setup> Default for Simulation<S> {
    fn default() -> Self {
        Self::new()
    }
}

impl<S: Setup> State<S> {
    fn new(seed: u64) -> Self {
        let root = S::draw(&mut Rng::new(seed, Stream::Reset, 0));
        Self::with_root(seed, root)
    }

    fn with_root(seed: u64, root: Point) -> Self {
        let mut episode = Episode::new(seed, S::RANGE, S::add_surroundings);
        let setup = S::add_object(&mut episode.world.physics, root);
        Self { episode, setup }
    }

    fn readings(&self) -> Readings<S::Object> {
        let object = self.setup.object(&self.episode.world.physics);
        self.episode.readings(object)
    }
}

impl<S: Setup + Send> Environment for Simulation<S> {
    fn spec(&self) -> &EnvSpec {
        &self.spec
    }

    fn reset(&mut self, seed: u64) -> Vec<f32> {
        self.state = State::new(seed);
        let now = S::moment(&self.readings());
        self.state.episode.first_observation(now)
    }

    fn step(&mut self, action: &[f32]) -> Result<Step, EnvError> {
        let State { episode, setup } = &mut self.state;
        let action = episode.course.begin_step(S::NAME, action)?;
        let is_finite = episode.advance(setup, action);
        let pose = self.pose();
        let course = &mut self.state.episode.course;
        course.check_state(S::NAME, is_finite, &pose)?;
        let readings = self.readings();
        let (now, judgement) = (S::moment(&readings), S::judge(&readings));
        let episode = &mut self.state.episode;
        let step = episode.finish_step(now, judgement);
        episode.course.checked_step(S::NAME, step)
    }

    fn pose(&self) -> Vec<f32> {
        let Episode { world, hand, .. } = &self.state.episode;
        let mut pose = sawyer_hand::pose(hand, &world.physics).to_vec();
        pose.extend(S::pose(&self.readings().object));
        pose
    }

    fn snapshot(&self) -> Vec<u8> {
        world::snapshot(S::NAME, &self.state)
    }

    fn restore(&mut self, snapshot: &[u8]) -> Result<(), EnvError> {
        self.state = world::restore(S::NAME, snapshot)?;
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::course::tests::{assert_loses_the_episode, spoil_a_free_body};
    use crate::tasks::sweep_into::SweepInto;
    use crate::tasks::window_open::WindowOpen;

    #[test]
    fn a_velocity_that_is_no_number_loses_the_episode() {
        // The hand, and the block.
        assert_loses_the_episode(Simulation::<WindowOpen>::new(), |environment| {
            spoil_a_free_body(&mut environment.state.episode.world);
        });
        assert_loses_the_episode(Simulation::<SweepInto>::new(), |environment| {
            spoil_a_free_body(&mut environment.state.episode.world);
        });
    }

    #[test]
    fn a_number_too_large_to_be_shown_loses_the_episode() {
        assert_loses_the_episode(Simulation::<WindowOpen>::new(), |environment| {
            environment.state.episode.before[4] = 1e300;
        });
    }
}
