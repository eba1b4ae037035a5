//! The walker of DeepMind's control suite: a torso on two legs that moves in the x-z plane.
//!
//! # Coordinates, and their rates in the same order
//! | index | meaning | unit |
//! |---|---|---|
//! | 0 | height of the torso's centre above 1.3 m | m |
//! | 1 | the torso's x | m |
//! | 2 | pitch about +y: positive leans forward | rad |
//! | 3–5 | right hip, knee, ankle about −y: positive swings forward | rad |
//! | 6–8 | the left ones | rad |
//!
//! The legs pass through each other and the torso; only the ground is felt, with friction 0.7.
//! Stops are soft: they begin to act at the end of the range.
//!
//! Source: `walker.xml` of dm_control 1.0.14.

use std::sync::OnceLock;

use crate::articulated::model::{Body, Form, Joint, JointKind, Model, Parts, Solid, Touch};
use crate::articulated::softness::Softness;
use crate::articulated::vector::{Mat3, Vec3, vec3};

/// Degrees of freedom, and coordinates.
pub const N_DOFS: usize = 9;
/// First of the six leg joints.
pub const FIRST_LEG_JOINT: usize = 3;
/// Height of the torso's centre with all coordinates at 0, metres.
pub const STANDING_HEIGHT: f64 = 1.3;
/// Torque of each leg joint at full action, N m.
pub const GEARS: [f64; 6] = [100.0, 50.0, 20.0, 100.0, 50.0, 20.0];
/// Ranges of the leg joints, degrees.
pub const RANGES_DEG: [[f64; 2]; 6] = [
    [-20.0, 100.0],
    [-150.0, 0.0],
    [-45.0, 45.0],
    [-20.0, 100.0],
    [-150.0, 0.0],
    [-45.0, 45.0],
];
/// Dynamics steps in a control step of 0.025 s.
pub const N_SUBSTEPS: usize = 10;

const STEP_S: f64 = 0.0025;
const GROUND_FRICTION: f64 = 0.7;
const CONTACT: Softness = Softness {
    time_constant: 0.02,
    damping_ratio: 1.0,
    at_touch: 0.9,
    deep: 0.95,
    width: 0.001,
};
const STOP: Softness = Softness {
    time_constant: 0.02,
    damping_ratio: 1.0,
    at_touch: 0.0,
    deep: 0.99,
    width: 0.01,
};

/// The walker, built once.
pub fn model() -> &'static Model<N_DOFS> {
    static MODEL: OnceLock<Model<N_DOFS>> = OnceLock::new();
    MODEL.get_or_init(|| {
        Model::new(Parts {
            bodies: bodies(),
            couplings: Vec::new(),
            touch: Touch {
                contact: CONTACT,
                stop: STOP,
                own_friction: None,
            },
            total_mass: None,
            step_s: STEP_S,
        })
    })
}

fn bodies() -> Vec<Body> {
    let torso = Body {
        name: "torso",
        parent: None,
        position: Vec3::Z * STANDING_HEIGHT,
        rotation: Mat3::IDENTITY,
        joints: vec![
            Joint::bare(JointKind::Slide, Vec3::Z),
            Joint::bare(JointKind::Slide, Vec3::X),
            Joint::bare(JointKind::Hinge, Vec3::Y),
        ],
        solids: vec![solid(Form::capsule(Vec3::ZERO, 0.0, 0.07, 0.30))],
    };
    let mut bodies = vec![torso];
    for (names, y) in [
        (["right_thigh", "right_leg", "right_foot"], -0.05),
        (["left_thigh", "left_leg", "left_foot"], 0.05),
    ] {
        let thigh = bodies.len();
        let along_x = std::f64::consts::FRAC_PI_2;
        bodies.push(Body {
            name: names[0],
            parent: Some(0),
            position: vec3(0.0, y, -0.3),
            rotation: Mat3::IDENTITY,
            joints: vec![leg_joint(0, Vec3::ZERO)],
            solids: vec![solid(Form::capsule(Vec3::Z * -0.225, 0.0, 0.05, 0.225))],
        });
        bodies.push(Body {
            name: names[1],
            parent: Some(thigh),
            position: Vec3::Z * -0.7,
            rotation: Mat3::IDENTITY,
            joints: vec![leg_joint(1, Vec3::Z * 0.25)],
            solids: vec![solid(Form::capsule(Vec3::ZERO, 0.0, 0.04, 0.25))],
        });
        bodies.push(Body {
            name: names[2],
            parent: Some(thigh + 1),
            position: vec3(0.06, 0.0, -0.25),
            rotation: Mat3::IDENTITY,
            joints: vec![leg_joint(2, Vec3::X * -0.06)],
            solids: vec![solid(Form::capsule(Vec3::ZERO, along_x, 0.05, 0.10))],
        });
    }
    bodies
}

fn leg_joint(index: usize, anchor: Vec3) -> Joint {
    Joint {
        anchor,
        range: Some(RANGES_DEG[index].map(f64::to_radians)),
        damping: 0.1,
        armature: 0.01,
        ..Joint::bare(JointKind::Hinge, -Vec3::Y)
    }
}

fn solid(form: Form) -> Solid {
    Solid {
        form,
        density: 1000.0,
        ground_friction: GROUND_FRICTION,
    }
}
