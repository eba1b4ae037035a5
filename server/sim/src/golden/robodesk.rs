//! RoboDesk's recordings: the task's readings, the arm's command map, and the arm's own numbers.

use std::collections::BTreeMap;

use rapier3d::prelude::{InteractionGroups, PhysicsWorld};
use serde::Deserialize;
use serde_json::{Map, Value};

use super::{Checks, OBSERVATION_TOLERANCE, REWARD_TOLERANCE};
use crate::robots::panda::{self, ACTION_SIZE, N_JOINTS, Panda, Point, links};
use crate::tasks::desk::{LIGHTS, N_POSITIONS};
use crate::tasks::push_green::{MOMENT_SIZE, Readings, observation};

/// Largest error of a place or a direction that still counts as the same; metres, or none.
const KINEMATICS_TOLERANCE: f64 = 1e-5;
/// Largest error of the joint-space inertia, as a share of its largest entry: the links' own
/// inertias are known to 1e-6 kg m², a few ten-thousandths of the last link's.
const INERTIA_TOLERANCE: f64 = 1e-4;
/// Largest error of the gravity load, as a share of its largest component.
const LOAD_TOLERANCE: f64 = 1e-3;

const LINK_NAMES: [&str; N_JOINTS] = [
    "panda0_link1",
    "panda0_link2",
    "panda0_link3",
    "panda0_link4",
    "panda0_link5",
    "panda0_link6",
    "panda0_link7",
    "panda0_leftfinger",
    "panda0_rightfinger",
];

/// Whether recordings of this task can be replayed.
pub(super) fn knows(task: &str) -> bool {
    ["push-green", "robodesk_push_green", "panda_kinematics"].contains(&task)
}

/// What a line holds.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Kind {
    /// The first observation of an episode.
    Reset,
    /// What one step brought.
    Step,
    /// A state set by hand, without a step.
    State,
    /// A posture of the arm, its inertia and the weight it carries.
    Kinematics,
}

impl Kind {
    /// Told apart by the field `kind`, which lines about the arm alone do not have.
    pub(super) fn of(fields: &Map<String, Value>) -> Option<Self> {
        match fields.get("kind").and_then(Value::as_str) {
            Some("reset") => Some(Self::Reset),
            Some("step") => Some(Self::Step),
            Some("state") => Some(Self::State),
            None if fields.contains_key("mass_matrix") => Some(Self::Kinematics),
            _ => None,
        }
    }
}

/// Moments of earlier lines, by seed and episode, with their step.
#[derive(Debug, Default)]
pub(super) struct StepsBefore(BTreeMap<(i64, i64), (i64, [f64; MOMENT_SIZE])>);

#[derive(Deserialize)]
struct Moment {
    seed: i64,
    ep: i64,
    t: i64,
    qpos: Vec<f64>,
    /// The green light, to more digits than `qpos` has.
    light: f64,
    ee: Point,
}

#[derive(Deserialize)]
struct Outcome {
    action: [f64; ACTION_SIZE],
    q_arm_before: [f64; N_JOINTS],
    target_q: [f64; N_JOINTS],
}

#[derive(Deserialize)]
struct Kinematics {
    qpos: [f64; N_JOINTS],
    bodies: BTreeMap<String, Body>,
    mass_matrix: [[f64; N_JOINTS]; N_JOINTS],
    bias_gravity: [f64; N_JOINTS],
    end_effector: Point,
    jac_ee: [[f64; N_JOINTS]; 3],
}

#[derive(Deserialize)]
struct Body {
    pos: Point,
    quat_wxyz: [f64; 4],
    com: Point,
}

/// Compares one line.
pub(super) fn check(kind: Kind, value: &Value, before: &mut StepsBefore) -> Result<Checks, String> {
    match kind {
        Kind::Kinematics => check_kinematics(&read(value)?),
        Kind::Reset => check_observation("resets", value, before),
        Kind::State => check_state(value),
        Kind::Step => {
            let mut checks = check_observation("steps", value, before)?;
            check_outcome(&mut checks, value)?;
            Ok(checks)
        }
    }
}

