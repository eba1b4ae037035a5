//! Agreement of two labelers beyond chance.

use super::interval::{Estimate, Interval};
use super::special::normal_z;

/// Cohen's kappa of two labelers with its large-sample interval.
///
/// * `counts` – `[K][K]`, items to which the first labeler gave the row's and the second the
///   column's answer
///
/// 1 is perfect agreement, 0 what chance gives. `None` for a table that is not square, without
/// items, or in which both labelers always gave one and the same answer: chance then explains
/// everything.
///
/// Source: Cohen (1960); interval: Fleiss, Cohen and Everitt (1969), not cut to [−1, 1].
pub fn cohens_kappa(counts: &[Vec<u64>], level: f64) -> Option<Estimate> {
    let k = counts.len();
    let n: u64 = counts.iter().flatten().sum();
    if n == 0 || counts.iter().any(|row| row.len() != k) {
        return None;
    }
    let share = |i: usize, j: usize| counts[i][j] as f64 / n as f64;
    let rows: Vec<f64> = (0..k).map(|i| (0..k).map(|j| share(i, j)).sum()).collect();
    let columns: Vec<f64> = (0..k).map(|j| (0..k).map(|i| share(i, j)).sum()).collect();
    let observed: f64 = (0..k).map(|i| share(i, i)).sum();
    let chance: f64 = (0..k).map(|i| rows[i] * columns[i]).sum();
    if chance >= 1.0 {
        return None;
    }
    let kappa = (observed - chance) / (1.0 - chance);
    let mut variance = -(kappa - chance * (1.0 - kappa)).powi(2);
    for i in 0..k {
        for j in 0..k {
            let weight = if i == j {
                1.0 - (rows[i] + columns[i]) * (1.0 - kappa)
            } else {
                (1.0 - kappa) * (columns[i] + rows[j])
            };
            variance += share(i, j) * weight.powi(2);
        }
    }
    let error = (variance.max(0.0) / n as f64).sqrt() / (1.0 - chance);
    let half = normal_z(level) * error;
    Some(Estimate {
        value: kappa,
        interval: Interval {
            lo: kappa - half,
            hi: kappa + half,
        },
    })
}

#[cfg(test)]
mod tests {
    use super::super::tests::{assert_close, assert_interval};
    use super::*;

    #[test]
    fn kappa_and_its_interval_agree_with_statsmodels() {
        // statsmodels 0.15.0: inter_rater.cohens_kappa(table): kappa, kappa_low, kappa_upp
        let found = cohens_kappa(&[vec![20, 5], vec![10, 15]], 0.95).unwrap();
        assert_close(found.value, 0.4, 1e-12);
        assert_interval(
            found.interval,
            [0.151_092_290_476_661, 0.648_907_709_523_338_9],
            1e-9,
        );
        let table = [vec![44, 5, 1], vec![7, 20, 3], vec![9, 5, 6]];
        let found = cohens_kappa(&table, 0.95).unwrap();
        assert_close(found.value, 0.491_525_423_728_813_47, 1e-9);
        assert_interval(
            found.interval,
            [0.350_158_201_217_486_9, 0.632_892_646_240_140_1],
            1e-9,
        );
    }

    #[test]
    fn swapping_the_labelers_changes_nothing() {
        let found = cohens_kappa(&[vec![9, 4], vec![1, 6]], 0.9);
        assert_eq!(found, cohens_kappa(&[vec![9, 1], vec![4, 6]], 0.9));
    }

    #[test]
    fn labelers_who_always_say_the_same_have_no_kappa() {
        assert_eq!(cohens_kappa(&[vec![12, 0], vec![0, 0]], 0.95), None);
        assert_eq!(cohens_kappa(&[vec![0, 0], vec![0, 0]], 0.95), None);
        assert_eq!(cohens_kappa(&[vec![1, 2]], 0.95), None);
    }
}
