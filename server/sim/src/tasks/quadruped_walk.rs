//! quadruped-walk: walk forward on four legs at 0.5 m/s, upright.
//!
//! Only the speed sets it apart from quadruped-run; [`super::quadruped`] holds what both share.
//!
//! # Geometry
//! The robot of [`crate::robots::quadruped`], free in space. A control step takes 0.02 s, an
//! episode 1,000 of them. Reset: any orientation, just clear of the ground, at rest.
//!
//! # State vector
//! The 78 numbers of the table in [`super::quadruped`]: joints and their rates, activations,
//! the torso's motion and orientation, forces and torques at the toes.
//!
//! # Action
//! Commands of the twelve motors (yaw, lift, extend of each leg), [−1, 1] stretched to their
//! ranges.
//!
//! # Reward
//! `(1 + u)/2 · move` in [0, 1], with u the height of the torso's upward unit vector, v the forward
//! speed in torso axes and V = **0.5 m/s**: move = 1 for v ≥ V, else ½ + v/(2V), not below 0.
//!
//! # Success
//! None; see [`super::locomotion`].
//!
//! Differs from the original: as [`super::quadruped`] says; above all, the dynamics are those of
//! [`crate::articulated`].
//! Source: `quadruped.py` of dm_control 1.0.14.

use super::Task;
use super::locomotion::{Locomotion, Sizes};
use super::quadruped::{self, ACTION_SIZE, AtPace, Pace};

/// The registry's line.
pub const TASK: Task = Task {
    name: SIZES.name,
    title: "Walk on four legs",
    summary: "The quadruped should stay upright and walk forward at a walking pace.",
    spec: || SIZES.spec(),
    make: || Box::new(Locomotion::<AtPace<Walk>, ACTION_SIZE>::new()),
    scene: quadruped::scene,
    place: quadruped::place,
    expert: None,
};

/// V, m/s.
pub const TARGET_SPEED: f64 = 0.5;
const SIZES: Sizes = quadruped::sizes("quadruped-walk");

struct Walk;

impl Pace for Walk {
    const SIZES: Sizes = SIZES;
    const TARGET_SPEED: f64 = TARGET_SPEED;
}
