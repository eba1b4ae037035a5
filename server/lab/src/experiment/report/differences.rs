//! Differences between methods and between settings, from runs of the same seed.

use domain::agreement::Bootstrap;

use super::group::{Group, members};
use super::numbers::{add, told_of};
use super::score::{area, same_stage, score};
use super::{RunResult, Runs};
use crate::words::thousands;

/// How likely a difference that is called one may be by chance.
const LEVEL: f64 = 0.05;

/// A table of the differences within a task; nothing where there is but one group.
pub(super) fn differences(text: &mut String, runs: &Runs, groups: &[&Group]) {
    let mut lines = String::new();
    for (first, second) in pairs(groups) {
        let (a, b) = (members(runs, first), members(runs, second));
        let paired: Vec<(&RunResult, &RunResult)> = a
            .iter()
            .filter_map(|run| {
                let other = b.iter().find(|other| other.key.seed == run.key.seed)?;
                Some((*run, *other))
            })
            .collect();
        let is_rate = a.iter().all(|run| run.end.has_success);
        let of = |f: &dyn Fn(&RunResult) -> f64| {
            let pairs: Vec<(f64, f64)> = paired.iter().map(|(a, b)| (f(a), f(b))).collect();
            difference(&pairs, is_rate)
        };
        let stage: Vec<(f64, f64)> = paired
            .iter()
            .filter_map(|(a, b)| Some((same_stage(a)?, same_stage(b)?)))
            .collect();
        add(
            &mut lines,
            format!(
                "| {} − {}{} | {} | {} | {} | {} |\n",
                first.named(),
                second.named(),
                other_steps(&a, &b),
                paired.len(),
                of(&|run| score(run).value),
                of(&area),
                difference(&stage, true)
            ),
        );
    }
    if !lines.is_empty() {
        text.push_str(
            "\nDifferences between runs of the same seed, mean with its 95 % bootstrap interval; bold where it excludes 0 \
             and a two-sided sign-flip test over the pairs (exact up to 16 of them) gives p < 0.05, which takes six pairs at least:\n\n\
             | difference | seeds | of scores | of areas | of pairs in one true stage |\n|---|---:|---|---|---|\n",
        );
        text.push_str(&lines);
    }
}

/// In a setting its first method against every other, and every other against PEBBLE; then of a
/// method its first setting against every other.
fn pairs<'a>(groups: &[&'a Group]) -> Vec<(&'a Group, &'a Group)> {
    let of_setting = |a: &Group, b: &Group| a.setting == b.setting;
    let of_method = |a: &Group, b: &Group| a.method == b.method;
    let mut pairs = against_first(groups, of_setting);
    pairs.extend(against_pebble(groups));
    pairs.extend(against_first(groups, of_method));
    pairs
}

/// The first of groups that are alike and each other one.
fn against_first<'a>(
    groups: &[&'a Group],
    are_alike: fn(&Group, &Group) -> bool,
) -> Vec<(&'a Group, &'a Group)> {
    let mut pairs = Vec::new();
    for (n, group) in groups.iter().enumerate() {
        let first = groups.iter().position(|other| are_alike(other, group));
        pairs.extend(
            first
                .filter(|first| *first < n)
                .map(|first| (groups[first], *group)),
        );
    }
    pairs
}

/// Each method and PEBBLE in the same setting, but the setting's first, which is held against all.
fn against_pebble<'a>(groups: &[&'a Group]) -> Vec<(&'a Group, &'a Group)> {
    let mut pairs = Vec::new();
    for (n, group) in groups.iter().enumerate() {
        let mut of_setting = (0..groups.len()).filter(|k| groups[*k].setting == group.setting);
        let first = of_setting.next();
        let pebble = of_setting.find(|k| groups[*k].method == "pebble");
        pairs.extend(
            pebble
                .filter(|pebble| *pebble != n && first != Some(n))
                .map(|pebble| (*group, groups[pebble])),
        );
    }
    pairs
}

/// ` (1,000,000 against 2,010,000 steps)` where one was trained for longer than the other.
fn other_steps(first: &[&RunResult], second: &[&RunResult]) -> String {
    let steps = |members: &[&RunResult]| members.first().map(|run| run.end.total_steps);
    match (steps(first), steps(second)) {
        (Some(a), Some(b)) if a != b => {
            format!(" ({} against {} steps)", thousands(a), thousands(b))
        }
        _ => String::new(),
    }
}

fn difference(pairs: &[(f64, f64)], is_rate: bool) -> String {
    let resampling = Bootstrap::default();
    resampling.paired_difference(pairs).map_or_else(
        || "–".into(),
        |found| {
            let told = told_of(pairs.len(), &found, is_rate);
            let is_unlikely = resampling.sign_flip_p(pairs).is_some_and(|p| p < LEVEL);
            let is_sure = is_unlikely && !found.interval.contains(0.0);
            if is_sure { format!("**{told}**") } else { told }
        },
    )
}
