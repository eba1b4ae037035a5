//! door-open: pull the door of a small cabinet open by its handle.
//!
//! # Geometry
//! A cabinet stands on the table at `P`, drawn per reset: x in [0, 0.1], y in [0.85, 0.95],
//! z = 0.15. Its door hangs on the left, at `P + (−0.185, −0.1, 0)`, and turns about +z by `q` in
//! [−2, 0] rad on soft stops: negative is open, the leaf swinging towards the robot. The goal is
//! `T = P + (−0.3, −0.45, 0)`.
//!
//! # State
//! | observation | meaning | unit |
//! |---|---|---|
//! | 0–2 | hand | m |
//! | 3 | gripper openness | – |
//! | 4–6 | `h = hinge + R_z(q) (0.3757, −0.1071, 0)`, a point on the handle | m |
//! | 7–10 | the handle's quaternion, (x, y, z, w) | – |
//! | 11–17 | zeros | – |
//! | 18–35 | 0–17 one step before | |
//! | 36–38 | zeros: the goal is hidden | m |
//!
//! # Action
//! `(x, y, z, grip)` in [−1, 1]: increments of the hand's target of up to 1 cm, +1 closes.
//!
//! # Reward
//! `r = 2 · hamacher(ready, s) + 8 · open`, and 10 at success, with
//! * `s` – the gripper command, brought to [0, 1]
//! * `ready = hamacher(A, B)`: `A` that the hand is higher than a floor which rises with its
//!   distance from the handle, `B` that it is behind the handle
//! * `open = 0.2 · [q < −2°] + 0.8 · tolerance(120° + q; 0, 0.5, margin 60°)`, long-tailed
//!
//! # Success
//! `|h.x − T.x| ≤ 0.08`: the door is open by 79° to 104°; wider no longer counts.
//!
//! Differs from the original: the shut leaf gives way to a fist as easily as the open one. There
//! it is twenty times as inert beyond its stop, but contacts creep, so that a fist that sits on
//! the handle slides in behind it; here friction would hold it there (a quarter of the noisy
//! expert's episodes). See also `robots::sawyer_hand` and `tasks::assembly`.
//! Source: METAWORLD.md 3.1 and 1.9, METAWORLD_EXPERTS.md.

use std::f64::consts::PI;

use domain::random::Rng;
use domain::scene::{Frame, Scene, Transform};
use rapier3d::prelude::{PhysicsWorld, SpringCoefficients};
use serde::{Deserialize, Serialize};

use super::Task;
use super::assembly::{self, Along, Motion, Mover, MovingPart, Part, Stops, cuboid, cylinder};
use super::cabinet::{self, HANDLE, STEEL};
use super::metaworld::picture::{self, OBJECT_BODY};
use super::metaworld::{
    self, Judgement, MOMENT_SIZE, Point, Readings, Setup, distance, distance_xy, minus, plus,
};
use crate::reward::{Sigmoid, hamacher, tolerance};
use crate::robots::sawyer_hand::HandRange;
use crate::robots::tabletop;

/// door-open, as the list of tasks shows it.
pub const TASK: Task = Task {
    name: DoorOpen::NAME,
    title: "Open the door",
    summary: "The arm should pull the cabinet's door open by its handle.",
    spec: metaworld::spec::<DoorOpen>,
    make: metaworld::make::<DoorOpen>,
    scene,
    place,
    expert: Some(expert),
};

// ── Reward ─────────────────────────────────────────────────────────────────────────────────

/// Where the door is.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Door {
    /// Root of the cabinet, `P`.
    pub root: Point,
    /// `q`, radians; the reward's.
    pub angle: f64,
    /// The angle at which the handle is seen: the same, but one substep older in recordings of
    /// the original's v2.
    pub seen_angle: f64,
}

/// Where the handle of a cabinet at `root` should get to.
pub fn goal(root: Point) -> Point {
    plus(root, [-0.3, -0.45, 0.0])
}

/// The point on the handle, seen from the hinge of a shut door.
const HANDLE_POINT: Point = [0.375_721_63, -0.107_139_90, 0.000_035_95];
/// How the handle is turned in a shut door, (w, x, y, z).
const HANDLE_TURN: [f64; 4] = [0.151_171_09, 0.690_758_50, -0.150_620_97, 0.690_878_66];

