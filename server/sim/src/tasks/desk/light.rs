//! The light over a button: 10 g on a rail of its own that a soft tie holds to the button's cap.
//!
//! Its axis points down, so its weight pulls towards +q, onto its upper stop at 0; the tie lifts
//! it when the cap goes down. Tie and stops are MuJoCo's soft constraints, here for one mass
//! whose cap is given: each has a reference acceleration `−b v − k d(r) r` and realises the share
//! `d(r)` of it, where `d` grows from 0.9 to 0.95 over the first millimetre.
//! Source: DMCONTROL_ROBODESK.md 1 and 5.4; DYNAMICS R6.

use serde::{Deserialize, Serialize};

/// A light is on below this position, metres.
pub const ON_BELOW_M: f64 = -0.004_53;
/// How far the light stays above the cap by its weight once it has left its stop, metres.
pub const HANG_M: f64 = 0.000_564;

const MASS: f64 = 0.01;
const GRAVITY: f64 = 9.81;
/// Lower and upper stop.
const RANGE: [f64; 2] = [-0.005, 0.0];
/// Time constant and damping ratio of tie and stops.
const TIME_S: f64 = 0.02;
const RATIO: f64 = 1.0;
/// Share of the reference acceleration that is realised at no and at full violation.
const SHARE: [f64; 2] = [0.9, 0.95];
/// Violation from which the share is full, metres.
const WIDTH_M: f64 = 0.001;
const SUBSTEP_S: f64 = 0.002;

/// One light on its rail.
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize, Deserialize)]
pub struct Light {
    /// Along its rail, in about [−0.005, 0]; metres.
    pub position: f64,
    /// Metres per second.
    velocity: f64,
}

/// A soft constraint on the light: pushes its violation `r` (a tie: either sign; a stop: only
/// while positive) to zero.
struct Soft {
    /// +1 where a larger position makes `r` larger, else −1.
    sign: f64,
    reference: f64,
    /// Acceleration per newton that the constraint leaves to others.
    slack: f64,
}

impl Soft {
    /// `violation` and its `rate` along `sign`; `inverse_mass` of all that the constraint moves.
    fn new(sign: f64, violation: f64, rate: f64, inverse_mass: f64) -> Self {
        let [least, full] = SHARE;
        let x = (violation.abs() / WIDTH_M).min(1.0);
        let rise = if x < 0.5 {
            2.0 * x * x
        } else {
            1.0 - 2.0 * (1.0 - x) * (1.0 - x)
        };
        let share = least + (full - least) * rise;
        let stiffness = 1.0 / (full * full * TIME_S * TIME_S * RATIO * RATIO);
        let damping = 2.0 / (full * TIME_S);
        Self {
            sign,
            reference: -damping * rate - stiffness * share * violation,
            slack: (1.0 - share) / share * inverse_mass,
        }
    }

    /// The force along `sign` that goes with an acceleration of the light.
    fn force(&self, acceleration: f64) -> f64 {
        (self.reference - self.sign * acceleration) / self.slack
    }
}

/// How a cap went during a step, between two positions and two velocities.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct CapPath {
    /// Position and velocity before the step, m and m/s.
    pub from: [f64; 2],
    /// The same after it.
    pub to: [f64; 2],
    /// Length of the step, seconds.
    pub step_s: f64,
}

impl CapPath {
    /// Position, velocity and acceleration at a share of the step: the cubic through both ends.
    fn at(&self, share: f64) -> [f64; 3] {
        let [start, v0] = [self.from[0], self.from[1] * self.step_s];
        let [end, v1] = [self.to[0], self.to[1] * self.step_s];
        let (square, cube) = (
            3.0 * (end - start) - 2.0 * v0 - v1,
            2.0 * (start - end) + v0 + v1,
        );
        let s = share;
        [
            start + s * (v0 + s * (square + s * cube)),
            (v0 + s * (2.0 * square + 3.0 * s * cube)) / self.step_s,
            (2.0 * square + 6.0 * s * cube) / (self.step_s * self.step_s),
        ]
    }
}

impl Light {
    /// A light at rest.
    pub fn at(position: f64) -> Self {
        Self {
            position,
            velocity: 0.0,
        }
    }

    /// Moves the light through a step in which its cap went along `cap`.
    pub fn follow(&mut self, cap: &CapPath) {
        let n_substeps = (cap.step_s / SUBSTEP_S).round().max(1.0);
        let dt = cap.step_s / n_substeps;
        for substep in 0..n_substeps as u32 {
            let now = cap.at(f64::from(substep) / n_substeps);
            self.velocity += dt * self.acceleration(now);
            self.position += dt * self.velocity;
        }
    }

    fn acceleration(&self, [cap, cap_velocity, cap_acceleration]: [f64; 3]) -> f64 {
        let mut tie = Soft::new(
            1.0,
            self.position - cap,
            self.velocity - cap_velocity,
            2.0 / MASS,
        );
        tie.reference += cap_acceleration;
        let stop = if self.position < RANGE[0] {
            Soft::new(-1.0, RANGE[0] - self.position, -self.velocity, 1.0 / MASS)
        } else if self.position > RANGE[1] {
            Soft::new(1.0, self.position - RANGE[1], self.velocity, 1.0 / MASS)
        } else {
            return balance(&[&tie]);
        };
        let with_stop = balance(&[&tie, &stop]);
        // A stop pushes, it never pulls.
        if stop.force(with_stop) < 0.0 {
            with_stop
        } else {
            balance(&[&tie])
        }
    }
}

/// The acceleration at which weight and constraint forces agree with each other.
fn balance(constraints: &[&Soft]) -> f64 {
    let (mut force, mut inertia) = (MASS * GRAVITY, MASS);
    for constraint in constraints {
        force += constraint.sign * constraint.reference / constraint.slack;
        inertia += 1.0 / constraint.slack;
    }
    force / inertia
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Where a light comes to rest over a cap that stays at `cap`.
    fn rest(cap: f64) -> f64 {
        let mut light = Light::default();
        for _ in 0..100 {
            light.follow(&CapPath {
                from: [cap, 0.0],
                to: [cap, 0.0],
                step_s: 0.02,
            });
        }
        light.position
    }

    /// DYNAMICS R6: button and light at the end of a constant push.
    #[test]
    fn a_light_rests_where_the_original_has_it_for_each_depth_of_the_cap() {
        for (cap, light) in [
            (-0.000_524, 0.000_023),
            (-0.001, -0.000_436),
            (-0.004, -0.003_436),
            (-0.005, -0.004_436),
            (-0.005_094, -0.004_53),
            (-0.005_203, -0.004_639),
            (-0.005_847, -0.005_169),
            (-0.006_546, -0.005_507),
            (-0.010_796, -0.006_801),
        ] {
            let is = rest(cap);
            assert!((is - light).abs() < 2e-5, "cap {cap}: {is}, not {light}");
        }
    }

    #[test]
    fn a_light_hangs_above_its_cap_by_the_length_that_the_cap_is_built_for() {
        assert!((rest(-0.003) - -0.003 - HANG_M).abs() < 2e-6);
    }
}
