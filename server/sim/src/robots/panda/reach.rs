//! Inverse kinematics: which joints put the end effector a centimetre further on.

use rapier3d::na::{Matrix3, Vector3};

use super::links::{end_effector, frames, jacobian};
use super::{N_JOINTS, Point};

/// Joints that reach; the last one only turns the hand.
const N_REACHING: usize = 6;
const MOST_ITERATIONS: usize = 100;
/// Metres.
const CLOSE_ENOUGH: f64 = 1e-14;
/// Metres per radian: steps that bring less than this are given up.
const POOR_PROGRESS: f64 = 20.0;
/// Longest change of the joints in one iteration, radians.
const LONGEST_STEP: f64 = 2.0;
/// From this error on, metres, the iteration is damped by [`DAMPING`].
const FAR: f64 = 0.1;
const DAMPING: f64 = 0.03;

/// The joints near `q` that bring the end effector to `target`: Gauss–Newton with the smallest
/// change of joints 1–6, `Δq = Jᵀ (J Jᵀ)⁻¹ e`. Neither the hand's orientation nor the joints'
/// stops are looked at, so the orientation drifts freely, as in the original.
///
/// A target out of reach ends where the iteration gave up.
pub(super) fn reach(q: &[f64; N_JOINTS], target: Point) -> [f64; N_JOINTS] {
    let mut q = *q;
    for _ in 0..MOST_ITERATIONS {
        let frames = frames(&q);
        let error = Vector3::from(target) - Vector3::from(end_effector(&frames));
        if error.norm() < CLOSE_ENOUGH {
            break;
        }
        let columns = &jacobian(&frames)[..N_REACHING];
        let mut normal = Matrix3::zeros();
        for column in columns {
            normal += column * column.transpose();
        }
        if error.norm() > FAR {
            normal += Matrix3::from_diagonal_element(DAMPING);
        }
        let Some(inverse) = normal.try_inverse() else {
            break; // a fully stretched arm: no direction is better than staying
        };
        let pull = inverse * error;
        let mut change: [f64; N_REACHING] = std::array::from_fn(|i| columns[i].dot(&pull));
        let length = change.iter().map(|x| x * x).sum::<f64>().sqrt();
        if error.norm() / length > POOR_PROGRESS || !length.is_finite() {
            break;
        }
        if length > LONGEST_STEP {
            change = change.map(|x| x * LONGEST_STEP / length);
        }
        for (joint, change) in q.iter_mut().zip(change) {
            *joint += change;
        }
    }
    q
}
