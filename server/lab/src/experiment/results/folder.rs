//! The folder of a grid: results, settings, and a folder for each run under way.
//!
//! ```text
//! experiment.toml       the file as it was given
//! variant.txt           `small` or `whole`: which of the file's grids
//! results.jsonl         rows of the runs that are over
//! settings/HASH.toml    resolved settings by fingerprint, seeds left out
//! runs/NAME/            a run: its folder, with history.json, and log.txt
//! progress.json         where the grid is, while it runs
//! log.jsonl             what runs said at their end; locked while any of them is up
//! ```

use std::collections::BTreeSet;
use std::fs::{self, File, OpenOptions};
use std::io::{self, Write as _};
use std::path::{Path, PathBuf};

use learn::durable;

use super::settings::{first_difference, table, without_seed};
use super::{Content, Results, Row, fingerprint};
use crate::config::{ConfigError, RunConfig};
use crate::experiment::grid::{self, Grid, GridRun, GridText, RunKey};
use crate::history::{Provenance, RunHistory};
use crate::words::counted;

/// Where the file is kept as it was given.
const FILE: &str = "experiment.toml";
/// Where it stands which of the file's grids is meant.
const VARIANT: &str = "variant.txt";
/// What it says of the small one.
const SMALL: &str = "small";

/// Why a grid's folder cannot be used.
#[derive(Debug, thiserror::Error)]
pub enum FolderError {
    /// The disk.
    #[error("cannot {doing} ({path}): {source}")]
    Io {
        /// What was tried.
        doing: &'static str,
        /// Where.
        path: PathBuf,
        /// What the system said.
        source: io::Error,
    },
    /// Rows or settings that cannot be read.
    #[error(transparent)]
    Text(#[from] ConfigError),
    /// Results that do not belong to this grid.
    #[error(transparent)]
    Misfit(#[from] Misfit),
}

/// Results that do not belong to this grid or this program.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
pub enum Misfit {
    /// The folder of another experiment, whose rows would be told with this one's.
    #[error(
        "{folder} holds another experiment, '{there}', with runs such as {run} that are none of '{here}'; choose another --out"
    )]
    OtherExperiment {
        /// The folder.
        folder: String,
        /// Title of the experiment that it holds.
        there: String,
        /// One of its runs.
        run: String,
        /// Title of the one that was asked for.
        here: String,
    },
    /// A run of this name was done with other settings.
    #[error(
        "{run} is there already with {key} = {there}, but the file now says {here}; put it back, or choose another --out"
    )]
    OtherSettings {
        /// The run.
        run: String,
        /// The first setting that differs.
        key: String,
        /// Its value in the folder.
        there: String,
        /// Its value in the file.
        here: String,
    },
    /// Runs that another version of the program made or began.
    #[error(
        "{} of revision {there}, this program is {here} (the first: {run}); their numbers may differ for that alone. Choose another --out, or allow it with --mixed", counted(*n as u64, "run there is", "runs there are")
    )]
    OtherRevision {
        /// How many.
        n: usize,
        /// The first of them.
        run: String,
        /// Their revision.
        there: String,
        /// Of this program.
        here: String,
    },
}

/// The folder of a grid.
#[derive(Debug, Clone)]
pub struct GridFolder {
    root: PathBuf,
}

impl GridFolder {
    /// The folder at a path, whether it exists or not.
    pub fn at(root: &Path) -> Self {
        Self {
            root: root.to_owned(),
        }
    }

    /// Makes it, where it does not exist.
    ///
    /// # Errors
    /// When the disk refuses.
    pub fn create(&self) -> Result<(), FolderError> {
        for folder in ["runs", "settings"] {
            let path = self.root.join(folder);
            fs::create_dir_all(&path).map_err(refused("make the experiment's folder", &path))?;
        }
        Ok(())
    }

    /// Keeps the file that it belongs to, and whether its small variant is meant.
    ///
    /// # Errors
    /// When the disk refuses.
    pub fn keep_file(&self, text: &str, is_small: bool) -> Result<(), FolderError> {
        self.replace(FILE, text)?;
        self.replace(VARIANT, if is_small { SMALL } else { "whole" })
    }

