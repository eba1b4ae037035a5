//! From a study's file to its pairs: which segments are put beside each other.
//!
//! Source: STAIR, 3.1 and 5.3 (the two human studies); design of practice and checks ours.

use std::path::Path;

use domain::environment::{EnvError, TaskReward};
use domain::episode::{EpisodeId, Segment, SegmentRecord};
use domain::query::QueryKey;
use domain::random::{Rng, Stream};
use sim::expert::{Rollout, rollout};
use sim::tasks::Task;

use super::{
    Expected, KnownPair, PackedSegment, Player, QuerySet, QuerySetError, Shot, Source, StudyFile,
    spread,
};

/// Keys of [`Stream::Study`] from here on draw a task's counted pairs, or their order where
/// methods chose them; smaller ones lay out labelers' turns.
const FIRST_KEY: u64 = 1 << 32;

/// Why a pair is in a study.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum PairRole {
    /// For the study's result.
    Counted {
        /// The method that chose it, by its number in [`Source::methods`]; `None` for segments
        /// of experts.
        method: Option<usize>,
    },
    /// Answered first, with a word on each answer.
    Practice {
        /// The right answer.
        expects: Expected,
        /// Why.
        because: String,
    },
    /// To see whether labelers look.
    Check {
        /// The right answer.
        expects: Expected,
    },
}

/// A pair with all that drawing it takes.
#[derive(Debug, Clone, PartialEq)]
pub struct PlannedPair {
    /// Number of its task in [`StudyFile::tasks`].
    pub task: usize,
    /// Why it is there.
    pub role: PairRole,
    /// σ₀.
    pub first: SegmentRecord,
    /// σ₁.
    pub second: SegmentRecord,
}

/// Why a study's pairs could not be had.
#[derive(Debug, thiserror::Error)]
pub enum PlanError {
    /// A task that this program does not know.
    #[error(transparent)]
    Task(#[from] sim::tasks::UnknownTask),
    /// An episode that cannot be played.
    #[error("cannot play an episode of {task}: {reason}")]
    Episode {
        /// Whose.
        task: String,
        /// What the environment said.
        reason: EnvError,
    },
    /// A query set that cannot be had.
    #[error(transparent)]
    QuerySet(#[from] QuerySetError),
    /// A query set with segments of another length than the study's.
    #[error("{path} holds segments of {found} steps, but the study says {expected}")]
    OtherLength {
        /// The file or folder.
        path: String,
        /// Steps of its segments.
        found: u32,
        /// The study's `segment_len`.
        expected: u32,
    },
    /// A query set with fewer queries than the study asks for.
    #[error(
        "{path} holds {found} queries, but the study asks each labeler about {expected} of them"
    )]
    TooFew {
        /// The file or folder.
        path: String,
        /// Its queries.
        found: usize,
        /// The method's share of the study's `labels_per_task`.
        expected: usize,
    },
    /// Episodes of experts with fewer segments than the study shows.
    #[error(
        "the expert's episodes of {task} hold {found} segments that start early enough, but {expected} are shown; play more `episodes`"
    )]
    TooFewSegments {
        /// Whose.
        task: String,
        /// Segments that there are.
        found: usize,
        /// Two for each pair.
        expected: usize,
    },
    /// A task without a scripted expert.
    #[error("{0} has no scripted expert to draw segments from")]
    NoExpert(String),
}

/// All pairs of a study: task by task practice, counted pairs, checks. The same file gives the
/// same pairs.
///
/// * `folder` – where the file lies; query sets are named from there
///
/// # Errors
/// [`PlanError`].
pub fn plan(study: &StudyFile, folder: &Path) -> Result<Vec<PlannedPair>, PlanError> {
    let mut pairs = Vec::new();
    for (number, name) in study.tasks.iter().enumerate() {
        let task = sim::tasks::task(name)?;
        for pair in study.practice.iter().filter(|pair| pair.task == *name) {
            let role = PairRole::Practice {
                expects: pair.expects,
                because: pair.because.clone(),
            };
            pairs.push(known(task, number, pair, role, study.segment_len)?);
        }
        pairs.extend(counted(study, task, number, folder)?);
        for pair in study.checks.iter().filter(|pair| pair.task == *name) {
            let role = PairRole::Check {
                expects: pair.expects,
            };
            pairs.push(known(task, number, pair, role, study.segment_len)?);
        }
    }
    Ok(pairs)
}

fn known(
    task: &Task,
    number: usize,
    pair: &KnownPair,
    role: PairRole,
    len: u32,
) -> Result<PlannedPair, PlanError> {
    let record = |shot: Shot| -> Result<SegmentRecord, PlanError> {
        Ok(window(&play(task, shot)?, shot.seed, shot.start, len))
    };
    Ok(PlannedPair {
        task: number,
        role,
        first: record(pair.first)?,
        second: record(pair.second)?,
    })
}

