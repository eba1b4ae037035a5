//! What a robot is made of: bodies in a tree, joints between them, solids on them.

use std::ops::Range;

use super::inertia::{self, Inertial};
use super::motion::Motion;
use super::softness::Softness;
use super::solver::Cholesky;
use super::vector::{Mat3, Vec3};

/// How a body moves against its parent. Joints of one body act in order, each in the frame that
/// the ones before it leave behind.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum JointKind {
    /// Anywhere: three coordinates of position and a quaternion, six degrees of freedom: velocity
    /// in world axes, angular velocity in the body's own. Only for a root.
    Free,
    /// Along the joint's axis.
    Slide,
    /// About the joint's axis through its anchor.
    Hinge,
}

/// A joint.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Joint {
    /// What it lets move.
    pub kind: JointKind,
    /// Unit vector in the body's frame.
    pub axis: Vec3,
    /// A point of the axis in the body's frame, metres.
    pub anchor: Vec3,
    /// Soft stops, radians.
    pub range: Option<[f64; 2]>,
    /// Torque against the joint's rate, N m s/rad.
    pub damping: f64,
    /// Added to the joint's diagonal of the inertia matrix, kg m²: the motor's rotor.
    pub armature: f64,
    /// Torque against the joint's angle, N m/rad.
    pub stiffness: f64,
}

impl Joint {
    /// A joint without stops, damping or rotor.
    pub const fn bare(kind: JointKind, axis: Vec3) -> Self {
        Self {
            kind,
            axis,
            anchor: Vec3::ZERO,
            range: None,
            damping: 0.0,
            armature: 0.0,
            stiffness: 0.0,
        }
    }

    fn n_dofs(self) -> usize {
        if self.kind == JointKind::Free { 6 } else { 1 }
    }

    fn n_coordinates(self) -> usize {
        if self.kind == JointKind::Free { 7 } else { 1 }
    }
}

/// The form of a solid, in its body's frame; metres.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Form {
    /// All points closer than `radius` to the way from one point to another; a ball when both
    /// are the same.
    Capsule {
        /// Where the axis begins and ends.
        ends: [Vec3; 2],
        /// Metres.
        radius: f64,
    },
    /// Its axes are the body's.
    Ellipsoid {
        /// Half the length along each axis.
        semi_axes: Vec3,
    },
    /// With flat ends.
    Cylinder {
        /// Middles of the two ends.
        ends: [Vec3; 2],
        /// Metres.
        radius: f64,
    },
}

impl Form {
    /// A capsule by its middle: `tilt` turns its axis from z about y, radians.
    pub fn capsule(centre: Vec3, tilt: f64, radius: f64, half_length: f64) -> Self {
        let half = Mat3::turn(Vec3::Y, tilt) * (Vec3::Z * half_length);
        Self::Capsule {
            ends: [centre - half, centre + half],
            radius,
        }
    }

    /// The ball around the solid: centre in the body's frame, radius.
    pub fn bounds(self) -> (Vec3, f64) {
        match self {
            Self::Capsule {
                ends: [a, b],
                radius,
            } => ((a + b) * 0.5, (b - a).length() / 2.0 + radius),
            Self::Ellipsoid { semi_axes } => {
                (Vec3::ZERO, semi_axes.x.max(semi_axes.y).max(semi_axes.z))
            }
            Self::Cylinder {
                ends: [a, b],
                radius,
            } => ((a + b) * 0.5, ((b - a).length() / 2.0).hypot(radius)),
        }
    }
}

/// A form with weight and friction.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Solid {
    /// Form.
    pub form: Form,
    /// kg/m³; 0 for something that only collides.
    pub density: f64,
    /// Friction coefficient against the ground.
    pub ground_friction: f64,
}

/// A rigid part.
#[derive(Debug, Clone, PartialEq)]
pub struct Body {
    /// As the recordings call it.
    pub name: &'static str,
    /// Index of the body that carries it; `None` for the root.
    pub parent: Option<usize>,
    /// Its origin in the parent's frame with all joints at 0, metres.
    pub position: Vec3,
    /// Its axes in the parent's frame with all joints at 0.
    pub rotation: Mat3,
    /// None for a part that is welded to its parent.
    pub joints: Vec<Joint>,
    /// What it is made of.
    pub solids: Vec<Solid>,
}

