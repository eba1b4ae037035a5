//! MetaWorld's sliding window: a frame that stands on the table and a pane that slides along +x.
//!
//! Metres. The frame's root `P` is its centre; the pane's frame is `P + (q, 0, 0)` with `q` in
//! [0, 0.2]. Parts serve as colliders and as shapes.
//! Source: METAWORLD.md 3.3 and 1.9.

use domain::scene::{Material, Scene, Transform};
use rapier3d::prelude::{PhysicsWorld, SpringCoefficients};
use serde::{Deserialize, Serialize};

use super::assembly::{
    self, Along, Motion, Mover, MovingPart, Part, Stops, capsule, cuboid, cylinder,
};
use super::metaworld::picture::{self, OBJECT_BODY};
use super::metaworld::{Judgement, Point, Readings, distance, plus, yes};
use crate::reward::{Sigmoid, hamacher, tolerance};
use crate::robots::tabletop;

const FRAME: Material = Material::plain(0.36, 0.26, 0.27);
const HANDLE: Material = Material::plain(0.65, 0.65, 0.65);
const GLASS: Material = Material {
    color: [0.0, 0.3, 0.4, 0.1],
    ..FRAME
};

/// Frame and right pane, around `P`.
const FIXED_PARTS: [Part; 11] = [
    cuboid([-0.216, 0.0, 0.0], [0.015, 0.03, 0.181], FRAME),
    cuboid([0.216, 0.0, 0.0], [0.015, 0.03, 0.181], FRAME),
    cuboid([0.0, 0.0, -0.192], [0.25, 0.06, 0.01], FRAME),
    cuboid([0.0, 0.0, -0.166], [0.201, 0.03, 0.015], FRAME),
    cuboid([0.0, 0.0, 0.166], [0.201, 0.03, 0.015], FRAME),
    cuboid([0.1, 0.013, -0.14], [0.08, 0.012, 0.01], FRAME),
    cuboid([0.1, 0.013, 0.14], [0.08, 0.012, 0.01], FRAME),
    cuboid([0.1, 0.008, 0.0], [0.08, 0.001, 0.13], GLASS),
    cuboid([0.1, 0.004, 0.0], [0.08, 0.003, 0.005], FRAME),
    cuboid([0.01, 0.013, 0.0], [0.01, 0.012, 0.15], FRAME),
    cuboid([0.19, 0.013, 0.0], [0.01, 0.012, 0.15], FRAME),
];

/// The pane that slides, around its own frame `P + (q, 0, 0)`.
const SLIDING_PARTS: [Part; 11] = [
    cuboid([-0.014, -0.013, 0.0], [0.014, 0.012, 0.15], FRAME),
    cuboid([-0.19, -0.013, 0.0], [0.01, 0.012, 0.15], FRAME),
    cuboid([-0.104, -0.013, -0.14], [0.076, 0.012, 0.01], FRAME),
    cuboid([-0.104, -0.013, 0.14], [0.076, 0.012, 0.01], FRAME),
    cuboid([-0.104, -0.018, 0.0], [0.076, 0.001, 0.13], GLASS),
    cuboid([-0.104, -0.022, 0.0], [0.076, 0.003, 0.005], FRAME),
    cylinder([-0.014, -0.028, -0.045], Along::Y, 0.012, 0.003, HANDLE),
    cylinder([-0.014, -0.028, 0.045], Along::Y, 0.012, 0.003, HANDLE),
    capsule([-0.014, -0.06, -0.045], Along::Y, 0.008, 0.035, HANDLE),
    capsule([-0.014, -0.06, 0.045], Along::Y, 0.008, 0.035, HANDLE),
    capsule([-0.014, -0.095, 0.0], Along::Z, 0.008, 0.045, HANDLE),
];

/// How far the pane slides, metres.
pub const TRAVEL_M: f64 = 0.2;

/// The pane's own joint. Its stops are stiffer than [`Stops::Soft`], because in the
/// original the pane also meets its frame: these hold it within 9 mm against the expert's 2 kN,
/// at 2 mm in the end (there 2.7 and 1.3 mm).
const PANE: Mover<'_> = Mover {
    motion: Motion::Slide(Along::X),
    limits: [0.0, TRAVEL_M as f32],
    stops: Stops::Own(SpringCoefficients {
        natural_frequency: 200.0,
        damping_ratio: 3.0,
    }),
    mass_kg: 0.638,
    centre_of_mass: [0.0; 3],
    inertia: 0.01,
    parts: &SLIDING_PARTS,
};