fn counted(
    study: &StudyFile,
    task: &Task,
    number: usize,
    folder: &Path,
) -> Result<Vec<PlannedPair>, PlanError> {
    match &study.source {
        Source::Expert {
            start_before,
            n_episodes,
        } => expert_pairs(study, task, number, (*start_before, *n_episodes)),
        Source::Queries(sets) => query_pairs(study, (task, number), sets, folder),
    }
}

/// As many queries of every method's run, spread over the run, as the method chose them; in an
/// order that says nothing about methods, for pairs are numbered by it, and answers are exported
/// with these numbers while the study is open.
fn query_pairs(
    study: &StudyFile,
    (task, number): (&Task, usize),
    sets: &[QuerySet],
    folder: &Path,
) -> Result<Vec<PlannedPair>, PlanError> {
    let methods = study.source.methods();
    let share = study.labels_per_task as usize / methods.len().max(1);
    let mut pairs = Vec::new();
    for set in sets.iter().filter(|set| set.task == task.name) {
        let queries = set.load(folder)?;
        let path = || set.from.display().to_string();
        if queries.len() < share {
            return Err(PlanError::TooFew {
                path: path(),
                found: queries.len(),
                expected: share,
            });
        }
        let keys: Vec<QueryKey> = queries.iter().map(|query| query.key).collect();
        for index in spread(&keys, share) {
            let query = &queries[index];
            let segments = [&query.first, &query.second];
            let other = segments.iter().find(|s| s.segment.len != study.segment_len);
            if let Some(segment) = other {
                return Err(PlanError::OtherLength {
                    path: path(),
                    found: segment.segment.len,
                    expected: study.segment_len,
                });
            }
            let [first, second] = segments.map(record_of);
            pairs.push(PlannedPair {
                task: number,
                role: PairRole::Counted {
                    method: methods.iter().position(|method| *method == set.method),
                },
                first,
                second,
            });
        }
    }
    let mut rng = Rng::new(study.seed.into(), Stream::Study, FIRST_KEY + number as u64);
    let order = rng.permutation(pairs.len());
    Ok(order.into_iter().map(|at| pairs[at].clone()).collect())
}

/// What can be seen of a segment; its task rewards are not kept in a query set.
fn record_of(segment: &PackedSegment) -> SegmentRecord {
    SegmentRecord {
        segment: segment.segment,
        poses: segment.poses.clone(),
        task_rewards: Vec::new(),
        stages: segment.stages.clone(),
    }
}

/// Random pairs from episodes of the task's expert; no segment is shown twice.
fn expert_pairs(
    study: &StudyFile,
    task: &Task,
    number: usize,
    (start_before, n_episodes): (u32, u32),
) -> Result<Vec<PlannedPair>, PlanError> {
    let key = FIRST_KEY + number as u64;
    let mut rng = Rng::new(study.seed.into(), Stream::Study, key);
    let mut episodes = Vec::new();
    for _ in 0..n_episodes {
        let seed = rng.next_u32();
        let player = Player::Expert;
        let shot = Shot {
            player,
            seed,
            start: 0,
        };
        episodes.push(play(task, shot)?);
    }
    let len = study.segment_len;
    let windows = |(number, episode): (usize, &Rollout)| {
        let n_steps = episode.task_rewards.len() as u32;
        let n_starts = start_before.min((n_steps + 1).saturating_sub(len));
        (0..n_starts).map(move |start| (number, start))
    };
    let windows: Vec<(usize, u32)> = episodes.iter().enumerate().flat_map(windows).collect();
    let n_wanted = 2 * study.labels_per_task as usize;
    if windows.len() < n_wanted {
        return Err(PlanError::TooFewSegments {
            task: task.name.to_owned(),
            found: windows.len(),
            expected: n_wanted,
        });
    }
    let order = rng.permutation(windows.len());
    let records: Vec<SegmentRecord> = order[..n_wanted]
        .iter()
        .map(|&at| {
            let (number, start) = windows[at];
            window(&episodes[number], number as u32, start, len)
        })
        .collect();
    let pairs = records.chunks_exact(2).map(|pair| PlannedPair {
        task: number,
        role: PairRole::Counted { method: None },
        first: pair[0].clone(),
        second: pair[1].clone(),
    });
    Ok(pairs.collect())
}

/// The whole episode of a shot.
pub(super) fn play(task: &Task, shot: Shot) -> Result<Rollout, PlanError> {
    let mut environment = (task.make)();
    let seed = u64::from(shot.seed);
    let played = match shot.player {
        Player::Expert => {
            let expert = task
                .expert
                .ok_or_else(|| PlanError::NoExpert(task.name.to_owned()))?;
            rollout(environment.as_mut(), seed, &mut |observation| {
                expert(observation)
            })
        }
        Player::Random => {
            let size = (task.spec)().action_size;
            let mut rng = Rng::new(seed, Stream::Rollout, 0);
            rollout(environment.as_mut(), seed, &mut |_| {
                let action = (0..size).map(|_| rng.uniform_in(-1.0, 1.0) as f32);
                action.collect()
            })
        }
    };
    played.map_err(|reason| PlanError::Episode {
        task: task.name.to_owned(),
        reason,
    })
}

