//! Where a robot touches the ground, z = 0, and itself.

use super::model::{Form, Model};
use super::motion::Motion;
use super::vector::{Mat3, Vec3};

/// A point where two solids overlap.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Contact {
    /// The body that the normal points away from; `None` for the ground.
    pub first: Option<usize>,
    /// The other one.
    pub second: usize,
    /// Halfway between the two surfaces, metres.
    pub point: Vec3,
    /// Unit vector from the first solid to the second.
    pub normal: Vec3,
    /// How far they overlap, metres; positive.
    pub depth: f64,
    /// Coulomb's coefficient; 0 without friction.
    pub friction: f64,
    /// A vector whose part along the surface is where friction's first direction points: a
    /// capsule's axis on the ground, y elsewhere. Friction is weaker between its directions.
    pub grain: Vec3,
}

/// A solid in its place in the world.
#[derive(Debug, Clone, Copy)]
enum Placed {
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

/// Finds contacts; keeps its memory between steps.
#[derive(Debug, Default)]
pub struct Collider {
    solids: Vec<Placed>,
    /// Centre and radius of the ball around each solid.
    balls: Vec<(Vec3, f64)>,
    /// What [`Collider::find`] found last.
    pub contacts: Vec<Contact>,
}

impl Collider {
    /// Fills [`Collider::contacts`] with every overlap.
    pub fn find<const N: usize>(&mut self, model: &Model<N>, motion: &Motion<N>) {
        self.solids.clear();
        self.balls.clear();
        self.contacts.clear();
        for piece in &model.pieces {
            let (position, rotation) = (motion.position(piece.body), motion.rotation(piece.body));
            let placed = |p: Vec3| position + *rotation * p;
            self.balls.push((placed(piece.bounds.0), piece.bounds.1));
            self.solids.push(match piece.solid.form {
                Form::Capsule { ends, radius } => Placed::Capsule {
                    ends: ends.map(placed),
                    radius,
                },
                Form::Ellipsoid { semi_axes } => Placed::Ellipsoid {
                    centre: position,
                    axes: *rotation,
                    semi_axes,
                },
                Form::Cylinder { ends, radius } => Placed::Cylinder {
                    ends: ends.map(placed),
                    radius,
                },
            });
        }
        for (index, piece) in model.pieces.iter().enumerate() {
            let (centre, radius) = self.balls[index];
            if centre.z < radius {
                let (body, friction) = (piece.body, piece.solid.ground_friction);
                let grain = match self.solids[index] {
                    Placed::Capsule { ends: [a, b], .. } if a != b => b - a,
                    _ => Vec3::Y,
                };
                for (lowest, depth) in below_ground(&self.solids[index]).into_iter().flatten() {
                    self.contacts.push(Contact {
                        first: None,
                        second: body,
                        point: lowest + Vec3::Z * (depth / 2.0),
                        normal: Vec3::Z,
                        depth,
                        friction,
                        grain,
                    });
                }
            }
        }
        for &(a, b) in &model.pairs {
            let ((centre_a, radius_a), (centre_b, radius_b)) = (self.balls[a], self.balls[b]);
            let (way, reach) = (centre_b - centre_a, radius_a + radius_b);
            if way.dot(way) < reach * reach {
                self.contacts.extend(overlap(model, a, b, &self.solids));
            }
        }
    }
}

/// The lowest points of a solid that are under the ground, each with its depth.
fn below_ground(solid: &Placed) -> [Option<(Vec3, f64)>; 4] {
    let sunk = |p: Vec3| (p.z < 0.0).then_some((p, -p.z));
    match *solid {
        Placed::Capsule {
            ends: [a, b],
            radius,
        } => {
            let down = Vec3::Z * radius;
            let second = if a == b { None } else { sunk(b - down) };
            [sunk(a - down), second, None, None]
        }
        Placed::Ellipsoid {
            centre,
            axes,
            semi_axes,
        } => {
            let down = axes.transposed_mul(-Vec3::Z);
            let scaled = times(semi_axes, down);
            let lowest = times(semi_axes, scaled) * (1.0 / scaled.length());
            [sunk(centre + axes * lowest), None, None, None]
        }
        Placed::Cylinder {
            ends: [a, b],
            radius,
        } => {
            let (lower, upper) = if a.z < b.z { (a, b) } else { (b, a) };
            let axis = (lower - upper) * (1.0 / (lower - upper).length());
            let slope = -Vec3::Z - axis * -axis.z;
            let steep = slope.length();
            // Upright, every direction is as good as any other.
            let out = if steep > 1e-9 {
                slope * (radius / steep)
            } else {
                Vec3::X * radius
            };
            // The lowest points of both rims, and two more of the lower one, a third around.
            let side = axis.cross(out) * (3f64.sqrt() / 2.0);
            [
                sunk(lower + out),
                sunk(upper + out),
                sunk(lower - out * 0.5 + side),
                sunk(lower - out * 0.5 - side),
            ]
        }
    }
}

/// Contact between pieces `a` and `b`.
fn overlap<const N: usize>(
    model: &Model<N>,
    a: usize,
    b: usize,
    solids: &[Placed],
) -> Option<Contact> {
    let friction = model.touch.own_friction.unwrap_or_default();
    let contact = |first: usize, second: usize, touch: Touching| Contact {
        first: Some(model.pieces[first].body),
        second: model.pieces[second].body,
        point: touch.point,
        normal: touch.normal,
        depth: touch.depth,
        friction,
        grain: Vec3::Y,
    };
    match (&solids[a], &solids[b]) {
        (Placed::Capsule { ends: p, radius: r }, Placed::Capsule { ends: q, radius: s }) => {
            between_capsules((*p, *r), (*q, *s)).map(|touch| contact(a, b, touch))
        }
        (core, Placed::Capsule { ends, radius }) => {
            on_core(core, *ends, *radius).map(|touch| contact(a, b, touch))
        }
        (Placed::Capsule { ends, radius }, core) => {
            on_core(core, *ends, *radius).map(|touch| contact(b, a, touch))
        }
        // The only solids that are no capsules are on one body.
        _ => None,
    }
}

struct Touching {
    point: Vec3,
    normal: Vec3,
    depth: f64,
}

fn between_capsules(
    (p, radius_p): ([Vec3; 2], f64),
    (q, radius_q): ([Vec3; 2], f64),
) -> Option<Touching> {
    let (at_p, at_q) = nearest_points(p, q);
    let way = at_q - at_p;
    let distance = way.length();
    let depth = radius_p + radius_q - distance;
    if depth <= 0.0 {
        return None;
    }
    let normal = if distance > 1e-15 {
        way * (1.0 / distance)
    } else {
        // Axes that cross: apart, at right angles to both.
        let across = (p[1] - p[0]).cross(q[1] - q[0]);
        across * (1.0 / across.length().max(1e-15))
    };
    Some(Touching {
        point: at_p + normal * (radius_p - depth / 2.0),
        normal,
        depth,
    })
}

/// The points of two line segments that are nearest to each other.
fn nearest_points(p: [Vec3; 2], q: [Vec3; 2]) -> (Vec3, Vec3) {
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

/// A capsule against a solid that is none; the normal points to the capsule. The distance from a
/// convex solid is convex along the capsule's axis, so its slope has one change of sign.
fn on_core(core: &Placed, ends: [Vec3; 2], radius: f64) -> Option<Touching> {
    const HALVINGS: usize = 40;
    let way = ends[1] - ends[0];
    let (mut low, mut high) = (0.0, 1.0);
    let slope = |t: f64| distance_from(core, ends[0] + way * t).1.dot(way);
    let at = if slope(0.0) >= 0.0 {
        0.0
    } else if slope(1.0) <= 0.0 {
        1.0
    } else {
        for _ in 0..HALVINGS {
            let middle = f64::midpoint(low, high);
            if slope(middle) < 0.0 {
                low = middle;
            } else {
                high = middle;
            }
        }
        f64::midpoint(low, high)
    };
    let nearest = ends[0] + way * at;
    let (distance, normal) = distance_from(core, nearest);
    let depth = radius - distance;
    (depth > 0.0).then(|| Touching {
        point: nearest - normal * f64::midpoint(radius, distance),
        normal,
        depth,
    })
}

/// Distance of a point from the surface of a solid, negative inside, and the direction in which
/// it grows.
fn distance_from(core: &Placed, point: Vec3) -> (f64, Vec3) {
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
fn times(a: Vec3, b: Vec3) -> Vec3 {
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

    #[test]
    fn a_ball_beside_a_cylinder_touches_its_side_its_end_or_its_rim() {
        let cylinder = Placed::Cylinder {
            ends: [Vec3::ZERO, Vec3::X],
            radius: 0.1,
        };
        let ball = |p: Vec3| on_core(&cylinder, [p, p], 0.05).map(|t| (t.normal, t.depth));
        let is = |found: Option<(Vec3, f64)>, normal: Vec3, depth: f64| {
            found.is_some_and(|(n, d)| (n - normal).length() < 1e-12 && (d - depth).abs() < 1e-12)
        };
        assert!(is(ball(vec3(0.5, 0.0, 0.14)), Vec3::Z, 0.01));
        assert!(is(ball(vec3(1.03, 0.02, 0.0)), Vec3::X, 0.02));
        let rim = vec3(1.03, 0.0, 0.13);
        let normal = vec3(0.5f64.sqrt(), 0.0, 0.5f64.sqrt());
        assert!(is(ball(rim), normal, 0.05 - 0.03 * 2f64.sqrt()));
        assert_eq!(ball(vec3(0.5, 0.0, 0.16)), None);
    }

    #[test]
    fn solids_under_the_ground_are_found_at_their_lowest_points() {
        let axes = Mat3::turn(Vec3::Y, std::f64::consts::FRAC_PI_2);
        let ellipsoid = Placed::Ellipsoid {
            centre: vec3(1.0, 2.0, 0.25),
            axes,
            semi_axes: vec3(0.30, 0.27, 0.20),
        };
        let [Some((lowest, depth)), None, None, None] = below_ground(&ellipsoid) else {
            panic!("one contact")
        };
        assert!((lowest - vec3(1.0, 2.0, -0.05)).length() < 1e-9);
        assert!((depth - 0.05).abs() < 1e-9);
        let standing = Placed::Cylinder {
            ends: [vec3(0.0, 0.0, 0.5), vec3(0.0, 0.0, -0.02)],
            radius: 0.1,
        };
        assert_eq!(below_ground(&standing).into_iter().flatten().count(), 3);
    }
}
