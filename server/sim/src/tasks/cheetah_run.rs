//! cheetah-run: run forward at 10 m/s.
//!
//! # Geometry
//! The robot of [`crate::robots::cheetah`], which moves in a plane. A control step is one
//! dynamics step of 0.01 s, an episode 1,000 of them. Reset: every leg joint uniform over its
//! range, then 2 s without action, so that an episode begins standing.
//!
//! # State vector
//! | index | content | unit |
//! |---|---|---|
//! | 0 | height of the torso's origin above 0.7 m | m |
//! | 1 | pitch, positive nose down | rad |
//! | 2–7 | back thigh, shin, foot, front thigh, shin, foot | rad |
//! | 8–10 | rates of x, height, pitch | m/s, rad/s |
//! | 11–16 | rates of the six leg joints | rad/s |
//!
//! # Action
//! Torques on back thigh, shin, foot, front thigh, shin, foot, over 120, 90, 60, 90, 60, 30 N m.
//!
//! # Reward
//! **vₓ/10, kept in [0, 1]**, with vₓ the speed of the whole robot's centre of mass. Any posture
//! will do.
//!
//! # Success
//! None; see [`super::locomotion`].
//!
//! Differs from the original: the dynamics are articulated ones of our own, not MuJoCo's and, unlike
//! those of other tasks, not rapier3d's either; [`crate::articulated`] says why. Pictures follow the
//! robot along the ground only, see [`super::locomotion`].
//! Source: `cheetah.py` of dm_control 1.0.14.

use domain::environment::EnvSpec;
use domain::random::{Rng, Stream};
use domain::scene::{Frame, Scene};
use serde::{Deserialize, Serialize};

use super::Task;
use super::locomotion::picture::{View, camera};
use super::locomotion::{Gait, Locomotion, Sizes, picture};
use crate::articulated::simulation::Simulation;
use crate::robots::cheetah::{self, FIRST_LEG_JOINT, GEARS, N_DOFS};

/// The registry's line.
pub const TASK: Task = Task {
    name: SIZES.name,
    title: "Run like a cheetah",
    summary: "The cheetah should run forward, to the right, as fast as it can.",
    spec,
    make: || Box::new(Locomotion::<Cheetah, ACTION_SIZE>::new()),
    scene,
    place,
    expert: None,
};

/// Numbers in an observation.
pub const OBSERVATION_SIZE: usize = 17;
const ACTION_SIZE: usize = 6;
const SIZES: Sizes = Sizes {
    name: "cheetah-run",
    observation_size: OBSERVATION_SIZE,
    action_size: ACTION_SIZE,
    pose_size: N_DOFS,
    control_period_s: 0.01,
};

/// m/s
const TARGET_SPEED: f64 = 10.0;
/// Dynamics steps without action at a reset.
const SETTLING_STEPS: usize = 200;

/// What observation and reward are made of.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Readings {
    /// All coordinates but x.
    pub posture: [f64; N_DOFS - 1],
    /// Rates of all coordinates.
    pub rates: [f64; N_DOFS],
    /// Horizontal speed of the whole robot's centre of mass, m/s.
    pub speed: f64,
}

impl Readings {
    /// What a simulated state says.
    pub fn of(simulation: &mut Simulation<N_DOFS>) -> Self {
        let model = cheetah::model();
        Self {
            posture: std::array::from_fn(|k| simulation.q[k + 1]),
            rates: std::array::from_fn(|dof| simulation.v[dof]),
            speed: simulation.motion(model).whole_velocity(model).x,
        }
    }

    /// See the module's table.
    pub fn observation(&self) -> [f64; OBSERVATION_SIZE] {
        let mut observation = [0.0; OBSERVATION_SIZE];
        observation[..8].copy_from_slice(&self.posture);
        observation[8..].copy_from_slice(&self.rates);
        observation
    }

    /// In [0, 1].
    pub fn reward(&self) -> f64 {
        (self.speed / TARGET_SPEED).clamp(0.0, 1.0)
    }
}

/// The cheetah in an episode.
#[derive(Serialize, Deserialize)]
struct Cheetah {
    simulation: Simulation<N_DOFS>,
}

impl Gait<ACTION_SIZE> for Cheetah {
    const SIZES: Sizes = SIZES;

    fn begin(seed: u64) -> Self {
        let mut rng = Rng::new(seed, Stream::Reset, 0);
        let mut q = cheetah::model().rest();
        for (angle, [low, high]) in q[FIRST_LEG_JOINT..].iter_mut().zip(cheetah::RANGES_DEG) {
            *angle = rng.uniform_in(low, high).to_radians();
        }
        let mut simulation = Simulation::new(q);
        for _ in 0..SETTLING_STEPS {
            simulation.step(cheetah::model(), &[0.0; N_DOFS]);
        }
        Self { simulation }
    }

    fn advance(&mut self, action: &[f64; ACTION_SIZE]) {
        let mut torques = [0.0; N_DOFS];
        for (motor, (action, gear)) in action.iter().zip(GEARS).enumerate() {
            torques[FIRST_LEG_JOINT + motor] = gear * action;
        }
        self.simulation.step(cheetah::model(), &torques);
    }

    fn judge(&mut self) -> (Vec<f64>, f64) {
        let readings = Readings::of(&mut self.simulation);
        (readings.observation().to_vec(), readings.reward())
    }

    fn configuration(&self) -> &[f64] {
        &self.simulation.q
    }

    fn is_finite(&self) -> bool {
        self.simulation.is_finite()
    }
}

fn spec() -> EnvSpec {
    SIZES.spec()
}

/// Height of the centre of mass of a cheetah that stands still, where the cameras look.
const MIDDLE: f32 = 0.45;

fn scene() -> Scene {
    let side = [-0.038, -3.0, MIDDLE + 0.149];
    let back = [-2.6, -1.5, MIDDLE + 1.0];
    picture::scene(
        cheetah::model(),
        MIDDLE,
        vec![
            camera("side", side, [0.0, 1.0, 0.0], 45.0),
            camera("corner", back, [0.822, 0.474, -0.316], 45.0),
        ],
    )
}

fn place(pose: &[f32]) -> Frame {
    picture::place(cheetah::model(), pose, View::ToTheSide)
}

#[cfg(test)]
mod tests;
