//! The quadruped of DeepMind's control suite: an ellipsoid on four legs, free in space.
//!
//! # Coordinates
//! 0–2 the torso's place (m), 3–6 its quaternion (w, x, y, z), then per leg, in the order front
//! left, front right, back right, back left: yaw, pitch, knee, ankle (rad). Rates: the torso's
//! velocity in world axes, its angular velocity in its own, the sixteen joints'.
//!
//! # Motors
//! Twelve, per leg yaw, lift, extend. Each pulls with `1000 (a − L)` at a combination L of the
//! leg's joints, where its activation a follows the command c within a tenth of a second:
//!
//! | motor | L | c |
//! |---|---|---|
//! | yaw | yaw | [−1, 1] |
//! | lift | (pitch − ankle)/2 | [−1, 1.1] |
//! | extend | (pitch + ankle)/4 − knee/2 | [−0.8, 0.8] |
//!
//! A soft coupling holds `pitch + knee + ankle` at 0 in each leg.
//!
//! Parts touch each other without friction, the ground with 1 and, at the toes, 1.5.
//!
//! Source: `quadruped.xml` of dm_control 1.0.14.

use std::sync::OnceLock;

use serde::{Deserialize, Serialize};

use crate::articulated::model::{
    Body, Coupling, Form, Joint, JointKind, Model, Parts, Solid, Touch,
};
use crate::articulated::simulation::Simulation;
use crate::articulated::softness::Softness;
use crate::articulated::vector::{Mat3, Vec3, vec3};

/// Degrees of freedom.
pub const N_DOFS: usize = 22;
/// Numbers in a configuration.
pub const N_COORDINATES: usize = 23;
/// Motors.
pub const N_MOTORS: usize = 12;
/// First of the sixteen leg joints among the coordinates.
pub const FIRST_LEG_COORDINATE: usize = 7;
/// First of the sixteen leg joints among the degrees of freedom.
pub const FIRST_LEG_DOF: usize = 6;
/// Dynamics steps in a control step of 0.02 s.
pub const N_SUBSTEPS: usize = 4;

const STEP_S: f64 = 0.005;
/// Torso centre with straight legs, clear of the ground, metres.
const REST_HEIGHT: f64 = 0.57;
/// Force per unit of difference between activation and length.
const MOTOR_GAIN: f64 = 1000.0;
/// Seconds in which an activation follows its command.
const MOTOR_TIME_S: f64 = 0.1;
/// Least and greatest command of yaw, lift, extend.
const COMMANDS: [[f64; 2]; 3] = [[-1.0, 1.0], [-1.0, 1.1], [-0.8, 0.8]];
/// How much each of yaw, pitch, knee, ankle lengthens each motor.
const MOTOR_ARMS: [[f64; 4]; 3] = [
    [1.0, 0.0, 0.0, 0.0],
    [0.0, 0.5, 0.0, -0.5],
    [0.0, 0.25, -0.5, 0.25],
];
const COUPLING_ARM: f64 = 0.333;

const LEG_DENSITY: f64 = 500.0;
const SEMI_AXES: Vec3 = vec3(0.30, 0.27, 0.20);
const TOE_RADIUS: f64 = 0.08;

const CONTACT: Softness = Softness {
    time_constant: 0.01,
    damping_ratio: 1.0,
    at_touch: 0.9,
    deep: 0.99,
    width: 0.003,
};
const STOP: Softness = Softness {
    time_constant: 0.02,
    damping_ratio: 1.0,
    at_touch: 0.0,
    deep: 0.99,
    width: 0.01,
};
const COUPLING: Softness = Softness {
    time_constant: 0.005,
    damping_ratio: 0.5,
    at_touch: 0.95,
    deep: 0.99,
    width: 0.01,
};

/// Names of the hip, knee, ankle and toe; place of the hip on the torso; where the leg points,
/// degrees about z.
const LEGS: [([&str; 4], [f64; 2], f64); 4] = [
    (
        [
            "hip_front_left",
            "knee_front_left",
            "ankle_front_left",
            "toe_front_left",
        ],
        [0.2, 0.2],
        45.0,
    ),
    (
        [
            "hip_front_right",
            "knee_front_right",
            "ankle_front_right",
            "toe_front_right",
        ],
        [0.2, -0.2],
        -45.0,
    ),
    (
        [
            "hip_back_right",
            "knee_back_right",
            "ankle_back_right",
            "toe_back_right",
        ],
        [-0.2, -0.2],
        -135.0,
    ),
    (
        [
            "hip_back_left",
            "knee_back_left",
            "ankle_back_left",
            "toe_back_left",
        ],
        [-0.2, 0.2],
        135.0,
    ),
];

