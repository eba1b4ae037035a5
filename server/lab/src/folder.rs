//! A run's folder on disk: settings, metrics, replay files and the two newest checkpoints.
//!
//! A checkpoint names the lengths of the append-only files that belong to it; whatever lies
//! beyond was written after it and is cut when the run resumes.

use std::fs::{self, File, OpenOptions};
use std::io::{self, Write as _};
use std::path::{Path, PathBuf};

use learn::checkpoint::Archive;
use learn::durable;

use crate::message::Event;
use crate::run::RunError;

/// Paths and open files of one run.
pub(crate) struct RunFolder {
    root: PathBuf,
    metrics: File,
}

impl RunFolder {
    /// Makes the folder of a new run. Until [`RunFolder::seal`] it counts as empty, and what a
    /// start that was cut short left in it is removed.
    ///
    /// # Errors
    /// When it holds a run already, or more of one than a start leaves, or cannot be written.
    pub(crate) fn create(root: &Path) -> Result<Self, RunError> {
        if Self::holds_run(root) {
            return Err(RunError::Occupied {
                folder: root.to_owned(),
            });
        }
        if let Some(found) = remains(root)? {
            return Err(RunError::Remains {
                folder: root.to_owned(),
                found,
            });
        }
        let replay = root.join("replay");
        if replay.exists() {
            fs::remove_dir_all(&replay).map_err(io_error("clear the run's folder", &replay))?;
        }
        fs::create_dir_all(&replay).map_err(io_error("make the run's folder", root))?;
        let mut folder = Self::at(root)?;
        for step in folder.checkpoints()? {
            let path = folder.checkpoint_path(step);
            fs::remove_file(&path).map_err(io_error("clear the run's folder", &path))?;
        }
        folder.cut_metrics(0)?;
        Ok(folder)
    }

    /// Saves the settings, after the first checkpoint: from now on the folder holds a run.
    ///
    /// # Errors
    /// When the disk refuses.
    pub(crate) fn seal(&self, config: &str) -> Result<(), RunError> {
        write_durably(&self.root.join("config.toml"), config.as_bytes())
    }

    /// Whether a run was started in this folder.
    pub(crate) fn holds_run(root: &Path) -> bool {
        root.join("config.toml").exists()
    }

    /// The folder of a run that was started before.
    ///
    /// # Errors
    /// When there is none or it cannot be read.
    pub(crate) fn open(root: &Path) -> Result<(Self, String), RunError> {
        if !Self::holds_run(root) {
            return Err(RunError::NoRun {
                folder: root.to_owned(),
            });
        }
        let path = root.join("config.toml");
        let config =
            fs::read_to_string(&path).map_err(io_error("read the run's settings", &path))?;
        Ok((Self::at(root)?, config))
    }

    fn at(root: &Path) -> Result<Self, RunError> {
        let path = root.join("metrics.jsonl");
        let metrics = OpenOptions::new().create(true).append(true).open(&path);
        Ok(Self {
            root: root.to_owned(),
            metrics: metrics.map_err(io_error("open the metrics", &path))?,
        })
    }

    /// Where the replay keeps its files.
    pub(crate) fn replay(&self) -> PathBuf {
        self.root.join("replay")
    }

    /// Appends an event as a JSON line. Poses of demonstrations and phases are not kept here.
    ///
    /// # Errors
    /// When the disk refuses.
    pub(crate) fn record(&mut self, event: &Event) -> Result<(), RunError> {
        if matches!(
            event,
            Event::Phase(_) | Event::Demonstration(_) | Event::Checkpointed(_)
        ) {
            return Ok(());
        }
        let mut line = serde_json::to_vec(event).expect("events are plain values");
        line.push(b'\n');
        let path = self.root.join("metrics.jsonl");
        self.metrics
            .write_all(&line)
            .map_err(io_error("write the metrics", &path))
    }

    /// Bytes of metrics so far, made durable.
    ///
    /// # Errors
    /// When the disk refuses.
    pub(crate) fn sync_metrics(&mut self) -> Result<u64, RunError> {
        let path = self.root.join("metrics.jsonl");
        self.metrics
            .sync_data()
            .map_err(io_error("save the metrics", &path))?;
        Ok(self
            .metrics
            .metadata()
            .map_err(io_error("save the metrics", &path))?
            .len())
    }

    /// Cuts the metrics to what belongs to a checkpoint.
    ///
    /// # Errors
    /// When they are shorter than that, or the disk refuses.
    pub(crate) fn cut_metrics(&mut self, len: u64) -> Result<(), RunError> {
        let path = self.root.join("metrics.jsonl");
        let found = self.metrics.metadata().map(|metadata| metadata.len());
        let found = found.map_err(io_error("read the metrics", &path))?;
        if found < len {
            return Err(RunError::CutShort {
                path,
                found,
                expected: len,
            });
        }
        self.metrics
            .set_len(len)
            .map_err(io_error("cut the metrics", &path))
    }

