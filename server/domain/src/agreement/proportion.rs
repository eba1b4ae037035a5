//! Shares of yes, and how they differ between two groups.

use super::interval::{Estimate, Interval};
use super::special::{beta_cdf, beta_quantile, ln_choose, normal_z};

/// How many of how many said yes.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Share {
    /// Yes.
    pub n_yes: u64,
    /// Asked.
    pub n: u64,
}

impl Share {
    /// The yes among answers.
    pub fn of(answers: impl IntoIterator<Item = bool>) -> Self {
        let none = Self { n_yes: 0, n: 0 };
        answers.into_iter().fold(none, |share, yes| Self {
            n_yes: share.n_yes + u64::from(yes),
            n: share.n + 1,
        })
    }

    /// The share with Wilson's score interval; `None` when nobody was asked or the counts
    /// contradict each other.
    ///
    /// Source: Wilson (1927), without continuity correction.
    ///
    /// ```
    /// use domain::agreement::Share;
    /// let found = Share { n_yes: 81, n: 263 }.wilson(0.95).unwrap();
    /// assert_eq!(format!("{:.4} {:.4}", found.interval.lo, found.interval.hi), "0.2553 0.3662");
    /// ```
    pub fn wilson(self, level: f64) -> Option<Estimate> {
        let (p, n) = (self.value()?, self.n as f64);
        let z2 = normal_z(level).powi(2);
        let centre = (p + z2 / (2.0 * n)) / (1.0 + z2 / n);
        let half = (z2 * (p * (1.0 - p) / n + z2 / (4.0 * n * n))).sqrt() / (1.0 + z2 / n);
        Some(Estimate {
            value: p,
            interval: Interval {
                lo: if self.n_yes == 0 { 0.0 } else { centre - half },
                hi: if self.n_yes == self.n {
                    1.0
                } else {
                    centre + half
                },
            },
        })
    }

    /// The share with the exact interval of Clopper and Pearson, which holds the truth at least
    /// as often as `level` says; `None` as for [`Share::wilson`].
    ///
    /// Source: Clopper and Pearson (1934), by quantiles of beta distributions.
    pub fn clopper_pearson(self, level: f64) -> Option<Estimate> {
        let value = self.value()?;
        let tail = (1.0 - level) / 2.0;
        let (yes, no) = (self.n_yes as f64, (self.n - self.n_yes) as f64);
        let (none, all) = (self.n_yes == 0, self.n_yes == self.n);
        let interval = Interval {
            lo: if none {
                0.0
            } else {
                beta_quantile(tail, yes, no + 1.0)
            },
            hi: if all {
                1.0
            } else {
                beta_quantile(1.0 - tail, yes + 1.0, no)
            },
        };
        Some(Estimate { value, interval })
    }

    /// How likely a share at least as unlikely as this one is if the true one is `p`: the exact
    /// binomial test, two-sided by the probabilities of the outcomes. `None` as for
    /// [`Share::wilson`].
    ///
    /// Source: as R's `binom.test`; outcomes within 10⁻⁷ of the observed one's probability count
    /// as equally likely.
    pub fn binomial_test(self, p: f64) -> Option<f64> {
        self.value()?;
        if p <= 0.0 || p >= 1.0 {
            let certain = if p <= 0.0 { 0 } else { self.n };
            return Some(f64::from(u8::from(self.n_yes == certain)));
        }
        let ln_mass =
            |k: u64| ln_choose(self.n, k) + k as f64 * p.ln() + (self.n - k) as f64 * (-p).ln_1p();
        let most = ln_mass(self.n_yes) + 1e-7_f64.ln_1p();
        // Masses rise to the mode and fall after it: what is as unlikely lies in both tails.
        let mode = (((self.n + 1) as f64 * p) as u64).min(self.n);
        let n_below = first(0, mode + 1, |k| ln_mass(k) > most);
        let first_above = first(mode, self.n + 1, |k| ln_mass(k) <= most);
        if n_below > mode {
            return Some(1.0);
        }
        let lower = if n_below == 0 {
            0.0
        } else {
            self.at_most(n_below - 1, p)
        };
        let upper = if first_above > self.n {
            0.0
        } else {
            self.at_least(first_above, p)
        };
        Some((lower + upper).min(1.0))
    }

