//! RoboDesk's desk: table and shelf, a drawer, a sliding door, three buttons with their lights,
//! a ball and two blocks, a bin.
//!
//! Metres and kilograms; x right, y away from the robot, z up, the floor at z = 0, the table's
//! top at z = 0.76. Drawer, door and buttons slide on joints of their own; the lights follow
//! their buttons ([`light`]).
//!
//! Differs from the original: a control step is 5 steps of 4 ms, not 10 of 2 (a light's own are 2);
//! furniture never meets furniture; the table's top goes on downwards under the caps, so that a hard
//! push does not drive one through it.
//! Source: DMCONTROL_ROBODESK.md 5.3 and 5.4.

use domain::random::Rng;
use rapier3d::prelude::*;
use serde::{Deserialize, Serialize};

use self::light::{CapPath, Light};
use crate::robots::panda::Point;

pub mod light;
mod look;
mod parts;

pub use look::{BACKGROUND, N_BODIES, bodies, cameras, shapes};

/// Numbers that say where everything is; see [`Desk::positions`].
pub const N_POSITIONS: usize = 29;
/// Red, green, blue.
pub const N_BUTTONS: usize = 3;
/// Middle of each button's holder on the table.
pub const BUTTONS: [Point; N_BUTTONS] = [
    [-0.45, 0.625, 0.76],
    [-0.25, 0.625, 0.76],
    [-0.05, 0.625, 0.76],
];
/// Where the positions of the lights begin in [`Desk::positions`].
pub const LIGHTS: usize = 5;

/// Which colliders meet. Furniture never meets furniture: drawer and door hang free.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Layer {
    /// What stands still.
    Fixed,
    /// Drawer and door.
    Sliding,
    /// The buttons' caps.
    Cap,
    /// Ball and blocks.
    Loose,
    /// What is under a cap, as deep as it takes: the table's top alone is so thin that a hard push
    /// drives a cap through it.
    Well,
    /// The robot.
    Robot,
}

impl Layer {
    /// Rapier's way of saying it.
    pub fn groups(self) -> InteractionGroups {
        let [fixed, sliding, cap, loose, robot, well] = [
            Group::GROUP_1,
            Group::GROUP_2,
            Group::GROUP_3,
            Group::GROUP_4,
            Group::GROUP_5,
            Group::GROUP_6,
        ];
        let (memberships, filter) = match self {
            Self::Fixed => (fixed, loose | robot),
            Self::Sliding => (sliding, loose | robot),
            Self::Cap => (cap, well | loose | robot),
            Self::Loose => (loose, fixed | sliding | cap | loose | robot),
            Self::Well => (well, cap),
            Self::Robot => (robot, fixed | sliding | cap | loose),
        };
        InteractionGroups::new(memberships, filter, InteractionTestMode::And)
    }
}

/// How a part slides, by its joint's value `q`.
struct Slide {
    /// Where the part is at `q` = 0.
    origin: [f32; 3],
    /// The way of positive `q`.
    along: Vector,
    range: [f32; 2],
    mass: f32,
    /// Inertia beyond the mass, kg.
    armature: f32,
    /// N s/m.
    damping: f32,
    /// Dry friction, N.
    friction: f32,
    /// Pull back to 0, N/m.
    spring: f32,
    stop: SpringCoefficients<f32>,
}

const DRAWER: Slide = Slide {
    origin: [0.0, 0.85, 0.655],
    along: Vector::Y,
    range: [-0.48, 0.0],
    mass: 29.0,
    armature: 0.1,
    damping: 2.0,
    friction: 5.0,
    spring: 0.0,
    stop: SpringCoefficients {
        natural_frequency: 60.0,
        damping_ratio: 1.0,
    },
};

const DOOR: Slide = Slide {
    origin: [0.0, 0.0, 0.0],
    along: Vector::X,
    range: [0.0, 0.6],
    mass: 5.87,
    ..DRAWER
};

/// A cap and the light that hangs on it, as one: 10 g each, and their weights cancel, because
/// the light's axis points down. The upper stop is where the light rests on its own.
const CAP: Slide = Slide {
    origin: [0.0; 3],
    along: Vector::Z,
    range: [-0.005, -light::HANG_M as f32],
    mass: 0.02,
    armature: 0.0,
    damping: 1.0,
    friction: 0.0,
    spring: 10.0,
    // The original's stops are soft: about 230 N/m over their first tenth of a millimetre.
    stop: SpringCoefficients {
        natural_frequency: 20.0,
        damping_ratio: 1.0,
    },
};

