//! door-unlock: turn the lever of a cabinet's lock from hanging down to pointing right.
//!
//! # Geometry
//! A shut cabinet stands on the table at `P`, drawn per reset: x in [−0.1, 0.1], y in
//! [0.8, 0.85], z = 0.15. The lever turns about +y at `Λ = P + (0, −0.118, 0.061)` by `q` in
//! [0, 1.57] rad: 1.57 hangs down, 0 points right. It has hardly any inertia, so its damping alone
//! decides how fast a push turns it, and its stops give way by half a radian. The goal is
//! `T = Λ + (0.1, −0.04, 0)`.
//!
//! # State
//! | observation | meaning | unit |
//! |---|---|---|
//! | 0–2 | hand | m |
//! | 3 | gripper openness | – |
//! | 4–6 | tip of the lever `h = Λ + R_y(q) (0.09, −0.04, −0.01)` | m |
//! | 7–10 | 1, 0, 0, 0 | – |
//! | 11–17 | zeros | – |
//! | 18–35 | 0–17 one step before | |
//! | 36–38 | zeros: the goal is hidden | m |
//!
//! # Action
//! `(x, y, z, grip)` in [−1, 1]: increments of the hand's target of up to 1 cm, +1 closes.
//!
//! # Reward
//! `r = 2 Q + 8 U` with `U = tolerance(|T.x − h.x|; 0, 0.005, margin 0.1)` and
//! `Q = tolerance(‖W (H + v − h)‖; 0, 0.02, margin ‖W (tcp₀ + v − Λ)‖)`, both long-tailed; `H` is
//! the hand, `tcp₀` the fingertips at the reset, `v = (0, 0.055, 0.07)`, `W = diag(0.25, 1, 0.5)`.
//!
//! # Success
//! `|T.x − h.x| ≤ 0.02`.
//!
//! Differs from the original: the arm never brushes the lock while an episode is set up. Contacts
//! do not creep, so that a hand that leans on the turned lever leaves it turned, where there it
//! slips in after some seconds and pushes the lever back: the expert's return is some 15 % higher.
//! See also `robots::sawyer_hand` and `tasks::assembly`.
//! Source: METAWORLD.md 3.5 and 1.9, METAWORLD_EXPERTS.md.

use domain::random::Rng;
use domain::scene::{Frame, Scene, Transform};
use rapier3d::prelude::PhysicsWorld;
use serde::{Deserialize, Serialize};

use super::Task;
use super::assembly::{self, Along, Motion, Mover, MovingPart, Part, Stops, cuboid};
use super::cabinet::{self, HANDLE, STEEL};
use super::metaworld::picture::{self, OBJECT_BODY};
use super::metaworld::{
    self, Judgement, MOMENT_SIZE, Point, Readings, Setup, distance, distance_xy, minus, plus, yes,
};
use crate::reward::{Sigmoid, tolerance};
use crate::robots::sawyer_hand::HandRange;
use crate::robots::tabletop;

/// door-unlock, as the list of tasks shows it.
pub const TASK: Task = Task {
    name: DoorUnlock::NAME,
    title: "Unlock the door",
    summary: "The arm should turn the lock's lever until it points to the right.",
    spec: metaworld::spec::<DoorUnlock>,
    make: metaworld::make::<DoorUnlock>,
    scene,
    place,
    expert: Some(expert),
};

// ── Reward ─────────────────────────────────────────────────────────────────────────────────

/// Where the lever is.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Lock {
    /// Root of the cabinet, `P`.
    pub root: Point,
    /// `q`, radians.
    pub angle: f64,
}

/// The lever's pivot `Λ` of a cabinet at `root`.
fn pivot(root: Point) -> Point {
    plus(root, [0.0, -0.118, 0.061])
}

/// Where the lever's tip should get to.
pub fn goal(root: Point) -> Point {
    plus(pivot(root), [0.1, -0.04, 0.0])
}

/// The tip of the lever, seen from the pivot at `q = 0`.
const TIP: Point = [0.09, -0.04, -0.01];

/// The tip of the lever at `angle`.
pub fn tip(root: Point, angle: f64) -> Point {
    let (sin, cos) = angle.sin_cos();
    let [x, y, z] = TIP;
    plus(pivot(root), [cos * x + sin * z, y, cos * z - sin * x])
}

/// The angle at which a tip is: the inverse of [`tip`].
pub fn angle_of(root: Point, tip: Point) -> f64 {
    let [x, _, z] = minus(tip, pivot(root));
    (-z).atan2(x) - (-TIP[2]).atan2(TIP[0])
}

/// How far the hand is from where it can push at `point`; across counts a quarter, height half.
fn reach_distance(hand: Point, point: Point) -> f64 {
    let [x, y, z] = minus(plus(hand, [0.0, 0.055, 0.07]), point);
    distance([0.25 * x, y, 0.5 * z], [0.0; 3])
}

// ── Setup ──────────────────────────────────────────────────────────────────────────────────

/// The shut door, its handle and the lock's plate, in the frame of the door's hinge.
const LEAF_PARTS: [Part; 6] = [
    cuboid([0.185, 0.0, 0.0], [0.184, 0.01, 0.124], STEEL),
    cuboid([0.185, -0.009, 0.061], [0.047, 0.013, 0.047], HANDLE),
    cuboid([0.325, -0.006, -0.05], [0.028, 0.012, 0.028], HANDLE),
    cuboid([0.325, -0.065, -0.05], [0.013, 0.047, 0.013], HANDLE),
    cuboid([0.381, -0.12, -0.05], [0.075, 0.019, 0.019], HANDLE),
    cuboid([0.395, -0.12, -0.05], [0.054, 0.023, 0.023], HANDLE),
];

