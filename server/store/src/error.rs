//! What the store refuses, and what can befall it.

use std::path::PathBuf;
use std::sync::Arc;

use domain::query::QueryKey;
use sqlx::sqlite::SqliteError;

use crate::answer::StoredAnswer;

/// Why the store did not do what it was asked. Nothing of the request was kept, except where a
/// variant says so.
#[derive(Debug, Clone, thiserror::Error)]
pub enum StoreError {
    /// The data folder cannot be used.
    #[error("cannot use the data folder {path}: {reason}")]
    Folder {
        /// Where.
        path: PathBuf,
        /// What the system said.
        reason: String,
    },
    /// Another server holds the data folder.
    #[error(
        "another server holds the data folder {path}{holder}; stop it, or choose another folder with --data"
    )]
    Held {
        /// Where.
        path: PathBuf,
        /// ` (process 123)`, or nothing.
        holder: String,
    },
    /// The database was written by a newer version of the program.
    #[error(
        "the database {path} is from a newer version of this program (it has migration {version}); use that version"
    )]
    Newer {
        /// Where.
        path: PathBuf,
        /// The migration that this program does not know.
        version: i64,
    },
    /// The database could not be brought up to date.
    #[error("cannot bring the database {path} up to date: {reason}")]
    Migration {
        /// Where.
        path: PathBuf,
        /// What went wrong.
        reason: String,
    },
    /// SQLite did not take a setting on which durability or integrity rests.
    #[error(
        "SQLite has {name} = {got} where {wanted} is needed; the file system of the data folder may not support it"
    )]
    Setting {
        /// The setting.
        name: &'static str,
        /// What is needed.
        wanted: &'static str,
        /// What it is.
        got: String,
    },
    /// The disk is full.
    #[error(
        "the disk with the data folder is full; free some space and try again, nothing stored is lost"
    )]
    Full,
    /// The disk or the file cannot be written.
    #[error(
        "the data folder cannot be written (read-only disk or missing permission); nothing stored is lost"
    )]
    ReadOnly,
    /// A rule of the database was broken; the name is the constraint's.
    #[error("the database refused it: {0}")]
    Rule(String),
    /// Anything else that the database said.
    #[error("the database failed: {0}")]
    Database(Arc<sqlx::Error>),
    /// A row holds what no row should hold.
    #[error("the database holds something impossible: {0}")]
    Impossible(String),
    /// A run asks about other segments than it asked about under the same number before: it fell back
    /// to an earlier checkpoint and did not come the same way again.
    #[error(
        "the run asks about other segments than those that are stored as query {} of session {}, so their answers would count for the wrong pair; start a new run", .0.index, .0.session
    )]
    OtherSegments(QueryKey),
    /// The server is closing.
    #[error("the server is closing")]
    Closed,
    /// The system gives no random numbers.
    #[error("the system gives no random numbers: {0}")]
    Random(String),
    /// There is no such row.
    #[error("there is no {what} {id}")]
    Missing {
        /// `run`, `query`, `lease`, `clip`.
        what: &'static str,
        /// As it was asked for.
        id: String,
    },
    /// A lease belongs to another labeler.
    #[error("this lease belongs to another labeler")]
    NotYours,
    /// A word that does not answer the question.
    #[error("'{pressed}' is no answer to the question {question}; it takes {takes}")]
    WrongQuestion {
        /// What came.
        pressed: String,
        /// What was asked.
        question: &'static str,
        /// What it takes.
        takes: &'static str,
    },
    /// A skip without a reason.
    #[error("a skip needs a reason")]
    NoReason,
    /// Another answer exists for this lease.
    #[error("this question was already answered differently ('{}')", .0.pressed)]
    Different(Box<StoredAnswer>),
    /// The answer that is to be superseded is not the lease's present answer.
    #[error("answer {0} is not an answer of this lease")]
    NotSupersedable(String),
    /// The study is not in the state for this; an answer is kept aside.
    #[error("the study is {state}: {told}")]
    StudyState {
        /// `preparing`, `ready`, `open`, `closed` or `failed`.
        state: String,
        /// What that means for what was asked.
        told: &'static str,
    },
    /// A study has no place left to give.
    #[error("there are places for {most} labelers, and {invited} of them are given out: {}", left(*most, *invited))]
    NoSeatLeft {
        /// Seats at most.
        most: u32,
        /// Seats that are given.
        invited: u32,
    },
    /// A link into a study that does not work, or no longer.
    #[error("{0}")]
    Link(LinkTrouble),
    /// Somebody else took the lease; the answer is kept aside.
    #[error("the lease ran out and somebody else has the question now; the answer is kept aside")]
    Taken,
    /// The stage question of a skipped pair; the answer is kept aside.
    #[error(
        "the pair was skipped, so its stages are not asked about any more; the answer is kept aside"
    )]
    Withdrawn,
    /// A name that is not a person's to take.
    #[error(
        "'{0}' is a name that this server keeps for itself, for the programs that answer or for those who were invited to a study; choose another name"
    )]
    NameKept(String),
}

fn left(most: u32, invited: u32) -> String {
    match most.saturating_sub(invited) {
        0 => "no more can be invited".to_owned(),
        n => format!("{n} more can be invited"),
    }
}

/// What is wrong with a link into a study.
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
pub enum LinkTrouble {
    /// Nobody was ever given it.
    #[error("this link is not one that was given out; it may be cut off")]
    Unknown,
    /// Somebody has entered by it.
    #[error(
        "somebody has begun by this link already; go on in the browser where you began, or with your return code"
    )]
    Used,
    /// It is too late.
    #[error("this link has run out; ask whoever sent it for a new one")]
    Expired,
    /// The study takes no answers yet.
    #[error("this study has not begun yet; try again later")]
    NotYet,
    /// The study takes no answers any more.
    #[error("this study is closed; thank you for wanting to take part")]
    Closed,
}

impl StoreError {
    pub(crate) fn missing(what: &'static str, id: &impl std::fmt::Display) -> Self {
        Self::Missing {
            what,
            id: id.to_string(),
        }
    }
}

impl From<sqlx::Error> for StoreError {
    fn from(error: sqlx::Error) -> Self {
        let Some(said) = error.as_database_error() else {
            return match error {
                sqlx::Error::PoolClosed | sqlx::Error::WorkerCrashed => Self::Closed,
                error => Self::Database(Arc::new(error)),
            };
        };
        let code = said
            .try_downcast_ref::<SqliteError>()
            .and_then(SqliteError::code);
        let code: i32 = code.and_then(|code| code.parse().ok()).unwrap_or(0);
        match code & 0xff {
            8 => Self::ReadOnly,
            13 => Self::Full,
            19 => Self::Rule(said.message().to_owned()),
            _ => Self::Database(Arc::new(error)),
        }
    }
}

use sqlx::error::DatabaseError as _;
