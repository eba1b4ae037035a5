//! Which lines share a panel: those of a task, or of a task in one setting; with more of them than
//! colours, few at a time.

use std::collections::{BTreeMap, BTreeSet};

use super::Curve;
use crate::figure::plot::N_COLORS;
use crate::figure::shown_method;

/// What a panel shows: a task, in one setting or in all.
#[derive(Debug, Clone, PartialEq, Eq, PartialOrd, Ord)]
pub(in crate::figure) struct Shown {
    pub(in crate::figure) task: String,
    pub(in crate::figure) setting: Option<String>,
}

impl Shown {
    /// Over the panel: its task, and the setting where the task has several.
    pub(in crate::figure) fn title<'a>(&self, all: impl IntoIterator<Item = &'a Self>) -> String {
        let is_other = |other: &Self| other.task == self.task && other.setting != self.setting;
        let has_several = all.into_iter().any(is_other);
        match self.setting.as_deref() {
            Some(setting) if has_several && !setting.is_empty() => {
                format!("{}, {setting}", self.task)
            }
            _ => self.task.clone(),
        }
    }
}

/// Whether each setting needs panels of its own, of task, method and setting of all that is drawn:
/// lines of several methods in several settings on one task would lie over each other.
pub(in crate::figure) fn is_by_setting<'a>(
    drawn: impl Iterator<Item = (&'a str, &'a str, &'a str)>,
) -> bool {
    let mut methods: BTreeMap<(&str, &str), BTreeSet<&str>> = BTreeMap::new();
    for (task, method, setting) in drawn {
        methods.entry((task, setting)).or_default().insert(method);
    }
    let with_several = |task: &str| {
        let of_task = methods.iter().filter(|((of, _), _)| *of == task);
        of_task.filter(|(_, methods)| methods.len() > 1).count()
    };
    methods.keys().any(|(task, _)| with_several(task) > 1)
}

/// Lines that belong together, such as those of one method in one setting.
pub(in crate::figure) struct Bundle {
    /// What they are of.
    pub(in crate::figure) name: String,
    /// Their places among the groups of a panel.
    pub(in crate::figure) lines: Vec<usize>,
}

/// A panel with its title; with more lines than colours one for each bundle: beside the first one
/// where a bundle is a single line, else alone, as its lines are held against each other.
///
/// * `groups` – the curves of each group; the bundles say which of them belong together
pub(in crate::figure) fn apart(
    title: &str,
    groups: Vec<Vec<Curve>>,
    bundles: &[Bundle],
) -> Vec<(String, Vec<Vec<Curve>>)> {
    let first: &[usize] = match bundles {
        [first, ..] => &first.lines,
        [] => &[],
    };
    let is_there = |n: usize| !groups[n].is_empty();
    let n_others = (0..groups.len()).filter(|n| is_there(*n) && !first.contains(n));
    if first.len() + n_others.count() <= N_COLORS {
        return vec![(title.to_owned(), groups)];
    }
    let are_single = bundles.iter().all(|bundle| bundle.lines.len() == 1);
    let beside: &[usize] = if are_single { first } else { &[] };
    let of_bundle = |bundle: &Bundle| {
        let is_drawn = |n: usize| bundle.lines.contains(&n) || beside.contains(&n);
        let drawn = |n: usize| {
            if is_drawn(n) {
                groups[n].clone()
            } else {
                Vec::new()
            }
        };
        let lines: Vec<Vec<Curve>> = (0..groups.len()).map(drawn).collect();
        (format!("{title}: {}", bundle.name), lines)
    };
    let bundles = bundles.iter().skip(usize::from(are_single));
    let there = bundles.filter(|bundle| bundle.lines.iter().any(|n| is_there(*n)));
    there.map(of_bundle).collect()
}

/// `STAIR, 80 answers`
pub(in crate::figure) fn line_name(method: &str, setting: &str) -> String {
    let method = shown_method(method);
    if setting.is_empty() {
        method
    } else {
        format!("{method}, {setting}")
    }
}

/// `5 seeds`, or `3–5 seeds` where not all curves of a line have as many.
pub(in crate::figure) fn seeds_in_words(of_curves: impl Iterator<Item = usize>) -> String {
    let of_curves: Vec<usize> = of_curves.collect();
    let least = of_curves.iter().min().copied().unwrap_or(0);
    let most = of_curves.iter().max().copied().unwrap_or(0);
    match (least, most) {
        (1, 1) => "1 seed".to_owned(),
        (least, most) if least == most => format!("{most} seeds"),
        (least, most) => format!("{least}–{most} seeds"),
    }
}