/// A linear combination of joint angles that is softly held at 0.
#[derive(Debug, Clone, PartialEq)]
pub struct Coupling {
    /// (degree of freedom, coefficient).
    pub terms: Vec<(usize, f64)>,
    /// How softly.
    pub softness: Softness,
}

/// What touching other things is like.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Touch {
    /// Of all contacts.
    pub contact: Softness,
    /// Of all joint stops.
    pub stop: Softness,
    /// Friction between the robot's own parts; `None` where they pass through each other.
    pub own_friction: Option<f64>,
}

/// What a robot is made of, before anything is derived from it.
#[derive(Debug, Clone, PartialEq)]
pub struct Parts {
    /// The root first, every parent before its children.
    pub bodies: Vec<Body>,
    /// Held combinations of joints.
    pub couplings: Vec<Coupling>,
    /// Contacts and stops.
    pub touch: Touch,
    /// Total weight to which all densities are scaled, kg.
    pub total_mass: Option<f64>,
    /// Seconds of one dynamics step.
    pub step_s: f64,
}

/// One degree of freedom.
#[derive(Debug, Clone, Copy)]
pub(super) struct Dof {
    pub(super) body: usize,
    pub(super) kind: DofKind,
    pub(super) joint: Joint,
    /// Where its coordinate is.
    pub(super) coordinate: usize,
}

#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) enum DofKind {
    FreeMove(usize),
    FreeTurn(usize),
    Slide,
    Hinge,
}

/// A solid and the body that it is on.
#[derive(Debug, Clone, Copy)]
pub(super) struct Piece {
    pub(super) body: usize,
    pub(super) solid: Solid,
    /// See [`Form::bounds`].
    pub(super) bounds: (Vec3, f64),
}

/// A robot with `N` degrees of freedom, ready to be simulated.
#[derive(Debug)]
pub struct Model<const N: usize> {
    pub(super) bodies: Vec<Body>,
    pub(super) couplings: Vec<Coupling>,
    pub(super) touch: Touch,
    pub(super) step_s: f64,
    pub(super) dofs: Vec<Dof>,
    /// Degrees of freedom of each body's own joints.
    pub(super) own_dofs: Vec<Range<usize>>,
    /// Bits of the degrees of freedom that move each body.
    pub(super) moved_by: Vec<u32>,
    pub(super) inertials: Vec<Inertial>,
    pub(super) pieces: Vec<Piece>,
    /// Pairs of pieces that may touch.
    pub(super) pairs: Vec<(usize, usize)>,
    /// Mobility of each body's centre of mass with all joints at 0: the mean over three axes of
    /// the speed that a unit impulse gives, 1/kg.
    pub(super) body_mobility: Vec<f64>,
    /// The same of each degree of freedom, 1/(kg m²) for hinges.
    pub(super) dof_mobility: [f64; N],
    /// The same of each coupling.
    pub(super) coupling_mobility: Vec<f64>,
    n_coordinates: usize,
}

impl<const N: usize> Model<N> {
    /// Derives everything that does not change from the parts.
    ///
    /// # Panics
    /// When the parts do not have `N` degrees of freedom: a robot is written wrongly.
    pub fn new(parts: Parts) -> Self {
        let (dofs, own_dofs, n_coordinates) = list_dofs(&parts.bodies);
        assert_eq!(dofs.len(), N, "a robot says wrongly how many ways it moves");
        let mut moved_by: Vec<u32> = Vec::new();
        for (body, own) in parts.bodies.iter().zip(&own_dofs) {
            let above = body.parent.map_or(0, |parent| moved_by[parent]);
            moved_by.push(own.clone().fold(above, |bits, dof| bits | 1 << dof));
        }
        let pieces = list_pieces(&parts.bodies);
        let pairs = if parts.touch.own_friction.is_some() {
            pairs_that_may_touch(&parts.bodies, &pieces)
        } else {
            Vec::new()
        };
        let mut model = Self {
            inertials: inertia::of_bodies(&parts.bodies, parts.total_mass),
            bodies: parts.bodies,
            couplings: parts.couplings,
            touch: parts.touch,
            step_s: parts.step_s,
            dofs,
            own_dofs,
            moved_by,
            pieces,
            pairs,
            body_mobility: Vec::new(),
            dof_mobility: [0.0; N],
            coupling_mobility: Vec::new(),
            n_coordinates,
        };
        model.find_mobilities();
        model
    }

    /// Numbers in a configuration.
    pub fn n_coordinates(&self) -> usize {
        self.n_coordinates
    }

