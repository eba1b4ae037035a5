//! Two groups compared within strata, such as two methods within tasks.

use super::interval::{Estimate, Interval};
use super::proportion::Share;
use super::special::{chi2_tail, normal_z};

/// Two groups in one stratum.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Stratum {
    /// One group.
    pub first: Share,
    /// The other.
    pub second: Share,
}

/// What the Cochran–Mantel–Haenszel test says about a difference that all strata share.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct StratifiedTest {
    /// χ² with one degree of freedom.
    pub statistic: f64,
    /// How likely a statistic at least so great is without any difference.
    pub p: f64,
    /// The odds of yes of the first group over those of the second, common to all strata, with
    /// its interval; `None` where no stratum shows both yes and no in both directions.
    pub odds_ratio: Option<Estimate>,
}

/// Whether the statistic is made smaller by half an answer, as R does unless told otherwise.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Continuity {
    /// As it is.
    Plain,
    /// Half an answer less; safer with few answers.
    Corrected,
}

/// Tests whether the first group says yes as often as the second within each stratum, and
/// estimates the common odds ratio. Strata with fewer than two answers, or in which all answers
/// are alike, say nothing and count nothing. `None` when none is left.
///
/// Source: Mantel and Haenszel (1959); interval of the odds ratio: Robins, Breslow and Greenland
/// (1986).
pub fn cochran_mantel_haenszel(
    strata: &[Stratum],
    continuity: Continuity,
    level: f64,
) -> Option<StratifiedTest> {
    let tables: Vec<Table> = strata.iter().filter_map(Table::of).collect();
    let surplus: f64 = tables.iter().map(|t| t.yes_first - t.expected()).sum();
    let variance: f64 = tables.iter().map(Table::variance).sum();
    if variance <= 0.0 {
        return None;
    }
    let less = match continuity {
        Continuity::Plain => 0.0,
        Continuity::Corrected => surplus.abs().min(0.5),
    };
    let statistic = (surplus.abs() - less).powi(2) / variance;
    Some(StratifiedTest {
        statistic,
        p: chi2_tail(statistic),
        odds_ratio: common_odds_ratio(&tables, level),
    })
}

/// Answers of one stratum: yes and no of the first group, then of the second.
struct Table {
    yes_first: f64,
    no_first: f64,
    yes_second: f64,
    no_second: f64,
    n: f64,
}

impl Table {
    fn of(stratum: &Stratum) -> Option<Self> {
        let counts = |s: Share| Some((s.n_yes as f64, s.n.checked_sub(s.n_yes)? as f64));
        let (yes_first, no_first) = counts(stratum.first)?;
        let (yes_second, no_second) = counts(stratum.second)?;
        let n = yes_first + no_first + yes_second + no_second;
        (n > 1.0).then_some(Self {
            yes_first,
            no_first,
            yes_second,
            no_second,
            n,
        })
    }

    fn expected(&self) -> f64 {
        (self.yes_first + self.no_first) * (self.yes_first + self.yes_second) / self.n
    }

    fn variance(&self) -> f64 {
        let groups = (self.yes_first + self.no_first) * (self.yes_second + self.no_second);
        let answers = (self.yes_first + self.yes_second) * (self.no_first + self.no_second);
        groups * answers / (self.n.powi(2) * (self.n - 1.0))
    }
}

fn common_odds_ratio(tables: &[Table], level: f64) -> Option<Estimate> {
    let (mut r_sum, mut s_sum) = (0.0, 0.0);
    let (mut pr, mut mixed, mut qs) = (0.0, 0.0, 0.0);
    for t in tables {
        let (r, s) = (
            t.yes_first * t.no_second / t.n,
            t.no_first * t.yes_second / t.n,
        );
        let p = (t.yes_first + t.no_second) / t.n;
        let q = 1.0 - p;
        r_sum += r;
        s_sum += s;
        pr += p * r;
        mixed += p * s + q * r;
        qs += q * s;
    }
    if r_sum <= 0.0 || s_sum <= 0.0 {
        return None;
    }
    let variance =
        pr / (2.0 * r_sum * r_sum) + mixed / (2.0 * r_sum * s_sum) + qs / (2.0 * s_sum * s_sum);
    let value = r_sum / s_sum;
    let times = (normal_z(level) * variance.sqrt()).exp();
    let interval = Interval {
        lo: value / times,
        hi: value * times,
    };
    Some(Estimate { value, interval })
}

