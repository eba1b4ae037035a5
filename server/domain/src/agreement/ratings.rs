//! Agreement of any number of labelers on the same items.

use super::bootstrap::Bootstrap;
use super::interval::Estimate;
use super::proportion::Share;

/// Answers of one item by category, `[K]`: how many labelers gave each.
type Tally = Vec<u32>;

/// Who answered what, reduced to what agreement depends on.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Ratings {
    items: Vec<Tally>,
}

/// A measure of agreement; NaN where it is undefined.
type Measure = fn(&[&Tally]) -> f64;

impl Ratings {
    /// From the answers to each item, as numbers of categories; labelers who did not answer an
    /// item are left out of it.
    pub fn new(items: &[Vec<usize>]) -> Self {
        let answers = items.iter().flatten();
        let n_categories = answers.max().map_or(0, |greatest| greatest + 1);
        let tally = |answers: &Vec<usize>| {
            let mut tally = vec![0; n_categories];
            for &category in answers {
                tally[category] += 1;
            }
            tally
        };
        Self {
            items: items.iter().map(tally).collect(),
        }
    }

    /// Probability that two labelers who both answered an item gave the same answer: mean over
    /// items with at least two answers. `None` without such items.
    ///
    /// Interval: percentile bootstrap over items.
    pub fn percent_agreement(&self, settings: Bootstrap) -> Option<Estimate> {
        self.estimate(settings, |items| {
            let items = items.iter().filter(|item| n_answers(item) >= 2.0);
            let (sum, n) = items.fold((0.0, 0.0), |(sum, n), item| {
                (sum + agreeing_pairs(item), n + 1.0)
            });
            sum / n
        })
    }

    /// Fleiss' kappa: agreement beyond what labelers who draw from the common shares of the
    /// categories reach. `None` unless all items have the same number of answers, at least two,
    /// and more than one category occurs.
    ///
    /// Interval: percentile bootstrap over items.
    ///
    /// Source: Fleiss (1971).
    pub fn fleiss_kappa(&self, settings: Bootstrap) -> Option<Estimate> {
        let n = n_answers(self.items.first()?);
        let is_complete = |item: &Tally| n_answers(item).total_cmp(&n).is_eq();
        if n < 2.0 || !self.items.iter().all(is_complete) {
            return None;
        }
        self.estimate(settings, |items| {
            let n_items = items.len() as f64;
            let observed = items.iter().map(|item| agreeing_pairs(item)).sum::<f64>() / n_items;
            let totals = totals(items);
            let all: f64 = totals.iter().sum();
            let chance: f64 = totals.iter().map(|t| (t / all).powi(2)).sum();
            (observed - chance) / (1.0 - chance)
        })
    }

    /// Krippendorff's alpha for categories without order: 1 − observed over expected
    /// disagreement. Answers may be missing; items with a single answer say nothing. `None`
    /// where no item has two answers or only one category occurs.
    ///
    /// Interval: percentile bootstrap over items.
    ///
    /// Source: Krippendorff (2011), by the coincidences within items.
    pub fn krippendorff_alpha(&self, settings: Bootstrap) -> Option<Estimate> {
        self.estimate(settings, |items| {
            let paired: Vec<&Tally> = items
                .iter()
                .copied()
                .filter(|item| n_answers(item) >= 2.0)
                .collect();
            let totals = totals(&paired);
            let n: f64 = totals.iter().sum();
            let agreeing: f64 = paired
                .iter()
                .map(|item| n_answers(item) * agreeing_pairs(item))
                .sum();
            let by_chance: f64 = totals.iter().map(|t| t * (t - 1.0)).sum();
            let (observed, expected) = (n - agreeing, n - by_chance / (n - 1.0));
            if expected > 0.0 {
                1.0 - observed / expected
            } else {
                f64::NAN
            }
        })
    }