/// Where the loose things start.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Start {
    /// Drawer (−0.48 open, 0 closed) and door (0…0.6), metres.
    pub sliding: [f64; 2],
    /// Centres of the ball, the upright and the flat block.
    pub loose: [Point; 3],
}

impl Start {
    /// Draws a start as the original does: a slightly open drawer and door, things in their
    /// thirds of the table.
    pub fn draw(rng: &mut Rng) -> Self {
        let sliding = [rng.uniform_in(-0.1, 0.0), rng.uniform_in(0.0, 0.2)];
        let mut on_table = |x: [f64; 2], y: [f64; 2], z| {
            let x = rng.uniform_in(x[0], x[1]);
            [x, rng.uniform_in(y[0], y[1]), z]
        };
        Self {
            sliding,
            loose: [
                on_table([-0.4, 0.08], [0.7, 0.78], 0.799),
                on_table([0.2, 0.5], [0.78, 0.83], 0.849_784_49),
                on_table([0.15, 0.45], [0.63, 0.7], 0.774_784_49),
            ],
        }
    }
}

/// The desk inside a world.
#[derive(Debug, Clone, Serialize, Deserialize)]
pub struct Desk {
    sliding: [RigidBodyHandle; 2],
    caps: [RigidBodyHandle; N_BUTTONS],
    loose: [RigidBodyHandle; 3],
    lights: [Light; N_BUTTONS],
    /// Position and velocity of the caps where the lights have followed them to.
    caps_before: [[f64; 2]; N_BUTTONS],
}

impl Desk {
    /// Builds everything, at rest.
    pub fn new(world: &mut PhysicsWorld, start: &Start) -> Self {
        for solid in parts::fixed() {
            insert(world, &solid, Layer::Fixed, None);
        }
        insert(world, &parts::well(), Layer::Well, None);
        let [drawer, door] =
            [(&DRAWER, parts::drawer()), (&DOOR, parts::door())].map(|(slide, solids)| {
                add_sliding(world, slide, slide.origin, &solids, Layer::Sliding)
            });
        set_slide(world, drawer, start.sliding[0]);
        set_slide(world, door, start.sliding[1]);
        let caps = BUTTONS.map(|button| {
            let origin = button.map(|x| x as f32);
            let cap = add_sliding(world, &CAP, origin, &[parts::cap()], Layer::Cap);
            set_slide(world, cap, 0.0);
            cap
        });
        let loose = std::array::from_fn(|i| add_loose(world, i, start.loose[i]));
        Self {
            sliding: [drawer, door],
            caps,
            loose,
            lights: [Light::default(); N_BUTTONS],
            caps_before: [[0.0; 2]; N_BUTTONS],
        }
    }

    /// Moves the lights through a world step that has just been made, `step_s` seconds.
    pub fn follow(&mut self, world: &PhysicsWorld, step_s: f64) {
        for (i, light) in self.lights.iter_mut().enumerate() {
            let position = slide_of(world, self.caps[i]);
            // Rapier's own velocity of a cap that rests on its stop is not zero.
            let velocity = (position - self.caps_before[i][0]) / step_s;
            let path = CapPath {
                from: self.caps_before[i],
                to: [position, velocity],
                step_s,
            };
            light.follow(&path);
            self.caps_before[i] = path.to;
        }
    }

    /// Where everything is.
    ///
    /// | index | meaning | unit |
    /// |---|---|---|
    /// | 0 | drawer, −0.48 open, 0 closed | m |
    /// | 1 | door, 0 closed | m |
    /// | 2–4 | red, green, blue button, −0.005 pressed | m |
    /// | 5–7 | their lights, on below −0.00453 | m |
    /// | 8–14, 15–21, 22–28 | ball, upright block, flat block: x, y, z, quaternion (w, x, y, z) | m, – |
    pub fn positions(&self, world: &PhysicsWorld) -> [f64; N_POSITIONS] {
        let mut positions = [0.0; N_POSITIONS];
        positions[0] = slide_of(world, self.sliding[0]);
        positions[1] = slide_of(world, self.sliding[1]);
        for i in 0..N_BUTTONS {
            positions[2 + i] = slide_of(world, self.caps[i]);
            positions[LIGHTS + i] = self.lights[i].position;
        }
        for (slots, body) in positions[8..].chunks_mut(7).zip(self.loose) {
            let pose = world.bodies[body].position();
            let (at, turn) = (pose.translation, pose.rotation);
            let numbers = [at.x, at.y, at.z, turn.w, turn.x, turn.y, turn.z];
            slots.copy_from_slice(&numbers.map(f64::from));
        }
        positions
    }

