//! Furniture with one moving part: forms that serve as colliders and as shapes, and the soft
//! joint between a fixed and a moving part.
//!
//! Metres, kilograms, radians. Every object joint has a damping of 2 N·s/m (N·m·s/rad) and an
//! armature of 0.001 kg (kg·m²); nothing pulls it back.
//! Source: METAWORLD.md 1.9 and 3.

use domain::scene::{Geometry, Material, Shape, Transform};
use rapier3d::prelude::*;
use serde::{Deserialize, Serialize};

use super::metaworld::Point;
use crate::robots::tabletop::{self, Layer};

// ── Parts ──────────────────────────────────────────────────────────────────────────────────

/// A form in the frame that it belongs to: the assembly's root or its moving part.
pub struct Part {
    form: Form,
    centre: [f32; 3],
    look: Material,
}

/// Along which axis of its frame a round form lies.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Along {
    /// Right.
    X,
    /// Away from the robot.
    Y,
    /// Up.
    Z,
}

enum Form {
    /// Half extents.
    Box([f32; 3]),
    /// Flat ends: radius and half length.
    Cylinder(Along, f32, f32),
    /// Round caps beyond the half length.
    Capsule(Along, f32, f32),
}

/// A box with these half extents.
pub const fn cuboid(centre: [f32; 3], half: [f32; 3], look: Material) -> Part {
    let form = Form::Box(half);
    Part { form, centre, look }
}

/// A cylinder of this radius and half length.
pub const fn cylinder(
    centre: [f32; 3],
    along: Along,
    radius: f32,
    half_length: f32,
    look: Material,
) -> Part {
    let form = Form::Cylinder(along, radius, half_length);
    Part { form, centre, look }
}

/// A capsule of this radius and half length between the middles of its caps.
pub const fn capsule(
    centre: [f32; 3],
    along: Along,
    radius: f32,
    half_length: f32,
    look: Material,
) -> Part {
    let form = Form::Capsule(along, radius, half_length);
    Part { form, centre, look }
}

impl Along {
    /// The turn that brings z onto this axis.
    fn turn_of_z(self) -> Transform {
        let right_angle = std::f32::consts::FRAC_PI_2;
        match self {
            Self::X => Transform::IDENTITY.turned([0.0, 1.0, 0.0], right_angle),
            Self::Y => Transform::IDENTITY.turned([1.0, 0.0, 0.0], right_angle),
            Self::Z => Transform::IDENTITY,
        }
    }

    /// The turn that brings y, along which rapier's round shapes lie, onto this axis.
    fn turn_of_y(self) -> Vector {
        let right_angle = std::f32::consts::FRAC_PI_2;
        match self {
            Self::X => Vector::new(0.0, 0.0, right_angle),
            Self::Y => Vector::ZERO,
            Self::Z => Vector::new(right_angle, 0.0, 0.0),
        }
    }
}

impl Part {
    fn collider(&self, layer: Layer) -> ColliderBuilder {
        let (shape, turn) = match self.form {
            Form::Box([x, y, z]) => (ColliderBuilder::cuboid(x, y, z), Vector::ZERO),
            Form::Cylinder(along, radius, half) => {
                (ColliderBuilder::cylinder(half, radius), along.turn_of_y())
            }
            Form::Capsule(along, radius, half) => {
                (ColliderBuilder::capsule_y(half, radius), along.turn_of_y())
            }
        };
        tabletop::collider(shape.rotation(turn), self.centre, layer).density(0.0)
    }

    /// The form as a picture shows it, on `body`.
    pub fn shape(&self, body: usize) -> Shape {
        let [x, y, z] = self.centre;
        let (turn, geometry) = match self.form {
            Form::Box(half) => (Transform::IDENTITY, Geometry::Cuboid { half }),
            Form::Cylinder(along, radius, half_length) => (
                along.turn_of_z(),
                Geometry::Cylinder {
                    radius,
                    half_length,
                },
            ),
            Form::Capsule(along, radius, half_length) => (
                along.turn_of_z(),
                Geometry::Capsule {
                    radius,
                    half_length,
                },
            ),
        };
        Shape {
            body,
            local: Transform::at(x, y, z).then(turn),
            geometry,
            material: self.look,
        }
    }
}

