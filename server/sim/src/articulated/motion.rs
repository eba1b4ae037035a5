//! Where a robot's bodies are, how they move, and what moving them takes.
//!
//! All in world axes about one reference point, the root's origin: inertia matrix by composite
//! rigid bodies, bias forces by recursive Newton-Euler (Featherstone, Rigid Body Dynamics
//! Algorithms, 2008).

use super::inertia::SpatialInertia;
use super::model::{DofKind, Model};
use super::vector::{Mat3, Spatial, Vec3, normalized, vec3};

/// Metres per second squared.
pub const GRAVITY: f64 = 9.81;

/// Everything that follows from a configuration and its velocities. Scratch: [`Motion::place`]
/// and [`Motion::set_moving`] write it anew.
#[derive(Debug)]
pub struct Motion<const N: usize> {
    positions: Vec<Vec3>,
    rotations: Vec<Mat3>,
    inertias: Vec<SpatialInertia>,
    composites: Vec<SpatialInertia>,
    /// Motion of everything beyond a degree of freedom that moves at unit rate.
    axes: [Spatial; N],
    velocities: Vec<Spatial>,
    forces: Vec<Spatial>,
}

impl<const N: usize> Default for Motion<N> {
    fn default() -> Self {
        Self {
            positions: Vec::new(),
            rotations: Vec::new(),
            inertias: Vec::new(),
            composites: Vec::new(),
            axes: [Spatial::ZERO; N],
            velocities: Vec::new(),
            forces: Vec::new(),
        }
    }
}

impl<const N: usize> Motion<N> {
    /// Puts every body where the configuration `q` says.
    pub fn place(&mut self, model: &Model<N>, q: &[f64]) {
        self.positions.clear();
        self.rotations.clear();
        // Axes first as (direction, point), both in the world.
        for (body, own) in model.bodies.iter().zip(&model.own_dofs) {
            let (mut position, mut rotation) = match body.parent {
                None => (body.position, body.rotation),
                Some(parent) => (
                    self.positions[parent] + self.rotations[parent] * body.position,
                    self.rotations[parent] * body.rotation,
                ),
            };
            for index in own.clone() {
                let dof = &model.dofs[index];
                let (joint, at) = (&dof.joint, dof.coordinate);
                let (direction, point) = match dof.kind {
                    DofKind::FreeMove(k) => {
                        if k == 0 {
                            position = vec3(q[at], q[at + 1], q[at + 2]);
                            let turn = [q[at + 3], q[at + 4], q[at + 5], q[at + 6]];
                            rotation = Mat3::from_quaternion(normalized(turn));
                        }
                        (Mat3::IDENTITY.columns[k], position)
                    }
                    DofKind::FreeTurn(k) => (rotation.columns[k], position),
                    DofKind::Slide => {
                        let direction = rotation * joint.axis;
                        position += direction * q[at];
                        (direction, position)
                    }
                    DofKind::Hinge => {
                        let direction = rotation * joint.axis;
                        let point = position + rotation * joint.anchor;
                        rotation = rotation * Mat3::turn(joint.axis, q[at]);
                        position = point - rotation * joint.anchor;
                        (direction, point)
                    }
                };
                self.axes[index] = Spatial {
                    angular: direction,
                    linear: point,
                };
            }
            self.positions.push(position);
            self.rotations.push(rotation);
        }
        let origin = self.positions[0];
        for (axis, dof) in self.axes.iter_mut().zip(&model.dofs) {
            let (direction, point) = (axis.angular, axis.linear);
            *axis = match dof.kind {
                DofKind::FreeMove(_) | DofKind::Slide => Spatial {
                    angular: Vec3::ZERO,
                    linear: direction,
                },
                DofKind::FreeTurn(_) | DofKind::Hinge => Spatial {
                    angular: direction,
                    linear: (point - origin).cross(direction),
                },
            };
        }
        self.inertias.clear();
        for (body, inertial) in model.inertials.iter().enumerate() {
            let rotation = &self.rotations[body];
            let centre = self.positions[body] + *rotation * inertial.centre - origin;
            self.inertias
                .push(SpatialInertia::new(inertial, rotation, centre));
        }
    }