    fn estimate(&self, settings: Bootstrap, measure: Measure) -> Option<Estimate> {
        let all: Vec<&Tally> = self.items.iter().collect();
        let value = measure(&all);
        if value.is_nan() {
            return None;
        }
        let interval = settings.interval(all.len(), |drawn| {
            measure(&drawn.iter().map(|&item| all[item]).collect::<Vec<_>>())
        })?;
        Some(Estimate { value, interval })
    }
}

/// How often a labeler gave the same answer to a repeated query as before, with Wilson's
/// interval; `None` without repeats.
pub fn self_consistency<A: PartialEq>(repeats: &[(A, A)], level: f64) -> Option<Estimate> {
    Share::of(repeats.iter().map(|(before, again)| before == again)).wilson(level)
}

fn n_answers(item: &Tally) -> f64 {
    f64::from(item.iter().sum::<u32>())
}

/// Share of an item's ordered pairs of answers that agree; NaN of a single answer.
fn agreeing_pairs(item: &Tally) -> f64 {
    let n = n_answers(item);
    let agreeing: f64 = item
        .iter()
        .map(|&count| f64::from(count) * (f64::from(count) - 1.0))
        .sum();
    agreeing / (n * (n - 1.0))
}

/// Answers of each category over all items.
fn totals(items: &[&Tally]) -> Vec<f64> {
    let n_categories = items.first().map_or(0, |item| item.len());
    (0..n_categories)
        .map(|k| items.iter().map(|item| f64::from(item[k])).sum())
        .collect()
}

#[cfg(test)]
mod tests {
    use super::super::tests::assert_close;
    use super::*;

    /// Items from how many labelers gave each category.
    fn tallied<const K: usize>(items: &[[usize; K]]) -> Ratings {
        let answers = |item: &[usize; K]| {
            let of_category = item.iter().enumerate();
            of_category
                .flat_map(|(k, &count)| std::iter::repeat_n(k, count))
                .collect()
        };
        Ratings::new(&items.iter().map(answers).collect::<Vec<_>>())
    }

    /// Thirty patients, six psychiatrists each: depression, personality disorder, schizophrenia,
    /// neurosis, other.
    ///
    /// Source: Fleiss (1971), table 1.
    const PSYCHIATRISTS: [[usize; 5]; 30] = [
        [0, 0, 0, 6, 0],
        [0, 3, 0, 0, 3],
        [0, 1, 4, 0, 1],
        [0, 0, 0, 0, 6],
        [0, 3, 0, 3, 0],
        [2, 0, 4, 0, 0],
        [0, 0, 4, 0, 2],
        [2, 0, 3, 1, 0],
        [2, 0, 0, 4, 0],
        [0, 0, 0, 0, 6],
        [1, 0, 0, 5, 0],
        [1, 1, 0, 4, 0],
        [0, 3, 3, 0, 0],
        [1, 0, 0, 5, 0],
        [0, 2, 0, 3, 1],
        [0, 0, 5, 0, 1],
        [3, 0, 0, 1, 2],
        [5, 1, 0, 0, 0],
        [0, 2, 0, 4, 0],
        [1, 0, 2, 0, 3],
        [0, 0, 0, 0, 6],
        [0, 1, 0, 5, 0],
        [0, 2, 0, 1, 3],
        [2, 0, 0, 4, 0],
        [1, 0, 0, 4, 1],
        [0, 5, 0, 1, 0],
        [4, 0, 0, 0, 2],
        [0, 2, 0, 4, 0],
        [1, 0, 5, 0, 0],
        [0, 0, 0, 0, 6],
    ];

    #[test]
    fn fleiss_psychiatrists_agree_as_printed() {
        let ratings = tallied(&PSYCHIATRISTS);
        let found = ratings.fleiss_kappa(Bootstrap::default()).unwrap();
        assert_close(found.value, 0.430, 0.5e-3);
        // statsmodels 0.15.0: inter_rater.fleiss_kappa(table)
        assert_close(found.value, 0.430_244_520_060_140_74, 1e-9);
        assert!(found.interval.contains(found.value));
        let agreement = ratings.percent_agreement(Bootstrap::default()).unwrap();
        assert_close(agreement.value, 0.5556, 0.5e-4);
    }

