//! Draws a Sawyer arm up to the hand it holds: finds joint angles that look right.
//!
//! The simulated hand floats freely (see `sim`'s hand robot); its arm is for the eye only. A real
//! Sawyer in these tasks rests against the limit of its joint 1, which leaves six joints for the
//! hand's six coordinates. Solutions are found step by step from the last frame's, so the arm
//! moves smoothly through a clip.
//!
//! Source: the joint table, limits and typical configurations are METAWORLD.md 1.8.

mod links;
mod solve;

use domain::scene::{Frame, Transform};

pub(crate) use links::{LINKS, Link};

/// Angles of the joints 0 to 6, radians.
pub type Joints = [f32; 7];

/// Where joint 1 rests, radians: just inside its limit of −0.5.
pub const JOINT_1_REST: f32 = -0.499;

const S: f32 = std::f32::consts::FRAC_1_SQRT_2;

/// Smallest and largest angle of each joint, radians.
const LIMITS: [(f32, f32); 7] = [
    (-3.0503, 3.0503),
    (-3.8, JOINT_1_REST),
    (-3.0426, 3.0426),
    (-3.0439, 3.0439),
    (-2.9761, 2.9761),
    (-2.9761, 2.9761),
    (-4.7124, 4.7124),
];

/// Each joint's frame inside the one before, at angle 0; it then turns about its own z.
const JOINT_FRAMES: [Transform; 7] = [
    frame([0.0, 0.0, 0.08], [1.0, 0.0, 0.0, 0.0]),
    frame([0.081, 0.05, 0.237], [0.5, -0.5, 0.5, 0.5]),
    frame([0.0, -0.14, 0.1425], [S, S, 0.0, 0.0]),
    frame([0.0, -0.042, 0.26], [S, -S, 0.0, 0.0]),
    frame([0.0, -0.125, -0.1265], [S, S, 0.0, 0.0]),
    frame([0.0, 0.031, 0.275], [S, -S, 0.0, 0.0]),
    frame(
        [0.0, -0.11, 0.1053],
        [0.061_624_8, 0.061_63, -0.704_416_1, 0.704_416_1],
    ),
];

/// The flange on joint 6.
const RIGHT_HAND: Transform = frame([0.0, 0.0, 0.0245], [S, 0.0, 0.0, S]);
/// The hand on the flange.
const HAND: Transform = frame([0.0, 0.0, 0.12], [-S, 0.0, S, 0.0]);
/// How every task commands the hand: turned by 90° about y, fingers down.
const HAND_ROTATION: [f32; 4] = [S, 0.0, S, 0.0];

const fn frame(position: [f32; 3], rotation: [f32; 4]) -> Transform {
    Transform { position, rotation }
}

/// The frames of a posed arm, in the world.
#[derive(Debug, Clone, PartialEq)]
pub struct Posture {
    /// `l0` to `l6`: the frames of the joints, turned.
    pub links: [Transform; 7],
    /// The flange that carries the gripper.
    pub right_hand: Transform,
    /// The hand frame of the tasks.
    pub hand: Transform,
}

/// Forward kinematics: where the links are.
pub fn posture(joints: &Joints) -> Posture {
    let mut links = [Transform::IDENTITY; 7];
    let mut parent = Transform::IDENTITY;
    for (k, angle) in joints.iter().enumerate() {
        parent = parent.then(JOINT_FRAMES[k]).turned([0.0, 0.0, 1.0], *angle);
        links[k] = parent;
    }
    let right_hand = parent.then(RIGHT_HAND);
    Posture {
        links,
        right_hand,
        hand: right_hand.then(HAND),
    }
}

/// Angles that bring the hand's origin to `position`, fingers down.
///
/// * `position` – metres, in the world
/// * `before` – the angles of the frame before; without them the nearest typical configuration
///
/// Joint 1 leaves its rest only where the other six cannot reach. Out of reach, the arm stretches
/// towards the hand as far as it can.
pub fn reach(position: [f32; 3], before: Option<&Joints>) -> Joints {
    let target = Transform {
        position,
        rotation: HAND_ROTATION,
    };
    let start = before
        .copied()
        .unwrap_or_else(|| solve::nearest_typical(position));
    solve::solve(&target, start)
}

