//! How the locomotion robots look: sand-coloured limbs over a chequered floor.

use domain::scene::{Camera, Frame, Geometry, Material, Pattern, Scene, Shape, Transform};

use crate::articulated::model::{Form, Model, Solid};
use crate::articulated::motion::Motion;
use crate::articulated::vector::{Mat3, Vec3};

/// Body of the floor; the robot's own follow.
const FLOOR: usize = 1;
const FIRST_BODY: usize = 2;

/// Half the side of the floor, metres.
const FLOOR_HALF: f32 = 40.0;
/// After this many metres the floor's pattern begins anew.
const FLOOR_PERIOD: f32 = 2.0;

const LIMB: Material = Material::plain(0.70, 0.50, 0.30);
/// What weighs nothing: eyes.
const EYE: Material = Material::plain(0.15, 0.13, 0.12);
const GROUND: Material = Material {
    color: [0.62, 0.68, 0.74, 1.0],
    pattern: Pattern::Checker,
    is_marker: false,
};
const SKY: [f32; 3] = [0.80, 0.87, 0.93];

/// Which way the floor slides.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum View {
    /// A planar robot: along x alone.
    ToTheSide,
    /// Along x and y.
    FromAbove,
}

/// Everything about a robot's picture that does not move.
///
/// * `middle` – height of its centre of mass, metres
pub fn scene<const N: usize>(model: &Model<N>, middle: f32, cameras: Vec<Camera>) -> Scene {
    let floor = Shape {
        body: FLOOR,
        local: Transform::at(0.0, 0.0, -0.1),
        geometry: Geometry::Cuboid {
            half: [FLOOR_HALF, FLOOR_HALF, 0.1],
        },
        material: GROUND,
    };
    let bodies = model.bodies().iter().enumerate();
    let limbs = bodies.flat_map(|(index, body)| {
        let limb = move |solid: &Solid| limb(FIRST_BODY + index, solid);
        body.solids.iter().map(limb)
    });
    Scene {
        n_bodies: FIRST_BODY + model.bodies().len(),
        shapes: std::iter::once(floor).chain(limbs).collect(),
        arm: None,
        cameras,
        background: SKY,
        focus: ([0.0, 0.0, middle], 1.5),
    }
}

/// A camera over the robot; `forward` may be of any length.
pub fn camera(name: &str, eye: [f32; 3], forward: [f32; 3], fovy_deg: f32) -> Camera {
    let length = forward.iter().map(|x| x * x).sum::<f32>().sqrt();
    let forward = forward.map(|x| x / length);
    // The part of z at right angles to `forward`.
    let level = (1.0 - forward[2] * forward[2]).sqrt();
    Camera {
        name: name.into(),
        eye,
        forward,
        up: [
            -forward[0] * forward[2] / level,
            -forward[1] * forward[2] / level,
            level,
        ],
        fovy_deg,
    }
}

/// The bodies of [`scene`] in a configuration, against the point of the ground below the centre
/// of mass.
///
/// # Panics
/// When the pose is not one of this robot.
pub fn place<const N: usize>(model: &Model<N>, pose: &[f32], view: View) -> Frame {
    assert_eq!(
        pose.len(),
        model.n_coordinates(),
        "a pose is the robot's configuration"
    );
    let q: Vec<f64> = pose.iter().map(|x| f64::from(*x)).collect();
    let mut motion = Motion::default();
    motion.place(model, &q);
    let centre = motion.whole_centre_of_mass(model);
    let below = match view {
        View::ToTheSide => Vec3::X * centre.x,
        View::FromAbove => centre - Vec3::Z * centre.z,
    };
    let slid = below
        .to_array()
        .map(|x| -(x.rem_euclid(f64::from(FLOOR_PERIOD))) as f32);
    let mut frame = vec![Transform::IDENTITY, Transform::at(slid[0], slid[1], 0.0)];
    frame.extend(
        (0..model.bodies().len())
            .map(|body| transform(motion.position(body) - below, motion.rotation(body))),
    );
    frame
}

