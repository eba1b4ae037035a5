//! quadruped-run: run forward on four legs at 5.0 m/s, upright.
//!
//! Geometry, state vector, action, reward and success are those of [`super::quadruped`] with a
//! target speed V of **5.0 m/s**.

use super::Task;
use super::locomotion::{Locomotion, Sizes};
use super::quadruped::{self, ACTION_SIZE, AtPace, Pace};

/// The registry's line.
pub const TASK: Task = Task {
    name: SIZES.name,
    title: "Run on four legs",
    summary: "The quadruped should stay upright and run forward as fast as it can.",
    spec: || SIZES.spec(),
    make: || Box::new(Locomotion::<AtPace<Run>, ACTION_SIZE>::new()),
    scene: quadruped::scene,
    place: quadruped::place,
    expert: None,
};

/// V, m/s.
pub const TARGET_SPEED: f64 = 5.0;
const SIZES: Sizes = quadruped::sizes("quadruped-run");

struct Run;

impl Pace for Run {
    const SIZES: Sizes = SIZES;
    const TARGET_SPEED: f64 = TARGET_SPEED;
}
