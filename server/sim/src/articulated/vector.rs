//! Vectors, rotations and spatial vectors in f64: rapier's own types are f32.

use std::ops::{Add, AddAssign, Mul, Neg, Sub};

use serde::{Deserialize, Serialize};

/// Three numbers: a point or a direction.
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize, Deserialize)]
pub struct Vec3 {
    /// Forward, at rest.
    pub x: f64,
    /// To the left, at rest.
    pub y: f64,
    /// Up.
    pub z: f64,
}

/// Short for a vector literal.
pub const fn vec3(x: f64, y: f64, z: f64) -> Vec3 {
    Vec3 { x, y, z }
}

impl Vec3 {
    /// The origin.
    pub const ZERO: Self = vec3(0.0, 0.0, 0.0);
    /// Forward.
    pub const X: Self = vec3(1.0, 0.0, 0.0);
    /// To the left.
    pub const Y: Self = vec3(0.0, 1.0, 0.0);
    /// Up.
    pub const Z: Self = vec3(0.0, 0.0, 1.0);

    /// Scalar product.
    pub fn dot(self, other: Self) -> f64 {
        self.x * other.x + self.y * other.y + self.z * other.z
    }

    /// Vector product.
    #[must_use]
    pub fn cross(self, other: Self) -> Self {
        vec3(
            self.y * other.z - self.z * other.y,
            self.z * other.x - self.x * other.z,
            self.x * other.y - self.y * other.x,
        )
    }

    /// Euclidean norm.
    pub fn length(self) -> f64 {
        self.dot(self).sqrt()
    }

    /// In order.
    pub const fn to_array(self) -> [f64; 3] {
        [self.x, self.y, self.z]
    }
}

impl From<[f64; 3]> for Vec3 {
    fn from([x, y, z]: [f64; 3]) -> Self {
        vec3(x, y, z)
    }
}

impl Add for Vec3 {
    type Output = Self;
    fn add(self, other: Self) -> Self {
        vec3(self.x + other.x, self.y + other.y, self.z + other.z)
    }
}

impl AddAssign for Vec3 {
    fn add_assign(&mut self, other: Self) {
        *self = *self + other;
    }
}

impl Sub for Vec3 {
    type Output = Self;
    fn sub(self, other: Self) -> Self {
        vec3(self.x - other.x, self.y - other.y, self.z - other.z)
    }
}

impl Neg for Vec3 {
    type Output = Self;
    fn neg(self) -> Self {
        vec3(-self.x, -self.y, -self.z)
    }
}

impl Mul<f64> for Vec3 {
    type Output = Self;
    fn mul(self, scale: f64) -> Self {
        vec3(self.x * scale, self.y * scale, self.z * scale)
    }
}

/// A 3 × 3 matrix by its columns; mostly a rotation, whose columns are the turned axes.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Mat3 {
    /// Images of the three axes.
    pub columns: [Vec3; 3],
}

impl Mat3 {
    /// No turn.
    pub const IDENTITY: Self = Self {
        columns: [Vec3::X, Vec3::Y, Vec3::Z],
    };

    /// A right-handed turn by `angle` radians about a unit `axis`.
    pub fn turn(axis: Vec3, angle: f64) -> Self {
        let (sin, cos) = angle.sin_cos();
        let column = |e: Vec3| e * cos + axis.cross(e) * sin + axis * (axis.dot(e) * (1.0 - cos));
        Self {
            columns: [column(Vec3::X), column(Vec3::Y), column(Vec3::Z)],
        }
    }

    /// The turn of a unit quaternion (w, x, y, z).
    pub fn from_quaternion([w, x, y, z]: [f64; 4]) -> Self {
        Self {
            columns: [
                vec3(
                    1.0 - 2.0 * (y * y + z * z),
                    2.0 * (x * y + w * z),
                    2.0 * (x * z - w * y),
                ),
                vec3(
                    2.0 * (x * y - w * z),
                    1.0 - 2.0 * (x * x + z * z),
                    2.0 * (y * z + w * x),
                ),
                vec3(
                    2.0 * (x * z + w * y),
                    2.0 * (y * z - w * x),
                    1.0 - 2.0 * (x * x + y * y),
                ),
            ],
        }
    }

    /// The transposed matrix times `v`: for a rotation, `v` seen from inside.
    #[must_use]
    pub fn transposed_mul(&self, v: Vec3) -> Vec3 {
        let [a, b, c] = self.columns;
        vec3(a.dot(v), b.dot(v), c.dot(v))
    }

    /// A unit quaternion (w, x, y, z) of this rotation, w ≥ 0 or the largest part positive.
    pub fn quaternion(&self) -> [f64; 4] {
        let [a, b, c] = self.columns;
        let trace = a.x + b.y + c.z;
        let quaternion = if trace > 0.0 {
            [1.0 + trace, b.z - c.y, c.x - a.z, a.y - b.x]
        } else if a.x >= b.y && a.x >= c.z {
            [b.z - c.y, 1.0 + a.x - b.y - c.z, b.x + a.y, c.x + a.z]
        } else if b.y >= c.z {
            [c.x - a.z, b.x + a.y, 1.0 + b.y - a.x - c.z, c.y + b.z]
        } else {
            [a.y - b.x, c.x + a.z, c.y + b.z, 1.0 + c.z - a.x - b.y]
        };
        normalized(quaternion)
    }
}

