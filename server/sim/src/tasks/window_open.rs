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
//! a stale read shows the one before); see also `robots::sawyer_hand`.
//! Source: METAWORLD.md 3.3 and 1.9, METAWORLD_EXPERTS.md.

use domain::environment::{EnvError, EnvSpec, Environment, Step};
use domain::random::{Rng, Stream};
use domain::scene::{Arm, Frame, Geometry, Material, Scene, Shape, Transform};
use rapier3d::prelude::RigidBodyHandle;
use serde::{Deserialize, Serialize};

use super::metaworld::{self, Episode, Judgement, MOMENT_SIZE, Point, distance, plus};
use super::window::handle;
use super::{Task, window};
use crate::reward::{Sigmoid, hamacher, tolerance};
use crate::robots::sawyer_hand::{self, HandRange};
use crate::robots::tabletop;
use crate::world;

const NAME: &str = "window-open";

/// window-open, as the list of tasks shows it.
pub const TASK: Task = Task {
    name: NAME,
    title: "Open the window",
    summary: "The arm should push the window's handle to the right until the window is open.",
    spec,
    make: || Box::new(WindowOpen::new()),
    scene,
    place,
    expert: Some(expert),
};

// ── Readings: from physics or from a recording ─────────────────────────────────────────────

/// What observation, reward and success are made of.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct Readings {
    /// The hand, metres.
    pub hand: Point,
    /// The point between the fingertips, metres.
    pub tcp: Point,
    /// 1 open.
    pub openness: f64,
    /// Root of the window, `P`.
    pub root: Point,
    /// How far the pane is open, `q`, metres.
    pub slide: f64,
    /// `tcp` at the reset.
    pub init_tcp: Point,
    /// Handle at the reset.
    pub init_handle: Point,
}

/// Where the pane of a window at `root` should get to.
pub fn goal(root: Point) -> Point {
    plus(root, [window::TRAVEL_M, 0.0, 0.0])
}

impl Readings {
    /// The first half of an observation.
    pub fn moment(&self) -> [f64; MOMENT_SIZE] {
        let handle = handle(self.root, self.slide);
        metaworld::moment(self.hand, self.openness, handle, [0.0; 4])
    }

    /// Reward, its parts, success.
    pub fn judge(&self) -> Judgement {
        let handle = handle(self.root, self.slide);
        let to_goal = (handle[0] - goal(self.root)[0]).abs();
        let in_place_margin = (distance(self.root, goal(self.root)) - 0.05).abs();
        let in_place = tolerance(to_goal, [0.0, 0.05], in_place_margin, Sigmoid::LongTail);
        let to_handle = distance(handle, self.tcp);
        let reach_margin = (distance(self.init_handle, self.init_tcp) - 0.02).abs();
        let reach = tolerance(to_handle, [0.0, 0.02], reach_margin, Sigmoid::LongTail);
        Judgement {
            reward: 10.0 * hamacher(reach, in_place),
            success: to_goal <= 0.05,
            near_object: to_handle <= 0.05,
            grasp_reward: reach,
            in_place_reward: in_place,
            obj_to_target: to_goal,
        }
    }
}

// ── Environment ────────────────────────────────────────────────────────────────────────────

/// The simulation of window-open.
pub struct WindowOpen {
    spec: EnvSpec,
    state: State,
}

/// Everything a snapshot holds.
#[derive(Serialize, Deserialize)]
struct State {
    episode: Episode,
    pane: RigidBodyHandle,
    root: Point,
    init_handle: Point,
}

impl WindowOpen {
    /// A window in the episode of seed 0, before its first step.
    pub fn new() -> Self {
        Self {
            spec: spec(),
            state: State::new(0),
        }
    }

    /// What the present state says.
    pub fn readings(&self) -> Readings {
        self.state.readings()
    }
}

impl Default for WindowOpen {
    fn default() -> Self {
        Self::new()
    }
}

