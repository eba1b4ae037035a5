//! What can go wrong while learning, for the person who reads it.

use std::path::{Path, PathBuf};

/// What this crate refuses or could not do.
#[derive(Debug, thiserror::Error)]
pub enum LearnError {
    /// A device that this machine or this libtorch does not have.
    #[error("there is no device {name:?} here: {reason}")]
    NoDevice {
        /// What was asked for.
        name: String,
        /// Why it cannot be had, and what can.
        reason: String,
    },
    /// A file that could not be read or written.
    #[error("could not {action} {path}: {source}", path = path.display())]
    File {
        /// `read`, `write`, …
        action: &'static str,
        /// The file or folder.
        path: PathBuf,
        /// What the system said.
        source: std::io::Error,
    },
    /// A file whose content is not what was written.
    #[error("{path} is damaged: {reason}", path = path.display())]
    Damaged {
        /// The file.
        path: PathBuf,
        /// What does not fit.
        reason: String,
    },
    /// A file of another version of the program.
    #[error("{path} was written by another version of the program (format {found}, this one reads {expected})", path = path.display())]
    Version {
        /// The file.
        path: PathBuf,
        /// Format in the file.
        found: u32,
        /// Format of this program.
        expected: u32,
    },
    /// A part that an archive lacks or that does not fit what is loaded.
    #[error("the checkpoint's section {section:?} does not fit: {reason}")]
    Section {
        /// Name of the part.
        section: String,
        /// What does not fit.
        reason: String,
    },
}

impl LearnError {
    pub(crate) fn file(action: &'static str, path: &Path, source: std::io::Error) -> Self {
        Self::File {
            action,
            path: path.to_owned(),
            source,
        }
    }

    pub(crate) fn damaged(path: &Path, reason: impl Into<String>) -> Self {
        Self::Damaged {
            path: path.to_owned(),
            reason: reason.into(),
        }
    }

    pub(crate) fn section(section: &str, reason: impl Into<String>) -> Self {
        Self::Section {
            section: section.to_owned(),
            reason: reason.into(),
        }
    }
}
