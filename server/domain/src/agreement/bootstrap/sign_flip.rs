//! Whether the differences of pairs lean to one side more than chance does.

use super::Bootstrap;
use crate::random::{Rng, Stream};

/// Up to so many pairs every flip is counted.
const MOST_COUNTED: usize = 16;
/// Flips that are drawn where there are more pairs.
const N_DRAWN: u32 = 65_536;

impl Bootstrap {
    /// How likely a mean of `first − second` at least as far from 0 is where it is chance which of
    /// a pair comes first, so that each difference could as well have the other sign. Two-sided;
    /// ties count as extreme. All 2ⁿ flips up to 16 pairs; beyond, 65,536 drawn ones, flip k from
    /// step k of the stream, and the observed one. Fewer than six pairs never give less than 0.05.
    ///
    /// `None` without pairs, or where a difference is no number.
    ///
    /// Source: Fisher (1935), The Design of Experiments, section 21: the randomisation test on
    /// paired differences; the observed flip beside drawn ones: Phipson and Smyth (2010).
    pub fn sign_flip_p(&self, pairs: &[(f64, f64)]) -> Option<f64> {
        let differences: Vec<f64> = pairs.iter().map(|(first, second)| first - second).collect();
        let furthest: f64 = differences.iter().map(|d| d.abs()).sum();
        if differences.is_empty() || !furthest.is_finite() {
            return None;
        }
        // Sums that differ by rounding alone are ties.
        let observed = differences.iter().sum::<f64>().abs() - 1e-12 * furthest;
        let is_extreme = |sum: f64| sum.abs() >= observed;
        if differences.len() <= MOST_COUNTED {
            let n_flips = 1_u32 << differences.len();
            let sums = (0..n_flips).map(|flips| flipped_sum(&differences, flips));
            let n_extreme = sums.filter(|sum| is_extreme(*sum)).count();
            return Some(n_extreme as f64 / f64::from(n_flips));
        }
        let sums = (0..N_DRAWN).map(|k| self.drawn_sum(&differences, k));
        let n_extreme = sums.filter(|sum| is_extreme(*sum)).count();
        Some((n_extreme + 1) as f64 / f64::from(N_DRAWN + 1))
    }

    /// The sum with the signs of the k-th draw.
    fn drawn_sum(&self, differences: &[f64], k: u32) -> f64 {
        let mut rng = Rng::new(self.seed, Stream::Bootstrap, u64::from(k));
        let parts = differences.chunks(32);
        parts.map(|part| flipped_sum(part, rng.next_u32())).sum()
    }
}

/// The sum with the n-th difference turned around where the n-th bit is set; at most 32.
fn flipped_sum(differences: &[f64], flips: u32) -> f64 {
    let turned = |(n, difference): (usize, &f64)| {
        let is_turned = (flips >> n) & 1 == 1;
        if is_turned { -difference } else { *difference }
    };
    differences.iter().enumerate().map(turned).sum()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn p(differences: &[f64]) -> Option<f64> {
        let pairs: Vec<(f64, f64)> = differences.iter().map(|d| (*d, 0.0)).collect();
        Bootstrap::default().sign_flip_p(&pairs)
    }

    fn assert_p(differences: &[f64], expected: f64) {
        let found = p(differences).unwrap();
        assert!((found - expected).abs() < 1e-12, "{found} for {expected}");
    }

    #[test]
    fn every_flip_of_a_few_pairs_is_counted() {
        // of ±1 ±2 ±3 only +6 and −6 are as far from 0
        assert_p(&[1.0, 2.0, 3.0], 2.0 / 8.0);
        // none or one of six turned: 1 + 6 flips, and as many on the other side
        assert_p(&[1.0, 1.0, 1.0, 1.0, 1.0, -1.0], 14.0 / 64.0);
        // the small one either way
        assert_p(&[0.25, 0.25, 0.25, 0.25, 0.25, -0.125], 4.0 / 64.0);
        assert_p(&[0.0; 4], 1.0);
    }

    #[test]
    fn six_pairs_of_one_sign_are_the_fewest_below_one_in_twenty() {
        assert_p(&[0.3; 5], 2.0 / 32.0);
        assert_p(&[0.3; 6], 2.0 / 64.0);
    }

    #[test]
    fn sums_that_rounding_tells_apart_are_ties() {
        // 0.5 − 0.7 + 0.4 + 0.3 is 0.5 + 0.7 − 0.4 − 0.3, which comes out a little smaller
        assert_p(&[0.5, -0.7, 0.4, 0.3], 12.0 / 16.0);
    }

    #[test]
    fn neither_the_side_nor_the_order_matters() {
        let differences = [0.3, -0.1, 0.7, 0.2, 0.9];
        let turned = differences.map(|d| -d);
        let mut back = differences;
        back.reverse();
        assert_eq!(p(&turned), p(&differences));
        assert_eq!(p(&back), p(&differences));
    }

    #[test]
    fn many_pairs_are_drawn_the_same_each_time() {
        let mut differences = [1.0; 20];
        differences[..5].fill(-1.0);
        // five or fewer of twenty on one side: 2 · 21,700 of 2²⁰
        let found = p(&differences).unwrap();
        assert!((found - 0.041_39).abs() < 0.003, "{found}");
        assert_eq!(p(&differences), Some(found));
        let far = p(&[1.0; 70]).unwrap();
        assert!(far > 0.0 && far < 1e-4, "{far}");
    }

    #[test]
    fn without_a_difference_one_case_in_twenty_at_most_is_called_one() {
        let is_called = |case: &u64| {
            let mut rng = Rng::new(*case, Stream::Test, 2);
            let pairs: Vec<(f64, f64)> = (0..8).map(|_| (rng.normal(), rng.normal())).collect();
            let p = Bootstrap::default().sign_flip_p(&pairs);
            p.is_some_and(|p| p < 0.05)
        };
        // below are those among the 12 furthest of 256 flips: about 47 of 1,000 cases
        let n_called = (0..1_000).filter(is_called).count();
        assert!((25..70).contains(&n_called), "{n_called}");
    }

    #[test]
    fn nothing_and_what_is_no_number_have_no_probability() {
        assert_eq!(p(&[]), None);
        assert_eq!(p(&[0.5, f64::NAN]), None);
        assert_eq!(p(&[0.5, f64::INFINITY]), None);
    }
}