/// A window in its world.
#[derive(Debug, Clone, Copy, Serialize, Deserialize)]
pub struct Window {
    root: Point,
    pane: MovingPart,
    init_handle: Point,
}

/// What the tasks read of a window.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct WindowReading {
    /// Root of the window, `P`.
    pub root: Point,
    /// How far the pane is open, `q`, metres.
    pub slide: f64,
    /// The task's point on the handle at the reset.
    pub init_handle: Point,
}

impl Window {
    /// Adds a window at `root` whose pane is open by `slide` metres; `handle` is the task's
    /// point on the handle, seen from the pane.
    pub fn add(world: &mut PhysicsWorld, root: Point, slide: f64, handle: Point) -> Self {
        let frame = assembly::add_fixed(world, root, &FIXED_PARTS);
        Self {
            root,
            pane: MovingPart::add(world, frame, root, &PANE, slide as f32),
            init_handle: handle_at(root, slide, handle),
        }
    }

    /// Where the pane is.
    pub fn read(&self, world: &PhysicsWorld) -> WindowReading {
        WindowReading {
            root: self.root,
            slide: self.pane.position(world),
            init_handle: self.init_handle,
        }
    }
}

impl WindowReading {
    /// `[q, P.x, P.y, P.z]`.
    pub fn pose(&self) -> Vec<f32> {
        let [x, y, z] = self.root;
        [self.slide, x, y, z].map(|v| v as f32).to_vec()
    }
}

/// Numbers of [`WindowReading::pose`].
pub const POSE_SIZE: usize = 4;

/// A point that moves with the pane: `P + (q, 0, 0) + handle`.
pub fn handle_at(root: Point, slide: f64, handle: Point) -> Point {
    plus(plus(root, [slide, 0.0, 0.0]), handle)
}

/// What a task asks of its point on the handle.
#[derive(Debug, Clone, Copy)]
pub struct Aim {
    /// Where the point is.
    pub handle: Point,
    /// Where it should get to; only x counts.
    pub goal: Point,
    /// Distance from the goal at which being in place counts a tenth, metres.
    pub in_place_margin: f64,
    /// How nearness of the fingertips to the handle falls off.
    pub reach: Sigmoid,
}

/// Reward and success of both tasks: `10 · hamacher(R, I)` with nearness `R` of the fingertips to the
/// handle and nearness `I` of the handle to its goal.
pub fn judge(readings: &Readings<WindowReading>, aim: &Aim) -> Judgement {
    let to_goal = (aim.handle[0] - aim.goal[0]).abs();
    let in_place = tolerance(to_goal, [0.0, 0.05], aim.in_place_margin, Sigmoid::LongTail);
    let to_handle = distance(aim.handle, readings.tcp);
    let reach_margin = (distance(readings.object.init_handle, readings.init_tcp) - 0.02).abs();
    let reach = tolerance(to_handle, [0.0, 0.02], reach_margin, aim.reach);
    Judgement {
        reward: 10.0 * hamacher(reach, in_place),
        success: to_goal <= 0.05,
        near_object: yes(to_handle <= 0.05),
        grasp_reward: reach,
        in_place_reward: in_place,
        obj_to_target: to_goal,
    }
}

/// The picture of both tasks: frame and pane, and the goal.
pub fn scene() -> Scene {
    let fixed = FIXED_PARTS.iter().map(|part| part.shape(OBJECT_BODY));
    let sliding = SLIDING_PARTS.iter().map(|part| part.shape(OBJECT_BODY + 1));
    picture::scene(
        tabletop::scenery(),
        fixed.chain(sliding).collect(),
        (0.02, picture::GREEN),
        "corner3",
    )
}

/// Frame and pane of `[q, P.x, P.y, P.z]`, and the middle of the grip of a pane that is open by
/// `goal` metres.
pub fn place(pose: &[f32], goal: f32) -> [Transform; 3] {
    let (slide, x, y, z) = (pose[0], pose[1], pose[2], pose[3]);
    [
        Transform::at(x, y, z),
        Transform::at(x + slide, y, z),
        Transform::at(x + goal - 0.014, y - 0.095, z),
    ]
}
