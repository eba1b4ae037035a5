//! A disc on wheels that rolls in any direction, turns its nose to where it goes, and has a
//! pair of jaws in front.
//!
//! It moves in the plane z = 0 (rapier keeps its height and tilt); the floor is its drive's
//! friction, not a collider. Heading 0 points along +x, positive turns are counter-clockwise.

use domain::scene::{Geometry, Material, Shape, Transform};
use rapier3d::prelude::{
    ColliderBuilder, LockedAxes, RigidBodyBuilder, RigidBodyHandle, Rotation, Vector,
};
use serde::{Deserialize, Serialize};

use crate::world::World;

/// Radius of the body, metres.
pub const RADIUS: f32 = 0.16;
/// From the robot's centre to the point between its jaws, metres.
pub const REACH: f32 = 0.25;
/// Fastest drive, metres per second.
pub const TOP_SPEED: f32 = 1.0;
/// Fastest turn, towards where it is told to drive, radians per second.
pub const TOP_TURN: f32 = 8.0;

/// Kilograms.
const MASS: f32 = 4.0;
/// Time constant of the drive's speed, seconds.
const SPEED_LAG_S: f32 = 0.1;
/// Hardest push of the drive, newtons: a wall stops it.
const PUSH: f32 = 40.0;
/// Time constant of the turning rate, seconds.
const TURN_LAG_S: f32 = 0.05;
/// Largest change of the jaws' openness in one control step.
const JAW_STEP: f32 = 0.16;

/// The robot inside a world.
#[derive(Debug, Clone, Serialize, Deserialize)]
pub struct PlanarRobot {
    body: RigidBodyHandle,
    /// how far the jaws are open, in [0, 1]: 1 open, 0 closed.
    pub openness: f32,
}

/// Where a robot is and how it moves.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct PlanarState {
    /// Metres, world axes.
    pub position: [f32; 2],
    /// Metres per second, world axes.
    pub velocity: [f32; 2],
    /// Unit vector of the nose, world axes.
    pub heading: [f32; 2],
    /// Radians per second, counter-clockwise.
    pub turn_rate: f32,
}

impl PlanarState {
    /// A vector of the robot's own axes, ahead and to its left, in those of the world.
    pub fn to_world(&self, [ahead, left]: [f32; 2]) -> [f32; 2] {
        let [x, y] = self.heading;
        [ahead * x - left * y, ahead * y + left * x]
    }

    /// A vector of the world's axes in the robot's own: the inverse of [`Self::to_world`].
    pub fn to_own(&self, [x, y]: [f32; 2]) -> [f32; 2] {
        let [c, s] = self.heading;
        [x * c + y * s, y * c - x * s]
    }

    /// The point between the jaws, metres.
    pub fn jaw_point(&self) -> [f32; 2] {
        [
            self.position[0] + REACH * self.heading[0],
            self.position[1] + REACH * self.heading[1],
        ]
    }

    /// How fast that point moves, metres per second.
    pub fn jaw_velocity(&self) -> [f32; 2] {
        let swing = REACH * self.turn_rate;
        [
            self.velocity[0] - swing * self.heading[1],
            self.velocity[1] + swing * self.heading[0],
        ]
    }
}

impl PlanarRobot {
    /// Puts a robot with open jaws at the origin of `world`.
    pub fn build(world: &mut World) -> Self {
        let body = RigidBodyBuilder::dynamic()
            .locked_axes(
                LockedAxes::TRANSLATION_LOCKED_Z
                    | LockedAxes::ROTATION_LOCKED_X
                    | LockedAxes::ROTATION_LOCKED_Y,
            )
            .can_sleep(false);
        // A ball, because only its equator ever touches anything and balls are the cheapest.
        let collider = ColliderBuilder::ball(RADIUS).mass(MASS).friction(0.2);
        let (body, _) = world.physics.insert(body, collider);
        Self {
            body,
            openness: 1.0,
        }
    }

    /// Stands the robot somewhere, at rest, with open jaws.
    pub fn place(&mut self, world: &mut World, position: [f32; 2], heading: f32) {
        let body = &mut world.physics.bodies[self.body];
        body.set_translation(Vector::new(position[0], position[1], 0.0), true);
        body.set_rotation(Rotation::from_rotation_z(heading), true);
        body.set_linvel(Vector::ZERO, true);
        body.set_angvel(Vector::ZERO, true);
        body.reset_forces(true);
        body.reset_torques(true);
        self.openness = 1.0;
    }

    /// Where it is now.
    pub fn state(&self, world: &World) -> PlanarState {
        let body = &world.physics.bodies[self.body];
        let (at, velocity) = (body.translation(), body.linvel());
        let nose = body.rotation() * Vector::X;
        PlanarState {
            position: [at.x, at.y],
            velocity: [velocity.x, velocity.y],
            heading: [nose.x, nose.y],
            turn_rate: body.angvel().z,
        }
    }

