//! Plays recorded actions in our own physics and compares where hand and object get to.
//!
//! The other replays check formulas; this one checks dynamics. Only the first line's state is
//! taken from the recording: every later difference is ours. Small ones grow as soon as the hand
//! touches something, so the hand is compared while it is free and the object at the end.

use serde::Deserialize;
use serde_json::Value;

use super::metaworld::{TASKS, TaskRecordings};
use crate::tasks::metaworld::{Point, Setup, Simulation, distance};
use domain::environment::Environment;

/// Largest error of the free hand that still counts as following, metres (rms).
pub const HAND_TOLERANCE_M: f64 = 0.010;
/// Largest error of the object at the end of an expert's episode, of its travel.
pub const OBJECT_TOLERANCE: f64 = 0.15;

/// Our physics after one recorded action.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Replayed {
    /// The hand, metres.
    pub hand: Point,
    /// Whether it is in contact with anything.
    pub hand_touches: bool,
    /// How far the object has moved: its joint, or metres from its start.
    pub object: f64,
}

/// Plays `actions` in the task whose object stands at `root`; one entry for the reset, one for
/// each action.
pub(super) fn replay<S: Setup + Send>(
    root: Point,
    actions: &[Vec<f32>],
) -> Result<Vec<Replayed>, String> {
    let mut simulation = Simulation::<S>::with_root(root);
    let now = |simulation: &Simulation<S>| {
        let readings = simulation.readings();
        Replayed {
            hand: readings.hand,
            hand_touches: simulation.hand_touches(),
            object: S::progress(&readings.object),
        }
    };
    let mut states = vec![now(&simulation)];
    for action in actions {
        simulation.step(action).map_err(|error| error.to_string())?;
        states.push(now(&simulation));
    }
    Ok(states)
}

/// How one recorded episode went here.
#[derive(Debug, Clone, PartialEq)]
pub struct DynamicsReport {
    /// `window-open v2 expert, seed 300`.
    pub recording: String,
    /// Whether the scripted expert acted; only then is the object held to its tolerance.
    pub is_expert: bool,
    /// Steps before the hand touched anything, here or there.
    pub n_free: usize,
    /// Error of the hand over these steps, metres (rms of the distance).
    pub hand_rms_m: f64,
    /// The object at the end, here and there: metres, radians.
    pub object: [f64; 2],
    /// How far the object moves in a solved episode.
    pub travel: f64,
}

impl DynamicsReport {
    /// Error of the object at the end, of its travel.
    pub fn object_error(&self) -> f64 {
        (self.object[0] - self.object[1]).abs() / self.travel
    }

    /// Whether hand and object are within their tolerances.
    pub fn is_within_tolerance(&self) -> bool {
        let object_is = !self.is_expert || self.object_error() <= OBJECT_TOLERANCE;
        self.hand_rms_m <= HAND_TOLERANCE_M && object_is
    }
}

/// A line of a recorded trajectory, as far as the dynamics care.
#[derive(Debug, Deserialize)]
pub(super) struct Line {
    #[serde(default)]
    task: String,
    #[serde(default)]
    ver: String,
    #[serde(default)]
    pol: String,
    #[serde(default)]
    seed: i64,
    t: i64,
    a: Vec<f32>,
    hand: Point,
    q: Vec<f64>,
    obj: Vec<f64>,
    rand_vec: Option<Vec<f64>>,
}

impl Line {
    /// Reads a line that the other replays have already found to be one of a trajectory.
    pub(super) fn read(line: &Value, task: &str) -> Result<Self, String> {
        let line: Self = serde_json::from_value(line.clone()).map_err(|error| error.to_string())?;
        Ok(Self {
            task: task.into(),
            ..line
        })
    }

    fn is_of_the_same_episode(&self, other: &Self) -> bool {
        let key = |line: &Self| {
            (
                line.task.clone(),
                line.ver.clone(),
                line.pol.clone(),
                line.seed,
            )
        };
        key(self) == key(other)
    }
}

/// Replays every episode among `lines`, which are in the order of their file.
///
/// # Errors
/// The first episode that cannot be played, and why.
pub(super) fn replay_all(lines: &[Line]) -> Result<Vec<DynamicsReport>, String> {
    lines
        .chunk_by(|a, b| a.is_of_the_same_episode(b) && b.t == a.t + 1)
        .filter(|episode| episode[0].t == 0)
        .map(replay_one)
        .collect()
}

fn replay_one(episode: &[Line]) -> Result<DynamicsReport, String> {
    let first = &episode[0];
    let task = TASKS
        .iter()
        .find(|known| known.name == first.task)
        .ok_or_else(|| format!("task {} is not known", first.task))?;
    let root = root(task, first)?;
    let actions: Vec<_> = episode[1..].iter().map(|line| line.a.clone()).collect();
    let ours = (task.replay)(root, &actions)?;
    let theirs: Vec<f64> = episode
        .iter()
        .map(|line| progress(task, root, line))
        .collect::<Result<_, _>>()?;

    // Contact shows here in the contacts, there in an object that moves.
    let moves = |object: f64| (object - theirs[0]).abs() > 0.01 * task.travel;
    let is_free = |t: &usize| !ours[*t].hand_touches && !moves(theirs[*t]);
    let n_free = (0..episode.len()).take_while(is_free).count();
    let squares = (0..n_free).map(|t| distance(ours[t].hand, episode[t].hand).powi(2));
    let last = episode.len() - 1;
    Ok(DynamicsReport {
        recording: format!(
            "{} {} {}, seed {}",
            first.task, first.ver, first.pol, first.seed
        ),
        is_expert: first.pol == "expert",
        n_free,
        hand_rms_m: (squares.sum::<f64>() / n_free.max(1) as f64).sqrt(),
        object: [ours[last].object, theirs[last]],
        travel: task.travel,
    })
}

/// Where the object stands; a block, of which only x and y are drawn, lies where it was.
fn root(task: &TaskRecordings, first: &Line) -> Result<Point, String> {
    let drawn = first
        .rand_vec
        .as_ref()
        .and_then(|drawn| drawn.get(..task.n_drawn))
        .ok_or("the first line of a trajectory needs rand_vec")?;
    let mut root: Point = *first
        .obj
        .first_chunk()
        .ok_or("obj has fewer than 3 numbers")?;
    root[..task.n_drawn].copy_from_slice(drawn);
    Ok(root)
}

/// How far the recorded object has moved: its joint, or metres from `start` without one.
fn progress(task: &TaskRecordings, start: Point, line: &Line) -> Result<f64, String> {
    if task.n_drawn == 3 {
        return line.q.first().copied().ok_or("q is empty".into());
    }
    let position = line
        .obj
        .first_chunk()
        .ok_or("obj has fewer than 3 numbers")?;
    Ok(distance(*position, start))
}
