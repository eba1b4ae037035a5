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
use domain::scene::{Frame, Geometry, Material, Scene, Shape, Transform};
use rapier3d::prelude::*;
use serde::{Deserialize, Serialize};

use super::Task;
use super::metaworld::{self, Episode, Judgement, MOMENT_SIZE, Point, distance, plus};
use crate::reward::{Sigmoid, hamacher, tolerance};
use crate::robots::sawyer_hand::{self, HandRange};
use crate::robots::tabletop::{self, Layer};
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
    expert,
};

// ── Geometry ───────────────────────────────────────────────────────────────────────────────

/// A form of the window in the frame it belongs to: the assembly's root `P` or the pane.
struct Part {
    form: Form,
    centre: [f32; 3],
    look: Material,
}

enum Form {
    /// Half extents.
    Box([f32; 3]),
    /// Radius and half length along y.
    RodY(f32, f32),
    /// Radius and half length along z.
    RodZ(f32, f32),
}

const FRAME: Material = Material::plain(0.36, 0.26, 0.27);
const HANDLE: Material = Material::plain(0.65, 0.65, 0.65);
const GLASS: Material = Material {
    color: [0.0, 0.3, 0.4, 0.1],
    ..FRAME
};

const fn cuboid(centre: [f32; 3], half: [f32; 3], look: Material) -> Part {
    Part {
        form: Form::Box(half),
        centre,
        look,
    }
}

const fn handle_part(centre: [f32; 3], form: Form) -> Part {
    Part {
        form,
        centre,
        look: HANDLE,
    }
}

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
    handle_part([-0.014, -0.028, -0.045], Form::RodY(0.012, 0.003)),
    handle_part([-0.014, -0.028, 0.045], Form::RodY(0.012, 0.003)),
    handle_part([-0.014, -0.06, -0.045], Form::RodY(0.008, 0.035)),
    handle_part([-0.014, -0.06, 0.045], Form::RodY(0.008, 0.035)),
    handle_part([-0.014, -0.095, 0.0], Form::RodZ(0.008, 0.045)),
];

impl Part {
    fn collider(&self, layer: Layer) -> ColliderBuilder {
        let shape = match self.form {
            Form::Box([x, y, z]) => ColliderBuilder::cuboid(x, y, z),
            Form::RodY(radius, half) => ColliderBuilder::capsule_y(half, radius),
            Form::RodZ(radius, half) => ColliderBuilder::capsule_z(half, radius),
        };
        tabletop::collider(shape, self.centre, layer).density(0.0)
    }

    fn shape(&self, body: usize) -> Shape {
        let [x, y, z] = self.centre;
        let upright = Transform::at(x, y, z);
        let (local, geometry) = match self.form {
            Form::Box(half) => (upright, Geometry::Cuboid { half }),
            Form::RodY(radius, half_length) => (
                upright.turned([1.0, 0.0, 0.0], std::f32::consts::FRAC_PI_2),
                Geometry::Capsule {
                    radius,
                    half_length,
                },
            ),
            Form::RodZ(radius, half_length) => (
                upright,
                Geometry::Capsule {
                    radius,
                    half_length,
                },
            ),
        };
        Shape {
            body,
            local,
            geometry,
            material: self.look,
        }
    }
}

/// Handle seen from the pane's frame.
const HANDLE_POINT: Point = [-0.04, -0.095, 0.0];
/// Goal seen from `P`; the pane's travel.
const TRAVEL_M: f64 = 0.2;

const PANE_MASS_KG: f32 = 0.638;
const PANE_DAMPING: f32 = 2.0;
/// Stops this stiff hold the pane within 9 mm against the expert's 2 kN, at 2 mm in the end
/// (the original: 2.7 and 1.3 mm, where the pane also meets its frame).
const STOP_HZ: f32 = 200.0;
const STOP_DAMPING: f32 = 3.0;

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

/// The handle of a window at `root` whose pane is open by `slide` metres.
pub fn handle(root: Point, slide: f64) -> Point {
    plus(plus(root, [slide, 0.0, 0.0]), HANDLE_POINT)
}

/// Where the goal of a window at `root` is.
pub fn goal(root: Point) -> Point {
    plus(root, [TRAVEL_M, 0.0, 0.0])
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
        let pane = add_window(&mut episode.world.physics, root);
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

/// Adds frame and pane; returns the pane's body.
fn add_window(world: &mut PhysicsWorld, root: Point) -> RigidBodyHandle {
    let at = Vector::new(root[0] as f32, root[1] as f32, root[2] as f32);
    let frame = world.insert_body(RigidBodyBuilder::fixed().translation(at));
    for part in &FIXED_PARTS {
        world.insert_collider(part.collider(Layer::Fixed), Some(frame));
    }
    let inertia = MassProperties::new(Vector::ZERO, PANE_MASS_KG, Vector::splat(0.01));
    let pane = RigidBodyBuilder::dynamic()
        .translation(at)
        .additional_mass_properties(inertia)
        .can_sleep(false);
    let pane = world.insert_body(pane);
    for part in &SLIDING_PARTS {
        world.insert_collider(part.collider(Layer::Object), Some(pane));
    }
    let slide = PrismaticJointBuilder::new(Vector::X)
        .limits([0.0, TRAVEL_M as f32])
        .softness(SpringCoefficients::new(STOP_HZ, STOP_DAMPING));
    let joint = world
        .insert_multibody_joint(frame, pane, slide)
        .expect("both bodies are new, so the joint closes no loop");
    if let Some((multibody, _)) = world.multibody_joints.get_mut(joint) {
        multibody.forward_kinematics(&world.bodies, true);
        multibody.damping_mut().fill(PANE_DAMPING);
        multibody.armature_mut().fill(0.001);
    }
    pane
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
const PANE_BODY: usize = FRAME_BODY + 1;
const GOAL_BODY: usize = PANE_BODY + 1;

fn scene() -> Scene {
    let mut shapes = tabletop::scenery();
    shapes.extend(sawyer_hand::shapes());
    shapes.extend(FIXED_PARTS.iter().map(|part| part.shape(FRAME_BODY)));
    shapes.extend(SLIDING_PARTS.iter().map(|part| part.shape(PANE_BODY)));
    shapes.push(Shape {
        body: GOAL_BODY,
        local: Transform::IDENTITY,
        geometry: Geometry::Sphere { radius: 0.02 },
        material: Material::marker(0.0, 0.8, 0.0, 1.0),
    });
    Scene {
        n_bodies: GOAL_BODY + 1,
        shapes,
        arm: Some(domain::scene::Arm::Sawyer {
            hand: sawyer_hand::HAND_BODY,
        }),
        cameras: tabletop::cameras("corner3"),
        background: tabletop::BACKGROUND,
        focus: ([0.0, 0.5, 0.1], 1.1),
    }
}

/// The bodies of [`scene`] in a pose of [`POSE_SIZE`] numbers.
fn place(pose: &[f32]) -> Frame {
    let (hand, window) = pose.split_at(sawyer_hand::POSE_SIZE);
    let [slide, x, y, z] = [window[0], window[1], window[2], window[3]];
    let mut frame = sawyer_hand::place(hand).to_vec();
    frame.push(Transform::at(x, y, z));
    frame.push(Transform::at(x + slide, y, z));
    frame.push(Transform::at(x + TRAVEL_M as f32, y, z));
    frame
}

#[cfg(test)]
mod tests;
