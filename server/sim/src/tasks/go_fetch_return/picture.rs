//! How go-fetch-return looks: a blue robot with eyes and jaws, an orange ball, a green ring.
//!
//! The colours are Okabe and Ito's, which colour-blind people tell apart. Jaws that hold the
//! ball turn yellow and lift it, so that "held" is seen without guessing at distances.
//!
//! # Pose
//! | index | content | unit |
//! |---|---|---|
//! | 0–1 | the robot's centre | m |
//! | 2 | its heading | rad |
//! | 3 | openness of the jaws, in [0, 1] | – |
//! | 4 | 1 while the object is held, else 0 | – |
//! | 5–6 | the object's centre | m |
//! | 7–8 | the goal's centre | m |

use domain::scene::{Camera, Frame, Geometry, Material, Pattern, Scene, Shape, Transform};

use super::{FLOOR_HALF, GOAL_RADIUS, OBJECT_RADIUS, POSE_SIZE, State, WALL_HALF_THICKNESS};
use crate::robots::planar_robot::{self, N_BODIES as ROBOT_BODIES};

/// First body of the robot; its others follow.
const ROBOT: usize = 1;
const OBJECT: usize = ROBOT + ROBOT_BODIES;
const GOAL: usize = OBJECT + 1;

const FLOOR: Material = Material {
    color: [0.93, 0.92, 0.89, 1.0],
    pattern: Pattern::Grid,
    is_marker: false,
};
const WALL: Material = Material::plain(0.66, 0.70, 0.74);
const ORANGE: Material = Material::plain(0.90, 0.40, 0.0);
const GREEN: [f32; 3] = [0.0, 0.62, 0.45];

/// What [`place`] needs, `[POSE_SIZE]`.
pub(super) fn pose(state: &State) -> Vec<f32> {
    let robot = state.robot.state(&state.world);
    let object = state.world.physics.bodies[state.object].translation();
    vec![
        robot.position[0],
        robot.position[1],
        robot.heading[1].atan2(robot.heading[0]),
        state.robot.openness,
        f32::from(state.is_held),
        object.x,
        object.y,
        state.goal[0],
        state.goal[1],
    ]
}

/// Where each body is in a recorded pose.
///
/// # Panics
/// When the pose is not one of this task.
pub(super) fn place(pose: &[f32]) -> Frame {
    let &[
        x,
        y,
        heading,
        openness,
        held,
        object_x,
        object_y,
        goal_x,
        goal_y,
    ] = pose
    else {
        panic!(
            "a pose of this task has {POSE_SIZE} numbers, not {}",
            pose.len()
        );
    };
    let is_held = held > 0.5;
    let lift = if is_held { planar_robot::LIFT } else { 0.0 };
    let robot = Transform::at(x, y, 0.0).turned([0.0, 0.0, 1.0], heading);
    let mut frame = vec![Transform::IDENTITY];
    frame.extend(planar_robot::place(robot, openness, is_held));
    frame.push(Transform::at(object_x, object_y, OBJECT_RADIUS + lift));
    frame.push(Transform::at(goal_x, goal_y, 0.0));
    frame
}

/// Everything that does not move.
pub(super) fn scene() -> Scene {
    let mut shapes = arena();
    shapes.extend(planar_robot::shapes(ROBOT));
    shapes.push(shape(
        OBJECT,
        Transform::IDENTITY,
        Geometry::Sphere {
            radius: OBJECT_RADIUS,
        },
        ORANGE,
    ));
    shapes.extend(goal());
    Scene {
        n_bodies: GOAL + 1,
        shapes,
        arm: None,
        cameras: vec![front(), above()],
        background: [0.80, 0.87, 0.93],
        focus: ([0.0, 0.0, 0.0], 1.8),
    }
}

fn arena() -> Vec<Shape> {
    const HEIGHT: f32 = 0.035;
    let (middle, thin) = (FLOOR_HALF + WALL_HALF_THICKNESS, WALL_HALF_THICKNESS);
    let long = FLOOR_HALF + 2.0 * thin;
    let floor = shape(
        0,
        Transform::at(0.0, 0.0, -0.02),
        Geometry::Cuboid {
            half: [long, long, 0.02],
        },
        FLOOR,
    );
    let walls = [
        (middle, 0.0, [thin, long, HEIGHT]),
        (-middle, 0.0, [thin, long, HEIGHT]),
        (0.0, middle, [FLOOR_HALF, thin, HEIGHT]),
        (0.0, -middle, [FLOOR_HALF, thin, HEIGHT]),
    ]
    .map(|(x, y, half)| {
        shape(
            0,
            Transform::at(x, y, HEIGHT),
            Geometry::Cuboid { half },
            WALL,
        )
    });
    std::iter::once(floor).chain(walls).collect()
}

fn goal() -> [Shape; 2] {
    let [r, g, b] = GREEN;
    let disc = |z, inner, alpha| {
        shape(
            GOAL,
            Transform::at(0.0, 0.0, z),
            Geometry::Ring {
                inner,
                outer: GOAL_RADIUS,
            },
            Material::marker(r, g, b, alpha),
        )
    };
    [disc(0.004, 0.0, 0.3), disc(0.006, 0.105, 1.0)]
}

/// The camera of the clips: raised, three quarters, the whole floor in a 4:3 picture.
fn front() -> Camera {
    looking("front", [0.0, -3.8, 4.2], [0.0, -0.15, 0.0], 24.5)
}

/// Straight down, for maps of trajectories; x to the right, y up.
fn above() -> Camera {
    Camera {
        name: "above".into(),
        eye: [0.0, 0.0, 3.6],
        forward: [0.0, 0.0, -1.0],
        up: [0.0, 1.0, 0.0],
        fovy_deg: 42.0,
    }
}

/// A camera in the plane x = 0 that looks at a point of that plane.
fn looking(name: &str, eye: [f32; 3], at: [f32; 3], fovy_deg: f32) -> Camera {
    let (y, z) = (at[1] - eye[1], at[2] - eye[2]);
    let length = y.hypot(z);
    Camera {
        name: name.into(),
        eye,
        forward: [0.0, y / length, z / length],
        up: [0.0, -z / length, y / length],
        fovy_deg,
    }
}

fn shape(body: usize, local: Transform, geometry: Geometry, material: Material) -> Shape {
    Shape {
        body,
        local,
        geometry,
        material,
    }
}
