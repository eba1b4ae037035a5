//! go-fetch-return: drive to an object, take it, bring it to the goal (the paper's Figure 1).
//!
//! Units: metres, seconds, radians. x to the right, y away from the viewer, z up. `‖·‖` is the
//! Euclidean norm in the plane. The task is our own; nothing here is taken from a benchmark.
//!
//! # Geometry
//! A floor of [−1.2, 1.2]² inside low walls. The robot is a disc of radius 0.16 that drives in
//! any direction at up to 1 m/s (lag 0.1 s) and turns its nose to where it is told to go; its
//! body pushes what it touches. p is its centre, n its nose (a unit vector) and
//! **j = p + 0.25 n** the point between its jaws. The object, a disc of radius 0.075, is at b; it
//! slides and comes to rest by itself. The goal, at g, is a mark on the floor of radius
//! ρ = 0.2.
//!
//! An episode has exactly **100** control steps of **0.05 s** (one world step with two substeps)
//! and ends by the time limit only. Reset: p ~ U[−0.9, 0.9]², nose in any direction, then b and
//! g ~ U[−0.95, 0.95]², drawn again until 0.6 ≤ ‖b − p‖ ≤ 1.1 and 0.6 ≤ ‖g − b‖ ≤ 1.1;
//! everything at rest, jaws open.
//!
//! # Taking and dropping
//! o is the jaws' openness: 1 open, 0.45 closed; it follows the command by up to 0.16 a step. The
//! object is **between the jaws** when ‖b − j‖ ≤ 0.14. Closing them with the object between them
//! **takes** it: from then on it is lifted and drawn to j. Opening to 0.6 **drops** it where it
//! is; it is also lost when something holds it back by more than 0.2.
//!
//! # State vector
//! | index | content | unit |
//! |---|---|---|
//! | 0–1 | velocity of the robot | 1 m/s |
//! | 2 | its turning rate, counter-clockwise | 8 rad/s |
//! | 3 | 2 o − 1 | – |
//! | 4 | 1 while the object is held, else −1 | – |
//! | 5–6 | b − j | 1.2 m |
//! | 7–8 | the same from close by: b − j, cut to ±1 | 0.25 m |
//! | 9 | how near the object is: 1 − ‖b − j‖/2 m, not below 0 | – |
//! | 10–14 | 5–9 for g − b instead of b − j; zeros while the goal is out of sight | as above |
//! | 15 | 1 while the object is at the goal, else −1 | – |
//!
//! Vectors are as the robot sees them: ahead, along n, then to its left. The goal is **in sight**
//! while the object is held or at the goal. So the states of a stage look alike wherever things lie
//! and whichever way the robot drives, so that a distance learned between states can measure progress.
//! In the world's axes no state of an episode that drives north leads to one that drives east, however
//! alike their stages are, and a learned distance told nothing of stages (`assets/results`).
//!
//! # Action
//! | index | content |
//! |---|---|
//! | 0–1 | wanted velocity, ahead and to the left; 1 is 1 m/s; cut to the unit disc |
//! | 2 | a: wanted openness of the jaws, (1 − a)/2; +1 closed, −1 open |
//!
//! # Reward
//! In [0, 10], with near(x) = 0.6 · (1 − x/3.4) + 0.4 · exp(−x/0.2), not below 0:
//!
//! | while | reward |
//! |---|---|
//! | ‖g − b‖ ≤ ρ | 10 |
//! | the object is held | 5 + 3 · near(‖g − b‖ − ρ) |
//! | it is between the jaws | 3 + (1 − o)/0.55, at most 4 |
//! | otherwise | 3 · near(‖b − j‖ − 0.14) |
//!
//! Each row pays at least as much as the best of the rows below it, so waiting before a later
//! stage never pays, nor does dropping the object before the goal.
//!
//! # Success
//! ‖g − b‖ ≤ ρ = 0.2: the object's centre over the mark, held or not.
//!
//! # Stages
//! `return` while the object is held or at the goal; otherwise `fetch` while ‖b − j‖ ≤ 0.35, and
//! `go` beyond. For evaluation, and for the method `true_stage`.

