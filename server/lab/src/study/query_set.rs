//! The queries that a method chose in one run, in one small file: what is drawn of them, and
//! nothing that could be learned from.
//!
//! A study that compares methods opens with such files where nobody has trained anything.

use std::io;
use std::path::{Path, PathBuf};

use domain::episode::Segment;
use domain::query::{Query, QueryKey};
use learn::replay::Replay;
use sim::tasks::UnknownTask;

use super::source::QuerySet;
use crate::record::RunRecord;
use crate::run::RunError;

mod format;
mod spread;

pub use spread::spread;

/// Sets that come with the program, named as ready studies name them.
const READY: &[(&str, &[u8])] = include!(concat!(env!("OUT_DIR"), "/query_sets.rs"));

/// Queries in a packed set where nobody says how many.
pub const DEFAULT_QUERIES: usize = 50;

/// The queries of one run, or some of them, with where they come from.
#[derive(Debug, Clone, PartialEq)]
pub struct PackedQueries {
    /// The run's task.
    pub task: String,
    /// The method that chose.
    pub method: String,
    /// The run's seed.
    pub seed: u64,
    /// The preset on top of the task's and the method's own that the run's settings are nearest to.
    pub preset: Option<String>,
    /// What trains the run again, who answers left out.
    pub command: String,
    /// Of the program that packed.
    pub revision: String,
    /// Steps of a segment, `H`.
    pub segment_len: u32,
    /// At least one, in the order in which they were asked.
    pub queries: Vec<PackedQuery>,
}

/// A query as the method chose it.
#[derive(Debug, Clone, PartialEq)]
pub struct PackedQuery {
    /// Its name in the run: the session, and its place there.
    pub key: QueryKey,
    /// σ₀.
    pub first: PackedSegment,
    /// σ₁.
    pub second: PackedSegment,
}

/// A segment as far as it can be seen.
#[derive(Debug, Clone, PartialEq)]
pub struct PackedSegment {
    /// Which window of the run.
    pub segment: Segment,
    /// Poses of the states after each step, `[H][pose_size]`.
    pub poses: Vec<Vec<f32>>,
    /// True stage of each state, `[H]`, empty where the task does not know.
    pub stages: Vec<u8>,
}

/// Why there are no queries to be had.
#[derive(Debug, thiserror::Error)]
pub enum QuerySetError {
    /// A file that cannot be read.
    #[error("cannot read {}: {source}", path.display())]
    Io {
        /// The file.
        path: PathBuf,
        /// What the system said.
        source: io::Error,
    },
    /// A file of another kind.
    #[error(
        "{} is no packed query set; `stair study pack` makes one of a run's folder", path.display()
    )]
    Foreign {
        /// The file.
        path: PathBuf,
    },
    /// A file that this program is too old for.
    #[error(
        "{} was packed by a newer version of this program (format {found}; this one reads {known})", path.display()
    )]
    TooNew {
        /// The file.
        path: PathBuf,
        /// Its format.
        found: u32,
        /// The format of this program.
        known: u32,
    },
    /// A file that is not what was packed.
    #[error("{} is damaged: {reason}; copy or pack it again", path.display())]
    Damaged {
        /// The file.
        path: PathBuf,
        /// What does not fit.
        reason: String,
    },
    /// A task that this program does not have.
    #[error("{}: {source}", path.display())]
    UnknownTask {
        /// The file.
        path: PathBuf,
        /// What is meant, perhaps.
        source: UnknownTask,
    },
    /// Poses of another version of the task.
    #[error(
        "{} has poses of {found} numbers, and {task} is drawn from {expected} now; train and pack it again", path.display()
    )]
    OtherPoses {
        /// The file.
        path: PathBuf,
        /// Its task.
        task: String,
        /// Numbers in its poses.
        found: usize,
        /// Numbers in the task's poses.
        expected: usize,
    },
    /// Queries of another task or method than a study says.
    #[error("{} holds queries of {found}, but the study says {expected}", path.display())]
    Misnamed {
        /// The file or folder.
        path: PathBuf,
        /// Method and task that it is of.
        found: String,
        /// Method and task that the study says.
        expected: String,
    },
    /// A run's folder that cannot be read.
    #[error(transparent)]
    Run(#[from] RunError),
    /// A run that is still to choose queries.
    #[error(
        "the run in {} has taken {step} of its {total_steps} steps; let it finish: stair train --resume {}", folder.display(), folder.display()
    )]
    Unfinished {
        /// Where.
        folder: PathBuf,
        /// Environment steps taken.
        step: u64,
        /// Environment steps in all.
        total_steps: u64,
    },
    /// A run with fewer queries than are wanted.
    #[error(
        "the run in {} chose {there} queries by its method (a first session is drawn at random), and {wanted} are wanted", folder.display()
    )]
    TooFew {
        /// Where.
        folder: PathBuf,
        /// How many it has.
        there: usize,
        /// How many are wanted.
        wanted: usize,
    },
}

