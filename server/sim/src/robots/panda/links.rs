//! The Panda's links as numbers: where they are, what they weigh, how their joints move.
//!
//! Metres, kilograms, radians, newtons. Double precision; the physics is built from this table,
//! and inverse kinematics, observations and pictures read it directly.
//! Source: DMCONTROL_ROBODESK.md 5.1.

use rapier3d::na::{Isometry3, Translation3, UnitQuaternion, Vector3};

use super::{N_JOINTS, Point};

/// A frame in the world.
pub type Pose = Isometry3<f64>;

/// How a link moves against its parent, by its joint's value `q`.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Motion {
    /// Turns about its own z axis, radians.
    Hinge,
    /// Moves along its own +y axis, metres.
    SlideLeft,
    /// Moves along its own −y axis, metres.
    SlideRight,
}

/// What drives a joint: a position servo, `τ = clamp(gain · (target − q), ±strongest) − damping · q̇`.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Drive {
    /// N m/rad, or N/m.
    pub gain: f64,
    /// N m s/rad, or N s/m.
    pub damping: f64,
    /// N m, or N.
    pub strongest: f64,
    /// Inertia of the rotor that the joint turns along; it has no weight.
    pub armature: f64,
    /// What targets are clamped to.
    pub command: [f64; 2],
}

/// A moving link.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Link {
    /// Index of its parent in [`frames`]: 0 is the base.
    pub parent: usize,
    /// Origin in the parent's frame.
    pub at: Point,
    /// Turned there about the parent's x, then about the resulting z.
    pub turn_xz: [f64; 2],
    /// How its joint moves it.
    pub motion: Motion,
    /// Where its joint stops.
    pub range: [f64; 2],
    /// Its servo.
    pub drive: Drive,
    /// Its mass.
    pub mass: f64,
    /// Centre of mass in its own frame.
    pub centre: Point,
    /// xx, yy, zz, xy, xz, yz about its centre of mass, along its own axes, kg m².
    pub inertia: [f64; 6],
}

const STRONG: Drive = Drive {
    gain: 870.0,
    damping: 100.0,
    strongest: 87.0,
    armature: 0.0,
    command: [-2.9671, 2.9671],
};
const WRIST: Drive = Drive {
    gain: 120.0,
    damping: 10.0,
    strongest: 12.0,
    ..STRONG
};
const FINGER: Drive = Drive {
    gain: 500.0,
    damping: 100.0,
    strongest: 70.0,
    armature: 5.0,
    command: [0.0, 0.04],
};
const HALF_PI: f64 = std::f64::consts::FRAC_PI_2;

/// The seven links of the arm, the left and the right finger. The last link includes the hand.
#[expect(
    clippy::approx_constant,
    reason = "the original rounds its angles, and so do we"
)]
pub const LINKS: [Link; N_JOINTS] = [
    Link {
        parent: 0,
        at: [0.0, 0.0, 0.333],
        turn_xz: [0.0, 0.0],
        motion: Motion::Hinge,
        range: [-2.8973, 2.8973],
        drive: STRONG,
        mass: 2.70630,
        centre: [0.00001, -0.03127, -0.06937],
        inertia: [0.016_029, 0.013_883, 0.006_477, 0.0, 0.000_001, 0.003_129],
    },
    Link {
        parent: 1,
        at: [0.0, 0.0, 0.0],
        turn_xz: [-HALF_PI, 0.0],
        motion: Motion::Hinge,
        range: [-1.7628, 1.7628],
        drive: Drive {
            command: [-1.8326, 1.8326],
            ..STRONG
        },
        mass: 2.73046,
        centre: [-0.00001, -0.07032, 0.03118],
        inertia: [
            0.016_372, 0.006_539, 0.014_207, -0.000_002, -0.000_001, -0.003_177,
        ],
    },
    Link {
        parent: 2,
        at: [0.0, -0.316, 0.0],
        turn_xz: [HALF_PI, 0.0],
        motion: Motion::Hinge,
        range: [-2.8973, 2.8973],
        drive: STRONG,
        mass: 2.04104,
        centre: [0.04435, 0.02493, -0.03813],
        inertia: [
            0.006_493, 0.007_833, 0.006_564, -0.001_264, -0.002_160, -0.001_167,
        ],
    },
    Link {
        parent: 3,
        at: [0.0825, 0.0, 0.0],
        turn_xz: [HALF_PI, 0.0],
        motion: Motion::Hinge,
        range: [-3.0718, -0.4],
        drive: Drive {
            command: [-3.1416, 0.0],
            ..STRONG
        },
        mass: 2.08129,
        centre: [-0.03855, 0.03953, 0.02472],
        inertia: [
            0.006_770, 0.006_701, 0.008_140, 0.002_245, -0.001_289, 0.001_214,
        ],
    },
    Link {
        parent: 4,
        at: [-0.0825, 0.384, 0.0],
        turn_xz: [-HALF_PI, 0.0],
        motion: Motion::Hinge,
        range: [-2.8973, 2.8973],
        drive: WRIST,
        mass: 3.00049,
        centre: [-0.00006, 0.03841, -0.10997],
        inertia: [
            0.026_186, 0.023_806, 0.006_784, -0.000_008, -0.000_035, -0.005_148,
        ],
    },
    Link {
        parent: 5,
        at: [0.0, 0.0, 0.0],
        turn_xz: [1.57, 1.57],
        motion: Motion::Hinge,
        range: [-1.6573, 2.1127],
        drive: Drive {
            command: [-3.7525, 2.1817],
            ..WRIST
        },
        mass: 1.32350,
        centre: [0.05100, 0.00693, 0.00617],
        inertia: [
            0.002_138, 0.003_266, 0.003_979, -0.000_150, 0.000_271, 0.000_027,
        ],
    },
    Link {
        parent: 6,
        at: [0.088, 0.0, 0.0],
        turn_xz: [1.57, 0.7854],
        motion: Motion::Hinge,
        range: [-2.8973, 2.8973],
        drive: WRIST,
        mass: 1.01909,
        centre: [0.00168, 0.00168, 0.12076],
        inertia: [
            0.002_313, 0.002_314, 0.002_858, -0.001_188, 0.000_048, 0.000_048,
        ],
    },
    Link {
        parent: 7,
        at: [0.0, 0.0, 0.1654],
        turn_xz: [0.0, -HALF_PI / 2.0],
        motion: Motion::SlideLeft,
        range: [0.0, 0.04],
        drive: FINGER,
        mass: 0.09271,
        centre: [-0.00002, 0.01187, 0.04341],
        inertia: [0.000_061, 0.000_065, 0.000_011, 0.0, 0.0, 0.000_005],
    },
    Link {
        parent: 7,
        at: [0.0, 0.0, 0.1654],
        turn_xz: [0.0, -HALF_PI / 2.0],
        motion: Motion::SlideRight,
        range: [0.0, 0.04],
        drive: FINGER,
        mass: 0.09271,
        centre: [0.00002, -0.01187, 0.04341],
        inertia: [0.000_061, 0.000_065, 0.000_011, 0.0, 0.0, -0.000_005],
    },
];