/// The point on the handle of a cabinet at `root` whose door is at `angle`.
pub fn handle(root: Point, angle: f64) -> Point {
    let (sin, cos) = angle.sin_cos();
    let [x, y, z] = HANDLE_POINT;
    let turned = [cos * x - sin * y, sin * x + cos * y, z];
    plus(plus(root, cabinet::HINGE), turned)
}

/// The angle at which a handle is: the inverse of [`handle`].
pub fn angle_of(root: Point, handle: Point) -> f64 {
    let [x, y, _] = minus(handle, plus(root, cabinet::HINGE));
    y.atan2(x) - HANDLE_POINT[1].atan2(HANDLE_POINT[0])
}

/// The handle's quaternion at `angle`, (x, y, z, w).
fn handle_turn(angle: f64) -> [f64; 4] {
    let (sin, cos) = (angle / 2.0).sin_cos();
    let [w, x, y, z] = HANDLE_TURN;
    [
        cos * x - sin * y,
        cos * y + sin * x,
        cos * z + sin * w,
        cos * w - sin * z,
    ]
}

/// How ready the hand is to pull at a handle: above a floor that keeps it from coming in from
/// the side, and behind the handle.
fn readiness(hand: Point, handle: Point) -> f64 {
    let beside = minus(handle, [0.05, 0.0, 0.0]);
    let radius = distance_xy(hand, beside);
    let floor = if radius <= 0.12 {
        0.0
    } else {
        0.4 + 0.04 * (radius - 0.12).ln()
    };
    let above = if hand[2] >= floor {
        1.0
    } else {
        tolerance(floor - hand[2], [0.0, 0.01], floor / 2.0, Sigmoid::LongTail)
    };
    let behind = plus(beside, [0.05, 0.03, -0.01]);
    let in_place = tolerance(distance(hand, behind), [0.0, 0.06], 0.5, Sigmoid::LongTail);
    hamacher(above, in_place)
}

/// How far open a door at `angle` is, in [0, 1].
fn openness(angle: f64) -> f64 {
    let to_goal = 2.0 * PI / 3.0 + angle;
    let ajar = if angle < -PI / 90.0 { 0.2 } else { 0.0 };
    ajar + 0.8 * tolerance(to_goal, [0.0, 0.5], PI / 3.0, Sigmoid::LongTail)
}

// ── Setup ──────────────────────────────────────────────────────────────────────────────────

/// The leaf, in the frame of its hinge.
const LEAF_PARTS: [Part; 5] = [
    cuboid([0.185, 0.0, 0.0], [0.18, 0.01, 0.123], STEEL),
    cylinder([0.325, -0.006, 0.0], Along::Y, 0.028, 0.012, HANDLE),
    cylinder([0.325, -0.065, 0.0], Along::Y, 0.013, 0.047, HANDLE),
    cylinder([0.381, -0.12, 0.0], Along::X, 0.019, 0.075, HANDLE),
    cylinder([0.395, -0.12, 0.0], Along::X, 0.023, 0.054, HANDLE),
];

/// The pins that it hangs on, in the same frame: seen, but nothing touches them.
const PINS: [Part; 2] = [
    cylinder([0.0, 0.0, -0.07], Along::Z, 0.013, 0.045, HANDLE),
    cylinder([0.0, 0.0, 0.07], Along::Z, 0.013, 0.045, HANDLE),
];

/// 0.150 kg·m² about the hinge, of which all but this is the centre of mass's way.
///
/// Its stops have the spring (7.5 kN·m/rad) and the damper (300 N·m·s/rad) of [`Stops::Soft`]
/// on the leaf's own inertia and damping, without the twentyfold inertia behind them.
const LEAF: Mover<'_> = Mover {
    motion: Motion::Hinge(Along::Z),
    limits: [-2.0, 0.0],
    stops: Stops::Own(SpringCoefficients {
        natural_frequency: 34.9,
        damping_ratio: 4.38,
    }),
    mass_kg: 2.23,
    centre_of_mass: [0.2237, -0.0204, 0.0],
    inertia: 0.0375,
    parts: &LEAF_PARTS,
};

