//! What every MetaWorld picture shows: the table, the arm, the task's object, its goal.

use domain::scene::{Arm, Frame, Geometry, Material, Scene, Shape, Transform};

use super::Point;
use crate::robots::sawyer_hand;
use crate::robots::tabletop;

/// The first of an object's own bodies in a scene.
pub const OBJECT_BODY: usize = sawyer_hand::N_BODIES;

/// The green of most goals.
pub const GREEN: Material = Material::marker(0.0, 0.8, 0.0, 0.7);
/// The blue of the others.
pub const BLUE: Material = Material::marker(0.0, 0.0, 0.8, 0.7);

/// The scene of a task.
///
/// * `surroundings` – on body 0
/// * `object` – on the bodies from [`OBJECT_BODY`] on; the goal's body follows them
/// * `goal` – radius (metres) and look of its ball
/// * `camera` – the one that clips use
pub fn scene(
    surroundings: Vec<Shape>,
    object: Vec<Shape>,
    goal: (f32, Material),
    camera: &str,
) -> Scene {
    let last = object.iter().map(|shape| shape.body).max();
    let goal_body = last.map_or(OBJECT_BODY, |body| body + 1);
    let (radius, material) = goal;
    let goal = Shape {
        body: goal_body,
        local: Transform::IDENTITY,
        geometry: Geometry::Sphere { radius },
        material,
    };
    let mut shapes = surroundings;
    shapes.extend(sawyer_hand::shapes());
    shapes.extend(object);
    shapes.push(goal);
    Scene {
        n_bodies: goal_body + 1,
        shapes,
        arm: Some(Arm::Sawyer {
            hand: sawyer_hand::HAND_BODY,
        }),
        cameras: tabletop::cameras(camera),
        background: tabletop::BACKGROUND,
        focus: ([0.0, 0.5, 0.1], 1.1),
    }
}

/// Where the bodies of a [`scene`] are in a pose; `object` places the object's bodies and the
/// goal, given the pose's numbers after the hand's.
pub fn place<const N: usize>(pose: &[f32], object: fn(&[f32]) -> [Transform; N]) -> Frame {
    let (hand, rest) = pose.split_at(sawyer_hand::POSE_SIZE);
    let mut frame = sawyer_hand::place(hand).to_vec();
    frame.extend(object(rest));
    frame
}

/// An unturned frame at `point`.
pub fn at(point: Point) -> Transform {
    let [x, y, z] = point.map(|v| v as f32);
    Transform::at(x, y, z)
}
