//! window-open: push the window's handle to the right until the pane is open.
//!
//! # Geometry
//! The window's frame stands on the table at `P`, drawn per reset: x in [−0.1, 0.1], y in
//! [0.7, 0.9], z = 0.16. Its left pane slides along +x by `q` in [0, 0.2] m on soft stops, with
//! a handle towards the robot. The goal is `T = P + (0.2, 0, 0)`.
//!
//! # State
//! | observation | meaning | unit |
//! |---|---|---|
//! | 0–2 | hand | m |
//! | 3 | gripper openness | – |
//! | 4–6 | handle `h = P + (q − 0.04, −0.095, 0)`, a point left of its grip | m |
//! | 7–17 | zeros | – |
//! | 18–35 | 0–17 one step before | |
//! | 36–38 | zeros: the goal is hidden | m |
//!
//! # Action
//! `(x, y, z, grip)` in [−1, 1]: increments of the hand's target of up to 1 cm, +1 closes.
//!
//! # Reward
//! `r = 10 · hamacher(R, I)` with `I = tolerance(|h.x − T.x|; 0, 0.05, margin 0.15)` and
//! `R = tolerance(‖h − tcp‖; 0, 0.02, margin ‖h₀ − tcp₀‖ − 0.02)`, both long-tailed; `h₀`,
//! `tcp₀` at the reset.
//!
//! # Success
//! `|h.x − T.x| ≤ 0.05`.
//!
//! Differs from the original: `h₀` and the first observation show this episode's window (there
//! a stale read shows the one before). The pane's stops are stiffer than those of
//! `tasks::assembly`, as there the pane also meets its frame, see [`window`]. See also
//! `robots::sawyer_hand`.
//! Source: METAWORLD.md 3.3 and 1.9, METAWORLD_EXPERTS.md.

use domain::random::Rng;
use domain::scene::{Frame, Scene};
use rapier3d::prelude::PhysicsWorld;
use serde::{Deserialize, Serialize};

use super::Task;
use super::metaworld::{
    self, Judgement, MOMENT_SIZE, Point, Readings, Setup, distance, picture, plus,
};
use super::window::{self, Aim, Window, WindowReading, handle_at};
use crate::reward::Sigmoid;
use crate::robots::sawyer_hand::HandRange;

/// window-open, as the list of tasks shows it.
pub const TASK: Task = Task {
    name: WindowOpen::NAME,
    title: "Open the window",
    summary: "The arm should push the window's handle to the right until the window is open.",
    spec: metaworld::spec::<WindowOpen>,
    make: metaworld::make::<WindowOpen>,
    scene,
    place,
    expert: Some(expert),
};

/// The task's point on the handle, left of its grip, seen from the pane.
const HANDLE: Point = [-0.04, -0.095, 0.0];

/// The window of one episode.
#[derive(Serialize, Deserialize)]
pub struct WindowOpen(Window);

/// Where the pane of a window at `root` should get to.
pub fn goal(root: Point) -> Point {
    plus(root, [window::TRAVEL_M, 0.0, 0.0])
}

/// The task's point on the handle of a window at `root` whose pane is open by `slide` metres.
pub fn handle(root: Point, slide: f64) -> Point {
    handle_at(root, slide, HANDLE)
}

impl Setup for WindowOpen {
    const NAME: &'static str = "window-open";
    const RANGE: HandRange = HandRange::NEAR;
    const POSE_SIZE: usize = window::POSE_SIZE;
    type Object = WindowReading;

    fn draw(rng: &mut Rng) -> Point {
        [rng.uniform_in(-0.1, 0.1), rng.uniform_in(0.7, 0.9), 0.16]
    }

    fn add_object(world: &mut PhysicsWorld, root: Point) -> Self {
        Self(Window::add(world, root, 0.0, HANDLE))
    }

    fn object(&self, world: &PhysicsWorld) -> WindowReading {
        self.0.read(world)
    }

    fn progress(object: &WindowReading) -> f64 {
        object.slide
    }

    fn moment(readings: &Readings<WindowReading>) -> [f64; MOMENT_SIZE] {
        let handle = handle(readings.object.root, readings.object.slide);
        metaworld::moment(readings.hand, readings.openness, handle, [0.0; 4])
    }

    fn judge(readings: &Readings<WindowReading>) -> Judgement {
        let WindowReading { root, slide, .. } = readings.object;
        let aim = Aim {
            handle: handle(root, slide),
            goal: goal(root),
            in_place_margin: (distance(root, goal(root)) - 0.05).abs(),
            reach: Sigmoid::LongTail,
        };
        window::judge(readings, &aim)
    }

    fn pose(object: &WindowReading) -> Vec<f32> {
        object.pose()
    }
}

/// With a closed fist: above the handle's left side, down beside it, then right.
fn expert(observation: &[f32]) -> Vec<f32> {
    let hand = metaworld::point(observation, 0);
    let beside = plus(metaworld::point(observation, 4), [-0.03, -0.03, -0.08]);
    let waypoint = if metaworld::distance_xy(hand, beside) > 0.04 {
        plus(beside, [0.0, 0.0, 0.3])
    } else if (hand[2] - beside[2]).abs() > 0.02 {
        beside
    } else {
        plus(beside, [0.1, 0.0, 0.0])
    };
    metaworld::towards(hand, waypoint, 25.0, 1.0)
}

// ── Picture ────────────────────────────────────────────────────────────────────────────────

fn scene() -> Scene {
    window::scene()
}

/// The window's bodies and the goal: the original's is hidden inside the frame, this one is
/// where the grip should get to.
fn place(pose: &[f32]) -> Frame {
    picture::place(pose, |window| {
        window::place(window, window::TRAVEL_M as f32)
    })
}

#[cfg(test)]
mod tests;