use domain::environment::{EnvError, EnvSpec, Environment, Step};
use domain::random::{Rng, Stream};
use rapier3d::prelude::{ColliderBuilder, LockedAxes, RigidBodyBuilder, RigidBodyHandle, Vector};
use serde::{Deserialize, Serialize};

use self::view::{View, norm};
use super::Task;
use crate::course::Course;
use crate::robots::planar_robot::PlanarRobot;
use crate::world::{self, Timing, World};

mod picture;
mod view;

/// The registry's line.
pub const TASK: Task = Task {
    name: NAME,
    title: "Go, fetch, return",
    summary: "Drive to the ball, take it between the jaws and bring it to the ring.",
    spec,
    make: || Box::new(GoFetchReturn::new()),
    scene: picture::scene,
    place: picture::place,
    expert: Some(expert),
};

const NAME: &str = "go-fetch-return";
const EPISODE_LEN: u32 = 100;
const CONTROL_PERIOD_S: f32 = 0.05;
const OBSERVATION_SIZE: usize = 16;
const ACTION_SIZE: usize = 3;
const POSE_SIZE: usize = 9;

/// Half the floor's side.
const FLOOR_HALF: f32 = 1.2;
const WALL_HALF_THICKNESS: f32 = 0.05;
const OBJECT_RADIUS: f32 = 0.075;
const OBJECT_MASS: f32 = 0.2;
/// Slows a pushed object by the floor's friction, 1/s.
const OBJECT_DAMPING: f32 = 5.0;
const GOAL_RADIUS: f32 = 0.2;
/// Between the jaws: this close to the point between them.
const JAW_ZONE: f32 = 0.14;
/// Openness of closed jaws: the object just fits.
const HELD_OPENNESS: f32 = 0.45;
/// Openness that lets a held object go.
const DROP_OPENNESS: f32 = 0.6;
/// A held object that is held back this far is lost.
const SLIP: f32 = 0.2;
/// Angular frequency of the grip's spring, critically damped, rad/s.
const GRIP_FREQUENCY: f32 = 30.0;
/// Where `go` becomes `fetch`.
const FETCH_DISTANCE: f32 = 0.35;
/// Unit of the close-up components of the state vector.
const CLOSE_UP: f32 = 0.25;
/// Where nearness, another component, has fallen to zero.
const FAR: f32 = 2.0;

const STAGES: [&str; 3] = ["go", "fetch", "return"];

fn spec() -> EnvSpec {
    EnvSpec {
        task: NAME.into(),
        observation_size: OBSERVATION_SIZE,
        action_size: ACTION_SIZE,
        pose_size: POSE_SIZE,
        episode_len: EPISODE_LEN,
        segment_len: 12,
        control_period_s: f64::from(CONTROL_PERIOD_S),
        has_success: true,
        stages: STAGES.map(String::from).to_vec(),
    }
}

/// The simulation.
struct GoFetchReturn {
    spec: EnvSpec,
    state: State,
}

/// Everything that changes during an episode.
#[derive(Serialize, Deserialize)]
struct State {
    world: World,
    robot: PlanarRobot,
    object: RigidBodyHandle,
    goal: [f32; 2],
    is_held: bool,
    course: Course,
}

impl GoFetchReturn {
    fn new() -> Self {
        Self {
            spec: spec(),
            state: State::new(0),
        }
    }
}

impl Environment for GoFetchReturn {
    fn spec(&self) -> &EnvSpec {
        &self.spec
    }

    fn reset(&mut self, seed: u64) -> Vec<f32> {
        self.state = State::new(seed);
        self.state.view().observation()
    }

