//! quadruped-walk: walk forward on four legs at 0.5 m/s, upright.
//!
//! Geometry, state vector, action, reward and success are those of [`super::quadruped`] with a
//! target speed V of **0.5 m/s**.

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
