//! MetaWorld's recordings: lines to readings, readings to checks.

use std::collections::BTreeMap;

use serde::de::Error;
use serde::{Deserialize, Deserializer};
use serde_json::{Map, Value};

use super::{Checks, OBSERVATION_TOLERANCE, REWARD_TOLERANCE, TRAJECTORY_TOLERANCE};
use crate::tasks::metaworld::{self, MOMENT_SIZE, OBSERVATION_SIZE, Point};

mod objects;

use objects::{Object, Recorded};
pub(super) use objects::{TASKS, TaskRecordings};

/// Whether recordings of this task can be replayed.
pub(super) fn knows(task: &str) -> bool {
    TASKS.iter().any(|known| known.name == task)
}

/// What a line holds.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Kind {
    Transition,
    Reset,
    Trajectory,
}

impl Kind {
    /// Told apart by the fields that only one of them has.
    pub(super) fn of(fields: &Map<String, Value>) -> Option<Self> {
        let has = |name| fields.contains_key(name);
        if has("obs") && has("r") {
            Some(Self::Transition)
        } else if has("obs") && has("rand_vec") {
            Some(Self::Reset)
        } else if has("obj") && has("grip") {
            Some(Self::Trajectory)
        } else {
            None
        }
    }
}

/// Which original a line is from.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Deserialize)]
enum Version {
    /// MuJoCo 2.1.0. Positions are read one substep before joint values.
    #[serde(rename = "v2")]
    V2,
    /// MuJoCo 3. Clips positions to the observation's bounds.
    #[serde(rename = "v3")]
    V3,
}

impl Version {
    fn name(self) -> &'static str {
        match self {
            Self::V2 => "v2",
            Self::V3 => "v3",
        }
    }

    /// Seconds by which positions are older than joint values.
    fn lag_s(self) -> f64 {
        match self {
            Self::V2 => 0.0025,
            Self::V3 => 0.0,
        }
    }

    /// The hand as this version's observation shows it.
    fn shown(self, hand: Point) -> Point {
        const LOWER: Point = [-0.525, 0.348, -0.0525];
        const UPPER: Point = [0.525, 1.025, 0.7];
        match self {
            Self::V2 => hand,
            Self::V3 => std::array::from_fn(|i| hand[i].clamp(LOWER[i], UPPER[i])),
        }
    }
}

/// What names an episode in every line of it.
#[derive(Debug, Clone, PartialEq, Eq, PartialOrd, Ord, Deserialize)]
struct EpisodeKey {
    ver: Version,
    #[serde(default)]
    task: String,
    #[serde(default)]
    pol: String,
    #[serde(default)]
    seed: i64,
}

#[derive(Deserialize)]
struct Transition {
    #[serde(flatten)]
    episode: EpisodeKey,
    t: i64,
    obs: Vec<f64>,
    r: f64,
    #[serde(deserialize_with = "yes_or_no")]
    success: bool,
    #[serde(default, deserialize_with = "maybe_number")]
    near_object: Option<f64>,
    grasp_reward: Option<f64>,
    in_place_reward: Option<f64>,
    obj_to_target: Option<f64>,
    hand: Point,
    tcp: Point,
    lp: Option<Point>,
    rp: Option<Point>,
    lc: Point,
    rc: Point,
    a: Vec<f64>,
    q: Vec<f64>,
    qd: Vec<f64>,
    target: Point,
    obj_init: Option<Point>,
    init_tcp: Point,
    handle_init: Option<Point>,
}

#[derive(Deserialize)]
struct Reset {
    ver: Version,
    obs: Vec<f64>,
    hand: Point,
    tcp: Point,
    lc: Point,
    rc: Point,
    q: Vec<f64>,
    target: Point,
    obj_init: Option<Point>,
    init_tcp: Point,
    handle_init: Option<Point>,
    rand_vec: Vec<f64>,
}

#[derive(Deserialize)]
struct TrajectoryStep {
    #[serde(flatten)]
    episode: EpisodeKey,
    t: i64,
    hand: Point,
    grip: f64,
    obj: Vec<f64>,
    tcp: Point,
    a: Vec<f64>,
    q: Vec<f64>,
    r: f64,
    #[serde(deserialize_with = "yes_or_no")]
    success: bool,
    target: Option<Point>,
    obj_init: Option<Point>,
    init_tcp: Option<Point>,
}