/// Bodies of the four toes, front left, front right, back right, back left.
pub const TOES: [usize; 4] = [4, 8, 12, 16];

/// The quadruped, built once.
pub fn model() -> &'static Model<N_DOFS> {
    static MODEL: OnceLock<Model<N_DOFS>> = OnceLock::new();
    MODEL.get_or_init(|| {
        let coupling = |leg: usize| {
            let first = FIRST_LEG_DOF + 4 * leg;
            Coupling {
                terms: (1..4).map(|k| (first + k, COUPLING_ARM)).collect(),
                softness: COUPLING,
            }
        };
        Model::new(Parts {
            bodies: bodies(),
            couplings: (0..4).map(coupling).collect(),
            touch: Touch {
                contact: CONTACT,
                stop: STOP,
                own_friction: Some(0.0),
            },
            total_mass: None,
            step_s: STEP_S,
        })
    })
}

fn bodies() -> Vec<Body> {
    let eye = |y: f64| Solid {
        form: Form::Cylinder {
            ends: [vec3(0.1, y, 0.12), vec3(0.31, y, 0.08)],
            radius: 0.05,
        },
        density: 0.0,
        ground_friction: 1.0,
    };
    let mut bodies = vec![Body {
        name: "torso",
        parent: None,
        position: Vec3::Z * REST_HEIGHT,
        rotation: Mat3::IDENTITY,
        joints: vec![Joint::bare(JointKind::Free, Vec3::ZERO)],
        solids: vec![
            Solid {
                form: Form::Ellipsoid {
                    semi_axes: SEMI_AXES,
                },
                density: 1000.0,
                ground_friction: 1.0,
            },
            eye(-0.07),
            eye(0.07),
        ],
    }];
    for (names, [x, y], mount) in LEGS {
        bodies.extend(leg(bodies.len(), names, vec3(x, y, 0.0), mount));
    }
    bodies
}

/// Hip, knee, ankle and toe of a leg whose hip gets the index `first`.
fn leg(first: usize, names: [&'static str; 4], hip: Vec3, mount_deg: f64) -> [Body; 4] {
    let bone = |radius: f64, end: Vec3| Solid {
        form: Form::Capsule {
            ends: [Vec3::ZERO, end],
            radius,
        },
        density: LEG_DENSITY,
        ground_friction: 1.0,
    };
    let (knee, ankle) = (vec3(0.3, 0.0, 0.11), vec3(0.25, 0.0, -0.25));
    let body = |k: usize, parent: usize, position: Vec3, joints: Vec<Joint>, solid: Solid| Body {
        name: names[k],
        parent: Some(parent),
        position,
        rotation: Mat3::IDENTITY,
        joints,
        solids: vec![solid],
    };
    let hip_joints = vec![
        leg_joint(Vec3::Z, [-50.0, 50.0]),
        leg_joint(Vec3::Y, [-20.0, 60.0]),
    ];
    let toe = Solid {
        ground_friction: 1.5,
        ..bone(TOE_RADIUS, Vec3::ZERO)
    };
    [
        Body {
            rotation: Mat3::turn(Vec3::Z, mount_deg.to_radians()),
            ..body(0, 0, hip, hip_joints, bone(0.08, knee))
        },
        body(
            1,
            first,
            knee,
            vec![leg_joint(Vec3::Y, [-60.0, 50.0])],
            bone(0.065, ankle),
        ),
        body(
            2,
            first + 1,
            ankle,
            vec![leg_joint(Vec3::Y, [-45.0, 55.0])],
            bone(0.055, Vec3::Z * -0.25),
        ),
        body(3, first + 2, Vec3::Z * -0.3, Vec::new(), toe),
    ]
}

fn leg_joint(axis: Vec3, range_deg: [f64; 2]) -> Joint {
    Joint {
        range: Some(range_deg.map(f64::to_radians)),
        damping: 30.0,
        armature: 0.01,
        ..Joint::bare(JointKind::Hinge, axis)
    }
}

/// What an agent's action, each component in [−1, 1], commands the motors.
pub fn commands(action: &[f64; N_MOTORS]) -> [f64; N_MOTORS] {
    std::array::from_fn(|motor| {
        let [low, high] = COMMANDS[motor % 3];
        let command = low + f64::midpoint(action[motor], 1.0) * (high - low);
        // The original hands commands over in single precision.
        f64::from(command as f32).clamp(low, high)
    })
}

/// Activations one dynamics step later.
pub fn activations_after_a_step(
    activations: &[f64; N_MOTORS],
    commands: &[f64; N_MOTORS],
) -> [f64; N_MOTORS] {
    std::array::from_fn(|motor| {
        let (now, wanted) = (activations[motor], commands[motor]);
        now + STEP_S * (wanted - now) / MOTOR_TIME_S
    })
}

/// Torques of the motors along the degrees of freedom.
pub fn torques(q: &[f64], activations: &[f64; N_MOTORS]) -> [f64; N_DOFS] {
    let mut torques = [0.0; N_DOFS];
    for (motor, activation) in activations.iter().enumerate() {
        let (leg, arms) = (motor / 3, MOTOR_ARMS[motor % 3]);
        let joints = &q[FIRST_LEG_COORDINATE + 4 * leg..][..4];
        let length: f64 = arms.iter().zip(joints).map(|(arm, q)| arm * q).sum();
        let force = MOTOR_GAIN * (activation - length);
        for (joint, arm) in arms.iter().enumerate() {
            torques[FIRST_LEG_DOF + 4 * leg + joint] += arm * force;
        }
    }
    torques
}

/// What the quadruped feels: it depends on forces, which a state alone does not tell.
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize, Deserialize)]
pub struct Senses {
    /// At the torso's origin, torso axes, m/s²: 9.81 upwards at rest.
    pub accelerometer: [f64; 3],
    /// What each ankle does to its toe, toe axes, newtons.
    pub toe_forces: [[f64; 3]; 4],
    /// The same as torques about the toe's centre, newton metres.
    pub toe_torques: [[f64; 3]; 4],
}