impl PackedQueries {
    /// The queries that its method chose in the finished run of a folder: `n` of them, [`spread`]
    /// over the run, or all.
    ///
    /// Those of the first session are left out: nothing is believed by then, and every method
    /// draws them at random.
    ///
    /// # Errors
    /// A folder without a run that can be read, a run that is not finished, or too few queries.
    pub fn of_run(folder: &Path, n: Option<usize>, revision: &str) -> Result<Self, QuerySetError> {
        let record = RunRecord::open(folder)?;
        let config = record.config();
        if !record.is_finished() {
            return Err(QuerySetError::Unfinished {
                folder: folder.to_owned(),
                step: record.step(),
                total_steps: config.training.total_steps,
            });
        }
        let asked = record.asked().iter().copied();
        let mut chosen: Vec<_> = asked.filter(|(key, _)| key.session > 0).collect();
        let wanted = n.unwrap_or(chosen.len()).max(1);
        if chosen.len() < wanted {
            return Err(QuerySetError::TooFew {
                folder: folder.to_owned(),
                there: chosen.len(),
                wanted,
            });
        }
        let keys: Vec<QueryKey> = chosen.iter().map(|(key, _)| *key).collect();
        chosen = spread(&keys, wanted).iter().map(|&i| chosen[i]).collect();
        Ok(Self {
            task: config.task.clone(),
            method: config.method.clone(),
            seed: config.seed,
            preset: config.preset_and_settings().0.map(str::to_owned),
            command: config.command(),
            revision: revision.to_owned(),
            segment_len: chosen[0].1.first.len,
            queries: chosen
                .into_iter()
                .map(|(key, query)| PackedQuery::of(key, query, record.replay()))
                .collect(),
        })
    }

    /// The `n` queries that the method ranked highest in their sessions, earlier sessions first
    /// among equal ranks; all where there are fewer.
    pub fn top(&self, n: usize) -> Vec<&PackedQuery> {
        let mut queries: Vec<&PackedQuery> = self.queries.iter().collect();
        queries.sort_by_key(|query| (query.key.index, query.key.session));
        queries.truncate(n);
        queries
    }

    /// Reads a packed file.
    ///
    /// # Errors
    /// A file that cannot be read, is of another kind or version, damaged, or not to be drawn by
    /// this version of its task.
    pub fn read(path: &Path) -> Result<Self, QuerySetError> {
        let bytes = std::fs::read(path).map_err(|source| QuerySetError::Io {
            path: path.to_owned(),
            source,
        })?;
        Self::unpack(path, &bytes)
    }
}

impl PackedQuery {
    fn of(key: QueryKey, query: Query, replay: &Replay) -> Self {
        let packed = |segment| {
            let record = replay.record(segment);
            PackedSegment {
                segment,
                poses: record.poses,
                stages: record.stages,
            }
        };
        Self {
            key,
            first: packed(query.first),
            second: packed(query.second),
        }
    }
}

impl QuerySet {
    /// Whether there is something to load.
    pub(super) fn exists(&self, folder: &Path) -> bool {
        self.shipped(folder).is_some() || folder.join(&self.from).exists()
    }

    /// The bytes of a set that comes with the program, for a study without a folder.
    fn shipped(&self, folder: &Path) -> Option<&'static [u8]> {
        let is_ready = folder.as_os_str().is_empty();
        let mut sets = READY.iter().filter(|_| is_ready);
        let found = sets.find(|(name, _)| Path::new(name) == self.from);
        found.map(|(_, bytes)| *bytes)
    }

    /// The queries of a packed file, or all that the method chose in the run of a folder, in the
    /// order in which they were asked. `folder` is where the study's file lies; a ready study has
    /// none, and its sets come with the program.
    ///
    /// # Errors
    /// As [`PackedQueries::read`] and [`PackedQueries::of_run`]; queries of another task or method
    /// than the study says.
    pub fn load(&self, folder: &Path) -> Result<Vec<PackedQuery>, QuerySetError> {
        let path = folder.join(&self.from);
        let packed = if let Some(bytes) = self.shipped(folder) {
            PackedQueries::unpack(&path, bytes)?
        } else if path.is_dir() {
            PackedQueries::of_run(&path, None, "")?
        } else {
            PackedQueries::read(&path)?
        };
        let (found, expected) = (
            format!("{} on {}", packed.method, packed.task),
            format!("{} on {}", self.method, self.task),
        );
        if found == expected {
            Ok(packed.queries)
        } else {
            Err(QuerySetError::Misnamed {
                path,
                found,
                expected,
            })
        }
    }
}