/// 0, 1, 0.0, 1.0, false or true.
fn yes_or_no<'de, D: Deserializer<'de>>(deserializer: D) -> Result<bool, D::Error> {
    let value = Value::deserialize(deserializer)?;
    match (value.as_bool(), value.as_f64()) {
        (Some(flag), _) => Ok(flag),
        (None, Some(0.0)) => Ok(false),
        (None, Some(1.0)) => Ok(true),
        _ => Err(D::Error::custom(format!("expected 0 or 1, not {value}"))),
    }
}

/// A number, false or true.
fn maybe_number<'de, D: Deserializer<'de>>(deserializer: D) -> Result<Option<f64>, D::Error> {
    let value = Value::deserialize(deserializer)?;
    let number = value.as_bool().map(metaworld::yes).or(value.as_f64());
    match number {
        None => Err(D::Error::custom(format!("expected a number, not {value}"))),
        number => Ok(number),
    }
}

/// What earlier lines of a file say about later ones.
#[derive(Debug, Default)]
pub(super) struct StepsBefore {
    last: BTreeMap<EpisodeKey, Remembered>,
    starts: BTreeMap<EpisodeKey, Start>,
}

/// The last transition of an episode.
#[derive(Debug)]
struct Remembered {
    t: i64,
    target: Point,
    moment: [f64; MOMENT_SIZE],
}

/// The first line of a trajectory.
#[derive(Debug)]
struct Start {
    target: Point,
    obj_init: Option<Point>,
    init_tcp: Point,
    object: Point,
}

/// Compares one line. `task` is one of those that [`knows`] answers for.
pub(super) fn check(
    task: &str,
    kind: Kind,
    line: &Value,
    before: &mut StepsBefore,
) -> Result<Checks, String> {
    let Some(task) = TASKS.iter().find(|known| known.name == task) else {
        return Err(format!("task {task} is not known"));
    };
    match kind {
        Kind::Transition => check_transition(task, &read(line)?, before),
        Kind::Reset => check_reset(task, &read(line)?),
        Kind::Trajectory => check_trajectory(task, &read(line)?, before),
    }
}

fn read<T: serde::de::DeserializeOwned>(line: &Value) -> Result<T, String> {
    serde_json::from_value(line.clone()).map_err(|error| error.to_string())
}

fn check_transition(
    task: &TaskRecordings,
    line: &Transition,
    before: &mut StepsBefore,
) -> Result<Checks, String> {
    let theirs = observation_of(&line.obs)?;
    let before_substep = |(q, qd): (&f64, &f64)| q - line.episode.ver.lag_s() * qd;
    let joints = line.q.iter().zip(&line.qd).map(before_substep).collect();
    let rebuilt = (task.rebuild)(&Recorded {
        hand: line.episode.ver.shown(line.hand),
        tcp: line.tcp,
        openness: metaworld::openness(line.lc, line.rc),
        pads: line
            .lp
            .zip(line.rp)
            .map(|(left, right)| [left[1], right[1]]),
        command: command(&line.a)?,
        newest: line.q.clone(),
        object: Object::Joints(joints),
        target: line.target,
        obj_init: line.obj_init,
        init_tcp: line.init_tcp,
        handle_init: line.handle_init,
        first_seen: None,
    })?;
    let step_before = before
        .last
        .get(&line.episode)
        .filter(|last| last.t + 1 == line.t && metaworld::distance(last.target, line.target) < 1e-9)
        .map(|last| last.moment);
    let ours = metaworld::observation(&rebuilt.moment, &step_before.unwrap_or(rebuilt.moment));

    let mut checks = Checks::new(format!(
        "{} {} transitions",
        task.name,
        line.episode.ver.name()
    ));
    let judgement = rebuilt.judgement;
    checks.number("reward", judgement.reward, line.r, REWARD_TOLERANCE);
    checks.flag("success", judgement.success, line.success);
    let parts = [
        ("near_object", judgement.near_object, line.near_object),
        ("grasp_reward", judgement.grasp_reward, line.grasp_reward),
        (
            "in_place_reward",
            judgement.in_place_reward,
            line.in_place_reward,
        ),
        ("obj_to_target", judgement.obj_to_target, line.obj_to_target),
    ];
    for (field, ours, theirs) in parts {
        if let Some(theirs) = theirs {
            checks.number(field, ours, theirs, REWARD_TOLERANCE);
        }
    }
    let mut slots = |field, range: std::ops::Range<usize>| {
        checks.numbers(
            field,
            &ours[range.clone()],
            &theirs[range],
            OBSERVATION_TOLERANCE,
        );
    };
    slots("observation 0-17", 0..18);
    if step_before.is_some() {
        slots("observation 18-35", 18..36);
    }
    slots("observation 36-38", 36..39);
    before.last.insert(
        line.episode.clone(),
        Remembered {
            t: line.t,
            target: line.target,
            moment: rebuilt.moment,
        },
    );
    Ok(checks)
}