    /// Refuses the folder of another experiment: of another title, with runs that this one has not,
    /// or without any run in common, seeds aside. A file that was edited otherwise goes on.
    ///
    /// # Errors
    /// [`Misfit::OtherExperiment`] names both.
    pub fn check_experiment(&self, grid: &Grid) -> Result<(), FolderError> {
        let Some(there) = self.kept() else {
            return Ok(());
        };
        let combination = |run: &GridRun| RunKey {
            seed: 0,
            ..run.key.clone()
        };
        let own: BTreeSet<RunKey> = grid.runs.iter().map(combination).collect();
        let is_foreign = |run: &&GridRun| !own.contains(&combination(run));
        let foreign: Vec<&GridRun> = there.runs.iter().filter(is_foreign).collect();
        // Earlier revisions kept no variant; the runs that are looked at may not be those meant.
        let is_apart = foreign.len() == there.runs.len() && self.root.join(VARIANT).exists();
        match foreign.first() {
            Some(run) if is_apart || there.title != grid.title => Err(Misfit::OtherExperiment {
                folder: self.root.display().to_string(),
                there: there.title.clone(),
                run: run.key.name(),
                here: grid.title.clone(),
            }
            .into()),
            _ => Ok(()),
        }
    }

    /// The experiment of the file that is kept here; `None` where there is none that this program
    /// can read.
    fn kept(&self) -> Option<Grid> {
        let path = self.root.join(FILE);
        let (name, text) = (path.display().to_string(), fs::read_to_string(&path).ok()?);
        let source = GridText {
            name: &name,
            text: &text,
        };
        grid::resolve(source, self.is_small()).ok()
    }

    /// Whether it is of the small variant; no folder of the program's earlier revisions says so.
    pub fn is_small(&self) -> bool {
        let variant = fs::read_to_string(self.root.join(VARIANT));
        variant.is_ok_and(|variant| variant.trim() == SMALL)
    }

    /// The log, which whoever works on the grid holds locked: a run that was started from here
    /// writes to the same open file, so that the lock lasts until the last of them has ended.
    ///
    /// # Errors
    /// When the disk refuses.
    pub fn log_file(&self) -> Result<File, FolderError> {
        let path = self.root.join("log.jsonl");
        let file = OpenOptions::new().create(true).append(true).open(&path);
        file.map_err(refused("open the experiment's log", &path))
    }

    /// Where the rows are.
    pub fn results_path(&self) -> PathBuf {
        self.root.join("results.jsonl")
    }

    /// The folder of a run.
    pub fn run_path(&self, key: &RunKey) -> PathBuf {
        self.root.join("runs").join(key.name())
    }

    /// The rows so far; none where there is no file yet.
    ///
    /// # Errors
    /// A file that cannot be read, a line that is no row.
    pub fn results(&self) -> Result<Results, FolderError> {
        let path = self.results_path();
        let text = match read_rows(&path) {
            Err(error) if error.kind() == io::ErrorKind::NotFound => String::new(),
            read => read.map_err(refused("read the results", &path))?,
        };
        Ok(Results::parse(&path.display().to_string(), &text)?)
    }

    /// Adds the rows of one run, durably. What a kill left behind the last row that counts is
    /// cut first.
    ///
    /// # Errors
    /// When the disk refuses.
    ///
    /// # Panics
    /// Never: rows are plain values.
    pub fn add(&self, rows: &[Row]) -> Result<(), FolderError> {
        let len = self.results()?.len;
        let path = self.results_path();
        let mut text = String::new();
        for row in rows {
            text.push_str(&serde_json::to_string(row).expect("rows are plain values"));
            text.push('\n');
        }
        let file = OpenOptions::new().create(true).append(true).open(&path);
        let added = file.and_then(|mut file| {
            file.set_len(len)?;
            file.write_all(text.as_bytes())?;
            file.sync_all()
        });
        added.map_err(refused("add to the results", &path))
    }

    /// Marks a run as failed, with its reason.
    ///
    /// # Errors
    /// When the disk refuses.
    pub fn add_failure(
        &self,
        run: &GridRun,
        reason: &str,
        provenance: Provenance,
    ) -> Result<(), FolderError> {
        self.add(&[Row {
            key: run.key.clone(),
            content: Content::Failed {
                reason: reason.to_owned(),
                revision: provenance.revision,
                machine: provenance.machine,
                config: table(&run.config),
            },
        }])
    }

    /// Keeps resolved settings under their fingerprint; the path of the file.
    ///
    /// # Errors
    /// When the disk refuses.
    pub fn keep_settings(&self, config: &RunConfig) -> Result<PathBuf, FolderError> {
        let name = format!("settings/{}.toml", fingerprint(config));
        self.replace(&name, &without_seed(config).to_toml())?;
        Ok(self.root.join(name))
    }

