//! Which runs a figure over the budget has a place for.

use std::collections::BTreeSet;

use super::group::Group;
use super::{RunKey, RunResult};

/// Runs by budget, where that alone tells the settings of a method apart.
pub(super) struct Budgets<'a> {
    /// Of methods with several budgets, one setting for each.
    pub(super) shown: Vec<&'a RunResult>,
    /// Other settings of methods with several budgets.
    pub(super) left_out: Vec<Group>,
}

impl<'a> Budgets<'a> {
    /// Shows of a method's settings with one budget the one that stands for it, where the method has
    /// several budgets then.
    pub(super) fn of(runs: &[&'a RunResult]) -> Self {
        let settings = firsts(runs);
        let (mut shown, mut left_out) = (Vec::new(), Vec::new());
        for setting in &settings {
            let of_method = settings
                .iter()
                .filter(|s| line(&s.key) == line(&setting.key));
            let budgets: BTreeSet<u32> = of_method.map(|s| s.end.budget).collect();
            let of_budgets: Vec<&RunResult> = budgets
                .iter()
                .filter_map(|budget| standing(&settings, &setting.key, *budget))
                .collect();
            let stands = of_budgets.iter().any(|s| is_of(&s.key, &setting.key));
            if of_budgets.len() > 1 && stands {
                shown.push(&setting.key);
            } else if budgets.len() > 1 {
                left_out.push(Group::of(&setting.key));
            }
        }
        let is_shown = |run: &&RunResult| shown.iter().any(|setting| is_of(&run.key, setting));
        Self {
            shown: runs.iter().copied().filter(is_shown).collect(),
            left_out,
        }
    }
}

/// The first run of each setting of each method.
fn firsts<'a>(runs: &[&'a RunResult]) -> Vec<&'a RunResult> {
    let mut firsts: Vec<&RunResult> = Vec::new();
    for run in runs {
        if !firsts.iter().any(|first| is_of(&first.key, &run.key)) {
            firsts.push(*run);
        }
    }
    firsts
}

/// What is one line of the figure.
fn line(key: &RunKey) -> (&str, &str, &str) {
    (&key.task, &key.method, &key.teacher)
}

/// Whether two runs are of one setting of one method.
fn is_of(a: &RunKey, b: &RunKey) -> bool {
    line(a) == line(b) && a.setting == b.setting
}

/// Of a method's settings with a budget the one that most other methods on the task have too; `None`
/// where several are had by as many.
fn standing<'a>(settings: &[&'a RunResult], method: &RunKey, budget: u32) -> Option<&'a RunResult> {
    let n_others = |key: &RunKey| {
        let here = (&key.task, &key.teacher, &key.setting);
        let others = settings.iter().map(|s| &s.key);
        let others = others.filter(|other| (&other.task, &other.teacher, &other.setting) == here);
        others.filter(|other| other.method != key.method).count()
    };
    let candidates = || {
        let of_method = settings.iter().filter(|s| line(&s.key) == line(method));
        of_method.filter(|s| s.end.budget == budget)
    };
    let most = candidates().map(|s| n_others(&s.key)).max()?;
    let mut leading = candidates().filter(|s| n_others(&s.key) == most);
    match (leading.next(), leading.next()) {
        (Some(one), None) => Some(*one),
        _ => None,
    }
}