    /// Puts a checkpoint that cannot be used where none is looked for, so that it does not count
    /// as one of the newest two.
    ///
    /// # Errors
    /// When the disk refuses.
    pub(crate) fn set_aside(&self, step: u64) -> Result<(), RunError> {
        let path = self.checkpoint_path(step);
        fs::rename(&path, path.with_extension("damaged"))
            .map_err(io_error("set a checkpoint aside", &path))
    }

    /// Writes a checkpoint and removes all but the newest two.
    ///
    /// # Errors
    /// When the disk refuses; the older checkpoints are then untouched.
    pub(crate) fn save(&self, step: u64, archive: &Archive) -> Result<(), RunError> {
        archive.write(&self.checkpoint_path(step))?;
        for old in self.checkpoints()?.into_iter().rev().skip(2) {
            let path = self.checkpoint_path(old);
            fs::remove_file(&path).map_err(io_error("remove an old checkpoint", &path))?;
        }
        Ok(())
    }

    /// Steps of the checkpoints that there are, oldest first.
    ///
    /// # Errors
    /// When the folder cannot be read.
    pub(crate) fn checkpoints(&self) -> Result<Vec<u64>, RunError> {
        let entries =
            fs::read_dir(&self.root).map_err(io_error("read the run's folder", &self.root))?;
        let mut steps: Vec<u64> = entries
            .filter_map(|entry| {
                let name = entry.ok()?.file_name().into_string().ok()?;
                name.strip_prefix("checkpoint-")?
                    .strip_suffix(".stair")?
                    .parse()
                    .ok()
            })
            .collect();
        steps.sort_unstable();
        Ok(steps)
    }

    /// What `read` makes of the newest checkpoint that it can read, else of `last`.
    ///
    /// # Errors
    /// When there is none, with what was wrong with each.
    pub(crate) fn newest<T>(
        &self,
        last: Option<PathBuf>,
        read: impl Fn(&Path) -> Result<T, RunError>,
    ) -> Result<T, RunError> {
        let mut reasons: Vec<String> = Vec::new();
        let checkpoints = self.checkpoints()?.into_iter().rev();
        let checkpoints = checkpoints.map(|step| self.checkpoint_path(step));
        for path in checkpoints.chain(last) {
            match read(&path) {
                Ok(found) => return Ok(found),
                Err(error) => reasons.push(error.to_string()),
            }
        }
        reasons.dedup(); // where one thing is wrong with all
        let reasons = if reasons.is_empty() {
            "there is none".into()
        } else {
            reasons.join("; ")
        };
        Err(RunError::NoCheckpoint {
            folder: self.root.clone(),
            reasons,
        })
    }

    /// Where a finished run leaves its policy: small, and all that looking at it takes.
    pub(crate) fn policy_path(&self) -> PathBuf {
        self.root.join("policy.stair")
    }

    /// Where the checkpoint of a step lies.
    pub(crate) fn checkpoint_path(&self, step: u64) -> PathBuf {
        self.root.join(format!("checkpoint-{step:09}.stair"))
    }
}

/// What there is of a run in a folder without settings, beyond what a start that was cut short
/// leaves: the journal and first rewards of its replay, a checkpoint of step 0, empty metrics.
fn remains(root: &Path) -> Result<Option<String>, RunError> {
    let metrics = root.join("metrics.jsonl");
    if fs::metadata(&metrics).is_ok_and(|metadata| metadata.len() > 0) {
        return Ok(Some("metrics.jsonl".into()));
    }
    let is_later =
        |name: &str| name.starts_with("checkpoint-") && !name.starts_with("checkpoint-000000000.");
    let is_further = |name: &str| {
        let known = ["journal", "rewards-1", "rewards-1.partial"];
        !known.contains(&name)
    };
    let found = first_entry(root, &is_later)?;
    if found.is_some() {
        return Ok(found);
    }
    let found = first_entry(&root.join("replay"), &is_further)?;
    Ok(found.map(|name| format!("replay/{name}")))
}

/// The first name in a folder that is so; none where there is no folder.
fn first_entry(folder: &Path, is: &dyn Fn(&str) -> bool) -> Result<Option<String>, RunError> {
    let entries = match fs::read_dir(folder) {
        Err(error) if error.kind() == io::ErrorKind::NotFound => return Ok(None),
        read => read.map_err(io_error("read the run's folder", folder))?,
    };
    let names = entries.filter_map(|entry| Some(entry.ok()?.file_name().display().to_string()));
    Ok(names.filter(|name| is(name)).min())
}

/// Writes a file so that a kill leaves the old or the new one.
pub(crate) fn write_durably(path: &Path, bytes: &[u8]) -> Result<(), RunError> {
    durable::replace(path, bytes).map_err(io_error("save", path))
}

/// Says what was tried, and where.
pub(crate) fn io_error<'a>(
    doing: &'static str,
    path: &'a Path,
) -> impl FnOnce(io::Error) -> RunError + 'a {
    move |source| RunError::Io {
        doing,
        path: path.to_owned(),
        source,
    }
}
