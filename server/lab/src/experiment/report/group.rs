//! Runs that stand in one line of a table.

use super::{RunKey, RunResult, Runs};
use crate::method::rank;

/// Runs of one method in one setting under one teacher on one task.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(super) struct Group {
    pub(super) task: String,
    pub(super) method: String,
    /// As tables and keys show it; with the teacher where it is not the oracle.
    pub(super) setting: String,
}

impl Group {
    pub(super) fn of(key: &RunKey) -> Self {
        Self {
            task: key.task.clone(),
            method: key.method.clone(),
            setting: key.shown_setting(),
        }
    }

    /// `stair (80 answers)`
    pub(super) fn named(&self) -> String {
        match self.setting.as_str() {
            "" => self.method.clone(),
            setting => format!("{} ({setting})", self.method),
        }
    }
}

/// The groups of a report: tasks in order of their runs, in each the settings in theirs, in each
/// the methods in the registry's order.
pub(super) fn groups(runs: &Runs) -> Vec<Group> {
    let (mut tasks, mut settings, mut groups) = (Vec::new(), Vec::new(), Vec::new());
    for run in &runs.runs {
        let group = Group::of(&run.key);
        if !tasks.contains(&group.task) {
            tasks.push(group.task.clone());
        }
        if !settings.contains(&group.setting) {
            settings.push(group.setting.clone());
        }
        if !groups.contains(&group) {
            groups.push(group);
        }
    }
    let place = |list: &[String], name: &str| list.iter().position(|known| known == name);
    groups.sort_by_key(|group| {
        (
            place(&tasks, &group.task),
            place(&settings, &group.setting),
            rank(&group.method),
        )
    });
    groups
}

/// The runs of a group by seed.
pub(super) fn members<'a>(runs: &'a Runs, group: &Group) -> Vec<&'a RunResult> {
    let mut members: Vec<&RunResult> = runs
        .runs
        .iter()
        .filter(|run| Group::of(&run.key) == *group)
        .collect();
    members.sort_by_key(|run| run.key.seed);
    members
}