    /// Refuses results that the runs of a grid do not fit: other settings under the same name,
    /// and, unless they may be mixed, rows of another revision and runs that one began.
    ///
    /// # Errors
    /// [`Misfit`] names the run and what differs.
    pub fn check(
        &self,
        runs: &[GridRun],
        results: &Results,
        revision: Option<&str>,
    ) -> Result<(), FolderError> {
        for run in runs {
            let Some(there) = self.settings_of(run, results)? else {
                continue; // as here, or not started
            };
            if let Some((key, there, here)) = first_difference(&there, &run.config) {
                let run = run.key.name();
                return Err(Misfit::OtherSettings {
                    run,
                    key,
                    there,
                    here,
                }
                .into());
            }
        }
        let Some(here) = revision else { return Ok(()) };
        let mut others = Vec::new();
        for run in &results.runs {
            others.push((&run.key, run.end.revision.clone()));
        }
        for run in runs.iter().filter(|run| results.run(&run.key).is_none()) {
            let begun = RunHistory::of(&self.run_path(&run.key));
            let begun = begun.unwrap_or_default(); // a damaged one is told when the run goes on
            if !begun.revisions.is_empty() {
                others.push((&run.key, begun.revisions.join(" then ")));
            }
        }
        others.retain(|(_, revision)| revision != here);
        if let Some((first, there)) = others.first() {
            return Err(Misfit::OtherRevision {
                n: others.len(),
                run: first.name(),
                there: there.clone(),
                here: here.to_owned(),
            }
            .into());
        }
        Ok(())
    }

    /// The settings under which a run was finished or started where they may be others than the
    /// grid's.
    fn settings_of(
        &self,
        run: &GridRun,
        results: &Results,
    ) -> Result<Option<RunConfig>, FolderError> {
        let path = match results.run(&run.key) {
            Some(done) if done.end.settings == fingerprint(&run.config) => return Ok(None),
            Some(done) => {
                if let Some(config) = done.config()? {
                    return Ok(Some(config));
                }
                let name = format!("settings/{}.toml", done.end.settings);
                self.root.join(name)
            }
            None => {
                let path = self.run_path(&run.key).join("config.toml");
                if !path.exists() {
                    return Ok(None);
                }
                path
            }
        };
        let text = fs::read_to_string(&path).map_err(refused("read a run's settings", &path))?;
        Ok(Some(RunConfig::parse(&path.display().to_string(), &text)?))
    }

    /// Removes what only going on would need: replay and checkpoints. Settings, metrics and the
    /// policy stay.
    ///
    /// # Errors
    /// When the disk refuses.
    pub fn slim(&self, key: &RunKey) -> Result<(), FolderError> {
        let root = self.run_path(key);
        let entries = fs::read_dir(&root).map_err(refused("read the run's folder", &root))?;
        for entry in entries.flatten() {
            let path = entry.path();
            let name = entry.file_name().to_string_lossy().into_owned();
            let removed = if name == "replay" {
                fs::remove_dir_all(&path)
            } else if name.starts_with("checkpoint-") {
                fs::remove_file(&path)
            } else {
                continue;
            };
            removed.map_err(refused("remove what the run no longer needs", &path))?;
        }
        Ok(())
    }

    /// Writes a file so that readers see the old or the new one, never half.
    ///
    /// # Errors
    /// When the disk refuses.
    pub fn replace(&self, name: &str, text: &str) -> Result<(), FolderError> {
        let path = self.root.join(name);
        durable::replace(&path, text.as_bytes()).map_err(refused("save", &path))
    }
}

/// The whole lines of a file of rows; a kill may have cut the last one anywhere, inside a
/// character too.
///
/// # Errors
/// A file that cannot be read or is no UTF-8.
pub fn read_rows(path: &Path) -> io::Result<String> {
    let mut bytes = fs::read(path)?;
    let end = bytes.iter().rposition(|byte| *byte == b'\n');
    bytes.truncate(end.map_or(0, |end| end + 1));
    String::from_utf8(bytes).map_err(io::Error::other)
}

fn refused<'a>(doing: &'static str, path: &'a Path) -> impl FnOnce(io::Error) -> FolderError + 'a {
    move |source| FolderError::Io {
        doing,
        path: path.to_owned(),
        source,
    }
}
