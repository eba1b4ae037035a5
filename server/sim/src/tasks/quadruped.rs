//! What quadruped-walk and quadruped-run share: all but the speed that they ask for.
//!
//! # Geometry
//! The robot of [`crate::robots::quadruped`], free in space. A control step takes 0.02 s in four
//! dynamics steps, an episode 1,000 of them. Reset: any orientation, also upside down, joints and
//! activations at 0, at rest, as low over the ground as it does not touch, in steps of 1 cm.
//!
//! # State vector
//! | index | content | unit |
//! |---|---|---|
//! | 0–15 | yaw, pitch, knee, ankle of front left, front right, back right, back left | rad |
//! | 16–31 | their rates | rad/s |
//! | 32–43 | activations of the motors: yaw, lift, extend of each leg | – |
//! | 44–46 | velocity of the torso's origin, torso axes | m/s |
//! | 47 | u, height of the torso's upward unit vector | – |
//! | 48–50 | accelerometer, torso axes: (0, 0, 9.81) at rest | m/s² |
//! | 51–53 | angular velocity, torso axes | rad/s |
//! | 54–65 | asinh of the force of each ankle on its toe, toe axes | N |
//! | 66–77 | asinh of its torque about the toe's centre | N m |
//!
//! Accelerations and forces are those of the last dynamics step, at whose start they were found;
//! everything else is as the step left it. A reset is in free fall: all forces are 0.
//!
//! # Action
//! Commands of the twelve motors, [−1, 1] stretched to their ranges.
//!
//! # Reward
//! With v the forward speed in torso axes and V the target:
//!
//! - upright = (1 + u)/2
//! - move = 1 for v ≥ V, else ½ + v/(2V), not below 0
//! - **reward = upright · move**
//!
//! Standing still earns ½ a step.
//!
//! # Success
//! None; see [`super::locomotion`].
//!
//! Differs from the original: the dynamics are articulated ones of our own, not MuJoCo's and, unlike
//! those of other tasks, not rapier3d's either; [`crate::articulated`] says why. Pictures follow the
//! robot along the ground only, see [`super::locomotion`], and begin with a nearer camera.
//! Source: `quadruped.py` of dm_control 1.0.14.

use domain::random::{Rng, Stream};
use domain::scene::{Frame, Scene};
use serde::{Deserialize, Serialize};

use super::locomotion::picture::{View, camera};
use super::locomotion::{Gait, Sizes, picture};
use crate::articulated::simulation::Simulation;
use crate::articulated::vector::normalized;
use crate::robots::quadruped::{
    self, FIRST_LEG_COORDINATE, FIRST_LEG_DOF, N_COORDINATES, N_DOFS, N_MOTORS, Quadruped, Senses,
};

/// Numbers in an observation.
pub const OBSERVATION_SIZE: usize = 78;
/// Numbers in an action.
pub const ACTION_SIZE: usize = N_MOTORS;

/// Sizes of the task `name`.
pub const fn sizes(name: &'static str) -> Sizes {
    Sizes {
        name,
        observation_size: OBSERVATION_SIZE,
        action_size: ACTION_SIZE,
        pose_size: N_COORDINATES,
        control_period_s: 0.02,
    }
}

/// What observation and reward are made of.
#[derive(Debug, Clone, PartialEq)]
pub struct Readings {
    /// The sixteen leg joints.
    pub joints: [f64; 16],
    /// Their rates.
    pub joint_rates: [f64; 16],
    /// Of the motors.
    pub activations: [f64; N_MOTORS],
    /// Of the torso's origin, torso axes, m/s.
    pub velocity: [f64; 3],
    /// u
    pub upright: f64,
    /// Of the torso, its own axes, rad/s.
    pub angular_velocity: [f64; 3],
    /// Accelerations and forces.
    pub senses: Senses,
}

impl Readings {
    /// What a simulated state says, with what was felt on the way to it.
    pub fn of(
        simulation: &mut Simulation<N_DOFS>,
        activations: &[f64; N_MOTORS],
        senses: &Senses,
    ) -> Self {
        let (joints, joint_rates) = (
            std::array::from_fn(|k| simulation.q[FIRST_LEG_COORDINATE + k]),
            std::array::from_fn(|k| simulation.v[FIRST_LEG_DOF + k]),
        );
        let angular_velocity = std::array::from_fn(|k| simulation.v[3 + k]);
        let motion = simulation.motion(quadruped::model());
        let axes = motion.rotation(0);
        Self {
            joints,
            joint_rates,
            activations: *activations,
            velocity: axes.transposed_mul(motion.origin_velocity(0)).to_array(),
            upright: axes.columns[2].z,
            angular_velocity,
            senses: *senses,
        }
    }

