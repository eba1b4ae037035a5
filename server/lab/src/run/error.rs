//! Why a run cannot go on.

use std::path::PathBuf;

use domain::environment::EnvError;
use domain::teacher::TeacherError;
use learn::LearnError;

use crate::config::ConfigError;
use crate::memory::TooLittleMemory;

/// Why a run cannot go on.
#[derive(Debug, thiserror::Error)]
pub enum RunError {
    /// Settings that cannot be used.
    #[error(transparent)]
    Config(#[from] ConfigError),
    /// Tensors, devices and checkpoints.
    #[error(transparent)]
    Learn(#[from] LearnError),
    /// A simulation that failed.
    #[error(transparent)]
    Environment(#[from] EnvError),
    /// A teacher that cannot be asked.
    #[error("the teacher cannot go on: {0}")]
    Teacher(#[from] TeacherError),
    /// A run that this machine cannot hold.
    #[error(transparent)]
    Memory(#[from] TooLittleMemory),
    /// A checkpoint and the folder's settings that do not belong together.
    #[error(
        "{path} was written with {key} = {checkpoint}, but config.toml beside it says {settings}; put {checkpoint} back there to go on with it, or start a new run elsewhere", path = path.display()
    )]
    OtherSettings {
        /// The checkpoint.
        path: PathBuf,
        /// Dotted path of the setting.
        key: &'static str,
        /// Its value in the checkpoint.
        checkpoint: String,
        /// Its value in the folder.
        settings: String,
    },
    /// The disk.
    #[error("cannot {doing} ({path}): {source}")]
    Io {
        /// What was tried.
        doing: &'static str,
        /// Where.
        path: PathBuf,
        /// What the system said.
        source: std::io::Error,
    },
    /// A new run where one is already.
    #[error("{folder} holds a run already; resume it or choose another folder")]
    Occupied {
        /// Where.
        folder: PathBuf,
    },
    /// A new run where there is one without its settings.
    #[error(
        "{} has no config.toml but holds {found}, which a run left there; put its config.toml back to go on with it, or choose another folder", folder.display()
    )]
    Remains {
        /// Where.
        folder: PathBuf,
        /// What is there.
        found: String,
    },
    /// A file that has lost some of what a checkpoint knows of it.
    #[error(
        "{} has {found} bytes, and {expected} belong to the checkpoint; put the whole file back", path.display()
    )]
    CutShort {
        /// The file.
        path: PathBuf,
        /// Its length.
        found: u64,
        /// The length that it had.
        expected: u64,
    },
    /// No run where one should be.
    #[error("{folder} holds no run: there is no config.toml in it")]
    NoRun {
        /// Where.
        folder: PathBuf,
    },
    /// None of the checkpoints can be read.
    #[error("no checkpoint in {folder} can be used: {reasons}")]
    NoCheckpoint {
        /// Where.
        folder: PathBuf,
        /// What each said.
        reasons: String,
    },
}