    /// Sets the forces of the coming world step.
    ///
    /// `drive` is the wanted velocity in world axes as a share of [`TOP_SPEED`], cut to the unit
    /// disc. The nose turns towards it the faster the stronger it is, and stays where it is
    /// without any. `pull` is a force on the point between the jaws, newtons: a load.
    pub fn drive(&self, world: &mut World, drive: [f32; 2], pull: [f32; 2]) {
        let state = self.state(world);
        let step_s = world.physics.integration_parameters.dt;
        let length = drive[0].hypot(drive[1]);
        let scale = TOP_SPEED / length.max(1.0);
        let push = [0, 1].map(|axis| {
            let missing = drive[axis] * scale - state.velocity[axis];
            (MASS * missing / (SPEED_LAG_S + step_s)).clamp(-PUSH, PUSH)
        });
        let turn_rate = TOP_TURN * towards(state.heading, drive) * length.min(1.0);
        let body = &mut world.physics.bodies[self.body];
        let inertia = 0.4 * MASS * RADIUS * RADIUS;
        let torque = inertia * (turn_rate - state.turn_rate) / (TURN_LAG_S + step_s);
        body.reset_forces(true);
        body.reset_torques(true);
        body.add_force(Vector::new(push[0] + pull[0], push[1] + pull[1], 0.0), true);
        body.add_torque(Vector::new(0.0, 0.0, torque), true);
    }

    /// Moves the jaws for one control step towards where `command` wants them (+1 closed, −1
    /// open), not beyond `narrowest`: 0, or the width that they stop at.
    pub fn move_jaws(&mut self, command: f32, narrowest: f32) {
        let missing = 0.5 * (1.0 - command) - self.openness;
        self.openness = (self.openness + missing.clamp(-JAW_STEP, JAW_STEP)).clamp(narrowest, 1.0);
    }
}

/// How hard to turn from `heading` towards `wanted`, in [−1, 1]: the sine of the angle between
/// them, or a full turn where they point apart.
fn towards(heading: [f32; 2], wanted: [f32; 2]) -> f32 {
    let length = wanted[0].hypot(wanted[1]).max(1e-6);
    let sine = (heading[0] * wanted[1] - heading[1] * wanted[0]) / length;
    let cosine = (heading[0] * wanted[0] + heading[1] * wanted[1]) / length;
    if cosine >= 0.0 {
        sine
    } else {
        1.0_f32.copysign(sine)
    }
}

/// Bodies that [`place`] gives: the robot, its jaws, and its jaws in the colour of holding.
pub const N_BODIES: usize = 5;
/// How high held things are lifted in pictures, metres.
pub const LIFT: f32 = 0.09;

/// Below the middle of the floor, where no camera sees it.
const HIDDEN: Transform = Transform::at(0.0, 0.0, -0.15);

const BLUE: Material = Material::plain(0.0, 0.45, 0.70);
const SKY: Material = Material::plain(0.34, 0.71, 0.91);
const WHITE: Material = Material::plain(0.97, 0.97, 0.97);
const BLACK: Material = Material::plain(0.08, 0.08, 0.10);
const GREY: Material = Material::plain(0.35, 0.37, 0.40);
const YELLOW: Material = Material::plain(0.98, 0.86, 0.10);

/// The robot's look, with its bodies numbered from `first_body` in the order of [`place`].
pub fn shapes(first_body: usize) -> Vec<Shape> {
    let on_robot = |x, y, z, geometry, material| Shape {
        body: first_body,
        local: Transform::at(x, y, z),
        geometry,
        material,
    };
    let disc = |radius, half_length| Geometry::Cylinder {
        radius,
        half_length,
    };
    let ball = |radius| Geometry::Sphere { radius };
    let mut shapes = vec![
        on_robot(0.0, 0.0, 0.03, disc(RADIUS - 0.02, 0.03), BLACK),
        on_robot(0.0, 0.0, 0.10, disc(RADIUS, 0.05), BLUE),
        on_robot(-0.03, 0.0, 0.165, disc(0.10, 0.02), SKY),
    ];
    for side in [-1.0, 1.0] {
        shapes.push(on_robot(0.07, 0.055 * side, 0.17, ball(0.045), WHITE));
        shapes.push(on_robot(0.098, 0.055 * side, 0.185, ball(0.025), BLACK));
    }
    for (jaw, material) in [GREY, GREY, YELLOW, YELLOW].into_iter().enumerate() {
        let inward: f32 = if jaw % 2 == 0 { 1.0 } else { -1.0 };
        let part = |x, y, half| Shape {
            body: first_body + 1 + jaw,
            local: Transform::at(x, y * inward, 0.055),
            geometry: Geometry::Cuboid { half },
            material,
        };
        shapes.push(part(0.21, 0.012, [0.10, 0.012, 0.03]));
        shapes.push(part(0.30, 0.0, [0.012, 0.024, 0.03]));
    }
    shapes
}

/// Where the bodies of a robot at `robot` are: the robot, left and right jaw, and the same two
/// in the colour of holding. The pair that does not apply is hidden below the floor's middle.
pub fn place(robot: Transform, openness: f32, is_holding: bool) -> [Transform; N_BODIES] {
    let half_gap = 0.015 + 0.155 * openness;
    let jaw = |side: f32, is_shown: bool| {
        let z = if is_holding { LIFT } else { 0.0 };
        if is_shown {
            robot.then(Transform::at(0.0, side * half_gap, z))
        } else {
            HIDDEN
        }
    };
    [
        robot,
        jaw(1.0, !is_holding),
        jaw(-1.0, !is_holding),
        jaw(1.0, is_holding),
        jaw(-1.0, is_holding),
    ]
}