/// The lever, in the frame of its pivot.
const LEVER_PARTS: [Part; 1] = [cuboid([0.042, -0.024, 0.0], [0.05, 0.019, 0.01], HANDLE)];

/// The joint's armature is nearly all of the lever's inertia.
const LEVER: Mover<'_> = Mover {
    motion: Motion::Hinge(Along::Y),
    limits: [0.0, 1.57],
    stops: Stops::Soft,
    mass_kg: 1e-3,
    centre_of_mass: [0.0; 3],
    inertia: 1e-6,
    parts: &LEVER_PARTS,
};

/// The lock of one episode.
#[derive(Serialize, Deserialize)]
pub struct DoorUnlock {
    root: Point,
    lever: MovingPart,
}

impl Setup for DoorUnlock {
    const NAME: &'static str = "door-unlock";
    const RANGE: HandRange = HandRange::FAR.deep();
    const POSE_SIZE: usize = 4;
    type Object = Lock;

    fn draw(rng: &mut Rng) -> Point {
        [rng.uniform_in(-0.1, 0.1), rng.uniform_in(0.8, 0.85), 0.15]
    }

    fn add_object(world: &mut PhysicsWorld, root: Point) -> Self {
        assembly::add_fixed(world, root, &cabinet::PARTS);
        let leaf = assembly::add_fixed(world, plus(root, cabinet::HINGE), &LEAF_PARTS);
        let hanging = std::f32::consts::FRAC_PI_2;
        let lever = MovingPart::add(world, leaf, pivot(root), &LEVER, hanging);
        Self { root, lever }
    }

    fn meet_stops(&self, world: &mut PhysicsWorld) {
        self.lever.meet_stops(world);
    }

    fn object(&self, world: &PhysicsWorld) -> Lock {
        Lock {
            root: self.root,
            angle: self.lever.position(world),
        }
    }

    fn progress(object: &Lock) -> f64 {
        object.angle
    }

    fn moment(readings: &Readings<Lock>) -> [f64; MOMENT_SIZE] {
        let tip = tip(readings.object.root, readings.object.angle);
        metaworld::moment(readings.hand, readings.openness, tip, [1.0, 0.0, 0.0, 0.0])
    }

    fn judge(readings: &Readings<Lock>) -> Judgement {
        let Lock { root, angle } = readings.object;
        let tip = tip(root, angle);
        let to_tip = reach_distance(readings.hand, tip);
        let margin = reach_distance(readings.init_tcp, pivot(root));
        let reach = tolerance(to_tip, [0.0, 0.02], margin, Sigmoid::LongTail);
        let to_goal = (goal(root)[0] - tip[0]).abs();
        let turned = tolerance(to_goal, [0.0, 0.005], 0.1, Sigmoid::LongTail);
        Judgement {
            reward: 2.0 * reach + 8.0 * turned,
            success: to_goal <= 0.02,
            near_object: yes(to_tip <= 0.05),
            grasp_reward: reach,
            in_place_reward: turned,
            obj_to_target: to_goal,
        }
    }

    fn pose(object: &Lock) -> Vec<f32> {
        let [x, y, z] = object.root;
        [object.angle, x, y, z].map(|v| v as f32).to_vec()
    }
}

/// With a closed fist: back and down, to the left of the lever's tip, then right.
fn expert(observation: &[f32]) -> Vec<f32> {
    let hand = metaworld::point(observation, 0);
    let left = plus(metaworld::point(observation, 4), [-0.04, -0.02, -0.03]);
    let waypoint = if distance_xy(hand, left) <= 0.02 {
        plus(left, [0.1, 0.0, 0.01])
    } else if hand[2] > 0.15 {
        plus(hand, [0.0, -0.1, -0.1])
    } else {
        left
    };
    metaworld::towards(hand, waypoint, 25.0, 1.0)
}

// ── Picture ────────────────────────────────────────────────────────────────────────────────

fn scene() -> Scene {
    let cabinet = cabinet::PARTS.iter().map(|part| part.shape(OBJECT_BODY));
    let leaf = LEAF_PARTS.iter().map(|part| part.shape(OBJECT_BODY + 1));
    let lever = LEVER_PARTS.iter().map(|part| part.shape(OBJECT_BODY + 2));
    picture::scene(
        tabletop::scenery(),
        cabinet.chain(leaf).chain(lever).collect(),
        (0.01, picture::BLUE),
        "corner4",
    )
}

/// Cabinet, door, lever and goal of `[q, P.x, P.y, P.z]`.
fn place(pose: &[f32]) -> Frame {
    picture::place(pose, |lock| {
        let cabinet = Transform::at(lock[1], lock[2], lock[3]);
        let pivot = cabinet.then(picture::at(pivot([0.0; 3])));
        [
            cabinet,
            cabinet.then(picture::at(cabinet::HINGE)),
            pivot.turned([0.0, 1.0, 0.0], lock[0]),
            cabinet.then(picture::at(goal([0.0; 3]))),
        ]
    })
}

#[cfg(test)]
mod tests;