impl State {
    fn new(seed: u64) -> Self {
        let mut rng = Rng::new(seed, Stream::Reset, 0);
        let root = [rng.uniform_in(-0.1, 0.1), rng.uniform_in(0.7, 0.9), 0.16];
        let mut episode = Episode::new(seed, HandRange::NEAR);
        let pane = window::add(&mut episode.world.physics, root);
        Self {
            episode,
            pane,
            root,
            init_handle: handle(root, 0.0),
        }
    }

    fn readings(&self) -> Readings {
        let Episode { world, hand, .. } = &self.episode;
        let pane_x = f64::from(world.physics.bodies[self.pane].translation().x);
        Readings {
            hand: hand.position(&world.physics),
            tcp: hand.fingertips(&world.physics),
            openness: hand.openness(),
            root: self.root,
            slide: pane_x - self.root[0],
            init_tcp: self.episode.init_tcp,
            init_handle: self.init_handle,
        }
    }
}

impl Environment for WindowOpen {
    fn spec(&self) -> &EnvSpec {
        &self.spec
    }

    fn reset(&mut self, seed: u64) -> Vec<f32> {
        self.state = State::new(seed);
        let now = self.state.readings().moment();
        self.state.episode.first_observation(now)
    }

    fn step(&mut self, action: &[f32]) -> Result<Step, EnvError> {
        self.state.episode.advance(NAME, action)?;
        let readings = self.state.readings();
        let judgement = readings.judge();
        Ok(self.state.episode.finish_step(readings.moment(), judgement))
    }

    fn pose(&self) -> Vec<f32> {
        let Episode { world, hand, .. } = &self.state.episode;
        let mut pose = sawyer_hand::pose(hand, &world.physics).to_vec();
        pose.push(self.state.readings().slide as f32);
        pose.extend(self.state.root.map(|x| x as f32));
        pose
    }

    fn snapshot(&self) -> Vec<u8> {
        world::snapshot(NAME, &self.state)
    }

    fn restore(&mut self, snapshot: &[u8]) -> Result<(), EnvError> {
        self.state = world::restore(NAME, snapshot)?;
        Ok(())
    }
}

/// Numbers in a pose: the hand's five, `q`, `P`.
const POSE_SIZE: usize = sawyer_hand::POSE_SIZE + 4;

fn spec() -> EnvSpec {
    metaworld::spec(NAME, POSE_SIZE)
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

const FRAME_BODY: usize = sawyer_hand::N_BODIES;
const GOAL_BODY: usize = FRAME_BODY + window::N_BODIES;

fn scene() -> Scene {
    let mut shapes = tabletop::scenery();
    shapes.extend(sawyer_hand::shapes());
    shapes.extend(window::shapes(FRAME_BODY));
    // The original's goal is hidden inside the frame; this one is where the grip should get to.
    shapes.push(Shape {
        body: GOAL_BODY,
        local: Transform::IDENTITY,
        geometry: Geometry::Sphere { radius: 0.02 },
        material: Material::marker(0.0, 0.8, 0.0, 0.7),
    });
    Scene {
        n_bodies: GOAL_BODY + 1,
        shapes,
        arm: Some(Arm::Sawyer {
            hand: sawyer_hand::HAND_BODY,
        }),
        cameras: tabletop::cameras("corner3"),
        background: tabletop::BACKGROUND,
        focus: ([0.0, 0.5, 0.1], 1.1),
    }
}

/// The bodies of [`scene`] in a pose of [`POSE_SIZE`] numbers.
fn place(pose: &[f32]) -> Frame {
    let (hand, rest) = pose.split_at(sawyer_hand::POSE_SIZE);
    let [slide, x, y, z] = [rest[0], rest[1], rest[2], rest[3]];
    let mut frame = sawyer_hand::place(hand).to_vec();
    frame.extend(window::place([slide, x, y, z]));
    frame.push(window::grip([window::TRAVEL_M as f32, x, y, z]));
    frame
}

#[cfg(test)]
mod tests;
