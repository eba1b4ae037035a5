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

pub(super) fn number(value: f64, is_rate: bool) -> String {
    if is_rate {
        format!("{value:.2}")
    } else {
        format!("{value:.0}")
    }
}

pub(super) fn add(text: &mut String, more: impl AsRef<str>) {
    text.push_str(more.as_ref());
}
