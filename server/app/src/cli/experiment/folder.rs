//! An experiment's folder: its file, its results, and the folders of its runs.

use std::path::{Path, PathBuf};

use anyhow::Context as _;
use lab::config::RunConfig;
use lab::grid::{Ended, ExperimentFile, FileText, PlannedRun, RunResult, RunRow};
use lab::message::Event;
use lab::run::Run;

use super::machine;
use crate::cli::BadInput;
use crate::cli::figure::write;

/// Where an experiment lies.
pub(super) struct ExperimentFolder {
    root: PathBuf,
}

/// What became of a planned run so far.
pub(super) enum Standing {
    /// Its result is kept.
    Finished,
    /// It has a folder with checkpoints.
    Started,
    /// Nothing yet, or it failed before it could begin.
    New,
}

/// An experiment's file and its planned runs.
///
/// # Errors
/// [`BadInput`] names the line.
pub(super) fn read_plan(
    path: &Path,
    is_small: bool,
) -> anyhow::Result<(ExperimentFile, Vec<PlannedRun>)> {
    let name = path.display().to_string();
    let text = read(path)?;
    let file = FileText {
        name: &name,
        text: &text,
    };
    let plan = file.plan(is_small).map_err(BadInput::from_error)?;
    Ok((file.parse().map_err(BadInput::from_error)?, plan))
}

pub(super) fn read(path: &Path) -> anyhow::Result<String> {
    std::fs::read_to_string(path)
        .map_err(|error| BadInput(format!("cannot read {}: {error}", path.display())).into())
}

impl ExperimentFolder {
    pub(super) fn at(root: &Path) -> Self {
        Self {
            root: root.to_owned(),
        }
    }

    pub(super) fn root(&self) -> &Path {
        &self.root
    }

    pub(super) fn file(&self) -> PathBuf {
        self.root.join("experiment.toml")
    }

    pub(super) fn run_folder(&self, run: &PlannedRun) -> PathBuf {
        self.root.join("runs").join(&run.name)
    }

    pub(super) fn settings(&self, run: &PlannedRun) -> PathBuf {
        self.root
            .join("settings")
            .join(&run.name)
            .with_extension("toml")
    }

    pub(super) fn log(&self, run: &PlannedRun) -> PathBuf {
        self.root.join("logs").join(&run.name).with_extension("log")
    }

    fn result(&self, run: &str) -> PathBuf {
        self.root.join("results").join(format!("{run}.jsonl"))
    }

    /// Makes the folder, or makes sure that it holds this very experiment.
    ///
    /// # Errors
    /// [`BadInput`] when another experiment lies there.
    pub(super) fn claim(&self, text: &str) -> anyhow::Result<()> {
        let path = self.file();
        if path.exists() && read(&path)? != text {
            return Err(BadInput(format!(
                "{} holds results of another experiment's file (compare {}); choose another --out",
                self.root.display(),
                path.display()
            ))
            .into());
        }
        write(&path, text.as_bytes())
    }

    /// What became of a run, where it fits the plan.
    ///
    /// # Errors
    /// [`BadInput`] when it was made with other settings or by another revision.
    pub(super) fn standing(
        &self,
        run: &PlannedRun,
        may_mix_revisions: bool,
    ) -> anyhow::Result<Standing> {
        let path = self.result(&run.name);
        if path.exists() {
            let name = path.display().to_string();
            let result = RunResult::read(&name, &read(&path)?).map_err(BadInput::from_error)?;
            if result.row.is_finished() {
                check_settings(&name, result.row.first_difference(run))?;
                let revision = &result.row.revision;
                if revision != REVISION && !may_mix_revisions {
                    return Err(BadInput(format!(
                        "{name} is a result of revision {revision}, but this is {REVISION}; move it \
                         away to run it again, or say --mix-revisions to keep it"
                    ))
                    .into());
                }
                return Ok(Standing::Finished);
            }
        }
        let folder = self.run_folder(run);
        if !Run::exists(&folder) {
            return Ok(Standing::New);
        }
        let settings = folder.join("config.toml");
        let name = settings.display().to_string();
        let config = RunConfig::parse(&name, &read(&settings)?).map_err(BadInput::from_error)?;
        let started = PlannedRun {
            config,
            ..run.clone()
        };
        let row = row_of(
            &started,
            Ended::Failed {
                reason: String::new(),
            },
        );
        check_settings(&name, row.first_difference(run))?;
        Ok(Standing::Started)
    }

