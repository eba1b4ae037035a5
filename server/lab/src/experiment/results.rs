//! What runs of a grid came to, as rows: one JSON object a line, complete without any run's folder.
//!
//! `results.jsonl` is only added to. The rows of a run are added together when it is over, its
//! `finished` row last; rows without one are what a kill left behind, and count for nothing.

use serde::{Deserialize, Serialize};

use super::grid::RunKey;
use crate::config::{ConfigError, RunConfig, find_task};
use crate::history::RunHistory;
use crate::message::{Evaluation, Event, SessionClosed, SessionOffered};
use crate::method;

mod folder;
mod settings;

pub use folder::{FolderError, GridFolder, Misfit, read_rows};
pub use settings::fingerprint;
pub(crate) use settings::first_difference;

/// One line of `results.jsonl`.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Row {
    /// Which run.
    #[serde(flatten)]
    pub key: RunKey,
    /// What it says.
    #[serde(flatten)]
    pub content: Content,
}

/// What a row says about its run.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(tag = "kind", rename_all = "snake_case")]
pub enum Content {
    /// The policy on held-out episodes.
    Evaluation(Evaluation),
    /// A session of queries as it was asked.
    Session(SessionOffered),
    /// The same session when its answers were there.
    Answered(SessionClosed),
    /// All rows of the run are above.
    Finished(FinishedRow),
    /// The run could not go on; it is tried again at the next start.
    Failed {
        /// For the person who reads it.
        reason: String,
        /// Of the program.
        revision: String,
        /// Processor and cores of the machine; empty in rows of the program's earlier revisions.
        #[serde(default)]
        machine: String,
        /// The resolved settings; empty in rows of the program's earlier revisions.
        #[serde(default)]
        config: toml::Table,
    },
}

/// A run that is over, with all that comparing it needs.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct FinishedRow {
    /// Environment steps taken.
    pub total_steps: u64,
    /// Answers that it was given.
    pub labels: u32,
    /// Answers that it might have used; 0 for a method that asks nothing.
    pub budget: u32,
    /// Episodes in an evaluation.
    pub evaluation_episodes: u32,
    /// Environment steps between evaluations.
    pub evaluation_every: u64,
    /// Whether the task is solved or not, rather than done better or worse.
    pub has_success: bool,
    /// Fingerprint of the final weights: equal for bit-identical runs.
    pub weights: String,
    /// Fingerprint of the resolved settings.
    pub settings: String,
    /// The resolved settings themselves; empty in rows of the program's first revisions, whose
    /// settings lie beside as `settings/FINGERPRINT.toml`.
    #[serde(default)]
    pub config: toml::Table,
    /// Of the program, `A then B` where it changed in between.
    pub revision: String,
    /// Processor and cores of the machine.
    pub machine: String,
    /// Wall time, seconds, with whatever else ran on the machine.
    pub wall_s: f64,
}

/// The rows of a finished run from its settings and its metrics; `None` while it is not over.
///
/// # Errors
/// When a line of the metrics is no event.
pub fn rows_of_run(
    key: &RunKey,
    config: &RunConfig,
    metrics: &str,
    history: &RunHistory,
) -> Result<Option<Vec<Row>>, ConfigError> {
    let row = |content| Row {
        key: key.clone(),
        content,
    };
    let mut rows = Vec::new();
    for (n, line) in metrics.lines().enumerate() {
        let event = serde_json::from_str(line).map_err(|error| ConfigError::Invalid {
            origin: format!("metrics of {}", key.name()),
            message: format!("line {}: {error}", n + 1),
        })?;
        match event {
            Event::Evaluation(e) => rows.push(row(Content::Evaluation(e))),
            Event::SessionOffered(s) => rows.push(row(Content::Session(s))),
            Event::SessionClosed(s) => rows.push(row(Content::Answered(s))),
            Event::Finished(f) => {
                let asks = method::find(&config.method)
                    .is_ok_and(|method| (method.build)(config).sampler.is_some());
                rows.push(row(Content::Finished(FinishedRow {
                    total_steps: f.step,
                    labels: f.labels,
                    budget: if asks { config.feedback.budget } else { 0 },
                    evaluation_episodes: config.evaluation.episodes,
                    evaluation_every: config.evaluation.every,
                    has_success: (find_task(&config.task)?.spec)().has_success,
                    weights: f.weights,
                    settings: fingerprint(config),
                    config: settings::table(config),
                    revision: history.revisions.join(" then "),
                    machine: history.machines.join(" then "),
                    wall_s: history.wall_s,
                })));
                return Ok(Some(rows));
            }
            _ => {}
        }
    }
    Ok(None)
}