/// Checks what the original reads freshly at a reset: not the object's point where that shows
/// the episode before, and not the second half in v2, for the same reason.
fn check_reset(task: &TaskRecordings, line: &Reset) -> Result<Checks, String> {
    let theirs = observation_of(&line.obs)?;
    let rebuilt = (task.rebuild)(&Recorded {
        hand: line.ver.shown(line.hand),
        tcp: line.tcp,
        openness: metaworld::openness(line.lc, line.rc),
        pads: None,
        command: -1.0,
        newest: line.q.clone(),
        object: Object::Joints(line.q.clone()),
        target: line.target,
        obj_init: line.obj_init,
        init_tcp: line.init_tcp,
        handle_init: line.handle_init,
        first_seen: None,
    })?;
    let ours = metaworld::observation(&rebuilt.moment, &rebuilt.moment);
    let mut checks = Checks::new(format!("{} {} resets", task.name, line.ver.name()));
    let drawn = line.rand_vec.get(..task.n_drawn).ok_or_else(|| {
        let n = line.rand_vec.len();
        format!("rand_vec has {n} numbers, not {} or more", task.n_drawn)
    })?;
    checks.numbers("drawn pose", &rebuilt.root, drawn, OBSERVATION_TOLERANCE);
    let mut slots = |field, range: std::ops::Range<usize>| {
        checks.numbers(
            field,
            &ours[range.clone()],
            &theirs[range],
            OBSERVATION_TOLERANCE,
        );
    };
    let has_second_half = line.ver == Version::V3;
    slots("observation 0-3", 0..4);
    slots("observation 7-17", 7..18);
    if has_second_half {
        slots("observation 18-21", 18..22);
        slots("observation 25-35", 25..36);
    }
    if task.is_fresh_at_reset {
        slots("observation 4-6", 4..7);
        if has_second_half {
            slots("observation 22-24", 22..25);
        }
    }
    slots("observation 36-38", 36..39);
    Ok(checks)
}

/// Checks reward and success; the first line of a trajectory tells the others where things are.
fn check_trajectory(
    task: &TaskRecordings,
    line: &TrajectoryStep,
    before: &mut StepsBefore,
) -> Result<Checks, String> {
    let mut checks = Checks::new(format!(
        "{} {} trajectories",
        task.name,
        line.episode.ver.name()
    ));
    let object = line
        .obj
        .first_chunk()
        .copied()
        .ok_or("obj has fewer than 3 numbers")?;
    if line.t == 0 {
        let start = Start {
            target: line.target.ok_or("missing field `target`")?,
            obj_init: line.obj_init,
            init_tcp: line.init_tcp.ok_or("missing field `init_tcp`")?,
            object,
        };
        before.starts.insert(line.episode.clone(), start);
        return Ok(checks);
    }
    let start = before
        .starts
        .get(&line.episode)
        .ok_or("the first line (t = 0) of this trajectory is not above it")?;
    let rebuilt = (task.rebuild)(&Recorded {
        hand: line.hand,
        tcp: line.tcp,
        openness: line.grip,
        pads: None,
        command: command(&line.a)?,
        newest: line.q.clone(),
        object: Object::Point(object),
        target: start.target,
        obj_init: start.obj_init,
        init_tcp: start.init_tcp,
        handle_init: None,
        first_seen: Some(start.object),
    })?;
    let judgement = rebuilt.judgement;
    if !task.needs_pads {
        checks.number("reward", judgement.reward, line.r, TRAJECTORY_TOLERANCE);
    }
    checks.flag("success", judgement.success, line.success);
    // Where an object has no joint, the point is all that a line tells of it, and shown as it is.
    if task.n_drawn == 3 {
        let ours = &rebuilt.moment[4..7];
        checks.numbers("observation 4-6", ours, &object, OBSERVATION_TOLERANCE);
    }
    Ok(checks)
}

fn observation_of(numbers: &[f64]) -> Result<[f64; OBSERVATION_SIZE], String> {
    numbers
        .try_into()
        .map_err(|_| format!("obs has {} numbers, not {OBSERVATION_SIZE}", numbers.len()))
}

/// The gripper command of an action.
fn command(action: &[f64]) -> Result<f64, String> {
    let command = action.get(3).ok_or("a has fewer than 4 numbers")?;
    Ok(command.clamp(-1.0, 1.0))
}
