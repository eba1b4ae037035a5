//! Replays recordings of the original environments through the functions that ours call.
//!
//! A recording is a file of JSON Lines. A *transition* holds what the original's physics said
//! after a step and what the original made of it; the same
//! [`Readings`](crate::tasks::metaworld::Readings) are built
//! from the line as from our physics, and observation, reward and success are compared. A
//! *reset* line is checked in what the original reads freshly, a *trajectory* line in reward and
//! success, its numbers being rounded more; the actions of a whole trajectory are also played in
//! our physics. For the control suite a line is a state: positions and velocities go into our
//! simulation, whose readings then have to agree. RoboDesk's lines say themselves what they are;
//! those about its arm alone are put to the physics. Other lines are counted as skipped, with the
//! reason.

use std::collections::BTreeMap;
use std::fs;
use std::io;
use std::path::{Path, PathBuf};

mod dmcontrol;
pub mod figures;
mod metaworld;
pub mod one_step;
mod robodesk;
pub mod trajectory;

use trajectory::DynamicsReport;

/// Largest error of a reward and its parts that still counts as the same.
pub const REWARD_TOLERANCE: f64 = 1e-6;
/// Largest error of an observation's numbers that still counts as the same.
pub const OBSERVATION_TOLERANCE: f64 = 1e-5;
/// The same for rewards of trajectory lines, whose inputs are rounded to 7 digits.
pub const TRAJECTORY_TOLERANCE: f64 = 2e-5;

/// Largest error of poses and inertias, relative to the largest number among them.
pub const KINEMATICS_TOLERANCE: f64 = 1e-4;
/// The same for gravity's and all other bias forces.
pub const LOAD_TOLERANCE: f64 = 1e-3;

/// What one kind of number came to, over all lines of one kind of recording.
#[derive(Debug, Clone, PartialEq)]
pub struct FieldReport {
    /// `window-open v2 transitions`.
    pub recording: String,
    /// `reward`, `success`, `observation 0-17`, …
    pub field: &'static str,
    /// Lines in which it was compared.
    pub n_lines: usize,
    /// The largest difference to the recording; for yes-or-no fields the number of lines that differ.
    pub largest_error: f64,
    /// What counts as the same; 0 for yes-or-no fields.
    pub tolerance: f64,
    /// File and line of the largest error.
    pub worst: String,
}

impl FieldReport {
    /// Whether every line agreed.
    pub fn is_within_tolerance(&self) -> bool {
        self.largest_error <= self.tolerance
    }
}

/// Everything a replay found.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Report {
    /// One entry per recording and field, recordings in order of name.
    pub fields: Vec<FieldReport>,
    /// One entry per trajectory, in the order of the files.
    pub dynamics: Vec<DynamicsReport>,
    /// Lines of no known kind: why, and how many.
    pub skipped: BTreeMap<String, usize>,
    /// Lines that could not be read, with file and line number.
    pub malformed: Vec<String>,
    /// Lines that were compared.
    pub n_checked: usize,
}

impl Report {
    /// Whether every compared number is within its tolerance. Dynamics do not enter: what two
    /// engines make of one contact is told, not judged.
    pub fn is_within_tolerance(&self) -> bool {
        self.fields.iter().all(FieldReport::is_within_tolerance)
    }

    fn entry(&mut self, recording: &str, check: &Check) -> &mut FieldReport {
        let fields = &mut self.fields;
        let is_it = |f: &FieldReport| f.recording == recording && f.field == check.field;
        let index = fields.iter().position(is_it).unwrap_or(fields.len());
        if index == fields.len() {
            fields.push(FieldReport {
                recording: recording.into(),
                field: check.field,
                n_lines: 0,
                largest_error: 0.0,
                tolerance: check.tolerance,
                worst: String::new(),
            });
        }
        &mut fields[index]
    }
}

/// Files among `paths`, and all `*.jsonl` in the folders among them, in order of name.
///
/// # Errors
/// A path that does not exist or cannot be read; the message names it.
pub fn find_recordings(paths: &[PathBuf]) -> io::Result<Vec<PathBuf>> {
    let mut files = Vec::new();
    for path in paths {
        let kind = fs::metadata(path).map_err(|error| named(path, &error))?;
        if kind.is_dir() {
            search(path, &mut files)?;
        } else {
            files.push(path.clone());
        }
    }
    Ok(files)
}

fn search(folder: &Path, files: &mut Vec<PathBuf>) -> io::Result<()> {
    let mut entries = fs::read_dir(folder)
        .and_then(Iterator::collect::<io::Result<Vec<_>>>)
        .map_err(|error| named(folder, &error))?;
    entries.sort_by_key(fs::DirEntry::file_name);
    for entry in entries {
        let path = entry.path();
        let kind = entry.file_type().map_err(|error| named(&path, &error))?;
        if kind.is_dir() {
            search(&path, files)?;
        } else if path
            .extension()
            .is_some_and(|extension| extension == "jsonl")
        {
            files.push(path);
        }
    }
    Ok(())
}

fn named(path: &Path, error: &io::Error) -> io::Error {
    io::Error::new(error.kind(), format!("{}: {error}", path.display()))
}

/// What earlier lines of a file say about later ones.
#[derive(Debug, Default)]
struct StepsBefore {
    metaworld: metaworld::StepsBefore,
    robodesk: robodesk::StepsBefore,
}

/// Replays recordings line by line; each file is a story of its own.
#[derive(Debug, Default)]
pub struct Replay {
    report: Report,
}

impl Replay {
    /// Nothing replayed yet.
    pub fn new() -> Self {
        Self::default()
    }