/// A window of an episode, with the states after each of its steps.
fn window(played: &Rollout, episode: u32, start: u32, len: u32) -> SegmentRecord {
    let steps = start as usize..(start + len) as usize;
    SegmentRecord {
        segment: Segment {
            episode: EpisodeId(episode),
            start,
            len,
        },
        poses: played.poses[steps.start + 1..=steps.end].to_vec(),
        task_rewards: played.task_rewards[steps.clone()]
            .iter()
            .copied()
            .map(TaskReward)
            .collect(),
        stages: played.stages.get(steps).unwrap_or_default().to_vec(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::study::READY;

    fn demo() -> StudyFile {
        ready("task-1-demo")
    }

    fn ready(wanted: &str) -> StudyFile {
        let (name, text) = READY.iter().find(|(name, _)| *name == wanted).unwrap();
        StudyFile::parse(name, text, Path::new("")).unwrap()
    }

    #[test]
    fn the_same_file_gives_the_same_pairs_and_another_seed_gives_others() {
        let study = demo();
        let pairs = plan(&study, Path::new("")).unwrap();
        assert_eq!(pairs, plan(&study, Path::new("")).unwrap());
        let seed = study.seed + 1;
        let other = plan(&StudyFile { seed, ..study }, Path::new("")).unwrap();
        let counted = |pair: &&PlannedPair| matches!(pair.role, PairRole::Counted { .. });
        let starts = |pairs: &[PlannedPair]| -> Vec<u32> {
            let counted = pairs.iter().filter(counted);
            counted.map(|pair| pair.first.segment.start).collect()
        };
        assert_ne!(starts(&pairs), starts(&other));
    }

    #[test]
    fn segments_are_of_the_files_length_start_early_and_are_never_shown_twice() {
        let study = demo();
        let pairs = plan(&study, Path::new("")).unwrap();
        let counted: Vec<_> = pairs
            .iter()
            .filter(|pair| matches!(pair.role, PairRole::Counted { method: None }))
            .collect();
        assert_eq!(counted.len(), 20);
        let mut seen = Vec::new();
        for record in counted.iter().flat_map(|pair| [&pair.first, &pair.second]) {
            assert_eq!((record.poses.len(), record.segment.len), (20, 20));
            assert_eq!(record.stages.len(), 20, "go-fetch-return knows its stages");
            assert!(record.segment.start < 80);
            assert!(!seen.contains(&record.segment), "{:?}", record.segment);
            seen.push(record.segment);
        }
    }

    /// The numbers of the methods of all counted pairs of a task, in the order of the pairs.
    fn methods(pairs: &[PlannedPair], task: usize) -> Vec<usize> {
        let of_task = pairs.iter().filter(|pair| pair.task == task);
        let method = |pair: &PlannedPair| match pair.role {
            PairRole::Counted { method } => method,
            _ => None,
        };
        of_task.filter_map(method).collect()
    }

    #[test]
    fn the_place_of_a_pair_does_not_tell_the_method_that_chose_it() {
        let study = ready("task-2");
        let pairs = plan(&study, Path::new("")).unwrap();
        let half = study.labels_per_task as usize / 2;
        let tasks = 0..study.tasks.len();
        let mut orders: Vec<Vec<usize>> = tasks.map(|task| methods(&pairs, task)).collect();
        for order in &orders {
            let n_first = |order: &[usize]| order.iter().filter(|method| **method == 0).count();
            assert_eq!((n_first(order), order.len()), (half, 2 * half));
            let early = n_first(&order[..half]);
            assert!(early.abs_diff(half - early) < half / 2, "{order:?}");
        }
        orders.sort();
        orders.dedup();
        assert_eq!(orders.len(), study.tasks.len(), "each task has its own");
        assert_eq!(pairs, plan(&study, Path::new("")).unwrap());
        let seed = study.seed + 1;
        let other = plan(&StudyFile { seed, ..study }, Path::new("")).unwrap();
        assert_ne!(methods(&pairs, 0), methods(&other, 0));
    }

    #[test]
    fn practice_comes_first_in_its_task_and_checks_last() {
        let pairs = plan(&demo(), Path::new("")).unwrap();
        assert!(matches!(pairs[0].role, PairRole::Practice { .. }));
        assert!(matches!(pairs[21].role, PairRole::Check { .. }));
        assert_eq!(pairs.len(), 22);
    }
}