    #[test]
    fn fleiss_kappa_of_fourteen_labelers_agrees_with_statsmodels() {
        let ratings = tallied(&[
            [0, 0, 0, 0, 14],
            [0, 2, 6, 4, 2],
            [0, 0, 3, 5, 6],
            [0, 3, 9, 2, 0],
            [2, 2, 8, 1, 1],
            [7, 7, 0, 0, 0],
            [3, 2, 6, 3, 0],
            [2, 5, 3, 2, 2],
            [6, 5, 2, 1, 0],
            [0, 2, 2, 3, 7],
        ]);
        let found = ratings.fleiss_kappa(Bootstrap::default()).unwrap();
        assert_close(found.value, 0.209_930_704_421_955_22, 1e-9);
    }

    #[test]
    fn krippendorffs_example_with_missing_answers_comes_out_as_printed() {
        // Krippendorff (2011), section C: four observers, twelve units; nominal alpha 0.743.
        let observers = [
            [1, 2, 3, 3, 2, 1, 4, 1, 2, 0, 0, 0],
            [1, 2, 3, 3, 2, 2, 4, 1, 2, 5, 0, 3],
            [0, 3, 3, 3, 2, 3, 4, 2, 2, 5, 1, 0],
            [1, 2, 3, 3, 2, 4, 4, 1, 2, 5, 1, 0],
        ];
        let unit = |u: usize| {
            let answers = observers.iter().map(|answers| answers[u]);
            answers.filter(|&answer| answer != 0).collect()
        };
        let items: Vec<Vec<usize>> = (0..12).map(unit).collect();
        let found = Ratings::new(&items)
            .krippendorff_alpha(Bootstrap::default())
            .unwrap();
        assert_close(found.value, 0.743, 0.5e-3);
        // krippendorff 0.9.0: alpha(reliability_data, level_of_measurement="nominal")
        assert_close(found.value, 0.743_421_052_631_579, 1e-9);
        assert!(found.interval.contains(found.value));
    }

    #[test]
    fn perfect_agreement_is_one_and_its_interval_a_point() {
        let ratings = Ratings::new(&[vec![0, 0, 0], vec![1, 1, 1], vec![2, 2, 2]]);
        let settings = Bootstrap::default();
        for found in [
            ratings.percent_agreement(settings),
            ratings.fleiss_kappa(settings),
            ratings.krippendorff_alpha(settings),
        ] {
            let found = found.unwrap();
            assert_close(found.value, 1.0, 1e-12);
            assert_close(found.interval.lo, 1.0, 1e-12);
        }
    }

    #[test]
    fn what_cannot_be_said_is_not_said() {
        let settings = Bootstrap::default();
        let one_category = Ratings::new(&[vec![0, 0], vec![0, 0]]);
        assert_eq!(one_category.fleiss_kappa(settings), None);
        assert_eq!(one_category.krippendorff_alpha(settings), None);
        let ragged = Ratings::new(&[vec![0, 1], vec![0]]);
        assert_eq!(ragged.fleiss_kappa(settings), None);
        let single = Ratings::new(&[vec![0], vec![]]);
        assert_eq!(single.percent_agreement(settings), None);
        assert_eq!(single.krippendorff_alpha(settings), None);
        assert_eq!(Ratings::new(&[]).percent_agreement(settings), None);
    }

    #[test]
    fn self_consistency_is_the_share_of_repeats_answered_alike() {
        let repeats = [('l', 'l'), ('r', 'r'), ('l', 'r'), ('e', 'e')];
        let found = self_consistency(&repeats, 0.95).unwrap();
        assert_close(found.value, 0.75, 1e-12);
        assert_eq!(self_consistency::<u8>(&[], 0.95), None);
    }
}
