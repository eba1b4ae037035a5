//! The paper's counts of comparisons, and what they count.

/// log₂ n!: the least comparisons that sort n things in the worst case, without rounding up.
///
/// ```
/// assert!((lab::experiment::query_counts::log2_factorial(5) - 120_f64.log2()).abs() < 1e-12);
/// ```
pub fn log2_factorial(n: usize) -> f64 {
    (2..=n).map(|k| (k as f64).log2()).sum()
}

/// Queries to learn the best policy by the paper's argument, worst case.
///
/// Ordering everything is more than a policy needs: (SA)!/(A!)^S global orders agree with given
/// orders within the stages, so that what has to be learned is worth `aligned` bits whatever is
/// asked. The difference bounds the cost of not choosing from above, not from below.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Counts {
    /// Each stage's actions sorted: S·log₂ A!.
    pub aligned: f64,
    /// All state-action pairs sorted, but for the order of stages: log₂ (SA)! − log₂ S!
    /// (Proposition 2).
    pub conventional: f64,
    /// Share of random pairs that lie within one stage: (A − 1)/(SA − 1).
    pub share_within: f64,
    /// Under a large stage reward bias only such pairs teach anything: `aligned / share_within`
    /// (Proposition 3).
    pub conventional_under_bias: f64,
}

impl Counts {
    /// What not choosing costs, by Proposition 2.
    pub fn extra(&self) -> f64 {
        self.conventional - self.aligned
    }

    /// What not choosing costs under a large stage reward bias, by Proposition 3.
    pub fn extra_under_bias(&self) -> f64 {
        self.conventional_under_bias - self.aligned
    }
}

/// The counts for `n_stages` stages with `n_actions` actions each, at least two.
///
/// Source: STAIR, Propositions 2 and 3 with their proofs. Differs from the paper: the algebra of
/// its proof of Proposition 2 writes e^S·A! where (A!)^S is meant; the numbers here are exact.
pub fn counts(n_stages: usize, n_actions: usize) -> Counts {
    let n_pairs = n_stages * n_actions;
    let aligned = n_stages as f64 * log2_factorial(n_actions);
    let share_within = (n_actions as f64 - 1.0) / (n_pairs as f64 - 1.0);
    Counts {
        aligned,
        conventional: log2_factorial(n_pairs) - log2_factorial(n_stages),
        share_within,
        conventional_under_bias: aligned / share_within,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn assert_printed(found: &[f64], printed: &[(f64, f64)]) {
        assert_eq!(found.len(), printed.len());
        for (found, (printed, unit)) in found.iter().zip(printed) {
            assert!(
                (found - printed).abs() <= unit / 2.0,
                "{found} for {printed}"
            );
        }
    }

    fn all(c: Counts) -> [f64; 6] {
        let (extra, extra_under_bias) = (c.extra(), c.extra_under_bias());
        let bias = c.conventional_under_bias;
        [
            c.aligned,
            c.conventional,
            extra,
            c.share_within,
            bias,
            extra_under_bias,
        ]
    }

    #[test]
    fn the_counts_have_the_printed_numbers() {
        let units = [0.1, 0.1, 0.1, 1e-4, 1.0, 1.0];
        let small = [69.1, 192.4, 123.3, 0.0816, 846.0, 777.0];
        let printed: Vec<_> = small.into_iter().zip(units).collect();
        assert_printed(&all(counts(10, 5)), &printed);
        let units = [0.1, 0.1, 0.1, 1e-5, 1.0, 1.0];
        // 86,163.5 under bias: printed one higher, from factors that were rounded before.
        let large = [690.7, 3_242.6, 2_551.9, 0.008_02, 86_163.5, 85_473.0];
        let printed: Vec<_> = large.into_iter().zip(units).collect();
        assert_printed(&all(counts(100, 5)), &printed);
        let wide = counts(20, 10);
        let found = [wide.aligned, wide.conventional, wide.extra()];
        assert_printed(&found, &[(435.8, 0.1), (1_184.3, 0.1), (748.5, 0.1)]);
        let found = [wide.conventional_under_bias, wide.extra_under_bias()];
        assert_printed(&found, &[(9_636.0, 1.0), (9_201.0, 1.0)]);
    }

    #[test]
    fn the_extra_grows_as_the_corrected_formula_says() {
        // S(A − 1)·log₂ S + O(S): doubling S adds 2S(A − 1) to twice as much.
        for n_stages in [200, 400, 800] {
            let (once, twice) = (counts(n_stages, 5), counts(2 * n_stages, 5));
            let gain = (twice.extra() - 2.0 * once.extra()) / (2 * n_stages * 4) as f64;
            assert!((gain - 1.0).abs() < 0.01, "{gain}");
        }
    }

    #[test]
    fn a_single_stage_has_nothing_to_align() {
        let only = counts(1, 6);
        assert!(only.extra().abs() < 1e-9 && only.extra_under_bias().abs() < 1e-9);
    }
}
