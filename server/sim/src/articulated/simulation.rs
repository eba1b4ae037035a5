//! Steps a robot through time.

use serde::{Deserialize, Serialize};

use super::collision::Collider;
use super::model::{DofKind, Model};
use super::motion::Motion;
use super::softness::Softness;
use super::solver::{Cholesky, Row, Solver, times};
use super::vector::{Vec3, turned};

/// A robot in motion with `N` degrees of freedom: what changes, and the scratch to change it.
#[derive(Debug, Serialize, Deserialize)]
pub struct Simulation<const N: usize> {
    /// Configuration; see [`JointKind`](super::model::JointKind) for a free root's seven numbers.
    pub q: Vec<f64>,
    /// Rates of the degrees of freedom, `[N]`.
    pub v: Vec<f64>,
    /// Accelerations of the last step, where the next search for them starts. `[N]`
    guess: Vec<f64>,
    #[serde(skip, default)]
    scratch: Scratch<N>,
}

#[derive(Debug)]
struct Scratch<const N: usize> {
    motion: Motion<N>,
    collider: Collider,
    solver: Solver,
    rows: Vec<Row<N>>,
    /// Of each contact: where its rows begin, and the two directions of its friction.
    frictions: Vec<(usize, [Vec3; 2])>,
    accelerations: [f64; N],
}

impl<const N: usize> Default for Scratch<N> {
    fn default() -> Self {
        Self {
            motion: Motion::default(),
            collider: Collider::default(),
            solver: Solver::default(),
            rows: Vec::new(),
            frictions: Vec::new(),
            accelerations: [0.0; N],
        }
    }
}

/// What the ground or another body does to a body.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ContactForce {
    /// Where, metres.
    pub point: Vec3,
    /// Newtons, world axes.
    pub force: Vec3,
}

impl<const N: usize> Simulation<N> {
    /// At rest in the configuration `q`.
    pub fn new(q: Vec<f64>) -> Self {
        Self {
            q,
            v: vec![0.0; N],
            guess: vec![0.0; N],
            scratch: Scratch::default(),
        }
    }

    /// Where everything is and how it moves now.
    pub fn motion(&mut self, model: &Model<N>) -> &Motion<N> {
        self.scratch.motion.place(model, &self.q);
        self.scratch.motion.set_moving(model, &self.v);
        &self.scratch.motion
    }

    /// Whether the robot touches the ground or itself.
    pub fn touches_anything(&mut self, model: &Model<N>) -> bool {
        let Scratch {
            motion, collider, ..
        } = &mut self.scratch;
        motion.place(model, &self.q);
        collider.find(model, motion);
        !collider.contacts.is_empty()
    }

    /// Whether all of the state are numbers.
    pub fn is_finite(&self) -> bool {
        self.q.iter().chain(&self.v).all(|x| x.is_finite())
    }

    /// Advances by [`Parts::step_s`](super::model::Parts::step_s): velocities first, then the
    /// configuration with the new velocities; joint damping is implicit.
    ///
    /// * `applied` – forces and torques of motors along the degrees of freedom
    pub fn step(&mut self, model: &Model<N>, applied: &[f64; N]) {
        let Scratch {
            motion,
            collider,
            solver,
            rows,
            frictions,
            accelerations,
        } = &mut self.scratch;
        motion.place(model, &self.q);
        motion.set_moving(model, &self.v);
        collider.find(model, motion);
        let mass = motion.mass_matrix(model);
        let bias = motion.bias_forces(model, &self.v);
        let push = std::array::from_fn(|dof| {
            let joint = &model.dofs[dof].joint;
            let spring = joint.stiffness * self.q[model.dofs[dof].coordinate];
            applied[dof] - bias[dof] - joint.damping * self.v[dof] - spring
        });
        let Some(factor) = Cholesky::new(&mass) else {
            self.v.fill(f64::NAN);
            return;
        };
        let free = factor.solve(&push);
        gather(model, &self.q, &self.v, motion, collider, rows, frictions);
        let guess = std::array::from_fn(|dof| self.guess[dof]);
        *accelerations = solver.solve(&mass, &free, &guess, rows);
        self.guess.copy_from_slice(accelerations);
        let damped = damped(model, &mass, accelerations);
        for (v, a) in self.v.iter_mut().zip(&damped) {
            *v += model.step_s * a;
        }
        advance(model, &mut self.q, &self.v);
    }

    /// The accelerations of the last step, along the degrees of freedom.
    pub fn accelerations(&self) -> &[f64; N] {
        &self.scratch.accelerations
    }

    /// What was the case when the last step began: poses and velocities.
    pub fn last_motion(&mut self) -> &mut Motion<N> {
        &mut self.scratch.motion
    }

    /// The forces of the last step on `body`, one per contact.
    pub fn forces_on(&self, body: usize) -> impl Iterator<Item = ContactForce> + '_ {
        let Scratch {
            collider,
            rows,
            frictions,
            accelerations,
            ..
        } = &self.scratch;
        let contacts = collider.contacts.iter().zip(frictions);
        contacts.filter_map(move |(contact, (start, directions))| {
            let sign = if contact.second == body {
                1.0
            } else if contact.first == Some(body) {
                -1.0
            } else {
                return None;
            };
            let force = |index: usize| rows[index].force(accelerations);
            let total = if contact.friction == 0.0 {
                contact.normal * force(*start)
            } else {
                let edges: [f64; 4] = std::array::from_fn(|k| force(start + k));
                contact.normal * edges.iter().sum::<f64>()
                    + directions[0] * (contact.friction * (edges[0] - edges[1]))
                    + directions[1] * (contact.friction * (edges[2] - edges[3]))
            };
            Some(ContactForce {
                point: contact.point,
                force: total * sign,
            })
        })
    }
}

