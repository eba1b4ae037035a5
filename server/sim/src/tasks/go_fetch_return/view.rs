//! What one moment means: observation, task reward, success and stage, as the parent module's
//! tables state them.

use domain::environment::TaskReward;

use super::{CLOSE_UP, FAR, FETCH_DISTANCE, FLOOR_HALF, GOAL_RADIUS, HELD_OPENNESS, JAW_ZONE};
use crate::robots::planar_robot::{PlanarState, TOP_SPEED, TOP_TURN};

/// What reward, success, stage and observation depend on.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct View {
    pub(super) robot: PlanarState,
    pub(super) openness: f32,
    pub(super) is_held: bool,
    /// b − j, metres, world axes.
    pub(super) jaws_to_object: [f32; 2],
    /// g − b, metres, world axes.
    pub(super) object_to_goal: [f32; 2],
}

impl View {
    pub(super) fn observation(&self) -> Vec<f32> {
        let seen = |v| self.robot.to_own(v);
        let velocity = seen(self.robot.velocity);
        let sees_goal = self.is_held || self.is_success();
        let mut observation = vec![
            velocity[0] / TOP_SPEED,
            velocity[1] / TOP_SPEED,
            self.robot.turn_rate / TOP_TURN,
            2.0 * self.openness - 1.0,
            sign(self.is_held),
        ];
        observation.extend(way(seen(self.jaws_to_object)));
        observation.extend(if sees_goal {
            way(seen(self.object_to_goal))
        } else {
            [0.0; WAY_SIZE]
        });
        observation.push(sign(self.is_success()));
        observation
    }

    pub(super) fn task_reward(&self) -> TaskReward {
        let to_object = norm(self.jaws_to_object);
        let to_goal = norm(self.object_to_goal);
        TaskReward(f64::from(if self.is_success() {
            10.0
        } else if self.is_held {
            5.0 + 3.0 * near(to_goal - GOAL_RADIUS)
        } else if to_object <= JAW_ZONE {
            3.0 + (1.0 - self.openness) / (1.0 - HELD_OPENNESS)
        } else {
            3.0 * near(to_object - JAW_ZONE)
        }))
    }

    pub(super) fn is_success(&self) -> bool {
        norm(self.object_to_goal) <= GOAL_RADIUS
    }

    pub(super) fn stage(&self) -> u8 {
        if self.is_held || self.is_success() {
            2
        } else {
            u8::from(norm(self.jaws_to_object) <= FETCH_DISTANCE)
        }
    }
}

/// Falls from 1 to 0 over the floor's diagonal, steeply at the end: a slope to follow from
/// everywhere and a point to come to.
fn near(distance: f32) -> f32 {
    (0.6 * (1.0 - distance / 3.4) + 0.4 * (-distance / 0.2).exp()).max(0.0)
}

const WAY_SIZE: usize = 5;

/// A way still to go, as the state vector shows it: from afar, from close by, and how near.
fn way([x, y]: [f32; 2]) -> [f32; WAY_SIZE] {
    let close_up = |x: f32| (x / CLOSE_UP).clamp(-1.0, 1.0);
    let nearness = (1.0 - norm([x, y]) / FAR).max(0.0);
    [
        x / FLOOR_HALF,
        y / FLOOR_HALF,
        close_up(x),
        close_up(y),
        nearness,
    ]
}

fn sign(is_true: bool) -> f32 {
    if is_true { 1.0 } else { -1.0 }
}

/// Length.
pub(super) fn norm(v: [f32; 2]) -> f32 {
    v[0].hypot(v[1])
}