/// Adds a body that never moves.
pub fn add_fixed(world: &mut PhysicsWorld, at: Point, parts: &[Part]) -> RigidBodyHandle {
    let body = world.insert_body(RigidBodyBuilder::fixed().translation(vector(at)));
    for part in parts {
        world.insert_collider(part.collider(Layer::Fixed), Some(body));
    }
    body
}

// ── Joint ──────────────────────────────────────────────────────────────────────────────────

/// How a moving part may move.
#[derive(Debug, Clone, Copy)]
pub enum Motion {
    /// Along an axis, metres.
    Slide(Along),
    /// About an axis through the origin of the part's frame, right-handed, radians.
    Hinge(Along),
}

/// A part that moves along one joint.
pub struct Mover<'a> {
    /// Its joint.
    pub motion: Motion,
    /// Where its soft stops begin.
    pub limits: [f32; 2],
    /// How its stops give way.
    pub stops: Stops,
    /// Kilograms.
    pub mass_kg: f32,
    /// Centre of its mass in its own frame.
    pub centre_of_mass: [f32; 3],
    /// Moments of inertia about the centre of mass, kg·m².
    pub inertia: f32,
    /// Its forms, in its own frame.
    pub parts: &'a [Part],
}

/// How the ends of a joint give way.
#[derive(Debug, Clone, Copy)]
pub enum Stops {
    /// Like MuJoCo's joint limits: see `SoftStops`.
    Soft,
    /// Rapier's own, in its terms.
    Own(SpringCoefficients<f32>),
}

/// MuJoCo's joint limits.
///
/// A limit there is a soft constraint: it lets only the share `1 − d` of a push through and
/// replaces the rest by the motion of a critically damped spring with the time constant
/// `T = 0.02 s · d`, `d` being its impedance of 0.95. For a joint of inertia `I` with the damping
/// `D` that is
/// `(I + h D) a = (1 − d) (τ − D v) − d I (2 v / T + r / T²)`
/// at a depth of `r`, with `h D` for damping that is integrated implicitly over a substep
/// `h`. Divided by `1 − d`: beyond its limit a joint is twenty times as inert as before it, on
/// a spring of `19 I / T² = 52 600 s⁻² · I` (measured: 50 000) and a damper of
/// `38 I / T = 2000 s⁻¹ · I` beside its own.
///
/// Differs from the original: there a limit only pushes; here a part that is pulled out of it faster
/// than it would come back by itself stays inert and held back until it is in its range.
#[derive(Debug, Clone, Copy, Serialize, Deserialize)]
struct SoftStops {
    limits: [f32; 2],
    /// Of the joint, armature included.
    inertia: f32,
}

impl SoftStops {
    const IMPEDANCE: f32 = 0.95;
    const TIME_CONSTANT_S: f32 = 0.02 * Self::IMPEDANCE;
    const SUBSTEP_S: f32 = 0.0025;

    /// What the joint has to carry at a position.
    fn at(self, position: f32) -> Load {
        let rest = position.clamp(self.limits[0], self.limits[1]);
        if position.total_cmp(&rest).is_eq() {
            return Load {
                armature: ARMATURE,
                damping: DAMPING,
                spring: 0.0,
                rest,
            };
        }
        let rate = 1.0 / Self::TIME_CONSTANT_S;
        let (passed, kept) = (1.0 - Self::IMPEDANCE, Self::IMPEDANCE * self.inertia);
        let inertia = (self.inertia + Self::SUBSTEP_S * DAMPING) / passed;
        Load {
            armature: ARMATURE + inertia - self.inertia,
            damping: DAMPING + 2.0 * rate * kept / passed,
            spring: rate * rate * kept / passed,
            rest,
        }
    }
}

/// What acts on a joint beside pushes.
struct Load {
    armature: f32,
    damping: f32,
    spring: f32,
    rest: f32,
}

const DAMPING: f32 = 2.0;
const ARMATURE: f32 = 0.001;

/// A moving part in its world.
#[derive(Debug, Clone, Copy, Serialize, Deserialize)]
pub struct MovingPart {
    joint: MultibodyJointHandle,
    is_hinge: bool,
    soft_stops: Option<SoftStops>,
}

