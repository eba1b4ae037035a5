//! sweep-into: sweep a small block over the table into a square hole.
//!
//! # Geometry
//! A table without walls, its top at z = 0.05, has a hole from (−0.08, 0.76) to (0.08, 0.92), 5 cm
//! deep. A
//! block of 4 cm lies on it at `b₀`, drawn per reset: x in [−0.1, 0.1], y in [0.6, 0.7], at least
//! 15 cm from the middle of the hole. It is light and never turns. The goal is
//! `T = (0, 0.84, 0.02)`, always.
//!
//! # State
//! | observation | meaning | unit |
//! |---|---|---|
//! | 0–2 | hand | m |
//! | 3 | gripper openness | – |
//! | 4–6 | middle of the block `b` | m |
//! | 7–10 | 0, 0, 0, 1 | – |
//! | 11–17 | zeros | – |
//! | 18–35 | 0–17 one step before | |
//! | 36–38 | zeros: the goal is hidden | m |
//!
//! # Action
//! `(x, y, z, grip)` in [−1, 1]: increments of the hand's target of up to 1 cm, +1 closes.
//!
//! # Reward
//! With `e` the distance of `b` from `T` in the plane, `r = 2 G + 6 · hamacher(G, I)`, and 10
//! where `e < 0.05`. `I = tolerance(e; 0, 0.05, margin ‖b₀ − (T.x, T.y, b.z)‖)`, long-tailed. `G` says
//! how well the fingers cage the block: see `caging`.
//!
//! # Success
//! `e ≤ 0.05`, at whatever height.
//!
//! Differs from the original: the block weighs 100 g instead of 10; see also
//! `robots::sawyer_hand`.
//! Source: METAWORLD.md 2 and 3.7, METAWORLD_EXPERTS.md.

use domain::random::Rng;
use domain::scene::{Frame, Geometry, Material, Pattern, Scene, Shape, Transform};
use rapier3d::prelude::{ColliderBuilder, PhysicsWorld, RigidBodyBuilder, RigidBodyHandle, Vector};
use serde::{Deserialize, Serialize};

use super::Task;
use super::metaworld::picture::{self, OBJECT_BODY};
use super::metaworld::{
    self, Judgement, MOMENT_SIZE, Point, Readings, Setup, distance, distance_xy, minus, plus, yes,
};
use crate::reward::{Sigmoid, hamacher, tolerance};
use crate::robots::sawyer_hand::HandRange;
use crate::robots::tabletop::{self, Layer};

/// sweep-into, as the list of tasks shows it.
pub const TASK: Task = Task {
    name: SweepInto::NAME,
    title: "Sweep into the hole",
    summary: "The arm should sweep the block into the hole in the table.",
    spec: metaworld::spec::<SweepInto>,
    make: metaworld::make::<SweepInto>,
    scene,
    place,
    expert: Some(expert),
};

// ── Reward ─────────────────────────────────────────────────────────────────────────────────

/// Where the block is.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Block {
    /// Its middle, `b`.
    pub position: Point,
    /// Its quaternion, (x, y, z, w): not turned, but for millionths in recordings.
    pub turn: [f64; 4],
    /// Its middle at the reset, `b₀`.
    pub start: Point,
}

/// Where the block should get to.
pub const GOAL: Point = [0.0, 0.84, 0.02];

/// How well the fingers cage the block, in [0, 1].
///
/// `δ` is how far a pad is outside the middle of the block along y. A pad is *beside* the block
/// from 2 to 5 cm and *at* it from 2 to 2.5 cm, both falling off over `||δ| − 5 cm|`. The fingers
/// cage the block if both are beside it and their tips are level with it; when they do so well,
/// being at it counts as well.
///
/// The original means the margins to stem from the pads at the reset, but its reference follows
/// the pads, so that beyond 5 cm `beside` is a tenth, however far.
fn caging(readings: &Readings<Block>) -> f64 {
    let Block {
        position, start, ..
    } = readings.object;
    let [left, right] = readings.pads;
    let outside = [left - position[1], position[1] - right];
    let both = |upper: f64| {
        let [left, right] = outside.map(|outside| {
            let margin = (outside.abs() - 0.05).abs();
            tolerance(outside, [0.02, upper], margin, Sigmoid::LongTail)
        });
        hamacher(right, left)
    };
    let distance_xz = |a: Point, b: Point| (a[0] - b[0]).hypot(a[2] - b[2]);
    let level = tolerance(
        distance_xz(readings.tcp, position),
        [0.0, 0.01],
        (distance_xz(start, readings.init_tcp) - 0.01).max(0.0),
        Sigmoid::LongTail,
    );
    let caged = hamacher(both(0.05), level);
    let gripped = if caged > 0.95 { both(0.025) } else { 0.0 };
    f64::midpoint(caged, gripped)
}

// ── Setup ──────────────────────────────────────────────────────────────────────────────────

