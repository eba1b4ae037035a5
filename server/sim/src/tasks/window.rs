//! MetaWorld's sliding window: a frame that stands on the table and a pane that slides along +x.
//!
//! Metres. The frame's root `P` is its centre; the pane's frame is `P + (q, 0, 0)` with `q` in
//! [0, 0.2]. Parts serve as colliders and as shapes.
//! Source: METAWORLD.md 3.3 and 1.9.

use domain::scene::{Geometry, Material, Shape, Transform};
use rapier3d::prelude::*;

use super::metaworld::{Point, plus};
use crate::robots::tabletop::{self, Layer};

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
/// How far the pane slides, metres.
pub const TRAVEL_M: f64 = 0.2;

const PANE_MASS_KG: f32 = 0.638;
const PANE_DAMPING: f32 = 2.0;
/// Stops this stiff hold the pane within 9 mm against the expert's 2 kN, at 2 mm in the end
/// (the original: 2.7 and 1.3 mm, where the pane also meets its frame).
const STOP_HZ: f32 = 200.0;
const STOP_DAMPING: f32 = 3.0;

/// Adds a window at `root` with its pane at `slide` 0; returns the pane's body.
///
/// # Panics
/// Never: the joint between two new bodies closes no loop.
pub fn add(world: &mut PhysicsWorld, root: Point) -> RigidBodyHandle {
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

/// What the observation calls the handle of window-open: a point left of the grip, of a window at `root` whose pane is open by `slide` metres.
pub fn handle(root: Point, slide: f64) -> Point {
    plus(plus(root, [slide, 0.0, 0.0]), HANDLE_POINT)
}

/// Bodies that [`place`] gives and [`shapes`] uses: the frame and the pane.
pub const N_BODIES: usize = 2;

/// Frame and pane, as the bodies `first_body` and the one after it.
pub fn shapes(first_body: usize) -> Vec<Shape> {
    let fixed = FIXED_PARTS.iter().map(|part| part.shape(first_body));
    let sliding = SLIDING_PARTS.iter().map(|part| part.shape(first_body + 1));
    fixed.chain(sliding).collect()
}

/// Where frame and pane are, from `[q, P.x, P.y, P.z]`.
pub fn place(pose: [f32; 4]) -> [Transform; N_BODIES] {
    let [slide, x, y, z] = pose;
    [Transform::at(x, y, z), Transform::at(x + slide, y, z)]
}

/// The middle of the grip of a window whose pose is `[q, P.x, P.y, P.z]`.
pub fn grip(pose: [f32; 4]) -> Transform {
    let [_, pane] = place(pose);
    pane.then(Transform::at(-0.014, -0.095, 0.0))
}