impl MovingPart {
    /// Adds a part that moves against `base`; its frame is at `at` when the joint is at 0, and
    /// the joint starts at `start`.
    ///
    /// # Panics
    /// Never: the joint between two new bodies closes no loop.
    pub fn add(
        world: &mut PhysicsWorld,
        base: RigidBodyHandle,
        at: Point,
        mover: &Mover<'_>,
        start: f32,
    ) -> Self {
        let properties = MassProperties::new(
            Vector::from(mover.centre_of_mass),
            mover.mass_kg,
            Vector::splat(mover.inertia),
        );
        let body = RigidBodyBuilder::dynamic()
            .translation(vector(at))
            .additional_mass_properties(properties)
            .gravity_scale(0.0)
            .can_sleep(false);
        let body = world.insert_body(body);
        for part in mover.parts {
            world.insert_collider(part.collider(Layer::Object), Some(body));
        }
        let anchor = vector(at) - world.bodies[base].translation();
        let joint = world
            .insert_multibody_joint(base, body, mover.joint(anchor))
            .expect("both bodies are new, so the joint closes no loop");
        let PhysicsWorld {
            multibody_joints,
            bodies,
            ..
        } = world;
        if let Some((multibody, _)) = multibody_joints.get_mut(joint) {
            multibody.forward_kinematics(bodies, true);
            multibody.apply_displacements(&[start]);
            multibody.forward_kinematics(bodies, false);
            multibody.update_rigid_bodies(bodies, true);
            multibody.damping_mut().fill(DAMPING);
            multibody.armature_mut().fill(ARMATURE);
        }
        let soft_stops = SoftStops {
            limits: mover.limits,
            inertia: mover.joint_inertia(),
        };
        Self {
            joint,
            is_hinge: matches!(mover.motion, Motion::Hinge(_)),
            soft_stops: matches!(mover.stops, Stops::Soft).then_some(soft_stops),
        }
    }

    /// Lets soft stops take hold or let go; to be called before each step of the world.
    pub fn meet_stops(&self, world: &mut PhysicsWorld) {
        let position = self.position(world) as f32;
        let (Some(stops), Some((multibody, link))) =
            (self.soft_stops, world.multibody_joints.get_mut(self.joint))
        else {
            return;
        };
        let load = stops.at(position);
        multibody.armature_mut().fill(load.armature);
        multibody.damping_mut().fill(load.damping);
        if let Some(link) = multibody.link_mut(link) {
            link.joint.set_spring(self.axis(), load.spring, load.rest);
        }
    }

    /// Where rapier keeps the joint's coordinate.
    fn axis(&self) -> usize {
        if self.is_hinge { 3 } else { 0 }
    }

    /// How far the joint is from 0, metres or radians; not a number when the world has lost it.
    pub fn position(&self, world: &PhysicsWorld) -> f64 {
        world
            .multibody_joints
            .get(self.joint)
            .and_then(|(multibody, link)| multibody.link(link))
            .map_or(f64::NAN, |link| {
                f64::from(link.joint().coords()[self.axis()])
            })
    }
}

impl Mover<'_> {
    /// What the joint has to set in motion, kg or kg·m².
    fn joint_inertia(&self) -> f32 {
        let [x, y, z] = self.centre_of_mass;
        let own = match self.motion {
            Motion::Slide(_) => self.mass_kg,
            Motion::Hinge(along) => {
                let square = match along {
                    Along::X => y * y + z * z,
                    Along::Y => x * x + z * z,
                    Along::Z => x * x + y * y,
                };
                self.inertia + self.mass_kg * square
            }
        };
        own + ARMATURE
    }

    fn joint(&self, anchor: Vector) -> GenericJoint {
        let axis = |along| match along {
            Along::X => Vector::X,
            Along::Y => Vector::Y,
            Along::Z => Vector::Z,
        };
        let mut joint: GenericJoint = match self.motion {
            Motion::Slide(along) => PrismaticJointBuilder::new(axis(along))
                .local_anchor1(anchor)
                .build()
                .into(),
            Motion::Hinge(along) => RevoluteJointBuilder::new(axis(along))
                .local_anchor1(anchor)
                .build()
                .into(),
        };
        if let Stops::Own(softness) = self.stops {
            let axis = match self.motion {
                Motion::Slide(_) => JointAxis::LinX,
                Motion::Hinge(_) => JointAxis::AngX,
            };
            joint.set_limits(axis, self.limits);
            joint.softness = softness;
        }
        joint
    }
}

