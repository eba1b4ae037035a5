//! What stops a command, in words for the person at the terminal.

use std::fmt;

/// Something on this machine is missing that a person has to see to.
pub(crate) const NEEDS_A_PERSON: u8 = 2;

/// A message and the exit code that goes with it.
#[derive(Debug)]
pub(crate) struct Failure {
    /// What happened and what to do about it.
    pub(crate) message: String,
    /// Exit code of the program: 2 where a person has to act, else that of the failed command.
    pub(crate) exit_code: u8,
}

impl Failure {
    /// A person has to do something before it can go on.
    pub(crate) fn needs_a_person(message: impl Into<String>) -> Self {
        Self {
            message: message.into(),
            exit_code: NEEDS_A_PERSON,
        }
    }

    /// An operation of this program failed.
    pub(crate) fn failed(message: impl Into<String>) -> Self {
        Self {
            message: message.into(),
            exit_code: 1,
        }
    }

    /// A file operation failed: says which one, on what.
    pub(crate) fn io(doing: &str, path: &std::path::Path, error: &std::io::Error) -> Self {
        Self::failed(format!("could not {doing} {}: {error}", path.display()))
    }
}

impl fmt::Display for Failure {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(formatter, "xtask: {}", self.message)
    }
}
