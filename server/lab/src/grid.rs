//! A grid of runs: task × method × teacher × setting × seed, from one file.
//!
//! An experiment's file holds one or more grids, and a `small` one that makes the same figure in
//! a fraction of the time. Planning it resolves every run's settings, so that a wrong name is
//! found before the first run starts.

use std::collections::BTreeSet;
use std::time::Duration;

use serde::Deserialize;
use toml::Spanned;

use crate::config::{ConfigError, Layers, RunConfig, find_task, unknown};
use crate::cost;
use crate::method;

mod rows;

pub use rows::{Ended, ResultError, RunResult, RunRow};

/// What an experiment's file says.
#[derive(Debug, Clone, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ExperimentFile {
    /// For people.
    pub title: String,
    /// What it shows, and where in the paper.
    pub summary: String,
    /// What runs along the horizontal axis of its curves.
    #[serde(default)]
    pub x: Axis,
    /// The whole of it.
    pub grid: Vec<Grid>,
    /// One task, two methods, two seeds: the same figure, sooner.
    pub small: Option<Grid>,
}

/// The horizontal axis of curves.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Axis {
    /// Environment steps.
    #[default]
    Step,
    /// Answers.
    Labels,
}

impl Axis {
    /// As figures call it.
    pub fn column(self) -> &'static str {
        match self {
            Self::Step => "step",
            Self::Labels => "labels",
        }
    }
}

/// A product of runs.
#[derive(Debug, Clone, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Grid {
    /// Names that `stair tasks` lists.
    pub tasks: Vec<Spanned<String>>,
    /// The same.
    pub methods: Vec<Spanned<String>>,
    /// The same; the oracle where nothing is said.
    #[serde(default)]
    pub teachers: Vec<Spanned<String>>,
    /// How many, from 1, or which.
    #[serde(default)]
    pub seeds: Seeds,
    /// On top of the tasks' and methods' own.
    #[serde(default)]
    pub presets: Vec<Spanned<String>>,
    /// Settings of all runs, `key.path=value`.
    #[serde(default)]
    pub set: Vec<Spanned<String>>,
    /// Settings in which runs differ; one without a name where nothing is said.
    #[serde(default)]
    pub settings: Vec<Variant>,
}

/// Seeds of a grid.
#[derive(Debug, Clone, PartialEq, Eq, Deserialize)]
#[serde(untagged)]
pub enum Seeds {
    /// 1 to this.
    UpTo(u64),
    /// These.
    These(Vec<u64>),
}

impl Default for Seeds {
    fn default() -> Self {
        Self::UpTo(1)
    }
}

impl Seeds {
    fn list(&self) -> Vec<u64> {
        match self {
            Self::UpTo(n) => (1..=*n).collect(),
            Self::These(seeds) => seeds.clone(),
        }
    }
}

/// One of the settings in which runs differ.
#[derive(Debug, Clone, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Variant {
    /// As figures and tables show it, such as `N = 500`.
    pub name: String,
    /// `key.path=value`.
    pub set: Vec<Spanned<String>>,
}

/// One run of an experiment.
#[derive(Debug, Clone, PartialEq)]
pub struct PlannedRun {
    /// Its place in the plan, from 0.
    pub index: usize,
    /// Tells it from the others and fits a file's name: `door-open-stair-1`.
    pub name: String,
    /// The scripted teacher.
    pub teacher: String,
    /// In what it differs beside task, method and seed; may be empty.
    pub setting: String,
    /// Resolved.
    pub config: RunConfig,
}

/// Why an experiment's file cannot be used.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum GridError {
    /// Not of this form.
    #[error("{file}: line {line}: {message}")]
    AtLine {
        /// The file.
        file: String,
        /// From 1.
        line: usize,
        /// What is wrong there.
        message: String,
    },
    /// Wrong as a whole.
    #[error("{file}: {message}")]
    Whole {
        /// The file.
        file: String,
        /// What is wrong.
        message: String,
    },
}

/// The text of an experiment's file, with its name for errors.
#[derive(Debug, Clone, Copy)]
pub struct FileText<'a> {
    /// The file.
    pub name: &'a str,
    /// What it holds.
    pub text: &'a str,
}