/// Half the block's edge, metres.
const HALF_M: f32 = 0.02;
/// Ten times the original's. No force here is small enough to feel the difference, but contacts
/// give way in proportion to the mass they act on: 10 g between fingers that hold it with 270 N
/// would be squeezed by more than its edge, 100 g are by 5 mm (in the original 6).
const MASS_KG: f32 = 0.1;
/// The middle of a block that lies on the table, metres.
const RESTING_Z: f64 = 0.0699;

/// The block of one episode.
#[derive(Serialize, Deserialize)]
pub struct SweepInto {
    block: RigidBodyHandle,
    start: Point,
}

impl Setup for SweepInto {
    const NAME: &'static str = "sweep-into";
    const RANGE: HandRange = HandRange::FAR;
    const POSE_SIZE: usize = 3;
    type Object = Block;

    fn draw(rng: &mut Rng) -> Point {
        loop {
            let [x, y] = [rng.uniform_in(-0.1, 0.1), rng.uniform_in(0.6, 0.7)];
            let start = [x, y, RESTING_Z];
            if distance_xy(start, GOAL) >= 0.15 {
                return start;
            }
        }
    }

    fn add_surroundings(world: &mut PhysicsWorld) {
        world.gravity = Vector::new(0.0, 0.0, -9.81);
        tabletop::add_table_with_hole(world);
        tabletop::add_floor(world);
    }

    fn add_object(world: &mut PhysicsWorld, root: Point) -> Self {
        let [x, y, z] = root.map(|v| v as f32);
        let body = RigidBodyBuilder::dynamic()
            .translation(Vector::new(x, y, z))
            .lock_rotations()
            .additional_mass(MASS_KG)
            .can_sleep(false);
        let block = world.insert_body(body);
        let cube = ColliderBuilder::cuboid(HALF_M, HALF_M, HALF_M);
        let cube = tabletop::collider(cube, [0.0; 3], Layer::Loose).density(0.0);
        world.insert_collider(cube, Some(block));
        Self { block, start: root }
    }

    fn object(&self, world: &PhysicsWorld) -> Block {
        let p = world.bodies[self.block].translation();
        Block {
            position: [p.x, p.y, p.z].map(f64::from),
            turn: [0.0, 0.0, 0.0, 1.0],
            start: self.start,
        }
    }

    fn progress(object: &Block) -> f64 {
        distance(object.position, object.start)
    }

    fn moment(readings: &Readings<Block>) -> [f64; MOMENT_SIZE] {
        let Block { position, turn, .. } = readings.object;
        metaworld::moment(readings.hand, readings.openness, position, turn)
    }

    fn judge(readings: &Readings<Block>) -> Judgement {
        let Block {
            position, start, ..
        } = readings.object;
        let above_goal = [GOAL[0], GOAL[1], position[2]];
        let to_goal = distance(position, above_goal);
        let margin = distance(start, above_goal);
        let in_place = tolerance(to_goal, [0.0, 0.05], margin, Sigmoid::LongTail);
        let caged = caging(readings);
        let reward = if to_goal < 0.05 {
            10.0
        } else {
            2.0 * caged + 6.0 * hamacher(caged, in_place)
        };
        Judgement {
            reward,
            success: to_goal <= 0.05,
            near_object: yes(distance(position, readings.tcp) <= 0.03),
            grasp_reward: caged,
            in_place_reward: in_place,
            obj_to_target: to_goal,
        }
    }

    fn pose(object: &Block) -> Vec<f32> {
        object.position.map(|v| v as f32).to_vec()
    }
}

/// Above the block, down over it, then with closing fingers to the goal.
fn expert(observation: &[f32]) -> Vec<f32> {
    let hand = metaworld::point(observation, 0);
    let block = metaworld::point(observation, 4);
    let over = plus(block, [-0.005, 0.0, 0.01]);
    let waypoint = if distance_xy(hand, over) > 0.04 {
        plus(over, [0.0, 0.0, 0.3])
    } else if (hand[2] - over[2]).abs() > 0.04 {
        over
    } else {
        GOAL
    };
    let is_far = distance_xy(hand, block) > 0.04 || minus(hand, block)[2].abs() > 0.15;
    metaworld::towards(hand, waypoint, 25.0, if is_far { -1.0 } else { 0.7 })
}

// ── Picture ────────────────────────────────────────────────────────────────────────────────

fn scene() -> Scene {
    let block = Shape {
        body: OBJECT_BODY,
        local: Transform::IDENTITY,
        geometry: Geometry::Cuboid { half: [HALF_M; 3] },
        material: Material {
            pattern: Pattern::Wood,
            ..Material::plain(0.42, 0.27, 0.17)
        },
    };
    picture::scene(
        tabletop::scenery_with_hole(),
        vec![block],
        (0.02, picture::BLUE),
        "corner3",
    )
}

/// The block of `[b.x, b.y, b.z]`, and the goal.
fn place(pose: &[f32]) -> Frame {
    picture::place(pose, |block| {
        [
            Transform::at(block[0], block[1], block[2]),
            picture::at(GOAL),
        ]
    })
}

#[cfg(test)]
mod tests;
