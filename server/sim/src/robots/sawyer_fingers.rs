//! The gripper's two fingers: heavy, slow slides that follow the gripper command.
//!
//! Source: METAWORLD.md 1.6. A finger is a mass of 100 kg (mostly the motor's armature) on a
//! damper of 1000 N·s/m, pulled by a spring of 400 N/m towards the command; its stops are
//! MuJoCo's soft constraints.

use serde::{Deserialize, Serialize};

const MASS_KG: f64 = 100.0;
const DAMPING: f64 = 1000.0;
const SPRING: f64 = 400.0;
const SUBSTEP_S: f64 = 0.0025;
const SUBSTEPS: usize = 5;

/// Where the right finger may slide, metres along y from its mounting at −0.05.
const RIGHT_STOPS: [f64; 2] = [0.0, 0.04];
/// Where the left finger may slide, metres along y from its mounting at +0.05.
const LEFT_STOPS: [f64; 2] = [-0.03, 0.0];

/// One finger slide.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
struct Slide {
    /// Metres along y.
    position: f64,
    /// Metres per second.
    velocity: f64,
}

/// Both fingers; [`Fingers::right`] and [`Fingers::left`] are what observations and pictures use.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct Fingers {
    right: Slide,
    left: Slide,
}

impl Fingers {
    /// At rest against the open stops, which the springs overrun by 0.17 mm.
    pub fn open() -> Self {
        let at = |position| Slide {
            position,
            velocity: 0.0,
        };
        Self {
            right: at(-0.000_172),
            left: at(0.000_172),
        }
    }

    /// Slide of the right finger along y, metres; 0 open, 0.04 closed.
    pub fn right(&self) -> f64 {
        self.right.position
    }

    /// Slide of the left finger along y, metres; 0 open, −0.03 closed.
    pub fn left(&self) -> f64 {
        self.left.position
    }

    /// One control step under `command` in [−1, 1]: +1 closes, −1 opens, 0 lets them stay.
    /// `forces` push the right and the left finger along +y, newtons.
    pub fn advance(&mut self, command: f64, forces: [f64; 2]) {
        let [right, left] = forces;
        for _ in 0..SUBSTEPS {
            self.right.advance(command, right, RIGHT_STOPS);
            self.left.advance(-command, left, LEFT_STOPS);
        }
    }
}

impl Slide {
    fn advance(&mut self, command: f64, force: f64, stops: [f64; 2]) {
        // Damping implicitly, as MuJoCo's integrator does.
        let mass_kg = MASS_KG + SUBSTEP_S * DAMPING;
        let spring = SPRING * (command - self.position);
        let free = (spring + force - DAMPING * self.velocity) / mass_kg;
        let beyond = self.position - self.position.clamp(stops[0], stops[1]);
        let acceleration = if beyond == 0.0 {
            free
        } else {
            soft_stop(free, beyond, self.velocity)
        };
        self.velocity += SUBSTEP_S * acceleration;
        self.position += SUBSTEP_S * self.velocity;
    }
}

/// MuJoCo's soft limit: a blend of the free acceleration and that of a critically damped
/// spring with a time constant of 0.02 s; it may only push back.
fn soft_stop(free: f64, beyond: f64, velocity: f64) -> f64 {
    const STRONGEST: f64 = 0.95;
    const WEAKEST: f64 = 0.9;
    const WIDTH_M: f64 = 0.001;
    const TIME_CONSTANT_S: f64 = 0.02;
    let depth = (beyond.abs() / WIDTH_M).min(1.0);
    // MuJoCo's smooth step from the weakest to the strongest impedance.
    let ramp = if depth < 0.5 {
        2.0 * depth * depth
    } else {
        1.0 - 2.0 * (1.0 - depth) * (1.0 - depth)
    };
    let impedance = WEAKEST + (STRONGEST - WEAKEST) * ramp;
    let rate = 1.0 / (STRONGEST * TIME_CONSTANT_S);
    let reference = -2.0 * rate * velocity - rate * rate * beyond;
    let pushes_back = (reference - free) * beyond < 0.0;
    if pushes_back {
        free + impedance * (reference - free)
    } else {
        free
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn openness_after_each_step(fingers: &mut Fingers, command: f64, n_steps: usize) -> Vec<f64> {
        (0..n_steps)
            .map(|_| {
                fingers.advance(command, [0.0; 2]);
                ((0.1 + fingers.left() - fingers.right()) / 0.1).clamp(0.0, 1.0)
            })
            .collect()
    }

    fn largest_gap(measured: &[f64], reference: &[f64]) -> f64 {
        let gaps = measured.iter().zip(reference).map(|(a, b)| (a - b).abs());
        gaps.fold(0.0, f64::max)
    }

    /// METAWORLD.md 1.6.
    const CLOSING: [f64; 20] = [
        0.999, 0.983, 0.957, 0.923, 0.881, 0.833, 0.778, 0.719, 0.655, 0.587, 0.515, 0.441, 0.369,
        0.322, 0.284, 0.264, 0.267, 0.275, 0.282, 0.287,
    ];
    const OPENING: [f64; 15] = [
        0.296, 0.316, 0.346, 0.384, 0.430, 0.482, 0.541, 0.604, 0.672, 0.743, 0.819, 0.897, 0.966,
        1.0, 1.0,
    ];

    #[test]
    fn fingers_close_and_open_along_the_recorded_curves() {
        let mut fingers = Fingers::open();
        let closing = openness_after_each_step(&mut fingers, 1.0, 20);
        let gap = largest_gap(&closing, &CLOSING);
        assert!(gap < 0.02, "closing is off by {gap}: {closing:.3?}");

        openness_after_each_step(&mut fingers, 1.0, 60);
        let opening = openness_after_each_step(&mut fingers, -1.0, 15);
        let gap = largest_gap(&opening, &OPENING);
        assert!(gap < 0.02, "opening is off by {gap}: {opening:.3?}");
    }

    #[test]
    fn closed_fingers_rest_at_the_recorded_openness() {
        let mut fingers = Fingers::open();
        let rest = openness_after_each_step(&mut fingers, 1.0, 200);
        assert!((rest[199] - 0.2967).abs() < 0.001, "{}", rest[199]);
    }

    #[test]
    fn half_a_command_closes_at_half_the_pace() {
        let mut fingers = Fingers::open();
        let closing = openness_after_each_step(&mut fingers, 0.5, 25);
        assert!((closing[16] - 0.52).abs() < 0.02, "{}", closing[16]);
        assert!((closing[24] - 0.285).abs() < 0.02, "{}", closing[24]);
    }
}
