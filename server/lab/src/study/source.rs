//! Where a study's segments come from.

use std::path::{Path, PathBuf};

use super::section::{Placed, Section, hint};
use crate::method::METHODS;

/// Where a study's segments come from.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum Source {
    /// Episodes of the tasks' scripted experts: random pairs of segments.
    Expert {
        /// Segments start before this step.
        start_before: u32,
        /// Episodes that segments are drawn from, of each task.
        n_episodes: u32,
    },
    /// Queries as methods chose them in runs.
    Queries(Vec<QuerySet>),
}

/// The queries of one run.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct QuerySet {
    /// The run's task.
    pub task: String,
    /// The method that chose; never told to a labeler.
    pub method: String,
    /// A packed query set, or the folder of a finished run; seen from the study file's folder.
    pub from: PathBuf,
}

#[derive(Clone, Copy)]
enum Kind {
    Expert,
    Queries,
}

impl Source {
    /// The methods that are compared, in the order of the file; empty for experts.
    pub fn methods(&self) -> Vec<&str> {
        let mut methods: Vec<&str> = Vec::new();
        if let Self::Queries(sets) = self {
            for set in sets {
                if !methods.contains(&set.method.as_str()) {
                    methods.push(&set.method);
                }
            }
        }
        methods
    }

    /// The table `[source]`; what does not fit is noted. `folder` is where the file lies.
    pub(super) fn read(
        mut section: Section<'_>,
        tasks: &[&'static sim::tasks::Task],
        folder: &Path,
    ) -> Self {
        let kinds = [("expert", Kind::Expert), ("queries", Kind::Queries)];
        let kind = section.choice("kind", &kinds);
        let source = match kind {
            Some(Kind::Queries) => Self::Queries(read_sets(&mut section, tasks, folder)),
            _ => Self::Expert {
                start_before: section.number("start_before", 1..=100_000, Some(100)).value,
                n_episodes: section.number("episodes", 1..=1_000, Some(20)).value,
            },
        };
        if matches!(kind, Some(Kind::Expert)) {
            for task in tasks.iter().filter(|task| task.expert.is_none()) {
                let message = format!("{} has no scripted expert to draw segments from", task.name);
                section.note(section.line(), message);
            }
        }
        if kind.is_some() {
            section.finish();
        }
        source
    }
}

fn read_sets(
    section: &mut Section<'_>,
    tasks: &[&'static sim::tasks::Task],
    folder: &Path,
) -> Vec<QuerySet> {
    let mut sets: Vec<QuerySet> = Vec::new();
    for mut set in section.tables("sets") {
        let task = set.words("task");
        known(&set, &task, "task of this study", &names(tasks));
        let method = set.words("method");
        let methods: Vec<&str> = METHODS.iter().map(|method| method.name).collect();
        known(&set, &method, "method", &methods);
        let from = set.words("from");
        let found = QuerySet {
            task: task.value,
            method: method.value,
            from: from.value.into(),
        };
        if !found.from.as_os_str().is_empty() && !found.exists(folder) {
            let message = format!("the query set {} does not exist", found.from.display());
            set.note(from.line, message);
        }
        let is_twice = sets
            .iter()
            .any(|other| other.task == found.task && other.method == found.method);
        if is_twice {
            let message = format!("{} of {} is there already", found.method, found.task);
            set.note(set.line(), message);
        }
        sets.push(found);
        set.finish();
    }
    check_cover(section, tasks, &sets);
    sets
}

/// Each task needs a set of each method, or the methods could not be compared within tasks.
fn check_cover(section: &Section<'_>, tasks: &[&'static sim::tasks::Task], sets: &[QuerySet]) {
    if sets.is_empty() {
        let message = "`sets` is missing: write [[source.sets]] with task, method and from";
        section.note(section.line(), message.to_owned());
        return;
    }
    let mut methods: Vec<&str> = sets.iter().map(|set| set.method.as_str()).collect();
    methods.sort_unstable();
    methods.dedup();
    for task in tasks {
        for method in &methods {
            let is_there = |set: &QuerySet| set.task == task.name && set.method == *method;
            if !sets.iter().any(is_there) {
                let message = format!("there is no query set of {method} for {}", task.name);
                section.note(section.line(), message);
            }
        }
    }
}

fn known(section: &Section<'_>, word: &Placed<String>, what: &str, known: &[&str]) {
    if !word.value.is_empty() && !known.contains(&word.value.as_str()) {
        let message = format!("there is no {what} '{}'", word.value);
        section.note(word.line, message + &hint(&word.value, known));
    }
}

fn names(tasks: &[&'static sim::tasks::Task]) -> Vec<&'static str> {
    tasks.iter().map(|task| task.name).collect()
}