impl FileText<'_> {
    fn at(self, place: usize, message: impl Into<String>) -> GridError {
        let before = &self.text[..place.min(self.text.len())];
        GridError::AtLine {
            file: self.name.to_owned(),
            line: 1 + before.matches('\n').count(),
            message: message.into(),
        }
    }

    fn whole(self, message: impl Into<String>) -> GridError {
        GridError::Whole {
            file: self.name.to_owned(),
            message: message.into(),
        }
    }

    /// Reads it.
    ///
    /// # Errors
    /// [`GridError`] with the line.
    pub fn parse(self) -> Result<ExperimentFile, GridError> {
        toml::from_str(self.text).map_err(|error| {
            let message = error.message().to_owned();
            match error.span() {
                Some(span) => self.at(span.start, message),
                None => self.whole(message),
            }
        })
    }

    /// All runs of the file, or of its small variant, in the order in which they are started.
    ///
    /// # Errors
    /// The first name or value that does not fit, with its line; an empty product; a run that is
    /// planned twice.
    pub fn plan(self, is_small: bool) -> Result<Vec<PlannedRun>, GridError> {
        let file = self.parse()?;
        let grids = match (is_small, file.small) {
            (false, _) => file.grid,
            (true, Some(small)) => vec![small],
            (true, None) => return Err(self.whole("it has no [small] variant")),
        };
        let mut runs: Vec<PlannedRun> = Vec::new();
        for grid in &grids {
            let planned = self.plan_grid(grid)?;
            if planned.is_empty() {
                return Err(self.whole(
                    "a grid is an empty product: it needs at least one task, one method and one seed",
                ));
            }
            runs.extend(planned);
        }
        if runs.is_empty() {
            return Err(self.whole("it has no [[grid]]"));
        }
        for (index, run) in runs.iter_mut().enumerate() {
            run.index = index;
        }
        let mut names = BTreeSet::new();
        match runs.iter().find(|run| !names.insert(run.name.clone())) {
            Some(twice) => Err(self.whole(format!("the run {} is planned twice", twice.name))),
            None => Ok(runs),
        }
    }

    fn plan_grid(self, grid: &Grid) -> Result<Vec<PlannedRun>, GridError> {
        let explain = |name: &Spanned<String>, error: &ConfigError| {
            self.at(name.span().start, error.to_string())
        };
        for task in &grid.tasks {
            find_task(task.as_ref()).map_err(|e| explain(task, &e))?;
        }
        for method in &grid.methods {
            method::find(method.as_ref()).map_err(|e| explain(method, &e))?;
        }
        for teacher in &grid.teachers {
            find_teacher(teacher.as_ref()).map_err(|e| explain(teacher, &e))?;
        }
        let oracle = ["oracle"];
        let teachers: Vec<&str> = match grid.teachers.as_slice() {
            [] => oracle.to_vec(),
            some => some.iter().map(|t| t.as_ref().as_str()).collect(),
        };
        let plain = Variant {
            name: String::new(),
            set: Vec::new(),
        };
        let variants = match grid.settings.as_slice() {
            [] => std::slice::from_ref(&plain),
            some => some,
        };
        let mut runs = Vec::new();
        // seeds outermost: an unfinished experiment has every method on the first seeds
        for seed in grid.seeds.list() {
            for task in &grid.tasks {
                for variant in variants {
                    for teacher in &teachers {
                        for method in &grid.methods {
                            let names = (task.as_ref().as_str(), method.as_ref().as_str());
                            runs.push(self.plan_run(grid, names, variant, teacher, seed)?);
                        }
                    }
                }
            }
        }
        Ok(runs)
    }

    fn plan_run(
        self,
        grid: &Grid,
        (task, method): (&str, &str),
        variant: &Variant,
        teacher: &str,
        seed: u64,
    ) -> Result<PlannedRun, GridError> {
        let told = || grid.set.iter().chain(&variant.set);
        let layers = |set: Vec<String>| Layers {
            task: Some(task.to_owned()),
            method: Some(method.to_owned()),
            presets: grid.presets.iter().map(|p| p.as_ref().clone()).collect(),
            file: None,
            overrides: set,
        };
        let mut all: Vec<String> = told().map(|s| s.as_ref().clone()).collect();
        all.push(format!("seed={seed}"));
        let config = RunConfig::resolve(&layers(all)).map_err(|error| {
            // which of them is it?
            let is_wrong = |set: Vec<String>| RunConfig::resolve(&layers(set)).is_err();
            let culprit = match grid.presets.first() {
                Some(preset) if is_wrong(Vec::new()) => Some(preset),
                _ => told().find(|s| is_wrong(vec![s.as_ref().clone()])),
            };
            match culprit {
                Some(culprit) => self.at(culprit.span().start, error.to_string()),
                None => self.whole(error.to_string()),
            }
        })?;
        let is_oracle = teacher == "oracle";
        let parts = [variant.name.as_str(), if is_oracle { "" } else { teacher }];
        let parts: Vec<&str> = parts.into_iter().filter(|p| !p.is_empty()).collect();
        let mut name = format!("{task}-{method}");
        for part in &parts {
            name.push('-');
            name.push_str(&slug(part));
        }
        Ok(PlannedRun {
            index: 0, // the whole plan says
            name: format!("{name}-{seed}"),
            teacher: teacher.to_owned(),
            setting: parts.join(", "),
            config,
        })
    }
}

