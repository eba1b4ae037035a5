//! Inverse kinematics by damped least squares, from a start that is nearly right.

use domain::scene::Transform;

use super::{JOINT_1_REST, Joints, LIMITS, posture};

/// Hand positions (metres) with the joints that MuJoCo's arm holds there, fingers down.
///
/// Source: METAWORLD.md 1.8, measured.
pub(super) const TYPICAL: [([f32; 3], Joints); 6] = [
    (
        [0.0, 0.6, 0.196],
        [1.9328, -0.4991, -1.0589, 1.6511, 1.0473, 1.0848, 2.2986],
    ),
    (
        [0.3, 0.6, 0.196],
        [1.355, -0.499, -0.940, 1.426, 0.913, 1.112, 1.999],
    ),
    (
        [-0.3, 0.6, 0.196],
        [2.283, -0.499, -0.941, 1.428, 0.914, 1.111, 2.932],
    ),
    (
        [0.0, 0.45, 0.196],
        [2.131, -0.499, -1.218, 2.056, 1.242, 1.057, 2.002],
    ),
    (
        [0.0, 0.6, 0.096],
        [1.877, -0.499, -0.828, 1.745, 1.053, 0.840, 2.277],
    ),
    (
        [0.0, 0.6, 0.346],
        [1.920, -0.499, -1.361, 1.464, 1.048, 1.440, 2.296],
    ),
];

/// A radian of turn counts as this many metres of displacement.
const METRES_PER_RADIAN: f32 = 0.25;
/// Where the search may stop, metres.
const GOOD_ENOUGH: f32 = 2e-5;
/// Where joint 1 is left alone, metres.
const REACHED: f32 = 1e-3;

/// The typical configuration whose hand is nearest.
pub(super) fn nearest_typical(position: [f32; 3]) -> Joints {
    let distance = |p: &[f32; 3]| (0..3).map(|k| (p[k] - position[k]).powi(2)).sum::<f32>();
    let mut best = TYPICAL[0];
    for candidate in TYPICAL {
        if distance(&candidate.0) < distance(&best.0) {
            best = candidate;
        }
    }
    best.1
}

/// Angles near `start` that bring the hand to `target`.
pub(super) fn solve(target: &Transform, start: Joints) -> Joints {
    let mut joints = start;
    // A joint 1 that had to leave its rest goes back slowly, so that the arm never jumps.
    joints[1] += (JOINT_1_REST - joints[1]) * 0.3;
    if (joints[1] - JOINT_1_REST).abs() < 2e-3 {
        joints[1] = JOINT_1_REST;
    }
    let error = descend(target, &mut joints, [1.0, 0.0, 1.0, 1.0, 1.0, 1.0, 1.0], 24);
    if error > REACHED {
        descend(target, &mut joints, [1.0; 7], 40);
    }
    joints
}

/// Steps downhill with the joints whose `freedom` is 1; returns the error that is left, metres.
fn descend(target: &Transform, joints: &mut Joints, freedom: [f32; 7], n_steps: usize) -> f32 {
    const LONGEST_STEP: f32 = 0.25;
    let mut size = f32::INFINITY;
    for _ in 0..n_steps {
        let (error, jacobian) = linearise(target, joints);
        size = error.iter().map(|e| e * e).sum::<f32>().sqrt();
        if size < GOOD_ENOUGH {
            break;
        }
        // (J Jᵀ + λ²) y = e, step = Jᵀ y
        let damping = 1e-6 + 0.02 * size * size;
        let mut system = [[0.0; 7]; 6];
        for (row, line) in system.iter_mut().enumerate() {
            for (column, cell) in line.iter_mut().take(6).enumerate() {
                *cell = (0..7)
                    .map(|k| freedom[k] * jacobian[k][row] * jacobian[k][column])
                    .sum();
            }
            line[row] += damping;
            line[6] = error[row];
        }
        let y = eliminate(system);
        let step: Joints = std::array::from_fn(|k| {
            freedom[k] * (0..6).map(|r| jacobian[k][r] * y[r]).sum::<f32>()
        });
        let longest = step.iter().fold(0.0_f32, |m, s| m.max(s.abs()));
        let scale = (LONGEST_STEP / longest.max(1e-9)).min(1.0);
        for k in 0..7 {
            joints[k] = (joints[k] + scale * step[k]).clamp(LIMITS[k].0, LIMITS[k].1);
        }
    }
    size
}

/// What the hand misses (displacement, then turn) and how each joint would move it. `[7][6]`
fn linearise(target: &Transform, joints: &Joints) -> ([f32; 6], [[f32; 6]; 7]) {
    let posture = posture(joints);
    let hand = posture.hand;
    let turn = rotation_between(hand.rotation, target.rotation);
    let mut error = [0.0; 6];
    for k in 0..3 {
        error[k] = target.position[k] - hand.position[k];
        error[3 + k] = METRES_PER_RADIAN * turn[k];
    }
    let jacobian = std::array::from_fn(|k| {
        let link = posture.links[k];
        let tip = link.then(Transform::at(0.0, 0.0, 1.0)).position;
        let axis: [f32; 3] = std::array::from_fn(|i| tip[i] - link.position[i]);
        let arm: [f32; 3] = std::array::from_fn(|i| hand.position[i] - link.position[i]);
        let moved = crate::projection::cross(axis, arm);
        std::array::from_fn(|i| {
            if i < 3 {
                moved[i]
            } else {
                METRES_PER_RADIAN * axis[i - 3]
            }
        })
    });
    (error, jacobian)
}

/// The turn from one orientation to another as a vector in the world, radians.
fn rotation_between(from: [f32; 4], to: [f32; 4]) -> [f32; 3] {
    // to · from⁻¹
    let (a, b) = (to, [from[0], -from[1], -from[2], -from[3]]);
    let w = a[0] * b[0] - a[1] * b[1] - a[2] * b[2] - a[3] * b[3];
    let v = [
        a[0] * b[1] + a[1] * b[0] + a[2] * b[3] - a[3] * b[2],
        a[0] * b[2] - a[1] * b[3] + a[2] * b[0] + a[3] * b[1],
        a[0] * b[3] + a[1] * b[2] - a[2] * b[1] + a[3] * b[0],
    ];
    v.map(|x| 2.0 * x * w.signum())
}

/// Solves six equations given as rows with their right-hand side; the system is positive definite.
fn eliminate(mut rows: [[f32; 7]; 6]) -> [f32; 6] {
    for pivot in 0..6 {
        for below in pivot + 1..6 {
            let factor = rows[below][pivot] / rows[pivot][pivot];
            let above = rows[pivot];
            for (cell, pivot_cell) in rows[below].iter_mut().zip(above).skip(pivot) {
                *cell -= factor * pivot_cell;
            }
        }
    }
    let mut solution = [0.0; 6];
    for row in (0..6).rev() {
        let known: f32 = (row + 1..6).map(|k| rows[row][k] * solution[k]).sum();
        solution[row] = (rows[row][6] - known) / rows[row][row];
    }
    solution
}
