//! The half-cheetah of DeepMind's control suite: a back on two legs that moves in the x-z plane.
//!
//! # Coordinates, and their rates in the same order
//! | index | meaning | unit |
//! |---|---|---|
//! | 0 | x of the torso's origin | m |
//! | 1 | its height above 0.7 m | m |
//! | 2 | pitch about +y: positive noses down | rad |
//! | 3–5 | back thigh, shin, foot about +y | rad |
//! | 6–8 | the front ones | rad |
//!
//! Springs hold the legs at 0. Parts touch each other with friction 0.4 and the ground with 1,
//! which wins as the larger of the two. Each motor has a rotor of 0.1 kg m², more than the feet.
//!
//! Source: `cheetah.xml` of dm_control 1.0.14.

use std::sync::OnceLock;

use crate::articulated::model::{Body, Form, Joint, JointKind, Model, Parts, Solid, Touch};
use crate::articulated::softness::Softness;
use crate::articulated::vector::{Mat3, Vec3, vec3};

/// Degrees of freedom, and coordinates.
pub const N_DOFS: usize = 9;
/// First of the six leg joints.
pub const FIRST_LEG_JOINT: usize = 3;
/// Height of the torso's origin with all coordinates at 0, metres.
pub const STANDING_HEIGHT: f64 = 0.7;
/// Torque of each leg joint at full action, N m.
pub const GEARS: [f64; 6] = [120.0, 90.0, 60.0, 90.0, 60.0, 30.0];
/// Ranges of the leg joints, degrees.
pub const RANGES_DEG: [[f64; 2]; 6] = [
    [-30.0, 60.0],
    [-50.0, 50.0],
    [-230.0, 50.0],
    [-57.0, 0.40],
    [-70.0, 50.0],
    [-28.0, 28.0],
];

const STEP_S: f64 = 0.01;
const TOTAL_MASS: f64 = 14.0;
const RADIUS: f64 = 0.046;
const SOFTNESS: Softness = Softness {
    time_constant: 0.02,
    damping_ratio: 1.0,
    at_touch: 0.9,
    deep: 0.95,
    width: 0.001,
};

/// Name, parent, origin in the parent, centre, tilt (degrees) and half length of the capsule,
/// stiffness, damping.
type Limb = (&'static str, usize, [f64; 3], [f64; 3], f64, f64, f64, f64);

const LIMBS: [Limb; 6] = [
    (
        "bthigh",
        0,
        [-0.5, 0.0, 0.0],
        [0.1, 0.0, -0.13],
        -218.0,
        0.145,
        240.0,
        6.0,
    ),
    (
        "bshin",
        1,
        [0.16, 0.0, -0.25],
        [-0.14, 0.0, -0.07],
        -116.0,
        0.15,
        180.0,
        4.5,
    ),
    (
        "bfoot",
        2,
        [-0.28, 0.0, -0.14],
        [0.03, 0.0, -0.097],
        -15.0,
        0.094,
        120.0,
        3.0,
    ),
    (
        "fthigh",
        0,
        [0.5, 0.0, 0.0],
        [-0.07, 0.0, -0.12],
        30.0,
        0.133,
        180.0,
        4.5,
    ),
    (
        "fshin",
        4,
        [-0.14, 0.0, -0.24],
        [0.065, 0.0, -0.09],
        -34.0,
        0.106,
        120.0,
        3.0,
    ),
    (
        "ffoot",
        5,
        [0.13, 0.0, -0.18],
        [0.045, 0.0, -0.07],
        -34.0,
        0.07,
        60.0,
        1.5,
    ),
];

/// The cheetah, built once.
pub fn model() -> &'static Model<N_DOFS> {
    static MODEL: OnceLock<Model<N_DOFS>> = OnceLock::new();
    MODEL.get_or_init(|| {
        Model::new(Parts {
            bodies: bodies(),
            couplings: Vec::new(),
            touch: Touch {
                contact: SOFTNESS,
                stop: SOFTNESS,
                own_friction: Some(0.4),
            },
            total_mass: Some(TOTAL_MASS),
            step_s: STEP_S,
        })
    })
}

fn bodies() -> Vec<Body> {
    let along_x = std::f64::consts::FRAC_PI_2;
    let head_tilt = 50f64.to_radians();
    let torso = Body {
        name: "torso",
        parent: None,
        position: Vec3::Z * STANDING_HEIGHT,
        rotation: Mat3::IDENTITY,
        joints: vec![
            Joint::bare(JointKind::Slide, Vec3::X),
            Joint::bare(JointKind::Slide, Vec3::Z),
            Joint::bare(JointKind::Hinge, Vec3::Y),
        ],
        solids: vec![
            solid(Form::capsule(Vec3::ZERO, along_x, RADIUS, 0.5)),
            solid(Form::capsule(vec3(0.6, 0.0, 0.1), head_tilt, RADIUS, 0.15)),
        ],
    };
    let limb = |(limb, range): (Limb, [f64; 2])| {
        let (name, parent, origin, centre, tilt, half_length, stiffness, damping) = limb;
        let form = Form::capsule(centre.into(), tilt.to_radians(), RADIUS, half_length);
        Body {
            name,
            parent: Some(parent),
            position: origin.into(),
            rotation: Mat3::IDENTITY,
            joints: vec![Joint {
                range: Some(range.map(f64::to_radians)),
                damping,
                armature: 0.1,
                stiffness,
                ..Joint::bare(JointKind::Hinge, Vec3::Y)
            }],
            solids: vec![solid(form)],
        }
    };
    let limbs = LIMBS.into_iter().zip(RANGES_DEG).map(limb);
    std::iter::once(torso).chain(limbs).collect()
}

fn solid(form: Form) -> Solid {
    Solid {
        form,
        density: 1000.0,
        ground_friction: 1.0,
    }
}
