//! drawer-open: pull a drawer open by its handle, to its stop and a little beyond.
//!
//! # Geometry
//! The case stands on the table at `P`, drawn per reset: x in [−0.1, 0.1], y = 0.9, z = 0. The
//! drawer slides along +y by `q` in [−0.16, 0] m: negative is open, towards the robot. The goal
//! is `T = P + (0, −0.36, 0.09)`, 0.19 m from a shut drawer's handle: at the stop the handle is
//! still 3 cm short of it, so the task lives on how softly the stop gives way.
//!
//! # State
//! | observation | meaning | unit |
//! |---|---|---|
//! | 0–2 | hand | m |
//! | 3 | gripper openness | – |
//! | 4–6 | handle `h = P + (0, −0.17 + q, 0.09)` | m |
//! | 7–10 | 1, 0, 0, 0 | – |
//! | 11–17 | zeros | – |
//! | 18–35 | 0–17 one step before | |
//! | 36–38 | zeros: the goal is hidden | m |
//!
//! # Action
//! `(x, y, z, grip)` in [−1, 1]: increments of the hand's target of up to 1 cm, +1 closes.
//!
//! # Reward
//! `r = 5 (C + O)` with `O = tolerance(‖h − T‖; 0, 0.02, margin 0.2)` and
//! `C = tolerance(‖W (h − H)‖; 0, 0.01, margin ‖W (T + (0, 0.2, 0) − tcp₀)‖)`, both long-tailed;
//! `H` is the hand, `tcp₀` the fingertips at the reset, `W = diag(3, 3, 1)`.
//!
//! # Success
//! `‖h − T‖ ≤ 0.03`.
//!
//! Differs from the original: the first observation shows this episode's drawer, shut (there a
//! stale read shows the one before). See also `robots::sawyer_hand` and `tasks::assembly`.
//! Source: METAWORLD.md 3.2 and 1.9, METAWORLD_EXPERTS.md.

use domain::random::Rng;
use domain::scene::{Frame, Material, Scene, Transform};
use rapier3d::prelude::PhysicsWorld;
use serde::{Deserialize, Serialize};

use super::Task;
use super::assembly::{self, Along, Motion, Mover, MovingPart, Part, Stops, capsule, cuboid};
use super::metaworld::picture::{self, OBJECT_BODY};
use super::metaworld::{
    self, Judgement, MOMENT_SIZE, Point, Readings, Setup, distance, distance_xy, minus, plus, yes,
};
use crate::reward::{Sigmoid, tolerance};
use crate::robots::sawyer_hand::HandRange;
use crate::robots::tabletop;

/// drawer-open, as the list of tasks shows it.
pub const TASK: Task = Task {
    name: DrawerOpen::NAME,
    title: "Open the drawer",
    summary: "The arm should pull the drawer open by its handle, as far as it goes.",
    spec: metaworld::spec::<DrawerOpen>,
    make: metaworld::make::<DrawerOpen>,
    scene,
    place,
    expert: Some(expert),
};

// ── Reward ─────────────────────────────────────────────────────────────────────────────────

/// Where the drawer is.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Drawer {
    /// Root of the case, `P`.
    pub root: Point,
    /// `q`, metres.
    pub slide: f64,
}

/// Where the handle of a drawer at `root` should get to.
pub fn goal(root: Point) -> Point {
    plus(root, [0.0, -0.36, 0.09])
}

/// The middle of the handle.
pub fn handle(root: Point, slide: f64) -> Point {
    plus(root, [0.0, -0.17 + slide, 0.09])
}

/// Length of a way on which sideways counts three times as much as up and down.
fn weighted(way: Point) -> f64 {
    let [x, y, z] = way;
    distance([3.0 * x, 3.0 * y, z], [0.0; 3])
}

// ── Setup ──────────────────────────────────────────────────────────────────────────────────

const GREEN: Material = Material::plain(0.4, 0.65, 0.4);
const HANDLE: Material = Material::plain(0.75, 0.75, 0.75);

/// From the root to the middle of the case.
const CASE: Point = [0.0, 0.0, 0.084];
/// The case, around its middle.
const CASE_PARTS: [Part; 5] = [
    cuboid([-0.11, 0.0, 0.0], [0.008, 0.1, 0.084], GREEN),
    cuboid([0.11, 0.0, 0.0], [0.008, 0.1, 0.084], GREEN),
    cuboid([0.0, 0.092, -0.008], [0.102, 0.008, 0.076], GREEN),
    cuboid([0.0, -0.008, -0.07], [0.102, 0.092, 0.014], GREEN),
    cuboid([0.0, 0.0, 0.076], [0.102, 0.1, 0.008], GREEN),
];

