//! How a report is written.

use domain::agreement::{Bootstrap, Estimate, interquartile_mean};

use crate::figure::LEAST_FOR_INTERVAL;

/// Shares of success of which the tables say when they were reached.
pub(super) const SHARES: [f64; 3] = [0.5, 0.8, 0.95];

/// Interquartile mean over seeds.
pub(super) fn center(values: &[f64], is_rate: bool) -> String {
    let found = Bootstrap::default().center(values, interquartile_mean);
    found.map_or_else(
        || "–".into(),
        |found| told_of(values.len(), &found, is_rate),
    )
}

/// With its interval where there are seeds enough for one.
pub(super) fn told_of(n_seeds: usize, found: &Estimate, is_rate: bool) -> String {
    if n_seeds < LEAST_FOR_INTERVAL {
        number(found.value, is_rate)
    } else {
        estimate(found, is_rate)
    }
}

pub(super) fn estimate(found: &Estimate, is_rate: bool) -> String {
    let told = |value| number(value, is_rate);
    let (lo, hi) = (told(found.interval.lo), told(found.interval.hi));
    format!("{} [{lo}, {hi}]", told(found.value))
}

/// Two digits of a rate, a whole number of anything else; what rounds to 0 has no sign.
pub(super) fn number(value: f64, is_rate: bool) -> String {
    let digits = if is_rate { 2 } else { 0 };
    let told = format!("{value:.digits$}");
    match told.strip_prefix('-') {
        Some(size) if size.bytes().all(|digit| matches!(digit, b'0' | b'.')) => size.to_owned(),
        _ => told,
    }
}

pub(super) fn add(text: &mut String, more: impl AsRef<str>) {
    text.push_str(more.as_ref());
}

#[cfg(test)]
mod tests {
    use super::number;

    #[test]
    fn what_rounds_to_nothing_has_no_sign() {
        assert_eq!(number(-0.004, true), "0.00");
        assert_eq!(number(-0.4, false), "0");
        assert_eq!(number(-0.006, true), "-0.01");
        assert_eq!(number(-12.0, false), "-12");
        assert_eq!(number(f64::NAN, true), "NaN");
    }
}