#[cfg(test)]
mod tests {
    use super::super::tests::{assert_close, assert_interval};
    use super::*;

    fn strata(tables: &[[u64; 4]]) -> Vec<Stratum> {
        let share = |yes, no| Share {
            n_yes: yes,
            n: yes + no,
        };
        let strata = tables.iter().map(|&[a, b, c, d]| Stratum {
            first: share(a, b),
            second: share(c, d),
        });
        strata.collect()
    }

    /// Admissions to Berkeley in 1973 by department: men admitted and rejected, then women.
    ///
    /// Source: Bickel, Hammel and O'Connell (1975); R's `UCBAdmissions`.
    const ADMISSIONS: [[u64; 4]; 6] = [
        [512, 313, 89, 19],
        [353, 207, 17, 8],
        [120, 205, 202, 391],
        [138, 279, 131, 244],
        [53, 138, 94, 299],
        [22, 351, 24, 317],
    ];

    #[test]
    fn admissions_to_berkeley_come_out_as_r_prints_them() {
        // R: mantelhaen.test(UCBAdmissions): X-squared = 1.4269, p-value = 0.2323, common odds
        // ratio 0.9046968, interval 0.7719074 1.0603298
        let found =
            cochran_mantel_haenszel(&strata(&ADMISSIONS), Continuity::Corrected, 0.95).unwrap();
        assert_close(found.statistic, 1.4269, 0.5e-4);
        assert_close(found.p, 0.2323, 0.5e-4);
        let ratio = found.odds_ratio.unwrap();
        assert_close(ratio.value, 0.904_696_8, 0.5e-7);
        assert_interval(ratio.interval, [0.771_907_4, 1.060_329_8], 0.5e-7);
    }

    #[test]
    fn the_test_agrees_with_statsmodels() {
        // statsmodels 0.15.0: StratifiedTable(tables), its test_null_odds(correction=…),
        // oddsratio_pooled and oddsratio_pooled_confint()
        let plain = cochran_mantel_haenszel(&strata(&ADMISSIONS), Continuity::Plain, 0.95).unwrap();
        assert_close(plain.statistic, 1.524_606_660_443_435_6, 1e-9);
        assert_close(plain.p, 0.216_923_697_055_518_17, 1e-9);
        let corrected =
            cochran_mantel_haenszel(&strata(&ADMISSIONS), Continuity::Corrected, 0.95).unwrap();
        assert_close(corrected.statistic, 1.426_946_228_586_688_3, 1e-9);
        assert_close(corrected.p, 0.232_263_462_817_048_02, 1e-9);
        let few = strata(&[[12, 5, 8, 9], [3, 7, 1, 11], [20, 10, 15, 18]]);
        let plain = cochran_mantel_haenszel(&few, Continuity::Plain, 0.95).unwrap();
        assert_close(plain.statistic, 6.139_379_379_992_041, 1e-9);
        assert_close(plain.p, 0.013_220_370_569_848_372, 1e-9);
        let corrected = cochran_mantel_haenszel(&few, Continuity::Corrected, 0.95).unwrap();
        assert_close(corrected.statistic, 5.233_214_952_413_01, 1e-9);
        assert_close(corrected.p, 0.022_159_536_740_942_065, 1e-9);
        let ratio = corrected.odds_ratio.unwrap();
        assert_close(ratio.value, 2.681_067_052_137_061, 1e-9);
        assert_interval(
            ratio.interval,
            [1.226_778_889_954_924_1, 5.859_344_823_188_982],
            1e-9,
        );
    }

    #[test]
    fn strata_that_say_nothing_count_nothing() {
        let said = strata(&[[12, 5, 8, 9]]);
        let more = strata(&[[12, 5, 8, 9], [4, 0, 6, 0], [1, 0, 0, 0], [0, 0, 0, 0]]);
        let test = |s: &[Stratum]| cochran_mantel_haenszel(s, Continuity::Plain, 0.95);
        assert_eq!(
            test(&said).unwrap().p.to_bits(),
            test(&more).unwrap().p.to_bits()
        );
        assert_eq!(test(&strata(&[[4, 0, 6, 0]])), None);
        assert_eq!(test(&[]), None);
    }

    #[test]
    fn groups_that_never_overlap_have_a_test_but_no_odds_ratio() {
        let apart = strata(&[[9, 0, 0, 9]]);
        let found = cochran_mantel_haenszel(&apart, Continuity::Plain, 0.95).unwrap();
        assert!(found.p < 1e-4 && found.odds_ratio.is_none());
    }
}