/// A file of rows, read.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Results {
    /// Every run that is over, in order of its rows.
    pub runs: Vec<RunResult>,
    /// Runs that could not go on and have not been finished since: which, and why.
    pub failed: Vec<(RunKey, String)>,
    /// Bytes up to the end of the last row that counts.
    pub len: u64,
}

/// All rows of a finished run.
#[derive(Debug, Clone, PartialEq)]
pub struct RunResult {
    /// Which.
    pub key: RunKey,
    /// In order of steps.
    pub evaluations: Vec<Evaluation>,
    /// In order of steps.
    pub sessions: Vec<SessionOffered>,
    /// In order of steps; none in rows of the program's earlier revisions.
    pub answered: Vec<SessionClosed>,
    /// How it ended.
    pub end: FinishedRow,
}

impl Results {
    /// Reads rows; what a kill left unfinished at the end is left out.
    ///
    /// # Errors
    /// A line in between that is no row, with its file and line; a run that is there twice.
    pub fn parse(name: &str, text: &str) -> Result<Self, ConfigError> {
        let mut results = Self::default();
        let (mut evaluations, mut sessions, mut answered) = (Vec::new(), Vec::new(), Vec::new());
        let mut at = 0_u64;
        let n_lines = text.lines().count();
        for (n, line) in text.split_inclusive('\n').enumerate() {
            at += line.len() as u64;
            let is_cut_short = n + 1 == n_lines && !line.ends_with('\n');
            if is_cut_short || line.trim().is_empty() {
                continue;
            }
            let row: Row = serde_json::from_str(line).map_err(|error| ConfigError::Invalid {
                origin: name.to_owned(),
                message: format!("line {}: {error}", n + 1),
            })?;
            let of_run = |(key, _): &(RunKey, _)| *key == row.key;
            match row.content {
                Content::Evaluation(e) => evaluations.push((row.key, e)),
                Content::Session(s) => sessions.push((row.key, s)),
                Content::Answered(s) => answered.push((row.key, s)),
                Content::Failed { reason, .. } => {
                    results.failed.retain(|f| !of_run(f));
                    results.failed.push((row.key, reason));
                    results.len = at;
                }
                Content::Finished(end) => {
                    if results.runs.iter().any(|run| run.key == row.key) {
                        return Err(ConfigError::Invalid {
                            origin: name.to_owned(),
                            message: format!("line {}: {} is there twice", n + 1, row.key.name()),
                        });
                    }
                    results.failed.retain(|f| f.0 != row.key);
                    results.runs.push(RunResult {
                        evaluations: own(&mut evaluations, &row.key),
                        sessions: own(&mut sessions, &row.key),
                        answered: own(&mut answered, &row.key),
                        key: row.key,
                        end,
                    });
                    results.len = at;
                }
            }
        }
        Ok(results)
    }

    /// The finished run of that key.
    pub fn run(&self, key: &RunKey) -> Option<&RunResult> {
        self.runs.iter().find(|run| run.key == *key)
    }
}

impl RunResult {
    /// The resolved settings, with what settings that came later were by default; `None` for a
    /// row of before settings stood in rows.
    ///
    /// # Errors
    /// Settings that this program does not know.
    pub fn config(&self) -> Result<Option<RunConfig>, ConfigError> {
        if self.end.config.is_empty() {
            return Ok(None);
        }
        let origin = format!("the settings of {}", self.key.name());
        match toml::to_string(&self.end.config) {
            Ok(text) => RunConfig::parse(&origin, &text).map(Some),
            Err(error) => Err(ConfigError::Invalid {
                origin,
                message: error.to_string(),
            }),
        }
    }
}

/// Takes the rows of one run; others are those of a run that was never finished.
fn own<T>(rows: &mut Vec<(RunKey, T)>, key: &RunKey) -> Vec<T> {
    let taken = rows.drain(..).filter(|(of, _)| of == key);
    taken.map(|(_, row)| row).collect()
}

#[cfg(test)]
mod tests;
