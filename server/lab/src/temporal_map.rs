//! How a run sees one of its episodes: which states are near one another in time, where that
//! cuts the episode into stages, and what was asked about it.

use domain::episode::{EpisodeId, Segment};
use domain::stage::{StageProbabilities, best_segmentation};
use learn::replay::Replay;
use learn::temporal::TemporalDistance;
use serde::{Deserialize, Serialize};

use crate::config::find_task;
use crate::record::RunRecord;
use crate::run::RunError;

/// States that are compared at most; of a longer episode every second or third.
const MOST_STATES: u32 = 90;
/// Stages to cut into where a task does not know its own.
const N_STAGES: usize = 4;

/// The temporal distances between the states of one episode, and what lies over them.
///
/// Steps count from 0; the state of a step is the one that it leads to.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct TemporalMap {
    /// The run's task.
    pub task: String,
    /// The run's method.
    pub method: String,
    /// The run's seed.
    pub seed: u64,
    /// Environment steps that the run had taken.
    pub run_step: u64,
    /// Number of the episode in the run.
    pub episode: u32,
    /// Its steps.
    pub len: u32,
    /// Steps whose states are compared, ascending, `[n]`.
    pub steps: Vec<u32>,
    /// Nats from the state of each row to that of each column, `[n][n]`.
    pub distance: Vec<Vec<f32>>,
    /// Index into `steps` of the first state of each stage; the first stage starts at 0.
    pub starts: Vec<usize>,
    /// True stage of each compared state, `[n]`, empty where the task does not know.
    pub stages: Vec<u8>,
    /// Names of the true stages.
    pub stage_names: Vec<String>,
    /// What was asked about the episode, in the order of asking.
    pub asked: Vec<AskedSegment>,
}

/// A segment of a query.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
pub struct AskedSegment {
    /// Round of asking, from 0.
    pub session: u32,
    /// First step.
    pub start: u32,
    /// Steps.
    pub len: u32,
}

/// Why a run has no map.
#[derive(Debug, thiserror::Error)]
pub enum MapError {
    /// A folder that cannot be read.
    #[error(transparent)]
    Run(#[from] RunError),
    /// A method without a temporal distance.
    #[error("{0} learns no temporal distance; runs of {1} do")]
    NotLearned(String, String),
    /// Nothing learned so far.
    #[error(
        "the temporal distance is learned once the first round is answered (it is asked at step {first}), and the run has saved step {step}"
    )]
    NotYet {
        /// Step of the first session.
        first: u64,
        /// Step of the checkpoint.
        step: u64,
    },
    /// An episode that the run does not have, or not to its end.
    #[error("the run has no complete episode {0}; its episodes are numbered from 0")]
    NoEpisode(u32),
}

impl TemporalMap {
    /// Of a complete episode of a run, or of the one that was asked about most, the newest of
    /// several.
    ///
    /// # Errors
    /// A run without a temporal distance, or without that episode.
    pub fn of(record: &RunRecord, episode: Option<u32>) -> Result<Self, MapError> {
        let config = record.config();
        let temporal = record.temporal_distance()?;
        let temporal = temporal.ok_or_else(|| MapError::not_learned(&config.method))?;
        if temporal.n_updates() == 0 {
            return Err(MapError::NotYet {
                first: config.feedback.step_of(0),
                step: record.step(),
            });
        }
        let replay = record.replay();
        let asked = segments(record);
        let id = match episode {
            Some(number) => *replay
                .complete_episodes()
                .iter()
                .find(|id| id.0 == number)
                .ok_or(MapError::NoEpisode(number))?,
            None => most_asked(replay, &asked).ok_or(MapError::NoEpisode(0))?,
        };
        let spec = (find_task(&config.task).map_err(RunError::from)?.spec)();
        let len = replay.episode(id).len;
        let stride = len.div_ceil(MOST_STATES).max(1) as usize;
        let steps: Vec<u32> = (0..len).step_by(stride).collect();
        let distance = distances(&temporal, replay, id, &steps);
        let whole = Segment {
            episode: id,
            start: 0,
            len,
        };
        let stages = replay.record(whole).stages;
        let n_stages = match spec.stages.len() {
            0 => N_STAGES,
            known => known,
        };
        Ok(Self {
            task: config.task.clone(),
            method: config.method.clone(),
            seed: config.seed,
            run_step: record.step(),
            episode: id.0,
            len,
            starts: stage_starts(&distance, n_stages),
            stages: stages.into_iter().step_by(stride).collect(),
            stage_names: spec.stages,
            asked: asked
                .into_iter()
                .filter(|(there, _)| *there == id)
                .map(|(_, segment)| segment)
                .collect(),
            steps,
            distance,
        })
    }
}

/// Whether runs of a method learn a temporal distance, so that they have maps.
pub fn is_learned_by(method: &str) -> bool {
    learning_methods().contains(&method)
}

