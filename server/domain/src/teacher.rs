//! Whoever answers queries: a person, a program over HTTP, or a script inside the run.

use crate::answer::Preference;
use crate::query::{OfferedQuery, QueryKey};

mod mistaken;
mod oracle;

pub use mistaken::Mistaken;
pub use oracle::Oracle;

/// An answer as a run receives it.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Answered {
    /// Which query.
    pub key: QueryKey,
    /// `None` for a skip: no budget is used and a replacement is asked.
    pub preference: Option<Preference>,
    /// Gap-free number of the answer in its run, from 1; a later one supersedes an earlier
    /// one for the same query.
    pub sequence: u64,
}

/// A mailbox for queries. Neither method ever blocks.
pub trait Teacher: Send {
    /// Puts queries to the teacher. Asking the same key again changes nothing.
    ///
    /// # Errors
    /// When the queries could not be kept; the run stops rather than wait for an answer that
    /// cannot come.
    fn ask(&mut self, queries: &[OfferedQuery]) -> Result<(), TeacherError>;

    /// Answers with a sequence number above `after`, in order.
    ///
    /// # Errors
    /// When the answers cannot be read.
    fn collect(&mut self, after: u64) -> Result<Vec<Answered>, TeacherError>;
}

/// Why a teacher cannot go on.
#[derive(Debug, Clone, thiserror::Error)]
#[error("{0}")]
pub struct TeacherError(pub String);

/// A rule that answers one query; what makes one scripted teacher differ from another.
pub trait Judge: Send {
    /// The preference for a query, a pure function of it and the judge's seed.
    fn judge(&self, query: &OfferedQuery) -> Option<Preference>;
}

/// A script inside the run: answers as soon as it is asked.
pub struct Scripted {
    judge: Box<dyn Judge>,
    answered: Vec<Answered>,
    n_before: u64,
}

impl Scripted {
    /// `n_before`: answers that the run has already consumed (it is resuming).
    pub fn new(judge: Box<dyn Judge>, n_before: u64) -> Self {
        Self {
            judge,
            answered: Vec::new(),
            n_before,
        }
    }
}

impl Teacher for Scripted {
    fn ask(&mut self, queries: &[OfferedQuery]) -> Result<(), TeacherError> {
        for query in queries {
            if self.answered.iter().any(|a| a.key == query.key) {
                continue;
            }
            let sequence = self.n_before + self.answered.len() as u64 + 1;
            self.answered.push(Answered {
                key: query.key,
                preference: self.judge.judge(query),
                sequence,
            });
        }
        Ok(())
    }

    fn collect(&mut self, after: u64) -> Result<Vec<Answered>, TeacherError> {
        Ok(self
            .answered
            .iter()
            .filter(|a| a.sequence > after)
            .copied()
            .collect())
    }
}

/// Names that `--teacher` takes, with what each does.
pub const SCRIPTED: &[(&str, &str)] = &[
    ("oracle", "prefers the segment with the larger task return"),
    ("mistaken", "the oracle, with every tenth answer flipped"),
    (
        "coin",
        "answers at random: a control that must not teach anything",
    ),
];

/// The scripted teacher of that name.
pub fn judge(name: &str, seed: u64) -> Option<Box<dyn Judge>> {
    Some(match name {
        "oracle" => Box::new(Oracle),
        "mistaken" => Box::new(Mistaken {
            probability: 0.1,
            seed,
        }),
        "coin" => Box::new(Mistaken {
            probability: 0.5,
            seed,
        }),
        _ => return None,
    })
}