/// The arm's angles in each frame of a clip, each found from the one before.
pub fn reach_all(frames: &[Frame], hand: usize) -> Vec<Joints> {
    let mut before = None;
    frames
        .iter()
        .map(|bodies| {
            let joints = reach(bodies[hand].position, before.as_ref());
            before = Some(joints);
            joints
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::solve::TYPICAL;
    use super::*;

    fn distance(a: [f32; 3], b: [f32; 3]) -> f32 {
        (0..3).map(|k| (a[k] - b[k]).powi(2)).sum::<f32>().sqrt()
    }

    #[test]
    fn all_joints_at_zero_put_the_hand_where_the_model_says() {
        let hand = posture(&[0.0; 7]).hand.position;
        assert!(distance(hand, [1.1355, 0.1603, 0.317]) < 1e-3, "{hand:?}");
    }

    #[test]
    fn a_bent_arm_has_its_joints_where_the_model_says() {
        let joints = [
            1.88929, -0.57577, -0.97666, 1.64199, 0.94286, 1.04370, 2.29283,
        ];
        let expected = [
            [0.0, 0.0, 0.08],
            [-0.0728, 0.0613, 0.317],
            [-0.245, 0.1282, 0.3932],
            [-0.285, 0.3247, 0.564],
            [-0.1113, 0.354, 0.5885],
            [0.0659, 0.5145, 0.4492],
            [0.0055, 0.6013, 0.3396],
        ];
        let posture = posture(&joints);
        for (link, expected) in posture.links.iter().zip(expected) {
            assert!(distance(link.position, expected) < 3e-4, "{link:?}");
        }
        assert!(distance(posture.hand.position, [0.0046, 0.6014, 0.1951]) < 3e-4);
    }

    #[test]
    fn the_typical_configurations_put_the_hand_where_they_say_fingers_down() {
        for (position, joints) in TYPICAL {
            let hand = posture(&joints).hand;
            assert!(distance(hand.position, position) < 4e-3, "{hand:?}");
            let turn: f32 = (0..4).map(|k| hand.rotation[k] * HAND_ROTATION[k]).sum();
            assert!(turn.abs() > 0.9995, "{hand:?}");
        }
    }

    #[test]
    fn a_typical_hand_gets_its_typical_arm() {
        for (position, joints) in TYPICAL {
            let found = reach(position, None);
            for (k, (a, b)) in found.iter().zip(joints).enumerate() {
                assert!((a - b).abs() < 0.03, "{position:?}: joint {k}: {a} for {b}");
            }
        }
    }

    #[test]
    fn recorded_arms_of_an_opened_window_are_found_again() {
        let recorded = [
            (
                [-0.0477, 0.5555, 0.3559],
                [2.0915, -0.4981, -1.4509, 1.6254, 1.128, 1.3956, 2.2992],
            ),
            (
                [-0.0519, 0.6048, 0.2512],
                [1.9991, -0.4974, -1.1583, 1.5419, 1.0066, 1.2506, 2.4606],
            ),
            (
                [-0.023, 0.6077, 0.0673],
                [1.8782, -0.4977, -0.7483, 1.7356, 1.0063, 0.7668, 2.3697],
            ),
        ];
        for (position, joints) in recorded {
            for (a, b) in reach(position, None).iter().zip(joints) {
                assert!((a - b).abs() < 0.08, "{position:?}: {a} for {b}");
            }
        }
    }

    #[test]
    fn the_hand_is_reached_everywhere_it_can_be_moved_to() {
        for x in [-0.4, -0.2, 0.0, 0.2, 0.4_f32] {
            for y in [0.42, 0.5, 0.6, 0.7] {
                for z in [0.06, 0.2, 0.35, 0.45_f32] {
                    let from_shoulder = distance([x, y, z], [0.0, 0.0, 0.317]);
                    if from_shoulder > 0.78 {
                        continue;
                    }
                    let joints = reach([x, y, z], None);
                    let hand = posture(&joints).hand;
                    assert!(
                        distance(hand.position, [x, y, z]) < 2e-3,
                        "{x} {y} {z} {joints:?}"
                    );
                }
            }
        }
    }

    #[test]
    fn the_arm_moves_smoothly_along_a_path() {
        let path = |t: f32| {
            [
                0.3 * (t * 0.05).sin(),
                0.58 + 0.12 * (t * 0.031).cos(),
                0.23 + 0.17 * (t * 0.043).sin(),
            ]
        };
        let mut before = reach(path(0.0), None);
        for t in 1..400 {
            let now = reach(path(t as f32), Some(&before));
            for (k, (a, b)) in now.iter().zip(before).enumerate() {
                assert!((a - b).abs() < 0.15, "step {t}, joint {k}: {b} to {a}");
            }
            before = now;
        }
    }

    #[test]
    fn a_hand_out_of_reach_stretches_the_arm_towards_it() {
        let joints = reach([0.0, 1.0, 0.2], None);
        let hand = posture(&joints).hand.position;
        assert!(joints.iter().all(|angle| angle.is_finite()));
        assert!(hand[1] > 0.8 && hand[0].abs() < 0.1, "{hand:?}");
    }
}