/// The door of one episode.
#[derive(Serialize, Deserialize)]
pub struct DoorOpen {
    root: Point,
    leaf: MovingPart,
}

impl Setup for DoorOpen {
    const NAME: &'static str = "door-open";
    const RANGE: HandRange = HandRange::FAR;
    const POSE_SIZE: usize = 4;
    type Object = Door;

    fn draw(rng: &mut Rng) -> Point {
        [rng.uniform_in(0.0, 0.1), rng.uniform_in(0.85, 0.95), 0.15]
    }

    fn add_object(world: &mut PhysicsWorld, root: Point) -> Self {
        let cabinet = assembly::add_fixed(world, root, &cabinet::PARTS);
        let hinge = plus(root, cabinet::HINGE);
        let leaf = MovingPart::add(world, cabinet, hinge, &LEAF, 0.0);
        Self { root, leaf }
    }

    fn object(&self, world: &PhysicsWorld) -> Door {
        let angle = self.leaf.position(world);
        Door {
            root: self.root,
            angle,
            seen_angle: angle,
        }
    }

    fn progress(object: &Door) -> f64 {
        object.angle
    }

    fn moment(readings: &Readings<Door>) -> [f64; MOMENT_SIZE] {
        let Door {
            root, seen_angle, ..
        } = readings.object;
        let handle = handle(root, seen_angle);
        let turn = handle_turn(seen_angle);
        metaworld::moment(readings.hand, readings.openness, handle, turn)
    }

    fn judge(readings: &Readings<Door>) -> Judgement {
        let Door {
            root,
            angle,
            seen_angle,
        } = readings.object;
        let handle = handle(root, seen_angle);
        let closing = f64::midpoint(readings.command.clamp(-1.0, 1.0), 1.0);
        let ready = readiness(readings.hand, handle);
        let open = openness(angle);
        let success = (handle[0] - goal(root)[0]).abs() <= 0.08;
        let reward = if success {
            10.0
        } else {
            2.0 * hamacher(ready, closing) + 8.0 * open
        };
        Judgement {
            reward,
            success,
            near_object: ready,
            grasp_reward: closing,
            in_place_reward: open,
            obj_to_target: 0.0,
        }
    }

    fn pose(object: &Door) -> Vec<f32> {
        let [x, y, z] = object.root;
        [object.angle, x, y, z].map(|v| v as f32).to_vec()
    }
}

/// With a closed fist: over the handle, down between handle and door, then after a point left of
/// the handle, which pulls the door open in an arc.
fn expert(observation: &[f32]) -> Vec<f32> {
    let hand = metaworld::point(observation, 0);
    let left = plus(metaworld::point(observation, 4), [-0.05, 0.0, 0.0]);
    let waypoint = if distance_xy(hand, left) > 0.12 {
        plus(left, [0.06, 0.02, 0.2])
    } else if (hand[2] - left[2]).abs() > 0.04 {
        plus(left, [0.06, 0.02, 0.0])
    } else {
        left
    };
    metaworld::towards(hand, waypoint, 25.0, 1.0)
}

// ── Picture ────────────────────────────────────────────────────────────────────────────────

fn scene() -> Scene {
    let cabinet = cabinet::PARTS.iter().map(|part| part.shape(OBJECT_BODY));
    let leaf = LEAF_PARTS.iter().chain(&PINS);
    let leaf = leaf.map(|part| part.shape(OBJECT_BODY + 1));
    picture::scene(
        tabletop::scenery(),
        cabinet.chain(leaf).collect(),
        (0.02, picture::GREEN),
        "corner3",
    )
}

/// Cabinet, leaf and goal of `[q, P.x, P.y, P.z]`.
fn place(pose: &[f32]) -> Frame {
    picture::place(pose, |door| {
        let cabinet = Transform::at(door[1], door[2], door[3]);
        let [x, y, z] = cabinet::HINGE.map(|v| v as f32);
        [
            cabinet,
            cabinet
                .then(Transform::at(x, y, z))
                .turned([0.0, 0.0, 1.0], door[0]),
            cabinet.then(picture::at(goal([0.0; 3]))),
        ]
    })
}

#[cfg(test)]
mod tests;