/// About how long runs take on this machine, a run on each of `n_jobs` cores.
///
/// # Panics
/// Never: planned runs have tasks that exist.
pub fn time_here(runs: &[PlannedRun], n_jobs: usize) -> Duration {
    let of = |run: &PlannedRun| {
        let task = find_task(&run.config.task).expect("a planned run's task exists");
        cost::time_here(&run.config, &(task.spec)())
    };
    runs.iter().map(of).sum::<Duration>() / n_jobs.max(1) as u32
}

fn find_teacher(name: &str) -> Result<(), ConfigError> {
    let known = || domain::teacher::SCRIPTED.iter().map(|(name, _)| *name);
    if known().any(|k| k == name) {
        Ok(())
    } else {
        Err(unknown("teacher", name, known()))
    }
}

/// `N = 500` → `n-500`.
fn slug(text: &str) -> String {
    let lower = text.to_lowercase();
    let words = lower.split(|c: char| !c.is_ascii_alphanumeric());
    let words: Vec<&str> = words.filter(|word| !word.is_empty()).collect();
    words.join("-")
}

#[cfg(test)]
mod tests {
    use super::*;

    const FILE: &str = r#"
title = "Labels"
summary = "How many answers it takes."
x = "labels"

[[grid]]
tasks = ["go-fetch-return"]
methods = ["stair", "pebble"]
teachers = ["oracle", "mistaken"]
seeds = 2
presets = ["quick"]
settings = [
    { name = "N = 40", set = ["feedback.budget=40"] },
    { name = "N = 80", set = ["feedback.budget=80"] },
]

[small]
tasks = ["go-fetch-return"]
methods = ["uniform"]
seeds = [7]
"#;

    fn plan(text: &str, is_small: bool) -> Result<Vec<PlannedRun>, GridError> {
        let name = "labels.toml";
        FileText { name, text }.plan(is_small)
    }

    fn told(text: &str) -> String {
        plan(text, false).unwrap_err().to_string()
    }

    #[test]
    fn a_grid_is_the_product_of_its_lists() {
        let runs = plan(FILE, false).unwrap();
        assert_eq!(runs.len(), 16);
        assert_eq!(runs[0].name, "go-fetch-return-stair-n-40-1");
        assert_eq!(runs[2].name, "go-fetch-return-stair-n-40-mistaken-1");
        assert_eq!(runs[2].setting, "N = 40, mistaken");
        assert_eq!(runs[15].name, "go-fetch-return-pebble-n-80-mistaken-2");
        assert_eq!(runs[15].config.feedback.budget, 80);
        assert_eq!(runs[15].config.seed, 2);
        let small = plan(FILE, true).unwrap();
        assert_eq!(small.len(), 1);
        assert_eq!(small[0].name, "go-fetch-return-uniform-7");
    }

    #[test]
    fn what_is_wrong_is_named_with_its_line_and_the_nearest_right_name() {
        let wrong = told(&FILE.replacen("\"pebble\"", "\"peble\"", 1));
        assert!(wrong.starts_with("labels.toml: line 8: "), "{wrong}");
        assert!(wrong.contains("did you mean 'pebble'"), "{wrong}");
        let wrong = told(&FILE.replace("\"mistaken\"", "\"mistakn\""));
        assert!(
            wrong.contains("line 9") && wrong.contains("'mistaken'"),
            "{wrong}"
        );
        let wrong = told(&FILE.replace("feedback.budget=80", "feedback.bugdet=80"));
        assert!(
            wrong.contains("line 14") && wrong.contains("`budget`"),
            "{wrong}"
        );
        let wrong = told(&FILE.replace("seeds = 2", "sedes = 2"));
        assert!(
            wrong.contains("line 10") && wrong.contains("sedes"),
            "{wrong}"
        );
        let wrong = told(&FILE.replace("[\"quick\"]", "[\"quik\"]"));
        assert!(
            wrong.contains("line 11") && wrong.contains("'quick'"),
            "{wrong}"
        );
    }

    #[test]
    fn an_empty_product_and_a_run_twice_are_refused() {
        let empty = told(&FILE.replace("seeds = 2", "seeds = []"));
        assert!(empty.contains("empty product"), "{empty}");
        let twice = told(&FILE.replace("\"pebble\"", "\"stair\""));
        assert!(twice.contains("planned twice"), "{twice}");
    }
}