impl Mul<Vec3> for Mat3 {
    type Output = Vec3;
    fn mul(self, v: Vec3) -> Vec3 {
        let [a, b, c] = self.columns;
        a * v.x + b * v.y + c * v.z
    }
}

impl Mul for Mat3 {
    type Output = Self;
    fn mul(self, other: Self) -> Self {
        Self {
            columns: other.columns.map(|column| self * column),
        }
    }
}

/// A quaternion of unit length in the same direction.
pub fn normalized(q: [f64; 4]) -> [f64; 4] {
    let length = q.iter().map(|x| x * x).sum::<f64>().sqrt();
    q.map(|x| x / length)
}

/// Turns a unit quaternion by the vector `turn`, radians, given in the turned axes.
pub fn turned(q: [f64; 4], turn: Vec3) -> [f64; 4] {
    let angle = turn.length();
    let (sin, cos) = (angle / 2.0).sin_cos();
    // sin(angle / 2) / angle, which tends to a half.
    let scale = if angle > 0.0 { sin / angle } else { 0.5 };
    let ([w, x, y, z], b, r) = (q, cos, turn * scale);
    normalized([
        w * b - x * r.x - y * r.y - z * r.z,
        w * r.x + x * b + y * r.z - z * r.y,
        w * r.y - x * r.z + y * b + z * r.x,
        w * r.z + x * r.y - y * r.x + z * b,
    ])
}

/// A motion or a force of a rigid body, in world axes about one reference point O that a whole
/// robot shares: (angular velocity, velocity of the body's point at O), or (torque, force).
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Spatial {
    /// Turn or torque.
    pub angular: Vec3,
    /// Move or force.
    pub linear: Vec3,
}

impl Spatial {
    /// Nothing.
    pub const ZERO: Self = Self {
        angular: Vec3::ZERO,
        linear: Vec3::ZERO,
    };

    /// Power of a force along a motion.
    pub fn dot(self, other: Self) -> f64 {
        self.angular.dot(other.angular) + self.linear.dot(other.linear)
    }

    /// How fast `motion`, fixed to a body that moves like `self`, changes.
    #[must_use]
    pub fn cross_motion(self, motion: Self) -> Self {
        Self {
            angular: self.angular.cross(motion.angular),
            linear: self.angular.cross(motion.linear) + self.linear.cross(motion.angular),
        }
    }

    /// How fast `force`, fixed to a body that moves like `self`, changes.
    #[must_use]
    pub fn cross_force(self, force: Self) -> Self {
        Self {
            angular: self.angular.cross(force.angular) + self.linear.cross(force.linear),
            linear: self.angular.cross(force.linear),
        }
    }

    /// Velocity of the body's point at `arm` from O.
    #[must_use]
    pub fn at(self, arm: Vec3) -> Vec3 {
        self.linear + self.angular.cross(arm)
    }
}

impl Add for Spatial {
    type Output = Self;
    fn add(self, other: Self) -> Self {
        Self {
            angular: self.angular + other.angular,
            linear: self.linear + other.linear,
        }
    }
}

impl AddAssign for Spatial {
    fn add_assign(&mut self, other: Self) {
        *self = *self + other;
    }
}

impl Mul<f64> for Spatial {
    type Output = Self;
    fn mul(self, scale: f64) -> Self {
        Self {
            angular: self.angular * scale,
            linear: self.linear * scale,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_turn_and_its_quaternion_are_the_same_rotation() {
        let axis = vec3(2.0, -1.0, 2.0) * (1.0 / 3.0);
        for angle in [-3.0, -1.0, 0.0, 0.4, 2.5, 3.1] {
            let matrix = Mat3::turn(axis, angle);
            let stepwise = turned(
                turned([1.0, 0.0, 0.0, 0.0], axis * (angle - 0.3)),
                axis * 0.3,
            );
            for other in [
                Mat3::from_quaternion(matrix.quaternion()),
                Mat3::from_quaternion(stepwise),
            ] {
                for (a, b) in matrix.columns.iter().zip(other.columns) {
                    assert!((*a - b).length() < 1e-12, "{angle}");
                }
            }
        }
    }

    #[test]
    fn forces_do_no_work_when_everything_turns_together() {
        let spatial = |s: f64| Spatial {
            angular: vec3(s, 2.0 - s, 0.3 * s),
            linear: vec3(-s, 1.0, s * s),
        };
        let (frame, motion, force) = (spatial(0.7), spatial(-1.1), spatial(2.3));
        let change = frame.cross_motion(motion).dot(force) + motion.dot(frame.cross_force(force));
        assert!(change.abs() < 1e-12);
    }
}