    /// The caps' bodies.
    pub fn caps(&self) -> &[RigidBodyHandle; N_BUTTONS] {
        &self.caps
    }
}

fn insert(
    world: &mut PhysicsWorld,
    solid: &crate::solid::Solid,
    layer: Layer,
    body: Option<RigidBodyHandle>,
) {
    let collider = solid.collider().expect("furniture has a volume");
    let collider = collider.friction(1.0).collision_groups(layer.groups());
    world.insert_collider(collider, body);
}

/// A body on a joint of its own, at `q` = 0.
fn add_sliding(
    world: &mut PhysicsWorld,
    slide: &Slide,
    origin: [f32; 3],
    solids: &[crate::solid::Solid],
    layer: Layer,
) -> RigidBodyHandle {
    let origin = Vector::from(origin);
    let anchor = world.insert_body(RigidBodyBuilder::fixed().translation(origin));
    let inertia = MassProperties::new(Vector::ZERO, slide.mass, Vector::splat(slide.mass * 0.01));
    let body = RigidBodyBuilder::dynamic()
        .translation(origin)
        .additional_mass_properties(inertia)
        .gravity_scale(0.0)
        .can_sleep(false);
    let body = world.insert_body(body);
    for solid in solids {
        insert(world, solid, layer, Some(body));
    }
    world.bodies[body].recompute_mass_properties_from_colliders(&world.colliders);
    let joint = PrismaticJointBuilder::new(slide.along)
        .limits(slide.range)
        .softness(slide.stop);
    let joint = world
        .insert_multibody_joint(anchor, body, joint)
        .expect("both bodies are new, so the joint closes no loop");
    if let Some((multibody, id)) = world.multibody_joints.get_mut(joint) {
        multibody.forward_kinematics(&world.bodies, true);
        multibody.damping_mut().fill(slide.damping);
        multibody.armature_mut().fill(slide.armature);
        multibody.frictions_mut().fill(slide.friction);
        if let Some(link) = multibody.link_mut(id) {
            link.joint.set_spring(0, slide.spring, 0.0);
        }
    }
    body
}

fn set_slide(world: &mut PhysicsWorld, body: RigidBodyHandle, q: f64) {
    let change = q - slide_of(world, body);
    let link = world.multibody_joints.rigid_body_link(body).copied();
    let multibody = link.and_then(|link| world.multibody_joints.get_multibody_mut(link.multibody));
    if let Some(multibody) = multibody {
        multibody.apply_displacements(&[change as f32]);
        multibody.forward_kinematics(&world.bodies, false);
        multibody.update_rigid_bodies(&mut world.bodies, true);
    }
}

/// How far a body is along its joint, metres.
fn slide_of(world: &PhysicsWorld, body: RigidBodyHandle) -> f64 {
    let joints = &world.multibody_joints;
    let id = joints.rigid_body_link(body).expect(JOINED);
    let multibody = joints.get_multibody(id.multibody).expect(JOINED);
    let link = multibody.link(id.id).expect(JOINED);
    f64::from(link.joint().coords()[0])
}

const JOINED: &str = "a sliding part is joined to its anchor when it is built";

fn add_loose(world: &mut PhysicsWorld, i: usize, centre: Point) -> RigidBodyHandle {
    let (solid, mass) = parts::loose(i);
    // The ball's frame is turned; the original starts it so.
    let turn = if i == 0 {
        Rotation::from_xyzw(0.0, 0.706_825_2, 0.0, 0.707_388_3)
    } else {
        Rotation::IDENTITY
    };
    let at = Vector::from(centre.map(|x| x as f32));
    let body = RigidBodyBuilder::dynamic()
        .pose(Pose::from_parts(at, turn))
        .gyroscopic_forces_enabled(true)
        .can_sleep(false);
    let body = world.insert_body(body);
    let collider = solid.collider().expect("it has a volume").mass(mass);
    let collider = collider
        .friction(1.0)
        .collision_groups(Layer::Loose.groups());
    world.insert_collider(collider, Some(body));
    body
}

#[cfg(test)]
mod tests;