fn read<T: for<'de> Deserialize<'de>>(value: &Value) -> Result<T, String> {
    T::deserialize(value).map_err(|error| error.to_string())
}

/// A list of numbers among the line's fields.
fn numbers<const N: usize>(value: &Value, field: &str) -> Result<[f64; N], String> {
    let numbers: Vec<f64> = value
        .get(field)
        .ok_or_else(|| format!("missing field `{field}`"))
        .and_then(read)?;
    let n = numbers.len();
    numbers
        .try_into()
        .map_err(|_| format!("{field} has {n} numbers, not {N}"))
}

fn readings(moment: &Moment) -> Result<Readings, String> {
    let joints = moment.qpos.first_chunk::<N_JOINTS>();
    let desk = moment.qpos.last_chunk::<N_POSITIONS>();
    let (Some(&joints), Some(&desk), true) =
        (joints, desk, moment.qpos.len() == N_JOINTS + N_POSITIONS)
    else {
        let n = moment.qpos.len();
        return Err(format!(
            "qpos has {n} numbers, not {}",
            N_JOINTS + N_POSITIONS
        ));
    };
    let mut readings = Readings { joints, desk };
    readings.desk[LIGHTS + 1] = moment.light;
    Ok(readings)
}

/// The observation; its second half only where the line of the step before was seen.
fn check_observation(
    lines: &str,
    value: &Value,
    before: &mut StepsBefore,
) -> Result<Checks, String> {
    let line: Moment = read(value)?;
    let theirs: [f64; 2 * MOMENT_SIZE] = numbers(value, "obs")?;
    let readings = readings(&line)?;
    let now = readings.moment();
    let episode = (line.seed, line.ep);
    let last = before.0.insert(episode, (line.t, now));
    let step_before = match last {
        _ if line.t == 0 => Some(now),
        Some((t, moment)) if t + 1 == line.t => Some(moment),
        _ => None,
    };
    let ours = observation(&now, &step_before.unwrap_or(now));
    let mut checks = Checks::new(format!("push-green {lines}"));
    let mut half = |field, range: std::ops::Range<usize>| {
        checks.numbers(
            field,
            &ours[range.clone()],
            &theirs[range],
            OBSERVATION_TOLERANCE,
        );
    };
    half("observation 0-33", 0..MOMENT_SIZE);
    if step_before.is_some() {
        half("observation 34-67", MOMENT_SIZE..2 * MOMENT_SIZE);
    }
    let ours = readings.end_effector();
    checks.numbers("end effector", &ours, &line.ee, OBSERVATION_TOLERANCE);
    Ok(checks)
}

/// Reward, success, and what the action made the servos aim at. Joint targets of the original
/// carry noise that does not move the end effector, so its place is compared instead.
fn check_outcome(checks: &mut Checks, value: &Value) -> Result<(), String> {
    let readings = readings(&read(value)?)?;
    let line: Outcome = read(value)?;
    let reward = number(value, "reward")?;
    checks.number("reward", readings.reward(), reward, REWARD_TOLERANCE);
    checks.flag("success", readings.is_lit(), flag(value, "success")?);
    let ours = panda::targets(&line.q_arm_before, &line.action);
    let place = |q| links::end_effector(&links::frames(q));
    checks.numbers(
        "target, end effector",
        &place(&ours),
        &place(&line.target_q),
        OBSERVATION_TOLERANCE,
    );
    checks.numbers(
        "target, wrist and fingers",
        &ours[6..],
        &line.target_q[6..],
        OBSERVATION_TOLERANCE,
    );
    Ok(())
}

fn check_state(value: &Value) -> Result<Checks, String> {
    let readings = readings(&read(value)?)?;
    let theirs: [f64; MOMENT_SIZE] = numbers(value, "obs_now")?;
    let mut checks = Checks::new("push-green states".into());
    checks.numbers(
        "observation 0-33",
        &readings.moment(),
        &theirs,
        OBSERVATION_TOLERANCE,
    );
    let reward = number(value, "reward")?;
    checks.number("reward", readings.reward(), reward, REWARD_TOLERANCE);
    let is_lit = flag(value, "reward_sparse")?;
    checks.flag("success", readings.is_lit(), is_lit);
    Ok(checks)
}