    /// Finds every body's velocity from the degrees of freedom's rates, `[N]`.
    pub fn set_moving(&mut self, model: &Model<N>, v: &[f64]) {
        self.velocities.clear();
        for (body, own) in model.bodies.iter().zip(&model.own_dofs) {
            let mut velocity = body.parent.map_or(Spatial::ZERO, |p| self.velocities[p]);
            for index in own.clone() {
                velocity += self.axes[index] * v[index];
            }
            self.velocities.push(velocity);
        }
    }

    /// Origin of a body, metres.
    pub fn position(&self, body: usize) -> Vec3 {
        self.positions[body]
    }

    /// Axes of a body.
    pub fn rotation(&self, body: usize) -> &Mat3 {
        &self.rotations[body]
    }

    /// Centre of mass of a body, metres.
    pub fn centre_of_mass(&self, model: &Model<N>, body: usize) -> Vec3 {
        self.positions[body] + self.rotations[body] * model.inertials[body].centre
    }

    /// Centre of mass of the whole robot, metres.
    pub fn whole_centre_of_mass(&self, model: &Model<N>) -> Vec3 {
        let weighted = |body| self.centre_of_mass(model, body) * model.inertials[body].mass;
        let moments = (0..model.bodies.len()).map(weighted);
        moments.fold(Vec3::ZERO, |a, b| a + b) * (1.0 / model.total_mass())
    }

    /// Velocity of the whole robot's centre of mass, m/s.
    pub fn whole_velocity(&self, model: &Model<N>) -> Vec3 {
        let momentum = |body: usize| self.inertias[body].apply(self.velocities[body]).linear;
        let momenta = (0..model.bodies.len()).map(momentum);
        momenta.fold(Vec3::ZERO, |a, b| a + b) * (1.0 / model.total_mass())
    }

    /// A body's motion about the root's origin.
    pub fn velocity(&self, body: usize) -> Spatial {
        self.velocities[body]
    }

    /// Velocity of a body's origin, m/s.
    pub fn origin_velocity(&self, body: usize) -> Vec3 {
        self.velocities[body].at(self.positions[body] - self.positions[0])
    }

    /// The joint-space inertia, rotors included.
    pub fn mass_matrix(&mut self, model: &Model<N>) -> [[f64; N]; N] {
        self.composites.clone_from(&self.inertias);
        for body in (1..model.bodies.len()).rev() {
            if let Some(parent) = model.bodies[body].parent {
                let carried = self.composites[body];
                self.composites[parent] += carried;
            }
        }
        let mut matrix = [[0.0; N]; N];
        for (row, dof) in model.dofs.iter().enumerate() {
            let momentum = self.composites[dof.body].apply(self.axes[row]);
            // This one and those before it that move the same body.
            let above = model.moved_by[dof.body] & ((1 << (row + 1)) - 1);
            for column in bits(above) {
                let entry = self.axes[column].dot(momentum);
                matrix[row][column] = entry;
                matrix[column][row] = entry;
            }
            matrix[row][row] += dof.joint.armature;
        }
        matrix
    }

    /// Forces that hold gravity, Coriolis and centrifugal forces in balance at the present
    /// velocities: what moving without acceleration takes.
    pub fn bias_forces(&mut self, model: &Model<N>, v: &[f64]) -> [f64; N] {
        self.forces_for(model, v, &[0.0; N])
    }

    /// Forces in the joints for rates `v` and accelerations `a` under gravity, rotors left out.
    pub fn forces_for(&mut self, model: &Model<N>, v: &[f64], a: &[f64]) -> [f64; N] {
        self.accelerate(model, v, a);
        // What was an acceleration becomes the force that it takes.
        for body in 0..model.bodies.len() {
            let (inertia, velocity) = (&self.inertias[body], self.velocities[body]);
            let momentum = inertia.apply(velocity);
            self.forces[body] = inertia.apply(self.forces[body]) + velocity.cross_force(momentum);
        }
        for body in (1..model.bodies.len()).rev() {
            if let Some(parent) = model.bodies[body].parent {
                let carried = self.forces[body];
                self.forces[parent] += carried;
            }
        }
        std::array::from_fn(|dof| self.axes[dof].dot(self.forces[model.dofs[dof].body]))
    }

