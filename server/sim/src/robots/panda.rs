//! Franka's Panda in front of RoboDesk's desk: seven hinges and two fingers on position servos.
//!
//! The links are one articulated body whose masses, inertias and stops are the original's. Each
//! servo is an implicit spring with damping; its torque limit is kept by drawing its target
//! closer, and the weight of the links is carried by an extra torque, as in the original.
//!
//! Differs from the original: links collide as capsules of the volume of their hulls instead of
//! as hulls, and not with each other; weight and torque limits are reckoned once a control step, not
//! every 2 ms, and what the links' own motion adds to their weight is not carried.
//! Source: DMCONTROL_ROBODESK.md 5.1 and 5.2.

use rapier3d::na::{Matrix3, SMatrix};
use rapier3d::prelude::*;
use rapier3d::utils::AngularInertiaOps;
use serde::{Deserialize, Serialize};

use self::links::{LINKS, Motion};

pub mod links;
mod look;
mod reach;

pub use look::{N_BODIES, bodies, shapes};

/// Metres.
pub type Point = [f64; 3];
/// Hinges 1–7, left and right finger.
pub const N_JOINTS: usize = 9;
/// Numbers of an action: three for the end effector, wrist, fingers.
pub const ACTION_SIZE: usize = 5;
/// Joints in the middle of all starting postures; fingers almost closed.
pub const HOME: [f64; N_JOINTS] = [-0.30, -0.4, 0.28, -2.5, 0.13, 1.87, 0.91, 0.01, 0.01];

/// Metres that the end effector's target is ahead of it at full action.
const LEAD_M: f64 = 0.01;
/// Radians that the wrist's target is ahead of it at full action.
const WRIST_LEAD: f64 = 0.02 * 2.9671;
const WRIST: usize = 6;

/// The arm inside a world.
#[derive(Debug, Clone, Serialize, Deserialize)]
pub struct Panda {
    links: [RigidBodyHandle; N_JOINTS],
}

impl Panda {
    /// Puts an arm with joints `q`, at rest, into a world whose gravity is the earth's.
    ///
    /// # Panics
    /// Never: joints between new bodies close no loop.
    pub fn new(world: &mut PhysicsWorld, q: &[f64; N_JOINTS], groups: InteractionGroups) -> Self {
        let base = RigidBodyBuilder::fixed().pose(single(&links::base()));
        let base = world.insert_body(base);
        for solid in look::pedestal() {
            let collider = solid.collider().expect("the pedestal has a volume");
            let collider = collider.friction(1.0).collision_groups(groups);
            world.insert_collider(collider, Some(base));
        }
        let mut links = [base; N_JOINTS];
        let frames = links::frames(q);
        for (i, link) in LINKS.iter().enumerate() {
            let body = RigidBodyBuilder::dynamic()
                .pose(single(&frames[i + 1]))
                .additional_mass_properties(mass_properties(link))
                .can_sleep(false);
            links[i] = world.insert_body(body);
            for solid in look::solids(i) {
                let collider = solid.collider().expect("a link has a volume");
                let collider = collider.friction(1.0).collision_groups(groups);
                world.insert_collider(collider, Some(links[i]));
            }
            world.bodies[links[i]].recompute_mass_properties_from_colliders(&world.colliders);
            let parent = if link.parent == 0 {
                base
            } else {
                links[link.parent - 1]
            };
            world
                .insert_multibody_joint(parent, links[i], joint(link))
                .expect("both bodies are new, so the joint closes no loop");
        }
        let panda = Self { links };
        panda.place(world, q);
        panda
    }

    /// Fills in what rapier leaves at defaults, and moves the joints from zero to `q`.
    fn place(&self, world: &mut PhysicsWorld, q: &[f64; N_JOINTS]) {
        let multibody = self.multibody_mut(&mut world.multibody_joints);
        multibody.forward_kinematics(&world.bodies, true);
        for (i, link) in LINKS.iter().enumerate() {
            multibody.damping_mut()[i] = link.drive.damping as f32;
            multibody.armature_mut()[i] = link.drive.armature as f32;
        }
        multibody.apply_displacements(&q.map(|q| q as f32));
        multibody.forward_kinematics(&world.bodies, false);
        multibody.update_rigid_bodies(&mut world.bodies, true);
    }