/// A point as rapier has it.
pub fn vector(p: Point) -> Vector {
    Vector::new(p[0] as f32, p[1] as f32, p[2] as f32)
}

#[cfg(test)]
mod tests {
    use super::*;

    const PART: Mover<'_> = Mover {
        motion: Motion::Hinge(Along::Y),
        limits: [-0.5, 0.5],
        stops: Stops::Soft,
        mass_kg: 1e-3,
        centre_of_mass: [0.0; 3],
        inertia: 1e-6,
        parts: &[],
    };

    fn add(world: &mut PhysicsWorld, mover: &Mover<'_>, start: f32) -> MovingPart {
        let base = add_fixed(world, [0.1, 0.2, 0.3], &[]);
        MovingPart::add(world, base, [0.1, 0.5, 0.3], mover, start)
    }

    fn body(world: &PhysicsWorld) -> RigidBodyHandle {
        let mut dynamic = world.bodies.iter().filter(|(_, body)| body.is_dynamic());
        dynamic.next().expect("the part").0
    }

    #[test]
    fn a_part_starts_where_it_is_told_to() {
        let mut world = tabletop::world().physics;
        let part = add(&mut world, &PART, 0.3);
        assert!((part.position(&world) - 0.3).abs() < 1e-6);
        let rotation = world.bodies[body(&world)].rotation();
        assert!((rotation.y - 0.15_f32.sin()).abs() < 1e-6, "{rotation:?}");
        let place = world.bodies[body(&world)].translation();
        assert!(
            (place - Vector::new(0.1, 0.5, 0.3)).length() < 1e-6,
            "{place:?}"
        );
    }

    const LEVER: Mover<'_> = PART;
    const DRAWER: Mover<'_> = Mover {
        motion: Motion::Slide(Along::Y),
        limits: [-0.16, 0.0],
        mass_kg: 0.38,
        inertia: 0.01,
        ..PART
    };

    /// Where a part gets to that starts at `start` and is pushed along +y (about it) throughout.
    fn pushed(mover: &Mover<'_>, start: f32, push: f32, n_steps: usize) -> f64 {
        let mut world = tabletop::world().physics;
        let part = add(&mut world, mover, start);
        let body = body(&world);
        let push = Vector::new(0.0, push, 0.0);
        match mover.motion {
            Motion::Slide(_) => world.bodies[body].add_force(push, true),
            Motion::Hinge(_) => world.bodies[body].add_torque(push, true),
        }
        for _ in 0..n_steps {
            part.meet_stops(&mut world);
            world.step();
        }
        part.position(&world)
    }

    /// METAWORLD.md 1.9 and 3.2: 50 N·m/rad for the lock; the drawer by newtons and millimetres.
    #[test]
    fn stops_give_way_as_measured() {
        let turned = pushed(&LEVER, 0.0, 10.0, 200) - 0.5;
        assert!((turned / 0.2 - 1.0).abs() < 0.1, "{turned} rad");
        for (newtons, reference_mm) in [(20.0, 1.0), (100.0, 5.0), (400.0, 21.0), (1000.0, 52.0)] {
            let slid_mm = 1e3 * (-0.16 - pushed(&DRAWER, 0.0, -newtons, 200));
            assert!(
                (slid_mm / reference_mm - 1.0).abs() < 0.1,
                "{slid_mm} mm at {newtons} N"
            );
        }
    }

    /// At critical damping a depth falls as `(1 + t/T) exp(−t/T)`, here with `T` = 19 ms.
    #[test]
    fn a_part_left_beyond_its_stop_comes_back_without_swinging() {
        for n_steps in [2, 4, 8, 16] {
            let left = (-0.16 - pushed(&DRAWER, -0.2, 0.0, n_steps)) / 0.04;
            let time = n_steps as f64 * 0.0125 / 0.019;
            let expected = (1.0 + time) * (-time).exp();
            assert!((left - expected).abs() < 0.1, "{left}, not {expected}");
        }
    }
}
