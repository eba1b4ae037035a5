//! Intervals by drawing the same observations again, with replacement.

use super::center::mean;
use super::interval::{Estimate, Interval};
use crate::random::{Rng, Stream};

mod sign_flip;

/// How to resample. The same settings give the same interval.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Bootstrap {
    /// How often.
    pub n_replicates: u32,
    /// Probability that the interval is to hold the truth, in (0, 1).
    pub level: f64,
    /// Of the random numbers; replicate k draws from step k of its stream.
    pub seed: u64,
}

impl Default for Bootstrap {
    fn default() -> Self {
        Self {
            n_replicates: 2_000,
            level: 0.95,
            seed: 0,
        }
    }
}

impl Bootstrap {
    /// The percentile interval of a statistic.
    ///
    /// * `n_units` – what is independent: observations, seeds, or whole labelers (clusters)
    /// * `statistic` – from the numbers of the drawn units, some more than once; NaN where it is
    ///   undefined, and such replicates are left out
    ///
    /// `None` without units or without a replicate in which the statistic exists. Few units make
    /// it too narrow: with 5, a level of 0.95 holds the truth in about 0.84 of all cases.
    ///
    /// Source: Efron and Tibshirani (1993), chapter 13.
    pub fn interval(
        &self,
        n_units: usize,
        mut statistic: impl FnMut(&[usize]) -> f64,
    ) -> Option<Interval> {
        if n_units == 0 {
            return None;
        }
        let mut drawn = vec![0; n_units];
        let mut replicates: Vec<f64> = (0..self.n_replicates)
            .map(|k| {
                let mut rng = Rng::new(self.seed, Stream::Bootstrap, u64::from(k));
                drawn.fill_with(|| rng.below(n_units));
                statistic(&drawn)
            })
            .filter(|value| !value.is_nan())
            .collect();
        (!replicates.is_empty()).then(|| self.percentiles(&mut replicates))
    }

    /// A centre of independent values, such as [`mean`] or the interquartile mean over seeds;
    /// `None` without values.
    pub fn center(&self, values: &[f64], center: fn(&[f64]) -> f64) -> Option<Estimate> {
        let mut drawn = Vec::with_capacity(values.len());
        let interval = self.interval(values.len(), |units| {
            drawn.clear();
            drawn.extend(units.iter().map(|&unit| values[unit]));
            center(&drawn)
        })?;
        Some(Estimate {
            value: center(values),
            interval,
        })
    }

    /// A centre of all values of several strata, such as the seeds of several tasks: each replicate
    /// draws within each stratum as many as it has. `None` where there is no value.
    ///
    /// Source: Agarwal et al. (2021), section 4.1.
    pub fn stratified(&self, strata: &[Vec<f64>], center: fn(&[f64]) -> f64) -> Option<Estimate> {
        let values = strata.concat();
        let mut drawn = Vec::with_capacity(values.len());
        let mut replicates: Vec<f64> = (0..self.n_replicates)
            .map(|k| {
                let mut rng = Rng::new(self.seed, Stream::Bootstrap, u64::from(k));
                drawn.clear();
                for stratum in strata {
                    drawn.extend(stratum.iter().map(|_| stratum[rng.below(stratum.len())]));
                }
                center(&drawn)
            })
            .collect();
        let value = center(&values);
        (!values.is_empty()).then(|| Estimate {
            value,
            interval: self.percentiles(&mut replicates),
        })
    }

    /// Both ends of the middle part of the replicates, of which there is at least one.
    fn percentiles(&self, replicates: &mut [f64]) -> Interval {
        replicates.sort_by(f64::total_cmp);
        let tail = (1.0 - self.level) / 2.0;
        Interval {
            lo: quantile(replicates, tail),
            hi: quantile(replicates, 1.0 - tail),
        }
    }

    /// Mean of `first − second` over pairs, such as two methods on the same seeds; `None`
    /// without pairs.
    pub fn paired_difference(&self, pairs: &[(f64, f64)]) -> Option<Estimate> {
        let differences: Vec<f64> = pairs.iter().map(|(first, second)| first - second).collect();
        self.center(&differences, mean)
    }
}