    /// The arm as rapier's one articulated body.
    fn multibody<'w>(&self, world: &'w PhysicsWorld) -> &'w Multibody {
        let joints = &world.multibody_joints;
        let link = joints.rigid_body_link(self.links[0]).expect(BUILT);
        joints.get_multibody(link.multibody).expect(BUILT)
    }

    fn multibody_mut<'w>(&self, joints: &'w mut MultibodyJointSet) -> &'w mut Multibody {
        let link = joints.rigid_body_link(self.links[0]).expect(BUILT);
        let id = link.multibody;
        joints.get_multibody_mut(id).expect(BUILT)
    }

    /// Where the joints are, radians and metres.
    ///
    /// # Panics
    /// In a world that is not the arm's.
    pub fn joints(&self, world: &PhysicsWorld) -> [f64; N_JOINTS] {
        let multibody = self.multibody(world);
        std::array::from_fn(|i| {
            let link = multibody.link(i + 1).expect(BUILT);
            f64::from(link.joint().coords()[free_axis(LINKS[i].motion)])
        })
    }

    /// The links' bodies, in the order of [`LINKS`].
    pub fn links(&self) -> &[RigidBodyHandle; N_JOINTS] {
        &self.links
    }

    /// Sets the servos for the coming world step: towards `targets`, as far as each joint takes
    /// commands, carrying the arm's weight.
    ///
    /// # Panics
    /// In a world that is not the arm's.
    pub fn hold(&self, world: &mut PhysicsWorld, targets: &[f64; N_JOINTS]) {
        let q = self.joints(world);
        let load = links::gravity_load(&links::frames(&q));
        let multibody = self.multibody_mut(&mut world.multibody_joints);
        for (i, links::Link { motion, drive, .. }) in LINKS.iter().enumerate() {
            let [lowest, highest] = drive.command;
            let ahead = targets[i].clamp(lowest, highest) - q[i];
            let pull = (drive.gain * ahead).clamp(-drive.strongest, drive.strongest);
            let rest = q[i] + (pull + load[i]) / drive.gain;
            let link = multibody.link_mut(i + 1).expect(BUILT);
            let axis = free_axis(*motion);
            link.joint.set_spring(axis, drive.gain as f32, rest as f32);
        }
    }

    /// Joint-space inertia as the physics sees it, rotors included, `[9][9]`.
    ///
    /// # Panics
    /// In a world that is not the arm's.
    pub fn inertia(&self, world: &PhysicsWorld) -> [[f64; N_JOINTS]; N_JOINTS] {
        let multibody = self.multibody(world);
        let mut inertia = SMatrix::<f64, N_JOINTS, N_JOINTS>::zeros();
        for (i, link) in self.links.iter().enumerate() {
            let properties = world.bodies[*link].mass_properties();
            let jacobian = multibody.body_jacobian(i + 1).map(f64::from);
            let moment = properties.effective_angular_inertia().into_matrix();
            let moment = Matrix3::from_fn(|r, c| f64::from(moment.col(c)[r]));
            let mass = f64::from(world.bodies[*link].mass());
            let (linear, angular) = (jacobian.fixed_rows::<3>(0), jacobian.fixed_rows::<3>(3));
            inertia += mass * linear.transpose() * linear;
            inertia += angular.transpose() * moment * angular;
        }
        std::array::from_fn(|row| {
            std::array::from_fn(|column| {
                let rotor = if row == column {
                    f64::from(multibody.armature()[row])
                } else {
                    0.0
                };
                inertia[(row, column)] + rotor
            })
        })
    }
}

const BUILT: &str = "the arm's links were joined when it was built";

/// What an action asks of the joints for one control step: the end effector 1 cm further along
/// it, the wrist a little further, the fingers at a width.
///
/// `action` is in [−1, 1]⁵. All leads start at the present joints `q`, so what lags behind is
/// never made up for. Wrist and fingers are kept to what their servos take; joints 1–6 may be
/// asked for more than that, as in the original, where only the servo ([`Panda::hold`]) keeps
/// them.
pub fn targets(q: &[f64; N_JOINTS], action: &[f64; ACTION_SIZE]) -> [f64; N_JOINTS] {
    let here = links::end_effector(&links::frames(q));
    let there = std::array::from_fn(|i| here[i] + LEAD_M * action[i]);
    let mut targets = reach::reach(q, there);
    targets[WRIST] = q[WRIST] + WRIST_LEAD * action[3];
    let width = 0.02 * (action[4] + 1.0);
    targets[WRIST + 1] = width;
    targets[WRIST + 2] = width;
    for (target, link) in targets.iter_mut().zip(&LINKS).skip(WRIST) {
        let [lowest, highest] = link.drive.command;
        *target = target.clamp(lowest, highest);
    }
    targets
}

fn mass_properties(link: &links::Link) -> MassProperties {
    let [xx, yy, zz, xy, xz, yz] = link.inertia.map(|x| x as f32);
    let columns = [
        Vector::new(xx, xy, xz),
        Vector::new(xy, yy, yz),
        Vector::new(xz, yz, zz),
    ];
    let inertia = Matrix::from_cols(columns[0], columns[1], columns[2]);
    let centre = Vector::from(link.centre.map(|x| x as f32));
    MassProperties::with_inertia_matrix(centre, link.mass as f32, inertia)
}

/// Index of a motion's coordinate among rapier's three linear and three angular ones.
fn free_axis(motion: Motion) -> usize {
    match motion {
        Motion::Hinge => JointAxis::AngZ as usize,
        Motion::SlideLeft | Motion::SlideRight => JointAxis::LinY as usize,
    }
}

fn joint(link: &links::Link) -> GenericJoint {
    let (free, axis) = match link.motion {
        Motion::Hinge => (JointAxesMask::ANG_Z, JointAxis::AngZ),
        Motion::SlideLeft | Motion::SlideRight => (JointAxesMask::LIN_Y, JointAxis::LinY),
    };
    // A joint slides along its frame's +y: the right finger's frame is turned round.
    let about_face = match link.motion {
        Motion::SlideRight => Pose::from_rotation(Rotation::from_rotation_z(std::f32::consts::PI)),
        Motion::Hinge | Motion::SlideLeft => Pose::IDENTITY,
    };
    GenericJointBuilder::new(JointAxesMask::all().difference(free))
        .local_frame1(single(&link.mount()) * about_face)
        .local_frame2(about_face)
        .limits(axis, link.range.map(|x| x as f32))
        .build()
}

/// A frame in rapier's precision.
fn single(pose: &links::Pose) -> Pose {
    let at = pose.translation.vector.map(|x| x as f32);
    let turn = pose.rotation.coords.map(|x| x as f32);
    Pose::from_parts(
        Vector::new(at.x, at.y, at.z),
        Rotation::from_xyzw(turn.x, turn.y, turn.z, turn.w),
    )
}