    fn at_most(self, k: u64, p: f64) -> f64 {
        if k >= self.n {
            return 1.0;
        }
        beta_cdf(1.0 - p, (self.n - k) as f64, k as f64 + 1.0)
    }

    fn at_least(self, k: u64, p: f64) -> f64 {
        if k == 0 {
            return 1.0;
        }
        beta_cdf(p, k as f64, (self.n - k) as f64 + 1.0)
    }

    fn value(self) -> Option<f64> {
        (self.n > 0 && self.n_yes <= self.n).then(|| self.n_yes as f64 / self.n as f64)
    }
}

/// The first of `from..to` at which `is_there`, false before and true after; `to` if none.
fn first(from: u64, to: u64, is_there: impl Fn(u64) -> bool) -> u64 {
    let (mut lo, mut hi) = (from, to);
    while lo < hi {
        let middle = u64::midpoint(lo, hi);
        if is_there(middle) {
            hi = middle;
        } else {
            lo = middle + 1;
        }
    }
    lo
}

/// The difference of two independent shares, first minus second, with Newcombe's hybrid score
/// interval; `None` when either group was not asked.
///
/// Source: Newcombe (1998), method 10: from both Wilson intervals, without continuity correction.
pub fn newcombe(first: Share, second: Share, level: f64) -> Option<Estimate> {
    let (a, b) = (first.wilson(level)?, second.wilson(level)?);
    let value = a.value - b.value;
    let below = (a.value - a.interval.lo).hypot(b.interval.hi - b.value);
    let above = (a.interval.hi - a.value).hypot(b.value - b.interval.lo);
    let interval = Interval {
        lo: value - below,
        hi: value + above,
    };
    Some(Estimate { value, interval })
}

#[cfg(test)]
mod tests {
    use super::super::tests::{assert_close, assert_interval};
    use super::*;

    fn share(n_yes: u64, n: u64) -> Share {
        Share { n_yes, n }
    }

    #[test]
    fn wilson_and_clopper_pearson_agree_with_statsmodels_and_scipy() {
        // statsmodels 0.15.0: proportion_confint(k, n, method="wilson");
        // SciPy 1.17.1: binomtest(k, n).proportion_ci(method="exact")
        let recorded = [
            (
                0,
                20,
                [0.0, 0.161_125_158_052_819_4],
                [0.0, 0.168_433_470_983_085_46],
            ),
            (
                7,
                20,
                [0.181_191_824_101_082_03, 0.567_145_723_314_763_8],
                [0.153_909_204_784_541_2, 0.592_188_534_532_832_8],
            ),
            (
                15,
                20,
                [0.531_299_122_381_255_9, 0.888_138_298_592_334_4],
                [0.508_954_128_292_042_5, 0.913_428_530_898_565_5],
            ),
            (
                81,
                263,
                [0.255_288_519_878_274_2, 0.366_209_576_982_800_04],
                [0.252_736_745_585_042_67, 0.367_621_922_601_347_46],
            ),
            (
                20,
                20,
                [0.838_874_841_947_180_4, 1.0],
                [0.831_566_529_016_914_5, 1.0],
            ),
            (
                1,
                29,
                [0.006_113_214_292_762_667, 0.171_755_218_793_202_94],
                [0.000_872_646_883_597_107_2, 0.177_644_295_488_414_65],
            ),
        ];
        for (n_yes, n, wilson, exact) in recorded {
            let share = share(n_yes, n);
            assert_interval(share.wilson(0.95).unwrap().interval, wilson, 1e-9);
            assert_interval(share.clopper_pearson(0.95).unwrap().interval, exact, 1e-9);
        }
    }

