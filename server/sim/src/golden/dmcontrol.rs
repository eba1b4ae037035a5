//! The control suite's recordings: positions and velocities to readings, readings to checks.
//!
//! A *state* line is the suite's observation and reward at a state, whether reset, stepped to or
//! set by hand. A *kinematics* line is the original physics' own view of a configuration: poses,
//! inertia matrix, bias forces. The quadruped's accelerations and contact forces follow from the
//! engine and not from the state, so they are taken from the line.

use std::collections::BTreeMap;

use serde::Deserialize;
use serde_json::Value;

use super::{
    Checks, KINEMATICS_TOLERANCE, LOAD_TOLERANCE, OBSERVATION_TOLERANCE, REWARD_TOLERANCE,
};
use crate::articulated::model::Model;
use crate::articulated::simulation::Simulation;
use crate::articulated::vector::Vec3;
use crate::robots::quadruped::{self, N_MOTORS, Senses};
use crate::robots::{cheetah, walker};
use crate::tasks::{cheetah_run, quadruped as quadruped_tasks, walker_run};
use crate::tasks::{quadruped_run, quadruped_walk};

/// Compares one line of the task that a file's stem names.
pub(super) type Checker = fn(&str, &Value) -> Result<Checks, String>;

const CHECKERS: [(&str, Checker); 7] = [
    ("walker_run", check_walker),
    ("cheetah_run", check_cheetah),
    ("quadruped_walk", |task, line| {
        check_quadruped(task, line, quadruped_walk::TARGET_SPEED)
    }),
    ("quadruped_run", |task, line| {
        check_quadruped(task, line, quadruped_run::TARGET_SPEED)
    }),
    ("walker_kinematics", |task, line| {
        check_kinematics(task, line, walker::model())
    }),
    ("cheetah_kinematics", |task, line| {
        check_kinematics(task, line, cheetah::model())
    }),
    ("quadruped_kinematics", |task, line| {
        check_kinematics(task, line, quadruped::model())
    }),
];

/// How lines of a task are compared, if it is one of the suite's.
pub(super) fn checker(task: &str) -> Option<Checker> {
    let found = CHECKERS.iter().find(|(name, _)| *name == task);
    found.map(|(_, checker)| *checker)
}

/// What every state line holds.
#[derive(Deserialize)]
struct State {
    qpos: Vec<f64>,
    qvel: Vec<f64>,
    obs: Vec<f64>,
    reward: Option<f64>,
    com_vel: Option<[f64; 3]>,
    body_xpos: Option<Vec<[f64; 3]>>,
}

/// What a quadruped's line holds beside it.
#[derive(Deserialize)]
struct Felt {
    act: [f64; N_MOTORS],
    act_before: Option<[f64; N_MOTORS]>,
    action: Option<[f64; N_MOTORS]>,
    ctrl: Option<[f64; N_MOTORS]>,
    accel: [f64; 3],
    toe_force: [[f64; 3]; 4],
    toe_torque: [[f64; 3]; 4],
    toe_xpos: [[f64; 3]; 4],
}

#[derive(Deserialize)]
struct Kinematics {
    qpos: Vec<f64>,
    qvel: Vec<f64>,
    bodies: BTreeMap<String, Pose>,
    mass_matrix: Option<Vec<Vec<f64>>>,
    bias_gravity: Vec<f64>,
    bias_total: Vec<f64>,
}

#[derive(Deserialize)]
struct Pose {
    pos: [f64; 3],
    quat_wxyz: [f64; 4],
    com: [f64; 3],
}

fn check_walker(task: &str, line: &Value) -> Result<Checks, String> {
    let state: State = read(line)?;
    let mut simulation = simulation(walker::model(), &state.qpos, &state.qvel)?;
    let readings = walker_run::Readings::of(&mut simulation);
    let mut checks = Checks::new(format!("{task} states"));
    observed(&mut checks, &readings.observation(), &state.obs)?;
    rewarded(&mut checks, readings.reward(), state.reward);
    placed(&mut checks, walker::model(), &mut simulation, &state);
    Ok(checks)
}

fn check_cheetah(task: &str, line: &Value) -> Result<Checks, String> {
    let state: State = read(line)?;
    let mut simulation = simulation(cheetah::model(), &state.qpos, &state.qvel)?;
    let readings = cheetah_run::Readings::of(&mut simulation);
    let mut checks = Checks::new(format!("{task} states"));
    observed(&mut checks, &readings.observation(), &state.obs)?;
    rewarded(&mut checks, readings.reward(), state.reward);
    placed(&mut checks, cheetah::model(), &mut simulation, &state);
    Ok(checks)
}

fn check_quadruped(task: &str, line: &Value, target_speed: f64) -> Result<Checks, String> {
    let (state, felt): (State, Felt) = (read(line)?, read(line)?);
    let mut simulation = simulation(quadruped::model(), &state.qpos, &state.qvel)?;
    let senses = Senses {
        accelerometer: felt.accel,
        toe_forces: felt.toe_force,
        toe_torques: felt.toe_torque,
    };
    let readings = quadruped_tasks::Readings::of(&mut simulation, &felt.act, &senses);
    let mut checks = Checks::new(format!("{task} states"));
    observed(&mut checks, &readings.observation(), &state.obs)?;
    rewarded(&mut checks, readings.reward(target_speed), state.reward);
    let motion = simulation.motion(quadruped::model());
    let toes = quadruped::TOES.map(|toe| motion.position(toe).to_array());
    let theirs = felt.toe_xpos.as_flattened();
    checks.relative("toes", toes.as_flattened(), theirs, KINEMATICS_TOLERANCE);
    if let (Some(action), Some(theirs)) = (felt.action, felt.ctrl) {
        let commands = quadruped::commands(&action);
        checks.numbers("commands", &commands, &theirs, OBSERVATION_TOLERANCE);
        if let Some(before) = felt.act_before {
            let mut activations = before;
            for _ in 0..quadruped::N_SUBSTEPS {
                activations = quadruped::activations_after_a_step(&activations, &commands);
            }
            let tolerance = OBSERVATION_TOLERANCE;
            checks.numbers("activations", &activations, &felt.act, tolerance);
        }
    }
    Ok(checks)
}