fn number(value: &Value, field: &str) -> Result<f64, String> {
    let number = value.get(field).and_then(Value::as_f64);
    number.ok_or_else(|| format!("field `{field}` is no number"))
}

/// true or false, 0 or 1.
fn flag(value: &Value, field: &str) -> Result<bool, String> {
    let found = value.get(field).unwrap_or(&Value::Null);
    match (found.as_bool(), found.as_f64()) {
        (Some(flag), _) => Ok(flag),
        (None, Some(0.0)) => Ok(false),
        (None, Some(1.0)) => Ok(true),
        _ => Err(format!("field `{field}` is {found}, not 0 or 1")),
    }
}

/// Builds the arm in a world as the task does and asks the physics about it.
fn check_kinematics(line: &Kinematics) -> Result<Checks, String> {
    let mut world = PhysicsWorld::new();
    let panda = Panda::new(&mut world, &line.qpos, InteractionGroups::all());
    let mut checks = Checks::new("panda kinematics".into());
    let [mut positions, mut rotations, mut centres] = [(); 3].map(|()| (Vec::new(), Vec::new()));
    for (handle, name) in panda.links().iter().zip(LINK_NAMES) {
        let theirs = line
            .bodies
            .get(name)
            .ok_or_else(|| format!("bodies has no {name}"))?;
        let body = &world.bodies[*handle];
        positions.0.extend(double(body.translation()));
        positions.1.extend(theirs.pos);
        centres.0.extend(double(body.center_of_mass()));
        centres.1.extend(theirs.com);
        let turn = body.rotation();
        let turn = [turn.w, turn.x, turn.y, turn.z].map(f64::from);
        // A rotation has two quaternions: take ours on their side.
        let dot: f64 = turn.iter().zip(theirs.quat_wxyz).map(|(a, b)| a * b).sum();
        rotations.0.extend(turn.map(|x| x * dot.signum()));
        rotations.1.extend(theirs.quat_wxyz);
    }
    for (field, (ours, theirs)) in [
        ("link positions", positions),
        ("link rotations", rotations),
        ("centres of mass", centres),
    ] {
        checks.numbers(field, &ours, &theirs, KINEMATICS_TOLERANCE);
    }
    check_arm(&mut checks, line, &panda.inertia(&world));
    Ok(checks)
}

fn double(v: rapier3d::prelude::Vector) -> [f64; 3] {
    [v.x, v.y, v.z].map(f64::from)
}

fn check_arm(checks: &mut Checks, line: &Kinematics, inertia: &[[f64; N_JOINTS]; N_JOINTS]) {
    let frames = links::frames(&line.qpos);
    let tip = links::end_effector(&frames);
    checks.numbers(
        "end effector",
        &tip,
        &line.end_effector,
        KINEMATICS_TOLERANCE,
    );
    let columns = links::jacobian(&frames);
    let ours: Vec<f64> = columns.iter().flat_map(|c| [c.x, c.y, c.z]).collect();
    let theirs: Vec<f64> = (0..columns.len())
        .flat_map(|column| line.jac_ee.map(|row| row[column]))
        .collect();
    checks.numbers("jacobian", &ours, &theirs, KINEMATICS_TOLERANCE);

    let largest = line.mass_matrix.as_flattened().iter();
    let largest = largest.fold(0.0_f64, |m, x| m.max(x.abs()));
    let shares = |matrix: &[[f64; N_JOINTS]; N_JOINTS]| -> Vec<f64> {
        let entries = matrix.as_flattened().iter();
        entries.map(|entry| entry / largest).collect()
    };
    checks.numbers(
        "inertia",
        &shares(inertia),
        &shares(&line.mass_matrix),
        INERTIA_TOLERANCE,
    );
    let largest = line
        .bias_gravity
        .iter()
        .fold(0.0_f64, |m, x| m.max(x.abs()));
    let share = |load: [f64; N_JOINTS]| load.map(|x| x / largest);
    checks.numbers(
        "gravity load",
        &share(links::gravity_load(&frames)),
        &share(line.bias_gravity),
        LOAD_TOLERANCE,
    );
}
