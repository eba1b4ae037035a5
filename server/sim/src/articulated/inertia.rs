//! Weight: mass, centre and inertia of solids and of the bodies that they make up.

use std::f64::consts::PI;
use std::ops::{Add, AddAssign};

use super::model::{Body, Form, Solid};
use super::vector::{Mat3, Spatial, Vec3, vec3};

/// A body's weight in its own frame.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Inertial {
    /// kg
    pub mass: f64,
    /// Centre of mass, metres.
    pub centre: Vec3,
    /// About the centre of mass, kg m².
    pub inertia: Symmetric,
}

/// A symmetric 3 × 3 matrix.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Symmetric {
    /// xx, yy, zz.
    pub diagonal: Vec3,
    /// yz, xz, xy.
    pub off: Vec3,
}

impl Symmetric {
    /// `s · v vᵀ`
    fn outer(v: Vec3, s: f64) -> Self {
        Self {
            diagonal: vec3(v.x * v.x, v.y * v.y, v.z * v.z) * s,
            off: vec3(v.y * v.z, v.x * v.z, v.x * v.y) * s,
        }
    }

    /// Inertia of a point of mass `m` at `r`: `m (r² 1 − r rᵀ)`.
    fn of_point(r: Vec3, m: f64) -> Self {
        let square = r.dot(r) * m;
        Self::outer(r, -m)
            + Self {
                diagonal: vec3(square, square, square),
                off: Vec3::ZERO,
            }
    }

    fn turned(self, r: &Mat3) -> Self {
        let turn = |e: Vec3| *r * (self * r.transposed_mul(e));
        let (x, y, z) = (turn(Vec3::X), turn(Vec3::Y), turn(Vec3::Z));
        Self {
            diagonal: vec3(x.x, y.y, z.z),
            off: vec3(y.z, x.z, x.y),
        }
    }
}

impl Add for Symmetric {
    type Output = Self;
    fn add(self, other: Self) -> Self {
        Self {
            diagonal: self.diagonal + other.diagonal,
            off: self.off + other.off,
        }
    }
}

impl std::ops::Mul<Vec3> for Symmetric {
    type Output = Vec3;
    fn mul(self, v: Vec3) -> Vec3 {
        let (d, o) = (self.diagonal, self.off);
        vec3(
            d.x * v.x + o.z * v.y + o.y * v.z,
            o.z * v.x + d.y * v.y + o.x * v.z,
            o.y * v.x + o.x * v.y + d.z * v.z,
        )
    }
}

/// Weight about the reference point O, in world axes: what turns a motion into a momentum.
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct SpatialInertia {
    mass: f64,
    /// Mass times the centre of mass.
    moment: Vec3,
    inertia: Symmetric,
}

impl SpatialInertia {
    /// * `rotation` – the body's axes
    /// * `centre` – centre of mass from O
    pub(super) fn new(inertial: &Inertial, rotation: &Mat3, centre: Vec3) -> Self {
        Self {
            mass: inertial.mass,
            moment: centre * inertial.mass,
            inertia: inertial.inertia.turned(rotation) + Symmetric::of_point(centre, inertial.mass),
        }
    }

    /// Momentum of a motion, or the force that an acceleration takes.
    pub(super) fn apply(&self, motion: Spatial) -> Spatial {
        let Spatial { angular, linear } = motion;
        Spatial {
            angular: self.inertia * angular + self.moment.cross(linear),
            linear: linear * self.mass + angular.cross(self.moment),
        }
    }
}

impl AddAssign for SpatialInertia {
    fn add_assign(&mut self, other: Self) {
        self.mass += other.mass;
        self.moment += other.moment;
        self.inertia = self.inertia + other.inertia;
    }
}

/// Weight of every body. With a total mass, all densities are scaled alike to reach it.
pub(super) fn of_bodies(bodies: &[Body], total_mass: Option<f64>) -> Vec<Inertial> {
    let mut inertials: Vec<Inertial> = bodies.iter().map(|body| of_body(&body.solids)).collect();
    if let Some(total) = total_mass {
        let scale = total / inertials.iter().map(|i| i.mass).sum::<f64>();
        for Inertial { mass, inertia, .. } in &mut inertials {
            *mass *= scale;
            inertia.diagonal = inertia.diagonal * scale;
            inertia.off = inertia.off * scale;
        }
    }
    inertials
}

fn of_body(solids: &[Solid]) -> Inertial {
    let parts: Vec<Inertial> = solids.iter().map(of_solid).collect();
    let mass: f64 = parts.iter().map(|part| part.mass).sum();
    let sum = |a: Vec3, b: Vec3| a + b;
    let moments = parts.iter().map(|part| part.centre * part.mass);
    let centre = moments.fold(Vec3::ZERO, sum) * (1.0 / mass);
    let inertia = parts.iter().fold(Symmetric::default(), |total, part| {
        total + part.inertia + Symmetric::of_point(part.centre - centre, part.mass)
    });
    Inertial {
        mass,
        centre,
        inertia,
    }
}

fn of_solid(solid: &Solid) -> Inertial {
    let density = solid.density;
    match solid.form {
        Form::Capsule { ends, radius } => {
            let half = (ends[1] - ends[0]).length() / 2.0;
            let tube = density * PI * radius * radius * 2.0 * half;
            let caps = density * 4.0 / 3.0 * PI * radius.powi(3);
            let across = tube * (3.0 * radius * radius + 4.0 * half * half) / 12.0
                + caps * (0.4 * radius * radius + half * half + 0.75 * half * radius);
            let along = tube * radius * radius / 2.0 + caps * 0.4 * radius * radius;
            round(ends, tube + caps, across, along)
        }
        Form::Cylinder { ends, radius } => {
            let half = (ends[1] - ends[0]).length() / 2.0;
            let mass = density * PI * radius * radius * 2.0 * half;
            let across = mass * (3.0 * radius * radius + 4.0 * half * half) / 12.0;
            round(ends, mass, across, mass * radius * radius / 2.0)
        }
        Form::Ellipsoid { semi_axes: a } => {
            let mass = density * 4.0 / 3.0 * PI * a.x * a.y * a.z;
            let squares = vec3(a.x * a.x, a.y * a.y, a.z * a.z);
            let diagonal = vec3(
                squares.y + squares.z,
                squares.x + squares.z,
                squares.x + squares.y,
            );
            Inertial {
                mass,
                centre: Vec3::ZERO,
                inertia: Symmetric {
                    diagonal: diagonal * (mass / 5.0),
                    off: Vec3::ZERO,
                },
            }
        }
    }
}

/// A solid of revolution about the line between `ends`.
fn round(ends: [Vec3; 2], mass: f64, across: f64, along: f64) -> Inertial {
    let way = ends[1] - ends[0];
    let length = way.length();
    let axis = if length > 0.0 {
        way * (1.0 / length)
    } else {
        Vec3::Z
    };
    let all = Symmetric {
        diagonal: vec3(across, across, across),
        off: Vec3::ZERO,
    };
    Inertial {
        mass,
        centre: (ends[0] + ends[1]) * 0.5,
        inertia: all + Symmetric::outer(axis, along - across),
    }
}
