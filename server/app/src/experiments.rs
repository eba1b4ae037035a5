//! Results of experiments, as pages show them: those below the data folder, which may still grow,
//! and those that come with the program.
//!
//! Invariants: reads only; a report is made once for the same rows.

use std::collections::BTreeMap;
use std::path::Path;
use std::sync::{Arc, Mutex, PoisonError};

use lab::experiment::Artifact;
use lab::experiment::grid::{GridText, resolve, setting_names};
use lab::experiment::report::{self, RowFile};
use lab::experiment::results::{GridFolder, Results, read_rows};
use serde::Deserialize;

/// `(name, experiment.toml, results.jsonl)`
const SHIPPED: &[(&str, &str, &str)] = include!(concat!(env!("OUT_DIR"), "/results.rs"));

/// An experiment with its rows.
#[derive(Debug, Clone)]
pub struct Experiment {
    /// Of its folder.
    pub name: String,
    /// What it shows, in a few words.
    pub title: String,
    /// What it shows, in sentences.
    pub about: String,
    /// JSON Lines.
    pub rows: String,
    /// What they say: runs that are over, and those that failed; else what is wrong with them.
    pub results: Result<Results, String>,
    /// Its settings, in the order of its file.
    pub settings: Vec<String>,
    /// Where it is, while it runs.
    pub progress: Option<Progress>,
    /// Whether it came with the program.
    pub is_shipped: bool,
}

/// What `stair experiment run` says about itself.
#[derive(Debug, Clone, PartialEq, Deserialize)]
pub struct Progress {
    /// In the grid.
    pub n_runs: usize,
    /// Finished or failed.
    pub n_over: usize,
    /// Under way.
    pub running: Vec<Running>,
    /// Seconds, about.
    pub left_s: f64,
    /// Whether somebody works on it now.
    #[serde(skip)]
    pub is_up: bool,
}

/// A run under way.
#[derive(Debug, Clone, PartialEq, Deserialize)]
pub struct Running {
    /// Its name.
    pub name: String,
    /// Environment steps taken.
    pub step: u64,
    /// Environment steps in all.
    pub total_steps: u64,
}

/// Every experiment: of the data folder, then of the program.
pub fn all(data: &Path) -> Vec<Experiment> {
    let entries = std::fs::read_dir(data.join("experiments"));
    let entries = entries.into_iter().flatten().flatten();
    let mut names: Vec<String> = entries
        .filter(|entry| entry.path().is_dir())
        .map(|entry| entry.file_name().to_string_lossy().into_owned())
        .collect();
    names.sort();
    let own = names.iter().map(|name| open(data, name));
    let shipped = SHIPPED
        .iter()
        .filter(|(name, _, _)| !names.iter().any(|own| own == name))
        .map(|(name, grid, rows)| Experiment {
            is_shipped: true,
            ..described(name, grid, Ok((*rows).to_owned()), None)
        });
    own.chain(shipped).collect()
}

/// The experiment of that name.
pub fn find(data: &Path, name: &str) -> Option<Experiment> {
    all(data)
        .into_iter()
        .find(|experiment| experiment.name == name)
}

fn open(data: &Path, name: &str) -> Experiment {
    let root = data.join("experiments").join(name);
    let text = |file: &str| std::fs::read_to_string(root.join(file)).unwrap_or_default();
    let rows = match read_rows(&root.join("results.jsonl")) {
        Err(error) if error.kind() == std::io::ErrorKind::NotFound => Ok(String::new()),
        read => read.map_err(|error| format!("{}: {error}", rows_of(name))),
    };
    let progress = serde_json::from_str::<Progress>(&text("progress.json")).ok();
    let progress = progress.map(|progress| Progress {
        is_up: is_held(&root),
        ..progress
    });
    described(name, &text("experiment.toml"), rows, progress)
}

/// Whether a start of the experiment, or a run of it, is up.
fn is_held(root: &Path) -> bool {
    if !root.join("log.jsonl").exists() {
        return false;
    }
    let log = GridFolder::at(root).log_file();
    log.is_ok_and(|log| matches!(log.try_lock(), Err(std::fs::TryLockError::WouldBlock)))
}

/// The file of an experiment's rows as people know it.
fn rows_of(name: &str) -> String {
    format!("experiments/{name}/results.jsonl")
}

fn described(
    name: &str,
    grid: &str,
    rows: Result<String, String>,
    progress: Option<Progress>,
) -> Experiment {
    let source = GridText { name, text: grid };
    let (title, about) = resolve(source, false).map_or_else(
        |_| (name.to_owned(), String::new()),
        |grid| (grid.title, grid.about),
    );
    let results = rows
        .as_ref()
        .map_err(String::clone)
        .and_then(|rows| Results::parse(&rows_of(name), rows).map_err(|error| error.to_string()));
    Experiment {
        name: name.to_owned(),
        title,
        about,
        rows: rows.unwrap_or_default(), // results say what is wrong with them
        results,
        settings: setting_names(source),
        progress,
        is_shipped: false,
    }
}

impl Experiment {
    /// The report; empty before the first run is over. Made anew when there are new rows.
    ///
    /// # Errors
    /// What is wrong with the rows, for the person who looks at them.
    pub fn report(&self) -> Result<Arc<Vec<Artifact>>, String> {
        type Made = (String, Arc<Vec<Artifact>>);
        static MADE: Mutex<BTreeMap<String, Made>> = Mutex::new(BTreeMap::new());
        if self
            .results
            .as_ref()
            .map_err(String::clone)?
            .runs
            .is_empty()
        {
            return Ok(Arc::default());
        }
        let mut made = MADE.lock().unwrap_or_else(PoisonError::into_inner);
        if let Some((rows, report)) = made.get(&self.name)
            && *rows == self.rows
        {
            return Ok(Arc::clone(report));
        }
        let file = RowFile {
            name: rows_of(&self.name),
            text: self.rows.clone(),
            settings: self.settings.clone(),
        };
        let report = Arc::new(report::make(&[file], true).map_err(|error| error.to_string())?);
        made.insert(self.name.clone(), (self.rows.clone(), Arc::clone(&report)));
        Ok(report)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_comes_with_the_program_can_be_reported() {
        for (name, grid, rows) in SHIPPED {
            let experiment = described(name, grid, Ok((*rows).to_owned()), None);
            assert_ne!(experiment.title, *name, "experiment.toml of {name}");
            let report = experiment
                .report()
                .unwrap_or_else(|error| panic!("{name}: {error}"));
            assert!(!report.is_empty(), "{name}");
        }
    }

    #[test]
    fn a_folder_without_rows_is_there_and_says_nothing() {
        let data = tempfile::tempdir().unwrap();
        std::fs::create_dir_all(data.path().join("experiments/mine")).unwrap();
        let mine = find(data.path(), "mine").unwrap();
        assert_eq!(
            (mine.results.clone(), mine.progress.clone()),
            (Ok(Results::default()), None)
        );
        assert!(mine.report().unwrap().is_empty());
        assert!(find(data.path(), "..").is_none());

        let rows = data.path().join("experiments/mine/results.jsonl");
        for (damaged, told) in [(&b"{}\n"[..], "line 1"), (b"\xff\n", "utf-8")] {
            std::fs::write(&rows, damaged).unwrap();
            let mine = find(data.path(), "mine").unwrap();
            let error = mine.report().unwrap_err();
            assert!(error.contains("mine") && error.contains(told), "{error}");
        }
    }
}