impl MapError {
    /// What is told of a method without a temporal distance.
    pub fn not_learned(method: &str) -> Self {
        Self::NotLearned(method.to_owned(), learning_methods().join(", "))
    }
}

/// Names of the methods that learn a temporal distance.
fn learning_methods() -> Vec<&'static str> {
    let learns = |name: &&str| {
        let config = crate::config::RunConfig {
            method: (*name).to_owned(),
            ..Default::default()
        };
        crate::method::build(&config).is_ok_and(|method| method.learns_temporal_distance())
    };
    let names = crate::method::METHODS.iter().map(|method| method.name);
    names.filter(learns).collect()
}

/// Both segments of every query.
fn segments(record: &RunRecord) -> Vec<(EpisodeId, AskedSegment)> {
    let of = |session: u32, segment: Segment| {
        let asked = AskedSegment {
            session,
            start: segment.start,
            len: segment.len,
        };
        (segment.episode, asked)
    };
    let asked = record.asked().iter();
    asked
        .flat_map(|(key, query)| [query.first, query.second].map(|s| of(key.session, s)))
        .collect()
}

fn most_asked(replay: &Replay, asked: &[(EpisodeId, AskedSegment)]) -> Option<EpisodeId> {
    let n_asked = |id: EpisodeId| asked.iter().filter(|(there, _)| *there == id).count();
    let complete = replay.complete_episodes().iter().copied();
    complete
        .filter(|id| replay.episode(*id).len > 1)
        .max_by_key(|id| (n_asked(*id), *id))
}

/// Between the states of the steps, `[n][n]`.
fn distances(
    temporal: &TemporalDistance,
    replay: &Replay,
    id: EpisodeId,
    steps: &[u32],
) -> Vec<Vec<f32>> {
    let states = steps
        .iter()
        .map(|&step| replay.observation(id, step as usize + 1));
    let all: Vec<f32> = states.clone().flatten().copied().collect();
    states
        .map(|from| temporal.distance(&from.repeat(steps.len()), &all))
        .collect()
}

/// Where the episode is cut into at most `n_stages` stages, indices of states.
///
/// Each stage has a state that stands for it: the first is the episode's first, and each further
/// one the farthest from those before. How likely a state s belongs to the stage of a is
/// exp(−d), d from the earlier of s and a to the later one, as the successor distance has it: the
/// discounted chance to come by, against that of staying. The best segmentation (STAIR, Eq. 3)
/// does the rest.
fn stage_starts(distance: &[Vec<f32>], n_stages: usize) -> Vec<usize> {
    let onward = |s: usize, a: usize| distance[s.min(a)][s.max(a)];
    let n_states = distance.len();
    let mut anchors = vec![0];
    while anchors.len() < n_stages.min(n_states) {
        let nearest = |s: usize| {
            let distances = anchors.iter().map(|&a| onward(s, a));
            distances.fold(f32::INFINITY, f32::min)
        };
        let farthest = (0..n_states).max_by(|&a, &b| nearest(a).total_cmp(&nearest(b)));
        anchors.push(farthest.expect("an episode has states"));
    }
    anchors.sort_unstable();
    anchors.dedup();
    let likely = |s: usize| anchors.iter().map(move |&a| (s, a));
    let values = (0..n_states).flat_map(likely);
    let values = values.map(|(s, a)| (-onward(s, a)).exp().clamp(0.0, 1.0));
    match StageProbabilities::new(values.collect(), anchors.len()) {
        Ok(table) => best_segmentation(&table).starts,
        Err(_) => vec![0], // weights that are no numbers give no stages
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Distances of an episode that stays in each of some places for some states; going on by a
    /// place takes a nat, staying a hundredth for each state.
    fn walk(places: &[usize]) -> Vec<Vec<f32>> {
        let n = places.len();
        let between =
            |i: usize, j: usize| places[i].abs_diff(places[j]) as f32 + 0.01 * i.abs_diff(j) as f32;
        (0..n)
            .map(|i| (0..n).map(|j| between(i, j)).collect())
            .collect()
    }

    #[test]
    fn an_episode_is_cut_where_it_goes_on_to_another_place() {
        let places: Vec<usize> = [[0; 5], [1; 5], [2; 5]].concat();
        assert_eq!(stage_starts(&walk(&places), 3), [0, 5, 10]);
        let long_last: Vec<usize> = [vec![0; 2], vec![1; 3], vec![2; 15]].concat();
        assert_eq!(stage_starts(&walk(&long_last), 3), [0, 2, 5]);
    }

    #[test]
    fn short_episodes_and_weights_that_are_no_numbers_have_what_stages_they_can() {
        assert_eq!(stage_starts(&walk(&[0]), 4), [0]);
        assert_eq!(stage_starts(&walk(&[0, 1]), 4), [0, 1]);
        assert_eq!(stage_starts(&vec![vec![f32::NAN; 3]; 3], 3), [0]);
    }
}
