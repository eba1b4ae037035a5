//! How contacts, stops and couplings give way.
//!
//! A constraint violated by a depth d wants the acceleration `−b ḋ − k I(d) d` of a spring and
//! damper, `k = 1/(D T ζ)²`, `b = 2/(D T)`, and gets the mean of that and of the acceleration
//! without it, with the weights I and 1 − I. The impedance I(d) rises from `at_touch` to
//! D = `deep` over `width`.
//!
//! Source: the soft constraints of MuJoCo, as its documentation describes them
//! ("Computation", Todorov 2014).

/// Numbers of one kind of constraint.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Softness {
    /// T, seconds.
    pub time_constant: f64,
    /// ζ; 1 is critical.
    pub damping_ratio: f64,
    /// I where the violation begins.
    pub at_touch: f64,
    /// I from `width` on, D.
    pub deep: f64,
    /// Metres or radians.
    pub width: f64,
}

/// What a constraint wants at one moment.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Demand {
    /// Acceleration along the constraint.
    pub(super) acceleration: f64,
    /// (1 − I)/I: regularisation per unit of mobility.
    pub(super) compliance: f64,
}

impl Softness {
    /// * `position` – negative while violated (couplings: on either side of 0)
    /// * `velocity` – of `position`
    /// * `step_s` – the dynamics step; no time constant is shorter than two of them
    pub(super) fn demand(&self, position: f64, velocity: f64, step_s: f64) -> Demand {
        let time = self.time_constant.max(2.0 * step_s);
        let stiffness = 1.0 / (self.deep * time * self.damping_ratio).powi(2);
        let damping = 2.0 / (self.deep * time);
        let impedance = self.impedance(position.abs());
        Demand {
            acceleration: -damping * velocity - stiffness * impedance * position,
            compliance: (1.0 - impedance) / impedance,
        }
    }

    /// Two parabolas that meet in the middle of `width`; neither end is quite 0 or 1.
    fn impedance(&self, depth: f64) -> f64 {
        let x = (depth / self.width).min(1.0);
        let rise = if x <= 0.5 {
            2.0 * x * x
        } else {
            1.0 - 2.0 * (1.0 - x) * (1.0 - x)
        };
        let [at_touch, deep] = [self.at_touch, self.deep].map(|end| end.clamp(1e-4, 0.9999));
        at_touch + rise * (deep - at_touch)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const CONTACT: Softness = Softness {
        time_constant: 0.02,
        damping_ratio: 1.0,
        at_touch: 0.9,
        deep: 0.95,
        width: 0.001,
    };

    #[test]
    fn the_impedance_rises_smoothly_from_touch_to_deep() {
        let at = |depth| CONTACT.impedance(depth);
        assert!((at(0.0) - 0.9).abs() < 1e-12);
        assert!((at(0.0005) - 0.925).abs() < 1e-12);
        assert!((at(0.00025) - 0.90625).abs() < 1e-12);
        assert!((at(0.001) - 0.95).abs() < 1e-12);
        assert!((at(0.5) - 0.95).abs() < 1e-12);
    }

    /// A stop that is all soft where it begins: its impedance rises from the least there is, so
    /// that a shallow violation lies above that and not at it.
    #[test]
    fn the_ends_of_the_impedance_are_kept_from_0_and_1_before_it_rises() {
        let stop = Softness {
            at_touch: 0.0,
            deep: 1.0,
            ..CONTACT
        };
        assert!((stop.impedance(0.0) - 1e-4).abs() < 1e-15);
        assert!((stop.impedance(0.000_05) - (1e-4 + 0.005 * 0.9998)).abs() < 1e-12);
        assert!((stop.impedance(0.001) - 0.9999).abs() < 1e-12);
    }

    #[test]
    fn a_deep_contact_wants_a_critically_damped_way_out() {
        let demand = CONTACT.demand(-0.01, -2.0, 0.0025);
        let (w, depth) = (1.0 / (0.95 * 0.02), 0.01);
        assert!((demand.acceleration - (2.0 * w * 2.0 + w * w * 0.95 * depth)).abs() < 1e-9);
        assert!((demand.compliance - 0.05 / 0.95).abs() < 1e-12);
    }

    #[test]
    fn no_time_constant_is_shorter_than_two_steps() {
        let stiff = Softness {
            time_constant: 0.005,
            ..CONTACT
        };
        let slower = Softness {
            time_constant: 0.01,
            ..CONTACT
        };
        assert_eq!(
            stiff.demand(-0.1, 0.0, 0.005),
            slower.demand(-0.1, 0.0, 0.005)
        );
    }
}