/// Accelerations under damping that acts on the new velocities: `(M + h D) a' = M a`.
fn damped<const N: usize>(
    model: &Model<N>,
    mass: &[[f64; N]; N],
    accelerations: &[f64; N],
) -> [f64; N] {
    let mut slowed = *mass;
    for (dof, row) in slowed.iter_mut().enumerate() {
        row[dof] += model.step_s * model.dofs[dof].joint.damping;
    }
    let forces = times(mass, accelerations);
    Cholesky::new(&slowed).map_or([f64::NAN; N], |factor| factor.solve(&forces))
}

fn advance<const N: usize>(model: &Model<N>, q: &mut [f64], v: &[f64]) {
    let h = model.step_s;
    for (index, dof) in model.dofs.iter().enumerate() {
        let at = dof.coordinate;
        match dof.kind {
            DofKind::FreeMove(k) => q[at + k] += h * v[index],
            DofKind::FreeTurn(0) => {
                let turn = Vec3::from([v[index], v[index + 1], v[index + 2]]) * h;
                let now = [q[at + 3], q[at + 4], q[at + 5], q[at + 6]];
                q[at + 3..at + 7].copy_from_slice(&turned(now, turn));
            }
            DofKind::FreeTurn(_) => {}
            DofKind::Slide | DofKind::Hinge => q[at] += h * v[index],
        }
    }
}

/// Everything that constrains the accelerations at this moment.
fn gather<const N: usize>(
    model: &Model<N>,
    q: &[f64],
    v: &[f64],
    motion: &Motion<N>,
    collider: &Collider,
    rows: &mut Vec<Row<N>>,
    frictions: &mut Vec<(usize, [Vec3; 2])>,
) {
    rows.clear();
    frictions.clear();
    let rate = |jacobian: &[f64; N]| jacobian.iter().zip(v).map(|(j, v)| j * v).sum::<f64>();
    let demand =
        |softness: &Softness, position, velocity| softness.demand(position, velocity, model.step_s);
    for contact in &collider.contacts {
        let bodies = (contact.first, contact.second);
        let along = |direction| motion.parting_row(model, bodies, contact.point, direction);
        let mobility = model.body_mobility[contact.second]
            + contact.first.map_or(0.0, |body| model.body_mobility[body]);
        let normal = along(contact.normal);
        let softness = &model.touch.contact;
        let directions = tangents(contact.normal, contact.grain);
        frictions.push((rows.len(), directions));
        let mut push = |jacobian: [f64; N], resistance: f64| {
            let demand = demand(softness, -contact.depth, rate(&jacobian));
            rows.push(Row {
                jacobian,
                reference: demand.acceleration,
                weight: 1.0 / (demand.compliance * resistance),
                is_one_sided: true,
            });
        };
        let mu = contact.friction;
        if mu == 0.0 {
            push(normal, mobility);
            continue;
        }
        // A pyramid of four edges: pushes along normal ± mu · tangent, none of them negative.
        let resistance = 2.0 * mu * mu * (1.0 + mu * mu) * mobility;
        for tangent in directions.map(along) {
            push(
                std::array::from_fn(|i| normal[i] + mu * tangent[i]),
                resistance,
            );
            push(
                std::array::from_fn(|i| normal[i] - mu * tangent[i]),
                resistance,
            );
        }
    }
    for (index, dof) in model.dofs.iter().enumerate() {
        let Some([low, high]) = dof.joint.range else {
            continue;
        };
        let angle = q[dof.coordinate];
        for (room, sign) in [(angle - low, 1.0), (high - angle, -1.0)] {
            if room < 0.0 {
                let demand = demand(&model.touch.stop, room, sign * v[index]);
                let mut jacobian = [0.0; N];
                jacobian[index] = sign;
                rows.push(Row {
                    jacobian,
                    reference: demand.acceleration,
                    weight: 1.0 / (demand.compliance * model.dof_mobility[index]),
                    is_one_sided: true,
                });
            }
        }
    }
    for (coupling, mobility) in model.couplings.iter().zip(&model.coupling_mobility) {
        let jacobian = coupling.row();
        let angles = coupling
            .terms
            .iter()
            .map(|(dof, coefficient)| coefficient * q[model.dofs[*dof].coordinate]);
        let demand = demand(&coupling.softness, angles.sum(), rate(&jacobian));
        rows.push(Row {
            jacobian,
            reference: demand.acceleration,
            weight: 1.0 / (demand.compliance * mobility),
            is_one_sided: false,
        });
    }
}

/// Two unit vectors at right angles to the normal and to each other, the first along the grain.
fn tangents(normal: Vec3, grain: Vec3) -> [Vec3; 2] {
    let along = |direction: Vec3| {
        let across = direction - normal * normal.dot(direction);
        let length = across.length();
        (length > 1e-6 * direction.length()).then(|| across * (1.0 / length))
    };
    // At least one of the axes is far from the normal.
    let first = along(grain)
        .or_else(|| along(Vec3::X))
        .or_else(|| along(Vec3::Y));
    let first = first.unwrap_or(Vec3::X);
    [first, normal.cross(first)]
}