    /// Keeps what a run left: as finished when its metrics say so.
    ///
    /// # Errors
    /// A folder that cannot be read or written.
    pub(super) fn keep(&self, run: &PlannedRun, reason: &str) -> anyhow::Result<RunResult> {
        let path = self.run_folder(run).join("metrics.jsonl");
        let name = path.display().to_string();
        let metrics = std::fs::read_to_string(&path).unwrap_or_default();
        let ended = finished(&metrics).unwrap_or_else(|| Ended::Failed {
            reason: reason.to_owned(),
        });
        let text = RunResult::write(&row_of(run, ended), &name, &metrics)?;
        let path = self.result(&run.name);
        let partial = path.with_extension("partial");
        write(&partial, text.as_bytes())?;
        std::fs::rename(&partial, &path)
            .with_context(|| format!("cannot write {}", path.display()))?;
        Ok(RunResult::read(&name, &text)?)
    }

    /// All results, finished and failed.
    ///
    /// # Errors
    /// [`BadInput`] when there are none, or a line is no row.
    pub(super) fn results(&self) -> anyhow::Result<Vec<RunResult>> {
        let folder = self.root.join("results");
        let entries = std::fs::read_dir(&folder)
            .map_err(|e| BadInput(format!("cannot read {}: {e}", folder.display())))?;
        let mut paths = Vec::new();
        for entry in entries {
            let path = entry.context("cannot list the results")?.path();
            if path
                .extension()
                .is_some_and(|extension| extension == "jsonl")
            {
                paths.push(path);
            }
        }
        paths.sort();
        let read = |path: &PathBuf| {
            let text = read(path)?;
            RunResult::read(&path.display().to_string(), &text).map_err(BadInput::from_error)
        };
        paths.iter().map(read).collect()
    }
}

const REVISION: &str = env!("STAIR_REVISION");

fn row_of(run: &PlannedRun, ended: Ended) -> RunRow {
    RunRow::new(run, REVISION, &machine::describe(), ended)
}

fn check_settings(name: &str, difference: Option<String>) -> anyhow::Result<()> {
    match difference {
        None => Ok(()),
        Some(key) => Err(BadInput(format!(
            "{name} was made with another {key} than the experiment's file says; move it away, or \
             choose another --out"
        ))
        .into()),
    }
}

/// How a run ended that took all its steps, from its metrics; the time is what its rows add up
/// to.
fn finished(metrics: &str) -> Option<Ended> {
    let mut wall_s = 0.0;
    let mut before = 0;
    let mut weights = None;
    for line in metrics.lines() {
        match serde_json::from_str(line) {
            Ok(Event::Metrics(row)) => {
                if row.steps_per_s > 0.0 {
                    wall_s += row.step.saturating_sub(before) as f64 / row.steps_per_s;
                }
                before = row.step;
            }
            Ok(Event::Finished(finished)) => weights = Some(finished.weights),
            _ => {}
        }
    }
    Some(Ended::Finished {
        weights: weights?,
        wall_s,
    })
}

/// Environment steps that a run has taken, from the end of its metrics; 0 where there are none.
pub(super) fn steps_taken(run_folder: &Path) -> u64 {
    use std::io::{Read as _, Seek as _, SeekFrom};
    const TAIL: u64 = 16_384;
    let tail = || -> std::io::Result<String> {
        let mut file = std::fs::File::open(run_folder.join("metrics.jsonl"))?;
        let from = file.metadata()?.len().saturating_sub(TAIL);
        file.seek(SeekFrom::Start(from))?;
        let mut bytes = Vec::new();
        file.read_to_end(&mut bytes)?;
        Ok(String::from_utf8_lossy(&bytes).into_owned())
    };
    let tail = tail().unwrap_or_default(); // a run that has not begun has no metrics
    let step = |line| match serde_json::from_str(line) {
        Ok(Event::Metrics(row)) => Some(row.step),
        Ok(Event::Evaluation(row)) => Some(row.step),
        _ => None,
    };
    tail.lines().rev().find_map(step).unwrap_or(0)
}