/// The value below which a share `p` of sorted values lies, straight lines between them.
///
/// Source: Hyndman and Fan (1996), definition 7: the default of R and NumPy.
fn quantile(sorted: &[f64], p: f64) -> f64 {
    let place = p * (sorted.len() - 1) as f64;
    let below = place.floor() as usize;
    let above = (below + 1).min(sorted.len() - 1);
    sorted[below] + (place - below as f64) * (sorted[above] - sorted[below])
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::agreement::interquartile_mean;

    #[test]
    fn quantiles_are_numpys() {
        // NumPy 2.x: np.quantile([1, 2, 4, 8, 16], [0.025, 0.4, 0.975])
        let sorted = [1.0, 2.0, 4.0, 8.0, 16.0];
        let found = [0.025, 0.4, 0.975].map(|p| quantile(&sorted, p));
        for (found, expected) in found.iter().zip([1.1, 3.2, 15.2]) {
            assert!((found - expected).abs() < 1e-12, "{found}");
        }
    }

    #[test]
    fn the_interval_of_a_mean_agrees_with_the_normal_one() {
        let mut rng = Rng::new(3, Stream::Test, 0);
        let values: Vec<f64> = (0..400).map(|_| rng.normal()).collect();
        let found = Bootstrap {
            n_replicates: 4_000,
            ..Bootstrap::default()
        };
        let found = found.center(&values, mean).unwrap();
        let variance = values
            .iter()
            .map(|v| (v - found.value).powi(2))
            .sum::<f64>()
            / 400.0;
        let half = 1.959_964 * (variance / 400.0).sqrt();
        assert!((found.interval.lo - (found.value - half)).abs() < 0.08 * half);
        assert!((found.interval.hi - (found.value + half)).abs() < 0.08 * half);
    }

    #[test]
    fn five_seeds_hold_the_truth_about_as_often_as_stated() {
        let n_cases = 1_000;
        let mut n_held = 0;
        for case in 0..n_cases {
            let mut rng = Rng::new(case, Stream::Test, 1);
            let values: Vec<f64> = (0..5).map(|_| rng.normal()).collect();
            let settings = Bootstrap {
                n_replicates: 400,
                seed: case,
                ..Bootstrap::default()
            };
            let found = settings.center(&values, mean).unwrap();
            n_held += u32::from(found.interval.contains(0.0));
        }
        let share = f64::from(n_held) / n_cases as f64;
        assert!((share - 0.84).abs() < 0.03, "{share}");
    }

    #[test]
    fn the_same_settings_give_the_same_interval_and_other_seeds_another() {
        let values = [0.3, 0.9, 0.1, 0.7, 0.8, 0.2, 0.4];
        let with_seed = |seed| {
            let settings = Bootstrap {
                seed,
                ..Bootstrap::default()
            };
            settings.center(&values, interquartile_mean)
        };
        assert_eq!(with_seed(1), with_seed(1));
        assert_ne!(with_seed(1), with_seed(2));
    }

    /// Every way to draw three of three, counted; the interval's ends by their cumulative shares.
    #[test]
    fn the_interval_of_three_values_is_that_of_all_27_draws() {
        let values = [0.0, 0.4, 1.0];
        let mut all: Vec<f64> = (0..27)
            .map(|n| [n % 3, n / 3 % 3, n / 9].map(|k| values[k]))
            .map(|drawn| mean(&drawn))
            .collect();
        all.sort_by(f64::total_cmp);
        // 1/27 of the draws are 0, 3/27 are 2/15 …: at a level of 0.8 the tails of 0.1 end
        // within the second and the second to last kind.
        let [lo, hi] = [all[(0.1 * 27.0) as usize], all[(0.9 * 27.0) as usize]];
        assert!(
            (lo - 0.4 / 3.0).abs() < 1e-12 && (hi - 0.8).abs() < 1e-12,
            "{lo} {hi}"
        );
        let settings = Bootstrap {
            level: 0.8,
            n_replicates: 5_000,
            seed: 0,
        };
        let found = settings.center(&values, mean).unwrap();
        assert!((found.interval.lo - lo).abs() < 1e-12 && (found.interval.hi - hi).abs() < 1e-12);
        let one_stratum = settings.stratified(&[values.to_vec()], mean).unwrap();
        assert_eq!(one_stratum, found);
    }

    #[test]
    fn strata_keep_their_share_in_every_replicate() {
        let strata = [vec![0.0; 5], vec![1.0; 15]];
        let settings = Bootstrap::default();
        let found = settings.stratified(&strata, mean).unwrap();
        assert!((found.interval.hi - found.interval.lo).abs() < 1e-12);
        assert!((found.value - 0.75).abs() < 1e-12);
        assert_eq!(settings.stratified(&[vec![], vec![]], mean), None);
    }

    #[test]
    fn pairs_that_differ_by_the_same_amount_leave_no_doubt() {
        let pairs = [(0.9, 0.5), (0.5, 0.1), (0.75, 0.35)];
        let found = Bootstrap::default().paired_difference(&pairs).unwrap();
        assert!((found.interval.hi - found.interval.lo).abs() < 1e-12);
        assert!((found.value - 0.4).abs() < 1e-12);
        assert_eq!(Bootstrap::default().paired_difference(&[]), None);
    }

    #[test]
    fn whole_clusters_are_drawn_so_that_alike_answers_do_not_count_twice() {
        let clusters: [&[f64]; 4] = [&[1.0; 25], &[0.0; 25], &[1.0; 25], &[0.0; 25]];
        let pooled = |units: &[usize]| {
            let all: Vec<f64> = units.iter().flat_map(|&u| clusters[u]).copied().collect();
            mean(&all)
        };
        let settings = Bootstrap::default();
        let by_cluster = settings.interval(4, pooled).unwrap();
        let singly = settings.center(&clusters.concat(), mean).unwrap().interval;
        assert!(by_cluster.hi - by_cluster.lo > 4.0 * (singly.hi - singly.lo));
    }
}