    fn step(&mut self, action: &[f32]) -> Result<Step, EnvError> {
        let action: [f64; ACTION_SIZE] = self.state.course.begin_step(NAME, action)?;
        let is_finite = self.state.advance(action.map(|a| a as f32));
        let pose = self.pose();
        self.state.course.check_state(NAME, is_finite, &pose)?;
        let view = self.state.view();
        let step = Step {
            observation: view.observation(),
            task_reward: view.task_reward(),
            success: view.is_success(),
            end: self.state.course.end(EPISODE_LEN),
            stage: Some(view.stage()),
        };
        self.state.course.checked_step(NAME, step)
    }

    fn pose(&self) -> Vec<f32> {
        picture::pose(&self.state)
    }

    fn stage(&self) -> Option<u8> {
        Some(self.state.view().stage())
    }

    fn snapshot(&self) -> Vec<u8> {
        world::snapshot(NAME, &self.state)
    }

    fn restore(&mut self, snapshot: &[u8]) -> Result<(), EnvError> {
        self.state = world::restore(NAME, snapshot)?;
        Ok(())
    }
}

impl State {
    /// The start of the episode of `seed`. Everything is built anew, so nothing of the episode
    /// before can leak into it.
    fn new(seed: u64) -> Self {
        let mut world = World::new(Timing {
            step_s: CONTROL_PERIOD_S,
            n_substeps: 2,
            gravity: 0.0,
        });
        build_walls(&mut world);
        let mut robot = PlanarRobot::build(&mut world);
        let start = Start::draw(&mut Rng::new(seed, Stream::Reset, 0));
        robot.place(&mut world, start.robot, start.heading);
        let object = build_object(&mut world, start.object);
        Self {
            world,
            robot,
            object,
            goal: start.goal,
            is_held: false,
            course: Course::new(seed),
        }
    }

    /// One control step; says whether the physics is still one of finite numbers.
    #[must_use = "a world that left the finite numbers must end its episode"]
    fn advance(&mut self, action: [f32; ACTION_SIZE]) -> bool {
        let [ahead, left, jaws] = action;
        let pull = if self.is_held { self.grip() } else { [0.0; 2] };
        let object = &mut self.world.physics.bodies[self.object];
        object.reset_forces(true);
        object.add_force(Vector::new(-pull[0], -pull[1], 0.0), true);
        let drive = self.robot.state(&self.world).to_world([ahead, left]);
        self.robot.drive(&mut self.world, drive, pull);
        let is_finite = self.world.step();
        self.move_jaws(jaws);
        is_finite
    }

    /// The force with which a held object pulls at the jaws, newtons: a critically damped spring,
    /// written so that it is stable for any step.
    fn grip(&self) -> [f32; 2] {
        const W: f32 = GRIP_FREQUENCY;
        const DT: f32 = CONTROL_PERIOD_S;
        let robot = self.robot.state(&self.world);
        let (jaw, jaw_velocity) = (robot.jaw_point(), robot.jaw_velocity());
        let object = &self.world.physics.bodies[self.object];
        let (at, velocity) = (object.translation(), object.linvel());
        let pull = |offset: f32, slip: f32| {
            let wanted = W * W * offset + (2.0 * W + W * W * DT) * slip;
            OBJECT_MASS * wanted / (1.0 + 2.0 * W * DT + W * W * DT * DT)
        };
        [
            pull(at.x - jaw[0], velocity.x - jaw_velocity[0]),
            pull(at.y - jaw[1], velocity.y - jaw_velocity[1]),
        ]
    }

    /// Opens or closes the jaws and settles who holds the object.
    fn move_jaws(&mut self, command: f32) {
        let distance = norm(self.view().jaws_to_object);
        self.robot.move_jaws(command, HELD_OPENNESS);
        self.is_held = if self.is_held {
            self.robot.openness < DROP_OPENNESS && distance <= SLIP
        } else {
            distance <= JAW_ZONE && command > 0.0 && self.robot.openness <= HELD_OPENNESS
        };
    }

