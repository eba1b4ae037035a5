//! Results of experiments, as pages show them: those below the data folder, which may still grow,
//! and those that come with the program.
//!
//! Invariants: reads only, and of a name that is asked for nothing but its own folder; a report is
//! kept until there are other rows.

use std::collections::BTreeMap;
use std::path::{Component, Path};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

use lab::experiment::Artifact;
use lab::experiment::grid::{GridText, resolve, setting_names};
use lab::experiment::report::{self, RowFile};
use lab::experiment::results::{GridFolder, Results, read_rows};
use serde::Deserialize;

/// `(name, experiment.toml, results.jsonl)`
type Shipped = (&'static str, &'static str, &'static str);

const SHIPPED: &[Shipped] = include!(concat!(env!("OUT_DIR"), "/results.rs"));

static REPORTS: Reports = Reports(Mutex::new(BTreeMap::new()));

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
    let is_own = |name: &str| names.iter().any(|own| own == name);
    let others = SHIPPED.iter().filter(|(name, _, _)| !is_own(name));
    own.chain(others.map(shipped)).collect()
}

/// The experiment of that name; `None` also for what is no name of a folder but a path.
pub fn find(data: &Path, name: &str) -> Option<Experiment> {
    if !is_name(name) {
        return None;
    }
    if data.join("experiments").join(name).is_dir() {
        return Some(open(data, name));
    }
    SHIPPED
        .iter()
        .find(|(known, _, _)| *known == name)
        .map(shipped)
}

/// Whether it names something within a folder: not the folder above it, nor anything below.
fn is_name(name: &str) -> bool {
    let mut parts = Path::new(name).components();
    matches!(
        (parts.next(), parts.next()),
        (Some(Component::Normal(part)), None) if part == name
    )
}

fn shipped((name, grid, rows): &Shipped) -> Experiment {
    Experiment {
        is_shipped: true,
        ..described(name, grid, Ok((*rows).to_owned()), None)
    }
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
    let mut experiment = described(name, &text("experiment.toml"), rows, progress);
    if GridFolder::at(&root).is_small() {
        experiment.title += " (small variant)";
    }
    experiment
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
        let results = self.results.as_ref().map_err(String::clone)?;
        if results.runs.is_empty() {
            return Ok(Arc::default());
        }
        REPORTS.get(&self.name, &self.rows, || {
            let file = RowFile {
                name: rows_of(&self.name),
                text: self.rows.clone(),
                settings: self.settings.clone(),
            };
            report::make(&[file], true).map_err(|error| error.to_string())
        })
    }
}

/// Rows and the report of them.
type Made = (String, Arc<Vec<Artifact>>);

/// The latest report of each experiment.
struct Reports(Mutex<BTreeMap<String, Made>>);

impl Reports {
    /// The report of an experiment's rows, made where it is not there.
    ///
    /// Nobody waits while one is made: reports of other experiments can be had meanwhile. Two who ask
    /// for the same new rows at once both make it, which is seldom and comes to the same bytes.
    fn get(
        &self,
        name: &str,
        rows: &str,
        make: impl FnOnce() -> Result<Vec<Artifact>, String>,
    ) -> Result<Arc<Vec<Artifact>>, String> {
        if let Some(report) = self.kept(name, rows) {
            return Ok(report);
        }
        let report = Arc::new(make()?);
        let made = (rows.to_owned(), Arc::clone(&report));
        self.lock().insert(name.to_owned(), made);
        Ok(report)
    }

    fn kept(&self, name: &str, rows: &str) -> Option<Arc<Vec<Artifact>>> {
        let reports = self.lock();
        let (of, report) = reports.get(name)?;
        (of == rows).then(|| Arc::clone(report))
    }

    fn lock(&self) -> MutexGuard<'_, BTreeMap<String, Made>> {
        self.0.lock().unwrap_or_else(PoisonError::into_inner)
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
    fn what_comes_with_the_program_is_named_by_its_whole_path() {
        let names: Vec<&str> = SHIPPED.iter().map(|(name, _, _)| *name).collect();
        assert!(names.is_sorted_by(|a, b| a < b), "each once: {names:?}");
        for name in ["80-answers", "query-rules"] {
            let whole = format!("go-fetch-return-world-axes-{name}");
            assert!(names.contains(&whole.as_str()), "{whole}");
            assert!(!names.contains(&name), "{name}");
        }
    }

    #[test]
    fn a_folder_of_ones_own_stands_for_what_comes_with_the_program() {
        let data = tempfile::tempdir().unwrap();
        let name = SHIPPED[0].0;
        assert!(find(data.path(), name).unwrap().is_shipped);
        std::fs::create_dir_all(data.path().join("experiments").join(name)).unwrap();
        assert!(!find(data.path(), name).unwrap().is_shipped);
        let all = all(data.path());
        let of_name = all.iter().filter(|experiment| experiment.name == name);
        assert_eq!(of_name.count(), 1);
    }

    #[test]
    fn only_folders_of_experiments_can_be_asked_for() {
        let data = tempfile::tempdir().unwrap();
        let folder = data.path().join("experiments/mine");
        std::fs::create_dir_all(folder.join("runs")).unwrap();
        std::fs::create_dir_all(data.path().join("else")).unwrap();
        assert!(find(data.path(), "mine").is_some());
        let outside = data.path().join("else").display().to_string();
        for name in [
            "",
            ".",
            "..",
            "./mine",
            "mine/",
            "mine/runs",
            "../else",
            outside.as_str(),
        ] {
            assert!(find(data.path(), name).is_none(), "{name}");
        }
    }

    #[test]
    fn a_small_variant_says_so() {
        let data = tempfile::tempdir().unwrap();
        let root = data.path().join("experiments/labels");
        std::fs::create_dir_all(&root).unwrap();
        let title = || find(data.path(), "labels").unwrap().title;
        let grid =
            "title = \"Labels\"\n[axes]\ntasks = [\"go-fetch-return\"]\nmethods = [\"stair\"]\n";
        std::fs::write(root.join("experiment.toml"), grid).unwrap();
        assert_eq!(title(), "Labels", "as an earlier revision left it");
        GridFolder::at(&root).keep_file(grid, true).unwrap();
        assert_eq!(title(), "Labels (small variant)");
        GridFolder::at(&root).keep_file(grid, false).unwrap();
        assert_eq!(title(), "Labels");
    }

    #[test]
    fn nobody_waits_while_a_report_is_made_and_it_is_made_once() {
        let reports = Reports(Mutex::default());
        let made = || {
            vec![Artifact {
                name: "report.md".into(),
                text: "made".into(),
            }]
        };
        let first = reports.get("mine", "rows", || {
            assert!(reports.0.try_lock().is_ok(), "others can be had meanwhile");
            Ok(made())
        });
        assert_eq!(*first.unwrap(), made());
        let again = reports.get("mine", "rows", || Err("made again".into()));
        assert_eq!(*again.unwrap(), made());
        let of_new_rows = reports.get("mine", "more rows", || Err("made again".into()));
        assert_eq!(of_new_rows.unwrap_err(), "made again");
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
