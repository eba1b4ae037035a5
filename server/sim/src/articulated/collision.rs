//! Where a robot touches the ground, z = 0, and itself.

use super::distance::{Placed, distance_from, nearest_points, times};
use super::model::{Form, Model};
use super::motion::Motion;
use super::vector::Vec3;

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

#[cfg(test)]
mod tests {
    use super::*;
    use crate::articulated::vector::{Mat3, vec3};

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