    fn view(&self) -> View {
        let robot = self.robot.state(&self.world);
        let jaw = robot.jaw_point();
        let object = self.world.physics.bodies[self.object].translation();
        View {
            robot,
            openness: self.robot.openness,
            is_held: self.is_held,
            jaws_to_object: [object.x - jaw[0], object.y - jaw[1]],
            object_to_goal: [self.goal[0] - object.x, self.goal[1] - object.y],
        }
    }
}

/// Where everything stands when an episode begins.
struct Start {
    robot: [f32; 2],
    heading: f32,
    object: [f32; 2],
    goal: [f32; 2],
}

impl Start {
    fn draw(rng: &mut Rng) -> Self {
        let robot = in_square(rng, 0.9);
        let heading = rng.uniform_in(-std::f64::consts::PI, std::f64::consts::PI) as f32;
        let object = at_some_distance(rng, robot);
        let goal = at_some_distance(rng, object);
        Self {
            robot,
            heading,
            object,
            goal,
        }
    }
}

fn in_square(rng: &mut Rng, half: f64) -> [f32; 2] {
    let x = rng.uniform_in(-half, half) as f32;
    [x, rng.uniform_in(-half, half) as f32]
}

/// Far enough from `other` to be a way, near enough to leave time for the rest. The square's
/// corners are further apart than 1.1 and its centre has room all around: it always ends.
fn at_some_distance(rng: &mut Rng, other: [f32; 2]) -> [f32; 2] {
    loop {
        let place = in_square(rng, 0.95);
        if (0.6..=1.1).contains(&norm([place[0] - other[0], place[1] - other[1]])) {
            return place;
        }
    }
}

fn build_walls(world: &mut World) {
    let middle = FLOOR_HALF + WALL_HALF_THICKNESS;
    for (x, y) in [(middle, 0.0), (-middle, 0.0), (0.0, middle), (0.0, -middle)] {
        let (long, thin) = (FLOOR_HALF + 2.0 * WALL_HALF_THICKNESS, WALL_HALF_THICKNESS);
        let (half_x, half_y) = if x == 0.0 { (long, thin) } else { (thin, long) };
        let wall = ColliderBuilder::cuboid(half_x, half_y, 0.2)
            .translation(Vector::new(x, y, 0.0))
            .friction(0.2);
        world.physics.insert(RigidBodyBuilder::fixed(), wall);
    }
}

fn build_object(world: &mut World, position: [f32; 2]) -> RigidBodyHandle {
    let body = RigidBodyBuilder::dynamic()
        .translation(Vector::new(position[0], position[1], 0.0))
        .locked_axes(LockedAxes::TRANSLATION_LOCKED_Z | LockedAxes::ROTATION_LOCKED)
        .linear_damping(OBJECT_DAMPING)
        .can_sleep(false);
    let collider = ColliderBuilder::ball(OBJECT_RADIUS)
        .mass(OBJECT_MASS)
        .friction(0.2);
    world.physics.insert(body, collider).0
}

/// Drives straight at the object with open jaws, closes them on it, drives straight to the goal.
fn expert(observation: &[f32]) -> Vec<f32> {
    let is_held = observation[4] > 0.0;
    let to_object = [observation[5] * FLOOR_HALF, observation[6] * FLOOR_HALF];
    let to_goal = [observation[10] * FLOOR_HALF, observation[11] * FLOOR_HALF];
    let way = if is_held { to_goal } else { to_object };
    let is_between = norm(to_object) <= JAW_ZONE;
    let jaws = if is_held || is_between { 1.0 } else { -1.0 };
    let drive = way.map(|x| 5.0 * x);
    let length = norm(drive).max(1.0);
    vec![drive[0] / length, drive[1] / length, jaws]
}

#[cfg(test)]
mod tests;