    /// See the module's table.
    pub fn observation(&self) -> [f64; OBSERVATION_SIZE] {
        let mut observation = [0.0; OBSERVATION_SIZE];
        observation[..16].copy_from_slice(&self.joints);
        observation[16..32].copy_from_slice(&self.joint_rates);
        observation[32..44].copy_from_slice(&self.activations);
        observation[44..47].copy_from_slice(&self.velocity);
        observation[47] = self.upright;
        observation[48..51].copy_from_slice(&self.senses.accelerometer);
        observation[51..54].copy_from_slice(&self.angular_velocity);
        let forces = self.senses.toe_forces.as_flattened();
        let torques = self.senses.toe_torques.as_flattened();
        for (slot, felt) in observation[54..]
            .iter_mut()
            .zip(forces.iter().chain(torques))
        {
            *slot = felt.asinh();
        }
        observation
    }

    /// In [0, 1].
    ///
    /// * `target_speed` – m/s
    pub fn reward(&self, target_speed: f64) -> f64 {
        let upright = f64::midpoint(1.0, self.upright).clamp(0.0, 1.0);
        let moving = (0.5 + 0.5 * self.velocity[0] / target_speed).clamp(0.0, 1.0);
        upright * moving
    }
}

/// What a quadruped's present state says.
fn readings(quadruped: &mut Quadruped) -> Readings {
    let Quadruped {
        simulation,
        activations,
        senses,
    } = quadruped;
    Readings::of(simulation, activations, senses)
}

/// The start of the episode of `seed`.
fn begin(seed: u64) -> Quadruped {
    let mut rng = Rng::new(seed, Stream::Reset, 0);
    let turn = normalized(std::array::from_fn(|_| rng.normal()));
    let mut q = quadruped::model().rest();
    q[3..7].copy_from_slice(&turn);
    for centimetres in 0.. {
        q[2] = f64::from(centimetres) * 0.01;
        if !Simulation::new(q.clone()).touches_anything(quadruped::model()) {
            break;
        }
    }
    Quadruped::new(q)
}

/// One of the two tasks.
pub(super) trait Pace: Send {
    /// The task.
    const SIZES: Sizes;
    /// m/s
    const TARGET_SPEED: f64;
}

/// The quadruped at a task.
#[derive(Serialize, Deserialize)]
#[serde(bound = "")]
pub(super) struct AtPace<P> {
    quadruped: Quadruped,
    #[serde(skip)]
    pace: std::marker::PhantomData<P>,
}

impl<P: Pace> Gait<ACTION_SIZE> for AtPace<P> {
    const SIZES: Sizes = P::SIZES;

    fn begin(seed: u64) -> Self {
        Self {
            quadruped: begin(seed),
            pace: std::marker::PhantomData,
        }
    }

    fn advance(&mut self, action: &[f64; ACTION_SIZE]) {
        self.quadruped.advance(&quadruped::commands(action));
    }

    fn judge(&mut self) -> (Vec<f64>, f64) {
        let readings = readings(&mut self.quadruped);
        let reward = readings.reward(P::TARGET_SPEED);
        (readings.observation().to_vec(), reward)
    }

    fn configuration(&self) -> &[f64] {
        &self.quadruped.simulation.q
    }

    fn is_finite(&self) -> bool {
        let felt = self.quadruped.senses.accelerometer;
        self.quadruped.simulation.is_finite() && felt.iter().all(|x| x.is_finite())
    }
}

/// Height of the centre of mass of a quadruped that stands still, where the cameras look.
const MIDDLE: f32 = 0.44;

pub(super) fn scene() -> Scene {
    // Nearer than the originals', from which people could hardly tell legs: theirs follow.
    let near = [-3.2, 3.2, MIDDLE + 2.4];
    let global = [-10.0, 10.0, MIDDLE + 9.46];
    let x = [-1.7, 0.0, MIDDLE + 1.03];
    let y = [0.0, 4.0, MIDDLE + 2.03];
    picture::scene(
        quadruped::model(),
        MIDDLE,
        vec![
            camera("near", near, [0.625, -0.625, -0.469], 30.0),
            camera("global", global, [0.577, -0.577, -0.577], 45.0),
            camera("x", x, [0.8, 0.0, -0.6], 45.0),
            camera("y", y, [0.0, -0.894, -0.447], 45.0),
        ],
    )
}

pub(super) fn place(pose: &[f32]) -> Frame {
    picture::place(quadruped::model(), pose, View::FromAbove)
}

#[cfg(test)]
mod tests;