    /// Replays one file.
    ///
    /// # Errors
    /// A file that cannot be read; the message names it. Lines that make no sense are part of
    /// the report instead.
    pub fn file(&mut self, path: &Path) -> io::Result<()> {
        let text = fs::read(path).map_err(|error| named(path, &error))?;
        self.text(&path.display().to_string(), &text);
        Ok(())
    }

    /// Replays a file's bytes; `name` is what the report calls it, its stem the task where
    /// lines do not say theirs.
    pub fn text(&mut self, name: &str, text: &[u8]) {
        let mut before = StepsBefore::default();
        let mut trajectories = Vec::new();
        for (index, line) in text.split(|byte| *byte == b'\n').enumerate() {
            if line.iter().all(u8::is_ascii_whitespace) {
                continue;
            }
            let place = format!("{name}:{}", index + 1);
            match self.line(name, line, &mut before, &mut trajectories) {
                Ok(Some(checks)) => self.count(&checks, &place),
                Ok(None) => {}
                Err(reason) => self.report.malformed.push(format!("{place}: {reason}")),
            }
        }
        match trajectory::replay_all(&trajectories) {
            Ok(dynamics) => self.report.dynamics.extend(dynamics),
            Err(reason) => self.report.malformed.push(format!("{name}: {reason}")),
        }
    }

    fn line(
        &mut self,
        name: &str,
        line: &[u8],
        before: &mut StepsBefore,
        trajectories: &mut Vec<trajectory::Line>,
    ) -> Result<Option<Checks>, String> {
        let value: serde_json::Value =
            serde_json::from_slice(line).map_err(|error| format!("this is no JSON: {error}"))?;
        let Some(fields) = value.as_object() else {
            return Err("this is JSON, but no object with named fields".into());
        };
        let stem = || {
            Path::new(name)
                .file_stem()
                .unwrap_or_default()
                .to_string_lossy()
        };
        let task = match fields.get("task") {
            None => stem().into_owned(),
            Some(serde_json::Value::String(task)) => task.clone(),
            Some(other) => return Err(format!("\"task\" should be a name, not {other}")),
        };
        if robodesk::knows(&task) {
            let Some(kind) = robodesk::Kind::of(fields) else {
                return Ok(self.skip(format!("{task}: its kind is not known")));
            };
            return robodesk::check(kind, &value, &mut before.robodesk).map(Some);
        }
        if let Some(check) = dmcontrol::checker(&task) {
            return check(&task, &value).map(Some);
        }
        if !metaworld::knows(&task) {
            return Ok(self.skip(format!("task {task} is not known")));
        }
        let Some(kind) = metaworld::Kind::of(fields) else {
            let reason = format!("{task}: neither a transition, a reset nor a trajectory");
            return Ok(self.skip(reason));
        };
        let checks = metaworld::check(&task, kind, &value, &mut before.metaworld)?;
        if kind == metaworld::Kind::Trajectory {
            trajectories.push(trajectory::Line::read(&value, &task)?);
        }
        Ok(Some(checks))
    }

    fn skip(&mut self, reason: String) -> Option<Checks> {
        *self.report.skipped.entry(reason).or_default() += 1;
        None
    }

    fn count(&mut self, checks: &Checks, place: &str) {
        self.report.n_checked += 1;
        for check in &checks.checks {
            let entry = self.report.entry(&checks.recording, check);
            entry.n_lines += 1;
            if check.tolerance == 0.0 {
                entry.largest_error += check.error;
            } else {
                entry.largest_error = entry.largest_error.max(check.error);
            }
            if check.error > 0.0 && (entry.worst.is_empty() || check.error >= entry.largest_error) {
                entry.worst = place.into();
            }
        }
    }

    /// What was found in all files so far.
    pub fn finish(mut self) -> Report {
        let fields = &mut self.report.fields;
        fields.sort_by(|a, b| a.recording.cmp(&b.recording));
        self.report
    }
}

/// What was compared in one line.
struct Checks {
    recording: String,
    checks: Vec<Check>,
}

struct Check {
    field: &'static str,
    /// Absolute difference; for yes-or-no fields 0 or 1.
    error: f64,
    /// 0 for yes-or-no fields.
    tolerance: f64,
}

impl Checks {
    fn new(recording: String) -> Self {
        Self {
            recording,
            checks: Vec::new(),
        }
    }

    fn number(&mut self, field: &'static str, ours: f64, theirs: f64, tolerance: f64) {
        self.numbers(field, &[ours], &[theirs], tolerance);
    }

    /// The largest difference between two lists of the same length.
    fn numbers(&mut self, field: &'static str, ours: &[f64], theirs: &[f64], tolerance: f64) {
        let differences = ours.iter().zip(theirs).map(|(a, b)| (a - b).abs());
        let differences = differences.map(or_infinite);
        self.checks.push(Check {
            field,
            error: differences.fold(0.0, f64::max),
            tolerance,
        });
    }

    /// The largest difference, as a share of the largest number of theirs, or of 1 if that is
    /// more: near 0 there is only rounding to compare.
    fn relative(&mut self, field: &'static str, ours: &[f64], theirs: &[f64], tolerance: f64) {
        let largest = theirs.iter().fold(1.0, |most: f64, x| most.max(x.abs()));
        let scale = 1.0 / largest;
        let scaled = |numbers: &[f64]| numbers.iter().map(|x| x * scale).collect::<Vec<_>>();
        self.numbers(field, &scaled(ours), &scaled(theirs), tolerance);
    }

    fn flag(&mut self, field: &'static str, ours: bool, theirs: bool) {
        self.checks.push(Check {
            field,
            error: f64::from(u8::from(ours != theirs)),
            tolerance: 0.0,
        });
    }
}

/// What is no number is as wrong as can be, where a maximum would pass over it.
fn or_infinite(error: f64) -> f64 {
    if error.is_nan() { f64::INFINITY } else { error }
}

#[cfg(test)]
mod tests;