/// The quadruped in motion.
#[derive(Debug, Serialize, Deserialize)]
pub struct Quadruped {
    /// Bodies and joints.
    pub simulation: Simulation<N_DOFS>,
    /// Of the motors.
    pub activations: [f64; N_MOTORS],
    /// What it felt in the last dynamics step.
    pub senses: Senses,
}

impl Quadruped {
    /// At rest in the configuration `q`.
    pub fn new(q: Vec<f64>) -> Self {
        Self {
            simulation: Simulation::new(q),
            activations: [0.0; N_MOTORS],
            senses: Senses::default(),
        }
    }

    /// Moves by one control step under commands that are held.
    pub fn advance(&mut self, commands: &[f64; N_MOTORS]) {
        let mut v_before = Vec::new();
        for _ in 0..N_SUBSTEPS {
            v_before.clone_from(&self.simulation.v);
            let torques = torques(&self.simulation.q, &self.activations);
            self.simulation.step(model(), &torques);
            self.activations = activations_after_a_step(&self.activations, commands);
        }
        self.senses = senses(&mut self.simulation, &v_before);
    }
}

/// What was felt in the last dynamics step, at whose start the poses were read.
fn senses(simulation: &mut Simulation<N_DOFS>, v_before: &[f64]) -> Senses {
    let model = model();
    let accelerations = *simulation.accelerations();
    let mass = toe_mass();
    // Of a ball about its centre.
    let inertia = 0.4 * mass * TOE_RADIUS * TOE_RADIUS;
    let motion = simulation.last_motion();
    let (felt, _) = motion.felt_acceleration(model, v_before, &accelerations, 0);
    let mut senses = Senses {
        accelerometer: motion.rotation(0).transposed_mul(felt).to_array(),
        ..Senses::default()
    };
    for (toe, &body) in TOES.iter().enumerate() {
        let motion = simulation.last_motion();
        let (felt, turning) = motion.felt_acceleration(model, v_before, &accelerations, body);
        let (centre, rotation) = (motion.position(body), *motion.rotation(body));
        let (mut force, mut torque) = (felt * mass, turning * inertia);
        for contact in simulation.forces_on(body) {
            force = force - contact.force;
            torque = torque - (contact.point - centre).cross(contact.force);
        }
        senses.toe_forces[toe] = rotation.transposed_mul(force).to_array();
        senses.toe_torques[toe] = rotation.transposed_mul(torque).to_array();
    }
    senses
}

fn toe_mass() -> f64 {
    LEG_DENSITY * 4.0 / 3.0 * std::f64::consts::PI * TOE_RADIUS.powi(3)
}
