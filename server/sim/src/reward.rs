//! The two helpers that MetaWorld's rewards are made of.
//!
//! Source: METAWORLD's `reward_utils` (`tolerance`, `hamacher_product`), which took the first
//! from DeepMind's control suite.

/// How `tolerance` falls off outside its bounds. Both give [`VALUE_AT_MARGIN`] at the margin.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Sigmoid {
    /// `0.1^(d²)`.
    Gaussian,
    /// `1 / (1 + 9 d²)`: still felt far away.
    LongTail,
}

/// What `tolerance` returns one margin outside its bounds.
pub const VALUE_AT_MARGIN: f64 = 0.1;

impl Sigmoid {
    /// The value `distance` margins outside the bounds, in (0, 1].
    pub fn value(self, distance: f64) -> f64 {
        match self {
            Self::Gaussian => VALUE_AT_MARGIN.powf(distance * distance),
            Self::LongTail => 1.0 / (1.0 + (1.0 / VALUE_AT_MARGIN - 1.0) * distance * distance),
        }
    }
}

/// 1 inside `bounds` (both ends included), falling to 0.1 one `margin` outside them.
///
/// A margin of 0 falls to 0 at once. `margin` has the unit of `x`.
///
/// ```
/// use sim::reward::{Sigmoid, tolerance};
/// assert!((tolerance(0.15, [0.0, 0.05], 0.2, Sigmoid::LongTail) - 0.307_692).abs() < 1e-6);
/// assert!((tolerance(0.15, [0.0, 0.05], 0.2, Sigmoid::Gaussian) - 0.562_341).abs() < 1e-6);
/// ```
///
/// # Panics
/// When the bounds are out of order or the margin is negative: a task is written wrongly.
pub fn tolerance(x: f64, bounds: [f64; 2], margin: f64, sigmoid: Sigmoid) -> f64 {
    let [lower, upper] = bounds;
    assert!(
        lower <= upper,
        "tolerance needs bounds in order, got {bounds:?}"
    );
    assert!(
        margin >= 0.0,
        "tolerance needs a margin of 0 or more, got {margin}"
    );
    if (lower..=upper).contains(&x) {
        return 1.0;
    }
    if margin == 0.0 {
        return 0.0;
    }
    let outside = if x < lower { lower - x } else { x - upper };
    sigmoid.value(outside / margin)
}

/// Fuzzy "and" of two values in [0, 1]: `a b / (a + b − a b)`, and 0 when both are 0.
///
/// `hamacher(1, b) = b`, `hamacher(0, b) = 0`; never above the smaller of the two.
///
/// ```
/// assert!((sim::reward::hamacher(0.5, 0.4) - 0.285_714).abs() < 1e-6);
/// ```
pub fn hamacher(a: f64, b: f64) -> f64 {
    let denominator = a + b - a * b;
    if denominator > 0.0 {
        a * b / denominator
    } else {
        0.0
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn close(a: f64, b: f64) -> bool {
        (a - b).abs() < 1e-6
    }

    #[test]
    fn tolerance_is_one_inside_and_a_tenth_at_the_margin() {
        for sigmoid in [Sigmoid::Gaussian, Sigmoid::LongTail] {
            for inside in [-1.0, 0.0, 2.0] {
                assert!(close(tolerance(inside, [-1.0, 2.0], 0.5, sigmoid), 1.0));
            }
            assert!(close(tolerance(2.5, [-1.0, 2.0], 0.5, sigmoid), 0.1));
            assert!(close(tolerance(-1.5, [-1.0, 2.0], 0.5, sigmoid), 0.1));
        }
    }

    #[test]
    fn no_margin_means_a_step() {
        assert!(close(
            tolerance(0.05, [0.0, 0.05], 0.0, Sigmoid::LongTail),
            1.0
        ));
        assert!(close(
            tolerance(0.051, [0.0, 0.05], 0.0, Sigmoid::LongTail),
            0.0
        ));
    }

    #[test]
    fn the_worked_examples_of_the_sweep_and_window_rewards_hold() {
        let near = tolerance(0.016_469, [0.0, 0.01], 0.069_460, Sigmoid::LongTail);
        assert!((near - 0.927_587).abs() < 2e-5, "{near}");
        let in_place = tolerance(0.126_969, [0.0, 0.05], 0.15, Sigmoid::LongTail);
        assert!((in_place - 0.296_761).abs() < 2e-5, "{in_place}");
        assert!((10.0 * hamacher(0.475_837, 0.296_761) - 2.236_496).abs() < 2e-5);
    }

    #[test]
    fn hamacher_is_symmetric_and_has_one_and_zero() {
        assert!(close(hamacher(0.3, 0.8), hamacher(0.8, 0.3)));
        assert!(close(hamacher(1.0, 0.37), 0.37));
        assert!(close(hamacher(0.0, 0.37), 0.0));
        assert!(close(hamacher(0.0, 0.0), 0.0));
    }
}