/// From the root to the frame of a shut drawer.
const SHUT: Point = [0.0, -0.01, 0.09];
/// The drawer, in its frame.
const DRAWER_PARTS: [Part; 8] = [
    cuboid([0.0, -0.082, 0.008], [0.1, 0.008, 0.052], GREEN),
    cuboid([0.0, 0.082, 0.008], [0.1, 0.008, 0.052], GREEN),
    cuboid([-0.092, 0.0, 0.008], [0.008, 0.074, 0.052], GREEN),
    cuboid([0.092, 0.0, 0.008], [0.008, 0.074, 0.052], GREEN),
    cuboid([0.0, 0.0, -0.052], [0.1, 0.09, 0.008], GREEN),
    capsule([-0.05, -0.12, 0.0], Along::Y, 0.009, 0.03, HANDLE),
    capsule([0.05, -0.12, 0.0], Along::Y, 0.009, 0.03, HANDLE),
    capsule([0.0, -0.15, 0.0], Along::X, 0.009, 0.05, HANDLE),
];

const DRAWER: Mover<'_> = Mover {
    motion: Motion::Slide(Along::Y),
    limits: [-0.16, 0.0],
    stops: Stops::Soft,
    mass_kg: 0.38,
    centre_of_mass: [0.0; 3],
    inertia: 0.01,
    parts: &DRAWER_PARTS,
};

/// The drawer of one episode.
#[derive(Serialize, Deserialize)]
pub struct DrawerOpen {
    root: Point,
    drawer: MovingPart,
}

impl Setup for DrawerOpen {
    const NAME: &'static str = "drawer-open";
    const RANGE: HandRange = HandRange::FAR;
    const POSE_SIZE: usize = 4;
    type Object = Drawer;

    fn draw(rng: &mut Rng) -> Point {
        [rng.uniform_in(-0.1, 0.1), 0.9, 0.0]
    }

    fn add_object(world: &mut PhysicsWorld, root: Point) -> Self {
        let case = assembly::add_fixed(world, plus(root, CASE), &CASE_PARTS);
        let drawer = MovingPart::add(world, case, plus(root, SHUT), &DRAWER, 0.0);
        Self { root, drawer }
    }

    fn meet_stops(&self, world: &mut PhysicsWorld) {
        self.drawer.meet_stops(world);
    }

    fn object(&self, world: &PhysicsWorld) -> Drawer {
        Drawer {
            root: self.root,
            slide: self.drawer.position(world),
        }
    }

    fn progress(object: &Drawer) -> f64 {
        object.slide
    }

    fn moment(readings: &Readings<Drawer>) -> [f64; MOMENT_SIZE] {
        let handle = handle(readings.object.root, readings.object.slide);
        metaworld::moment(
            readings.hand,
            readings.openness,
            handle,
            [1.0, 0.0, 0.0, 0.0],
        )
    }

    fn judge(readings: &Readings<Drawer>) -> Judgement {
        let Drawer { root, slide } = readings.object;
        let (handle, goal) = (handle(root, slide), goal(root));
        let to_goal = distance(handle, goal);
        let open = tolerance(to_goal, [0.0, 0.02], 0.2, Sigmoid::LongTail);
        let start = plus(goal, [0.0, 0.2, 0.0]);
        let margin = weighted(minus(start, readings.init_tcp));
        let to_hand = minus(handle, readings.hand);
        let reach = tolerance(weighted(to_hand), [0.0, 0.01], margin, Sigmoid::LongTail);
        Judgement {
            reward: 5.0 * (reach + open),
            success: to_goal <= 0.03,
            near_object: yes(distance(handle, readings.hand) <= 0.03),
            grasp_reward: reach,
            in_place_reward: open,
            obj_to_target: to_goal,
        }
    }

    fn pose(object: &Drawer) -> Vec<f32> {
        let [x, y, z] = object.root;
        [object.slide, x, y, z].map(|v| v as f32).to_vec()
    }
}

/// With open fingers: above the handle, down behind it, then hard towards the robot.
fn expert(observation: &[f32]) -> Vec<f32> {
    let hand = metaworld::point(observation, 0);
    let under = plus(metaworld::point(observation, 4), [0.0, 0.0, -0.02]);
    let (waypoint, gain) = if distance_xy(hand, under) > 0.06 {
        (plus(under, [0.0, 0.0, 0.3]), 4.0)
    } else if (hand[2] - under[2]).abs() > 0.04 {
        (under, 4.0)
    } else {
        (plus(under, [0.0, -0.06, 0.0]), 50.0)
    };
    metaworld::towards(hand, waypoint, gain, -1.0)
}

// ── Picture ────────────────────────────────────────────────────────────────────────────────

fn scene() -> Scene {
    let case = CASE_PARTS.iter().map(|part| part.shape(OBJECT_BODY));
    let drawer = DRAWER_PARTS.iter().map(|part| part.shape(OBJECT_BODY + 1));
    picture::scene(
        tabletop::scenery(),
        case.chain(drawer).collect(),
        (0.02, picture::GREEN),
        "corner3",
    )
}

/// Case, drawer and goal of `[q, P.x, P.y, P.z]`.
fn place(pose: &[f32]) -> Frame {
    picture::place(pose, |drawer| {
        let root = Transform::at(drawer[1], drawer[2], drawer[3]);
        let slid = plus(SHUT, [0.0, f64::from(drawer[0]), 0.0]);
        [
            root.then(picture::at(CASE)),
            root.then(picture::at(slid)),
            root.then(picture::at(goal([0.0; 3]))),
        ]
    })
}

#[cfg(test)]
mod tests;
