//! walker-run: run forward on two legs at 8 m/s, upright.
//!
//! # Geometry
//! The robot of [`crate::robots::walker`], which moves in a plane. A control step takes 0.025 s
//! in ten dynamics steps, an episode 1,000 of them. Reset: torso centre at 1.3 m, pitch uniform in
//! [−π, π], every leg joint uniform over its range, at rest; so it begins by falling.
//!
//! # State vector
//! | index | content | unit |
//! |---|---|---|
//! | 0–13 | cos θ, sin θ of torso, right thigh, leg, foot, left thigh, leg, foot; θ is the absolute pitch about +y | – |
//! | 14 | height h of the torso's centre | m |
//! | 15–17 | rates of height, x, pitch | m/s, rad/s |
//! | 18–23 | rates of right hip, knee, ankle, left hip, knee, ankle | rad/s |
//!
//! # Action
//! Torques on right hip, knee, ankle, left hip, knee, ankle, over 100, 50, 20 N m.
//!
//! # Reward
//! With u = cos θ of the torso and vₓ the speed of the whole robot's centre of mass:
//!
//! - standing = 1 for h ≥ 1.2, else `0.1^(((1.2 − h)/0.6)²)`
//! - stand = (3 standing + (1 + u)/2)/4
//! - move = vₓ/8, kept in [0, 1]
//! - **reward = stand (5 move + 1)/6**
//!
//! # Success
//! None; see [`super::locomotion`].
//!
//! Differs from the original: the dynamics are articulated ones of our own, not MuJoCo's and, unlike
//! those of other tasks, not rapier3d's either; [`crate::articulated`] says why. Pictures follow the
//! robot along the ground only, see [`super::locomotion`].
//! Source: `walker.py` of dm_control 1.0.14.

use domain::environment::EnvSpec;
use domain::random::{Rng, Stream};
use domain::scene::{Frame, Scene};
use serde::{Deserialize, Serialize};

use super::Task;
use super::locomotion::picture::{View, camera};
use super::locomotion::{Gait, Locomotion, Sizes, picture};
use crate::articulated::simulation::Simulation;
use crate::reward::{Sigmoid, tolerance};
use crate::robots::walker::{self, FIRST_LEG_JOINT, GEARS, N_DOFS, N_SUBSTEPS};

/// The registry's line.
pub const TASK: Task = Task {
    name: SIZES.name,
    title: "Run on two legs",
    summary: "The walker should get up and run forward, to the right, as fast as it can.",
    spec,
    make: || Box::new(Locomotion::<Walker, ACTION_SIZE>::new()),
    scene,
    place,
    expert: None,
};

/// Numbers in an observation.
pub const OBSERVATION_SIZE: usize = 24;
const ACTION_SIZE: usize = 6;
const SIZES: Sizes = Sizes {
    name: "walker-run",
    observation_size: OBSERVATION_SIZE,
    action_size: ACTION_SIZE,
    pose_size: N_DOFS,
    control_period_s: 0.025,
};

/// Height from which on the walker stands, metres.
const STAND_HEIGHT: f64 = 1.2;
/// m/s
const TARGET_SPEED: f64 = 8.0;

/// What observation and reward are made of.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Readings {
    /// cos and sin of each body's pitch, in the order of the observation.
    pub orientations: [[f64; 2]; 7],
    /// Of the torso's centre, metres.
    pub height: f64,
    /// Rates of all coordinates.
    pub rates: [f64; N_DOFS],
    /// Horizontal speed of the whole robot's centre of mass, m/s.
    pub speed: f64,
}

impl Readings {
    /// What a simulated state says.
    pub fn of(simulation: &mut Simulation<N_DOFS>) -> Self {
        let rates = std::array::from_fn(|dof| simulation.v[dof]);
        let model = walker::model();
        let motion = simulation.motion(model);
        Self {
            orientations: std::array::from_fn(|body| {
                let axes = motion.rotation(body).columns;
                [axes[0].x, axes[2].x]
            }),
            height: motion.position(0).z,
            rates,
            speed: motion.whole_velocity(model).x,
        }
    }

    /// See the module's table.
    pub fn observation(&self) -> [f64; OBSERVATION_SIZE] {
        let mut observation = [0.0; OBSERVATION_SIZE];
        observation[..14].copy_from_slice(self.orientations.as_flattened());
        observation[14] = self.height;
        observation[15..].copy_from_slice(&self.rates);
        observation
    }

    /// In [0, 1].
    pub fn reward(&self) -> f64 {
        let bounds = [STAND_HEIGHT, f64::INFINITY];
        let standing = tolerance(self.height, bounds, STAND_HEIGHT / 2.0, Sigmoid::Gaussian);
        let upright = f64::midpoint(1.0, self.orientations[0][0]);
        let stand = (3.0 * standing + upright) / 4.0;
        let moving = (self.speed / TARGET_SPEED).clamp(0.0, 1.0);
        stand * (5.0 * moving + 1.0) / 6.0
    }
}

/// The walker in an episode.
#[derive(Serialize, Deserialize)]
struct Walker {
    simulation: Simulation<N_DOFS>,
}

impl Gait<ACTION_SIZE> for Walker {
    const SIZES: Sizes = SIZES;

    fn begin(seed: u64) -> Self {
        use std::f64::consts::PI;
        let mut rng = Rng::new(seed, Stream::Reset, 0);
        let mut q = walker::model().rest();
        q[2] = rng.uniform_in(-PI, PI);
        for (angle, [low, high]) in q[FIRST_LEG_JOINT..].iter_mut().zip(walker::RANGES_DEG) {
            *angle = rng.uniform_in(low, high).to_radians();
        }
        Self {
            simulation: Simulation::new(q),
        }
    }

    fn advance(&mut self, action: &[f64; ACTION_SIZE]) {
        let mut torques = [0.0; N_DOFS];
        for (motor, (action, gear)) in action.iter().zip(GEARS).enumerate() {
            torques[FIRST_LEG_JOINT + motor] = gear * action;
        }
        for _ in 0..N_SUBSTEPS {
            self.simulation.step(walker::model(), &torques);
        }
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

/// Height of the centre of mass of a walker that stands straight, where the cameras look.
const MIDDLE: f32 = 0.772;

fn scene() -> Scene {
    let side = [-0.009, -2.0, MIDDLE + 1.228];
    let back = [-2.009, 0.0, MIDDLE + 1.028];
    picture::scene(
        walker::model(),
        MIDDLE,
        vec![
            camera("side", side, [0.0, 0.866, -0.5], 45.0),
            camera("back", back, [0.949, 0.0, -0.316], 45.0),
        ],
    )
}

fn place(pose: &[f32]) -> Frame {
    picture::place(walker::model(), pose, View::ToTheSide)
}

#[cfg(test)]
mod tests;