    /// Index of the body of that name.
    ///
    /// # Panics
    /// When there is none: a robot is written wrongly.
    pub fn body(&self, name: &str) -> usize {
        let found = self.bodies.iter().position(|body| body.name == name);
        found.unwrap_or_else(|| panic!("this robot has no body {name:?}"))
    }

    /// Every body, in the order of all indices.
    pub fn bodies(&self) -> &[Body] {
        &self.bodies
    }

    /// Weight of the whole robot, kg.
    pub fn total_mass(&self) -> f64 {
        self.inertials.iter().map(|inertial| inertial.mass).sum()
    }

    /// All joints at 0, the root at its place.
    pub fn rest(&self) -> Vec<f64> {
        let mut q = vec![0.0; self.n_coordinates];
        if self.dofs[0].kind == DofKind::FreeMove(0) {
            q[..3].copy_from_slice(&self.bodies[0].position.to_array());
            q[3] = 1.0;
        }
        q
    }

    fn find_mobilities(&mut self) {
        let mut motion = Motion::<N>::default();
        motion.place(self, &self.rest());
        let mass = motion.mass_matrix(self);
        let factor = Cholesky::new(&mass).expect("a robot's inertia is positive");
        let mobility = |row: &[f64; N]| -> f64 {
            let solved = factor.solve(row);
            row.iter().zip(&solved).map(|(a, b)| a * b).sum()
        };
        self.body_mobility = (0..self.bodies.len())
            .map(|body| {
                let centre = motion.centre_of_mass(self, body);
                let along = |axis| mobility(&motion.point_row(self, body, centre, axis));
                (along(Vec3::X) + along(Vec3::Y) + along(Vec3::Z)) / 3.0
            })
            .collect();
        self.dof_mobility = std::array::from_fn(|dof| {
            let mut row = [0.0; N];
            row[dof] = 1.0;
            mobility(&row)
        });
        self.coupling_mobility = self
            .couplings
            .iter()
            .map(|coupling| mobility(&coupling.row()))
            .collect();
    }
}

impl Coupling {
    /// The coefficients as a row.
    pub(super) fn row<const N: usize>(&self) -> [f64; N] {
        let mut row = [0.0; N];
        for (dof, coefficient) in &self.terms {
            row[*dof] = *coefficient;
        }
        row
    }
}

fn list_dofs(bodies: &[Body]) -> (Vec<Dof>, Vec<Range<usize>>, usize) {
    let (mut dofs, mut own, mut coordinate) = (Vec::new(), Vec::new(), 0);
    for (index, body) in bodies.iter().enumerate() {
        let start = dofs.len();
        for joint in &body.joints {
            for k in 0..joint.n_dofs() {
                let kind = match joint.kind {
                    JointKind::Free if k < 3 => DofKind::FreeMove(k),
                    JointKind::Free => DofKind::FreeTurn(k - 3),
                    JointKind::Slide => DofKind::Slide,
                    JointKind::Hinge => DofKind::Hinge,
                };
                dofs.push(Dof {
                    body: index,
                    kind,
                    joint: *joint,
                    coordinate,
                });
            }
            coordinate += joint.n_coordinates();
        }
        own.push(start..dofs.len());
    }
    (dofs, own, coordinate)
}

fn list_pieces(bodies: &[Body]) -> Vec<Piece> {
    let pieces_of = |(index, body): (usize, &Body)| -> Vec<Piece> {
        let piece = |solid: &Solid| Piece {
            body: index,
            solid: *solid,
            bounds: solid.form.bounds(),
        };
        body.solids.iter().map(piece).collect()
    };
    bodies.iter().enumerate().flat_map(pieces_of).collect()
}

/// Pieces of one body, and of bodies that a joint connects, never touch; a welded body counts
/// as the one that carries it.
fn pairs_that_may_touch(bodies: &[Body], pieces: &[Piece]) -> Vec<(usize, usize)> {
    let carrier = |mut body: usize| {
        while let (true, Some(parent)) = (bodies[body].joints.is_empty(), bodies[body].parent) {
            body = parent;
        }
        body
    };
    let parent = |body: usize| bodies[body].parent.map(carrier);
    let mut pairs = Vec::new();
    for second in 0..pieces.len() {
        for first in 0..second {
            let (a, b) = (carrier(pieces[first].body), carrier(pieces[second].body));
            if a != b && parent(a) != Some(b) && parent(b) != Some(a) {
                pairs.push((first, second));
            }
        }
    }
    pairs
}