    #[test]
    fn the_binomial_test_agrees_with_scipy() {
        // SciPy 1.17.1: binomtest(k, n, p).pvalue
        let recorded = [
            (0, 20, 0.5, 1.907_348_632_812_5e-6),
            (7, 20, 0.5, 0.263_175_964_355_468_75),
            (15, 20, 0.5, 0.041_389_465_332_031_25),
            (81, 263, 0.5, 4.301_366_625_027_649_5e-10),
            (1, 29, 0.5, 1.117_587_089_538_574_2e-7),
            (5, 30, 0.3, 0.161_064_812_367_701_7),
            (131, 317, 0.47, 0.042_961_758_470_196_36),
            (12, 18, 0.5, 0.237_884_521_484_375),
            (0, 10, 0.2, 0.228_248_064_000_000_08),
            (10, 20, 0.5, 1.0),
        ];
        for (n_yes, n, p, expected) in recorded {
            let found = share(n_yes, n).binomial_test(p).unwrap();
            assert_close(found, expected, 1e-9);
            assert!(
                (found / expected - 1.0).abs() < 1e-9,
                "{found} for {expected}"
            );
        }
    }

    #[test]
    fn two_sided_means_the_sum_of_all_outcomes_as_unlikely() {
        for (n, p) in [(1_u64, 0.5), (9, 0.2), (16, 0.5), (23, 0.71)] {
            let mass = |k: u64| {
                let (yes, no) = (k as f64 * f64::ln(p), (n - k) as f64 * f64::ln_1p(-p));
                (ln_choose(n, k) + yes + no).exp()
            };
            for k in 0..=n {
                let summed: f64 = (0..=n)
                    .map(mass)
                    .filter(|m| *m <= mass(k) * (1.0 + 1e-7))
                    .sum();
                assert_close(
                    share(k, n).binomial_test(p).unwrap(),
                    summed.min(1.0),
                    1e-12,
                );
            }
        }
    }

    #[test]
    fn newcombes_worked_examples_come_out_to_their_printed_digits() {
        // Newcombe (1998), table II, method 10, examples (a) to (h) but the two alike.
        let printed = [
            ((56, 70), (48, 80), [0.0524, 0.3339]),
            ((9, 10), (3, 10), [0.1705, 0.8090]),
            ((5, 56), (0, 29), [-0.0381, 0.1926]),
            ((0, 10), (0, 20), [-0.1611, 0.2775]),
            ((0, 10), (0, 10), [-0.2775, 0.2775]),
            ((10, 10), (0, 20), [0.6791, 1.0]),
            ((10, 10), (0, 10), [0.6075, 1.0]),
        ];
        for ((a, m), (b, n), interval) in printed {
            let found = newcombe(share(a, m), share(b, n), 0.95).unwrap();
            assert_interval(found.interval, interval, 0.5e-4);
        }
    }

    #[test]
    fn newcombe_agrees_with_statsmodels() {
        // statsmodels 0.15.0: confint_proportions_2indep(a, m, b, n, method="newcomb",
        // compare="diff")
        let recorded = [
            (
                (56, 70),
                (48, 80),
                [0.052_431_472_402_364_98, 0.333_872_654_036_906_14],
            ),
            (
                (9, 10),
                (3, 10),
                [0.170_522_723_934_502_9, 0.809_017_973_535_488],
            ),
            (
                (0, 29),
                (0, 80),
                [-0.045_818_129_535_527_12, 0.116_969_798_499_740_8],
            ),
        ];
        for ((a, m), (b, n), interval) in recorded {
            let found = newcombe(share(a, m), share(b, n), 0.95).unwrap();
            assert_interval(found.interval, interval, 1e-9);
        }
    }

    #[test]
    fn swapping_the_groups_turns_the_interval_around() {
        let (a, b) = (share(17, 50), share(30, 44));
        let (there, back) = (newcombe(a, b, 0.9).unwrap(), newcombe(b, a, 0.9).unwrap());
        assert_interval(
            back.interval,
            [-there.interval.hi, -there.interval.lo],
            1e-15,
        );
    }

    #[test]
    fn nobody_asked_leaves_nothing_to_say() {
        let nobody = Share::of([]);
        assert_eq!(nobody.wilson(0.95), None);
        assert_eq!(nobody.clopper_pearson(0.95), None);
        assert_eq!(nobody.binomial_test(0.5), None);
        assert_eq!(newcombe(nobody, share(1, 2), 0.95), None);
        assert_eq!(share(3, 2).wilson(0.95), None);
    }
}
