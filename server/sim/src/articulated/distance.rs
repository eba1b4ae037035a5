//! How far points and lines are from solids, and where they are nearest.

use super::vector::{Mat3, Vec3};

/// A solid in its place in the world.
#[derive(Debug, Clone, Copy)]
pub(super) enum Placed {
    Capsule {
        ends: [Vec3; 2],
        radius: f64,
    },
    Ellipsoid {
        centre: Vec3,
        axes: Mat3,
        semi_axes: Vec3,
    },
    Cylinder {
        ends: [Vec3; 2],
        radius: f64,
    },
}

/// The points of two line segments that are nearest to each other.
pub(super) fn nearest_points(p: [Vec3; 2], q: [Vec3; 2]) -> (Vec3, Vec3) {
    let (u, v, between) = (p[1] - p[0], q[1] - q[0], p[0] - q[0]);
    let (uu, vv, uv) = (u.dot(u), v.dot(v), u.dot(v));
    let (du, dv) = (u.dot(between), v.dot(between));
    let share = |along: f64, square: f64| {
        if square > 0.0 {
            (along / square).clamp(0.0, 1.0)
        } else {
            0.0
        }
    };
    let determinant = uu * vv - uv * uv;
    let s = share(uv * dv - vv * du, determinant.max(0.0));
    let t = share(uv * s + dv, vv);
    let s = share(uv * t - du, uu);
    (p[0] + u * s, q[0] + v * t)
}

/// Distance of a point from the surface of a solid, negative inside, and the direction in which
/// it grows.
pub(super) fn distance_from(core: &Placed, point: Vec3) -> (f64, Vec3) {
    match core {
        Placed::Capsule {
            ends: [a, b],
            radius,
        } => {
            let (nearest, _) = nearest_points([*a, *b], [point, point]);
            let way = point - nearest;
            let length = way.length();
            (length - radius, way * (1.0 / length.max(1e-15)))
        }
        Placed::Ellipsoid {
            centre,
            axes,
            semi_axes,
        } => {
            let inside = axes.transposed_mul(point - *centre);
            let nearest = nearest_on_ellipsoid(*semi_axes, inside);
            let a = semi_axes;
            let squares = Vec3::from([1.0 / (a.x * a.x), 1.0 / (a.y * a.y), 1.0 / (a.z * a.z)]);
            let gradient = times(nearest, squares);
            let normal = gradient * (1.0 / gradient.length());
            ((inside - nearest).dot(normal), *axes * normal)
        }
        Placed::Cylinder {
            ends: [a, b],
            radius,
        } => {
            let (middle, half) = ((*a + *b) * 0.5, (*b - *a) * 0.5);
            let length = half.length();
            let axis = half * (1.0 / length);
            let along = (point - middle).dot(axis);
            let out = point - middle - axis * along;
            let from_axis = out.length();
            let outwards = out * (1.0 / from_axis.max(1e-15));
            let onwards = axis * along.signum();
            let (beyond_side, beyond_end) = (from_axis - radius, along.abs() - length);
            if beyond_side > 0.0 && beyond_end > 0.0 {
                let distance = beyond_side.hypot(beyond_end);
                let way = outwards * beyond_side + onwards * beyond_end;
                (distance, way * (1.0 / distance))
            } else if beyond_side > beyond_end {
                (beyond_side, outwards)
            } else {
                (beyond_end, onwards)
            }
        }
    }
}

/// The point of an ellipsoid's surface that is nearest to `p`, both in the ellipsoid's axes.
///
/// It is `aᵢ² pᵢ / (aᵢ² + t)` for the largest root t of `Σ (aᵢ pᵢ / (aᵢ² + t))² = 1`; the sum
/// falls and is convex above −min aᵢ², so Newton's method from the left finds it.
fn nearest_on_ellipsoid(semi_axes: Vec3, p: Vec3) -> Vec3 {
    let a = semi_axes.to_array();
    // A coordinate of 0 would put the root on a pole.
    let p = p.to_array().map(|x| if x.abs() < 1e-9 { 1e-9 } else { x });
    let lefts = a.iter().zip(&p).map(|(a, p)| a * p.abs() - a * a);
    let mut t = lefts.fold(f64::NEG_INFINITY, f64::max);
    for _ in 0..60 {
        let (mut value, mut slope) = (-1.0, 0.0);
        for (a, p) in a.iter().zip(&p) {
            let share = a * p / (a * a + t);
            value += share * share;
            slope -= 2.0 * share * share / (a * a + t);
        }
        let step = value / slope;
        t -= step;
        if step.abs() < 1e-14 {
            break;
        }
    }
    let nearest = std::array::from_fn(|i| a[i] * a[i] * p[i] / (a[i] * a[i] + t));
    Vec3::from(nearest)
}

/// Component by component.
pub(super) fn times(a: Vec3, b: Vec3) -> Vec3 {
    Vec3::from([a.x * b.x, a.y * b.y, a.z * b.z])
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::articulated::vector::vec3;
    use domain::random::{Rng, Stream};

    fn draw(rng: &mut Rng, scale: f64) -> Vec3 {
        vec3(rng.normal(), rng.normal(), rng.normal()) * scale
    }

    #[test]
    fn the_nearest_points_of_two_segments_are_nearer_than_any_others() {
        let mut rng = Rng::new(8, Stream::Test, 0);
        for _ in 0..200 {
            let (p, q) = (
                [draw(&mut rng, 1.0), draw(&mut rng, 1.0)],
                [draw(&mut rng, 1.0), draw(&mut rng, 1.0)],
            );
            let (at_p, at_q) = nearest_points(p, q);
            let best = (at_p - at_q).length();
            for i in 0..=20 {
                for j in 0..=20 {
                    let a = p[0] + (p[1] - p[0]) * (f64::from(i) / 20.0);
                    let b = q[0] + (q[1] - q[0]) * (f64::from(j) / 20.0);
                    assert!((a - b).length() > best - 1e-9);
                }
            }
        }
    }

    #[test]
    fn the_nearest_point_of_an_ellipsoid_is_on_it_and_straight_below() {
        let mut rng = Rng::new(9, Stream::Test, 0);
        let semi_axes = vec3(0.30, 0.27, 0.20);
        for scale in [0.05, 0.1, 0.3, 1.0] {
            for _ in 0..100 {
                let p = draw(&mut rng, scale);
                let nearest = nearest_on_ellipsoid(semi_axes, p);
                let on =
                    |v: Vec3| (v.x / 0.30).powi(2) + (v.y / 0.27).powi(2) + (v.z / 0.20).powi(2);
                assert!((on(nearest) - 1.0).abs() < 1e-6, "{p:?} {nearest:?}");
                let gradient = vec3(nearest.x / 0.09, nearest.y / 0.0729, nearest.z / 0.04);
                let across = (p - nearest).cross(gradient).length();
                assert!(across < 1e-6 * gradient.length(), "{p:?}");
            }
        }
    }
}
