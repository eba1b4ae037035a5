//! Experiments: those that need no simulation, the classifier of an expert's time steps, and grids
//! of runs with their results and reports.
//!
//! The same settings give the same bytes, on any number of threads; grids aside, whose runs also
//! tell the time they took. A report is pure in its rows.

use std::num::NonZeroUsize;

use crate::config::{ConfigError, unknown};
use crate::figure::{FigureError, Source};

pub mod abstract_mdp;
pub mod grid;
pub mod query_counts;
pub mod report;
pub mod results;
pub mod timestep_classifier;

/// How an experiment is run.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Settings {
    /// Independent repetitions.
    pub n_seeds: u64,
    /// Threads; changes no number.
    pub n_threads: NonZeroUsize,
}

/// A file that an experiment makes.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Artifact {
    /// Its name, without a folder.
    pub name: String,
    /// What it holds.
    pub text: String,
}

impl Artifact {
    fn new(name: impl Into<String>, text: String) -> Self {
        let name = name.into();
        Self { name, text }
    }

    /// Rows, under the name by which figures call them.
    fn of(rows: Source) -> Self {
        Self::new(rows.name, rows.text)
    }
}

/// A line of the registry.
pub struct ExperimentEntry {
    /// As users type it.
    pub name: &'static str,
    /// One sentence.
    pub summary: &'static str,
    /// Runs it.
    pub run: fn(Settings) -> Result<Vec<Artifact>, FigureError>,
}

/// All experiments without simulation.
pub const EXPERIMENTS: &[ExperimentEntry] = &[abstract_mdp::ENTRY, query_counts::ENTRY];

/// The experiment without simulation of that name.
///
/// # Errors
/// Names the nearest right one, of all experiments.
pub fn find(name: &str) -> Result<&'static ExperimentEntry, ConfigError> {
    let known = EXPERIMENTS.iter().map(|e| e.name);
    let known = known.chain([timestep_classifier::NAME]);
    let found = EXPERIMENTS.iter().find(|e| e.name == name);
    found.ok_or_else(|| unknown("experiment", name, known))
}

/// Works through jobs on several threads; results are in the order of the jobs.
fn on_threads<J: Sync, R: Send>(
    jobs: &[J],
    n_threads: NonZeroUsize,
    work: impl Fn(&J) -> R + Sync,
) -> Vec<R> {
    let n_threads = n_threads.get().min(jobs.len().max(1));
    let mut results: Vec<Option<R>> = jobs.iter().map(|_| None).collect();
    std::thread::scope(|scope| {
        let work = &work;
        let workers: Vec<_> = (0..n_threads)
            .map(|worker| {
                let own = (worker..jobs.len()).step_by(n_threads);
                scope.spawn(move || own.map(|job| (job, work(&jobs[job]))).collect::<Vec<_>>())
            })
            .collect();
        for worker in workers {
            for (job, result) in worker.join().expect("a worker does not panic") {
                results[job] = Some(result);
            }
        }
    });
    let results = results.into_iter();
    results
        .map(|result| result.expect("every job was one worker's"))
        .collect()
}

/// Rows as JSON Lines.
fn json_lines<T: serde::Serialize>(rows: &[T]) -> String {
    let line = |row| serde_json::to_string(row).expect("rows are plain values") + "\n";
    rows.iter().map(line).collect()
}