/// The end effector, between the fingers and 5 cm short of their tips, in the last link's frame.
const END_EFFECTOR: Point = [0.0, 0.0, 0.210];
/// Links from the base to the end effector.
const N_HINGES: usize = 7;
/// Pull of the earth, m/s².
pub const GRAVITY: f64 = 9.81;

/// The base's frame, on its pedestal in front of the desk (turned by 1.57, not by π/2).
pub fn base() -> Pose {
    Pose::from_parts(
        Translation3::new(0.0, 0.1, 0.55),
        UnitQuaternion::from_axis_angle(&Vector3::z_axis(), 1.57),
    )
}

impl Link {
    /// Its frame in its parent's while its joint is at zero.
    pub fn mount(&self) -> Pose {
        let [x, z] = self.turn_xz;
        let turn = UnitQuaternion::from_axis_angle(&Vector3::x_axis(), x)
            * UnitQuaternion::from_axis_angle(&Vector3::z_axis(), z);
        Pose::from_parts(Translation3::from(Vector3::from(self.at)), turn)
    }

    /// Its frame against its own mount when its joint is at `q`.
    fn moved(&self, q: f64) -> Pose {
        match self.motion {
            Motion::Hinge => Pose::rotation(Vector3::new(0.0, 0.0, q)),
            Motion::SlideLeft => Pose::translation(0.0, q, 0.0),
            Motion::SlideRight => Pose::translation(0.0, -q, 0.0),
        }
    }

    /// Direction of its joint in the world: the axis of a turn, or the way of a slide.
    fn axis(&self, frame: &Pose) -> Vector3<f64> {
        frame.rotation
            * match self.motion {
                Motion::Hinge => Vector3::z(),
                Motion::SlideLeft => Vector3::y(),
                Motion::SlideRight => -Vector3::y(),
            }
    }
}

/// The base and the nine links in the world, for joints `q`.
pub fn frames(q: &[f64; N_JOINTS]) -> [Pose; N_JOINTS + 1] {
    let mut frames = [base(); N_JOINTS + 1];
    for (i, link) in LINKS.iter().enumerate() {
        frames[i + 1] = frames[link.parent] * link.mount() * link.moved(q[i]);
    }
    frames
}

/// The end effector in the world, metres.
pub fn end_effector(frames: &[Pose; N_JOINTS + 1]) -> Point {
    let point = frames[N_HINGES] * rapier3d::na::Point3::from(END_EFFECTOR);
    [point.x, point.y, point.z]
}

/// How the end effector moves with each hinge: columns of its Jacobian, `[7]` of metres per radian.
pub fn jacobian(frames: &[Pose; N_JOINTS + 1]) -> [Vector3<f64>; N_HINGES] {
    let tip = Vector3::from(end_effector(frames));
    std::array::from_fn(|i| {
        let frame = &frames[i + 1];
        LINKS[i]
            .axis(frame)
            .cross(&(tip - frame.translation.vector))
    })
}

/// What each joint has to hold against the weight of the links behind it at rest, N m or N.
pub fn gravity_load(frames: &[Pose; N_JOINTS + 1]) -> [f64; N_JOINTS] {
    let mut load = [0.0; N_JOINTS];
    for (i, link) in LINKS.iter().enumerate() {
        let centre = frames[i + 1] * rapier3d::na::Point3::from(link.centre);
        let mut carrier = i + 1;
        while carrier > 0 {
            let (joint, frame) = (&LINKS[carrier - 1], &frames[carrier]);
            let axis = joint.axis(frame);
            let rise = match joint.motion {
                Motion::Hinge => axis.cross(&(centre.coords - frame.translation.vector)).z,
                Motion::SlideLeft | Motion::SlideRight => axis.z,
            };
            load[carrier - 1] += GRAVITY * link.mass * rise;
            carrier = joint.parent;
        }
    }
    load
}