fn check_kinematics<const N: usize>(
    task: &str,
    line: &Value,
    model: &Model<N>,
) -> Result<Checks, String> {
    let line: Kinematics = read(line)?;
    let mut simulation = simulation(model, &line.qpos, &line.qvel)?;
    let still = [0.0; N];
    let moving = simulation.v.clone();
    simulation.motion(model);
    let motion = simulation.last_motion();
    let mut checks = Checks::new(task.to_owned());
    let (mut ours, mut theirs) = (<[Vec<f64>; 3]>::default(), <[Vec<f64>; 3]>::default());
    for (index, body) in model.bodies().iter().enumerate() {
        let pose = line.bodies.get(body.name);
        let pose = pose.ok_or_else(|| format!("bodies holds no {:?}", body.name))?;
        let rotation = motion.rotation(index).quaternion();
        // A quaternion and its opposite are the same turn.
        let alike: f64 = rotation
            .iter()
            .zip(pose.quat_wxyz)
            .map(|(a, b)| a * b)
            .sum();
        ours[0].extend(motion.position(index).to_array());
        ours[1].extend(rotation.map(|x| x * alike.signum()));
        ours[2].extend(motion.centre_of_mass(model, index).to_array());
        theirs[0].extend(pose.pos);
        theirs[1].extend(pose.quat_wxyz);
        theirs[2].extend(pose.com);
    }
    let fields = ["positions", "rotations", "centres of mass"];
    for ((field, ours), theirs) in fields.into_iter().zip(&ours).zip(&theirs) {
        checks.relative(field, ours, theirs, KINEMATICS_TOLERANCE);
    }
    if let Some(theirs) = &line.mass_matrix {
        let ours = motion.mass_matrix(model);
        let theirs = theirs.concat();
        if theirs.len() != N * N {
            return Err(format!("mass_matrix is not {N} by {N}"));
        }
        let tolerance = KINEMATICS_TOLERANCE;
        checks.relative("inertia matrix", ours.as_flattened(), &theirs, tolerance);
    }
    let total = motion.bias_forces(model, &moving);
    loaded(&mut checks, "bias forces", &total, &line.bias_total)?;
    simulation.v.fill(0.0);
    simulation.motion(model);
    let held = simulation.last_motion().bias_forces(model, &still);
    loaded(&mut checks, "gravity load", &held, &line.bias_gravity)?;
    Ok(checks)
}

fn read<T: serde::de::DeserializeOwned>(line: &Value) -> Result<T, String> {
    T::deserialize(line).map_err(|error| error.to_string())
}

/// A simulation in the recorded state.
pub(super) fn simulation<const N: usize>(
    model: &Model<N>,
    qpos: &[f64],
    qvel: &[f64],
) -> Result<Simulation<N>, String> {
    for (name, found, expected) in [
        ("qpos", qpos.len(), model.n_coordinates()),
        ("qvel", qvel.len(), N),
    ] {
        if found != expected {
            return Err(format!("{name} has {found} numbers, not {expected}"));
        }
    }
    let mut simulation = Simulation::new(qpos.to_vec());
    simulation.v.copy_from_slice(qvel);
    Ok(simulation)
}

fn observed(checks: &mut Checks, ours: &[f64], theirs: &[f64]) -> Result<(), String> {
    if ours.len() != theirs.len() {
        let (found, expected) = (theirs.len(), ours.len());
        return Err(format!("obs has {found} numbers, not {expected}"));
    }
    checks.numbers("observation", ours, theirs, OBSERVATION_TOLERANCE);
    Ok(())
}

/// A reset has no reward.
fn rewarded(checks: &mut Checks, ours: f64, theirs: Option<f64>) {
    if let Some(theirs) = theirs {
        checks.number("reward", ours, theirs, REWARD_TOLERANCE);
    }
}

fn placed<const N: usize>(
    checks: &mut Checks,
    model: &Model<N>,
    simulation: &mut Simulation<N>,
    state: &State,
) {
    let motion = simulation.motion(model);
    if let Some(theirs) = &state.com_vel {
        let ours: Vec3 = motion.whole_velocity(model);
        checks.relative("speed", &ours.to_array(), theirs, KINEMATICS_TOLERANCE);
    }
    if let Some(theirs) = &state.body_xpos {
        let ours: Vec<[f64; 3]> = (0..model.bodies().len())
            .map(|body| motion.position(body).to_array())
            .collect();
        let (ours, theirs) = (ours.as_flattened(), theirs.as_flattened());
        checks.relative("positions", ours, theirs, KINEMATICS_TOLERANCE);
    }
}

fn loaded(
    checks: &mut Checks,
    field: &'static str,
    ours: &[f64],
    theirs: &[f64],
) -> Result<(), String> {
    if ours.len() != theirs.len() {
        return Err(format!(
            "{field}: {} numbers, not {}",
            theirs.len(),
            ours.len()
        ));
    }
    checks.relative(field, ours, theirs, LOAD_TOLERANCE);
    Ok(())
}