fn limb(body: usize, solid: &Solid) -> Shape {
    let (local, geometry) = match solid.form {
        Form::Capsule { ends, radius } => {
            let (local, half_length) = along(ends);
            let radius = radius as f32;
            let capsule = Geometry::Capsule {
                radius,
                half_length,
            };
            let ball = Geometry::Sphere { radius };
            (local, if half_length > 0.0 { capsule } else { ball })
        }
        Form::Cylinder { ends, radius } => {
            let (local, half_length) = along(ends);
            let geometry = Geometry::Cylinder {
                radius: radius as f32,
                half_length,
            };
            (local, geometry)
        }
        Form::Ellipsoid { semi_axes } => {
            let semi_axes = semi_axes.to_array().map(|x| x as f32);
            (Transform::IDENTITY, Geometry::Ellipsoid { semi_axes })
        }
    };
    Shape {
        body,
        local,
        geometry,
        material: if solid.density > 0.0 { LIMB } else { EYE },
    }
}

/// A frame in the middle of a way, z along it, and half its length.
fn along(ends: [Vec3; 2]) -> (Transform, f32) {
    let way = ends[1] - ends[0];
    let (length, middle) = (way.length(), (ends[0] + ends[1]) * 0.5);
    let across = Vec3::Z.cross(way);
    let turn = if across.length() > 1e-9 * length {
        let angle = across.length().atan2(way.z);
        Mat3::turn(across * (1.0 / across.length()), angle)
    } else {
        Mat3::IDENTITY
    };
    (transform(middle, &turn), (length / 2.0) as f32)
}

fn transform(position: Vec3, rotation: &Mat3) -> Transform {
    Transform {
        position: position.to_array().map(|x| x as f32),
        rotation: rotation.quaternion().map(|x| x as f32),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::robots::{quadruped, walker};

    #[test]
    fn a_robot_far_away_is_drawn_in_the_middle_on_a_floor_that_slid() {
        let model = walker::model();
        let mut near = [0.0_f32; 9];
        near[4] = -0.5;
        let mut far = near;
        far[1] = 101.25;
        let (near, far) = (
            place(model, &near, View::ToTheSide),
            place(model, &far, View::ToTheSide),
        );
        for (a, b) in near.iter().zip(&far).skip(FIRST_BODY) {
            for (a, b) in a.position.iter().zip(b.position) {
                assert!((a - b).abs() < 1e-4);
            }
        }
        let slid = (near[FLOOR].position[0] - far[FLOOR].position[0]).rem_euclid(FLOOR_PERIOD);
        assert!((slid - 1.25).abs() < 1e-4, "{slid}");
    }

    #[test]
    fn limbs_reach_from_joint_to_joint() {
        let model = quadruped::model();
        let thigh = &model.bodies()[model.body("hip_back_left")];
        let shape = limb(0, &thigh.solids[0]);
        let Geometry::Capsule { half_length, .. } = shape.geometry else {
            panic!("a thigh is a capsule")
        };
        let end = shape
            .local
            .then(Transform::at(0.0, 0.0, half_length))
            .position;
        for (a, b) in end.iter().zip([0.3, 0.0, 0.11]) {
            assert!((a - b).abs() < 1e-6, "{end:?}");
        }
    }

    #[test]
    fn cameras_hold_their_heads_up() {
        let camera = camera("test", [0.0; 3], [0.8, 0.3, -0.6], 45.0);
        let dot = |a: [f32; 3], b: [f32; 3]| a.iter().zip(b).map(|(a, b)| a * b).sum::<f32>();
        assert!(dot(camera.forward, camera.up).abs() < 1e-6);
        assert!((dot(camera.up, camera.up) - 1.0).abs() < 1e-6 && camera.up[2] > 0.0);
    }
}