    /// What an accelerometer at the origin of `body` would read, in world axes, m/s²: 9.81
    /// upwards at rest, nothing in free fall. Beside it the angular acceleration, rad/s².
    pub fn felt_acceleration(
        &mut self,
        model: &Model<N>,
        v: &[f64],
        a: &[f64],
        body: usize,
    ) -> (Vec3, Vec3) {
        self.accelerate(model, v, a);
        let arm = self.positions[body] - self.positions[0];
        let turning = self.velocities[body]
            .angular
            .cross(self.origin_velocity(body));
        (
            self.forces[body].at(arm) + turning,
            self.forces[body].angular,
        )
    }

    /// Leaves every body's acceleration, seen by someone who falls freely, in `forces`.
    fn accelerate(&mut self, model: &Model<N>, v: &[f64], a: &[f64]) {
        self.forces.clear();
        for (body, own) in model.bodies.iter().zip(&model.own_dofs) {
            let (mut velocity, mut acceleration) = match body.parent {
                Some(parent) => (self.velocities[parent], self.forces[parent]),
                None => (
                    Spatial::ZERO,
                    Spatial {
                        angular: Vec3::ZERO,
                        linear: Vec3::Z * GRAVITY,
                    },
                ),
            };
            let mut before_turning = velocity;
            for index in own.clone() {
                let (kind, moving) = (model.dofs[index].kind, self.axes[index] * v[index]);
                match kind {
                    // World axes do not turn with anything.
                    DofKind::FreeMove(_) => before_turning += moving,
                    // The body's own axes turn with it; their turns among each other cancel.
                    DofKind::FreeTurn(_) => acceleration += before_turning.cross_motion(moving),
                    DofKind::Slide | DofKind::Hinge => {
                        acceleration += velocity.cross_motion(moving);
                    }
                }
                velocity += moving;
                acceleration += self.axes[index] * a[index];
            }
            self.forces.push(acceleration);
        }
    }

    /// How fast `body`'s point at `point` moves along `direction` per unit rate of each degree
    /// of freedom.
    pub fn point_row(
        &self,
        model: &Model<N>,
        body: usize,
        point: Vec3,
        direction: Vec3,
    ) -> [f64; N] {
        let wrench = self.wrench(point, direction);
        let mut row = [0.0; N];
        for dof in bits(model.moved_by[body]) {
            row[dof] = self.axes[dof].dot(wrench);
        }
        row
    }

    /// How fast two bodies part at `point` along `direction`, per unit rate of each degree of
    /// freedom: velocity of `second` less that of `first`, which is the ground if `None`.
    pub(super) fn parting_row(
        &self,
        model: &Model<N>,
        (first, second): (Option<usize>, usize),
        point: Vec3,
        direction: Vec3,
    ) -> [f64; N] {
        let wrench = self.wrench(point, direction);
        let mut row = [0.0; N];
        let moved_by_second = model.moved_by[second];
        let moved_by_first = first.map_or(0, |body| model.moved_by[body]);
        for dof in bits(moved_by_second & !moved_by_first) {
            row[dof] = self.axes[dof].dot(wrench);
        }
        for dof in bits(moved_by_first & !moved_by_second) {
            row[dof] = -self.axes[dof].dot(wrench);
        }
        row
    }

    fn wrench(&self, point: Vec3, direction: Vec3) -> Spatial {
        Spatial {
            angular: (point - self.positions[0]).cross(direction),
            linear: direction,
        }
    }
}

/// The places of the ones in `mask`, in order.
fn bits(mut mask: u32) -> impl Iterator<Item = usize> {
    std::iter::from_fn(move || {
        let next = (mask != 0).then(|| mask.trailing_zeros() as usize)?;
        mask &= mask - 1;
        Some(next)
    })
}
