//! One control step from each recorded state, against the recorded next one.
//!
//! This is where dynamics can be compared number by number: over many steps two engines part for
//! reasons of no interest, over one they must agree. Only the control suite's recordings hold
//! whole states in neighbouring lines.

use serde::Deserialize;

use super::or_infinite;
use crate::articulated::model::Model;
use crate::articulated::simulation::Simulation;
use crate::robots::quadruped::{self, N_MOTORS};
use crate::robots::{cheetah, walker};

/// One number of a state, over all steps.
#[derive(Debug, Clone, PartialEq)]
pub struct Errors {
    /// `q3`: a coordinate; `v3`: a rate; `felt3`: of accelerometer, toe forces, toe torques.
    pub name: String,
    /// Difference to the recording after each step, in order of lines.
    pub errors: Vec<f64>,
}

impl Errors {
    /// The largest; 0 without any.
    pub fn largest(&self) -> f64 {
        let errors = self.errors.iter().copied().map(or_infinite);
        errors.fold(0.0, f64::max)
    }

    /// The one in the middle; 0 without any.
    pub fn median(&self) -> f64 {
        let mut errors = self.errors.clone();
        errors.sort_by(f64::total_cmp);
        errors.get(errors.len() / 2).copied().unwrap_or_default()
    }
}

/// A line as far as a step needs it.
#[derive(Deserialize)]
struct Line {
    kind: String,
    seed: i64,
    ep: i64,
    controller: String,
    t: i64,
    qpos: Vec<f64>,
    qvel: Vec<f64>,
    #[serde(default)]
    action: Vec<f64>,
    #[serde(default)]
    act: Vec<f64>,
    #[serde(default)]
    accel: Vec<f64>,
    #[serde(default)]
    toe_force: Vec<[f64; 3]>,
    #[serde(default)]
    toe_torque: Vec<[f64; 3]>,
}

impl Line {
    fn follows(&self, before: &Self) -> bool {
        let episode = |line: &Self| (line.seed, line.ep, line.controller.clone());
        self.kind == "step"
            && before.kind != "state"
            && episode(self) == episode(before)
            && self.t == before.t + 1
    }

    /// Coordinates, rates, and what was felt.
    fn state(&self) -> [Vec<f64>; 3] {
        let (forces, torques) = (self.toe_force.concat(), self.toe_torque.concat());
        let felt = [self.accel.clone(), forces, torques].concat();
        [self.qpos.clone(), self.qvel.clone(), felt]
    }
}

/// Plays the action of the second line from the state of the first; the state after it.
type Play = fn(&Line, &Line) -> Result<[Vec<f64>; 3], String>;

/// Plays every recorded step that has its predecessor in the line above.
///
/// * `task` – stem of the recording's file: `walker_run`, `cheetah_run`, `quadruped_walk`,
///   `quadruped_run`
/// * `text` – its lines
///
/// # Errors
/// A task without whole states, or a line that does not fit; the message says which.
pub fn one_step_errors(task: &str, text: &str) -> Result<Vec<Errors>, String> {
    let play: Play = match task {
        "walker_run" => play_walker,
        "cheetah_run" => play_cheetah,
        "quadruped_walk" | "quadruped_run" => play_quadruped,
        _ => return Err(format!("recordings of {task} do not hold whole states")),
    };
    let mut all: Vec<Errors> = Vec::new();
    let mut before: Option<Line> = None;
    for (index, text) in text.lines().enumerate() {
        let named = |error: String| format!("line {}: {error}", index + 1);
        let line: Line = serde_json::from_str(text).map_err(|e| named(e.to_string()))?;
        if let Some(before) = before.as_ref().filter(|before| line.follows(before)) {
            let ours = play(before, &line).map_err(named)?;
            count(&mut all, &ours, &line.state()).map_err(named)?;
        }
        before = Some(line);
    }
    Ok(all)
}

fn count(
    all: &mut Vec<Errors>,
    ours: &[Vec<f64>; 3],
    theirs: &[Vec<f64>; 3],
) -> Result<(), String> {
    let is_first = all.is_empty();
    let mut at = 0;
    for (part, (ours, theirs)) in ["q", "v", "felt"].iter().zip(ours.iter().zip(theirs)) {
        if ours.len() != theirs.len() {
            return Err(format!(
                "{} numbers of {part}, not {}",
                theirs.len(),
                ours.len()
            ));
        }
        for (index, (a, b)) in ours.iter().zip(theirs).enumerate() {
            if is_first {
                all.push(Errors {
                    name: format!("{part}{index}"),
                    errors: Vec::new(),
                });
            }
            all[at].errors.push((a - b).abs());
            at += 1;
        }
    }
    Ok(())
}

fn play_walker(before: &Line, after: &Line) -> Result<[Vec<f64>; 3], String> {
    play_planar(
        walker::model(),
        walker::GEARS,
        walker::N_SUBSTEPS,
        before,
        after,
    )
}

fn play_cheetah(before: &Line, after: &Line) -> Result<[Vec<f64>; 3], String> {
    play_planar(cheetah::model(), cheetah::GEARS, 1, before, after)
}

fn play_planar(
    model: &Model<9>,
    gears: [f64; 6],
    n_substeps: usize,
    before: &Line,
    after: &Line,
) -> Result<[Vec<f64>; 3], String> {
    let mut simulation = start(model, before)?;
    let action: [f64; 6] = some(&after.action, "action")?;
    let mut torques = [0.0; 9];
    for (torque, (gear, action)) in torques[3..].iter_mut().zip(gears.iter().zip(action)) {
        *torque = gear * action;
    }
    for _ in 0..n_substeps {
        simulation.step(model, &torques);
    }
    Ok([simulation.q, simulation.v, Vec::new()])
}

fn play_quadruped(before: &Line, after: &Line) -> Result<[Vec<f64>; 3], String> {
    let mut robot = quadruped::Quadruped {
        simulation: start(quadruped::model(), before)?,
        activations: some(&before.act, "act")?,
        senses: quadruped::Senses::default(),
    };
    let action: [f64; N_MOTORS] = some(&after.action, "action")?;
    robot.advance(&quadruped::commands(&action));
    let senses = &robot.senses;
    let felt = [
        senses.accelerometer.as_slice(),
        senses.toe_forces.as_flattened(),
        senses.toe_torques.as_flattened(),
    ];
    let felt = felt.concat();
    Ok([robot.simulation.q, robot.simulation.v, felt])
}

/// A simulation in a recorded state.
fn start<const N: usize>(model: &Model<N>, line: &Line) -> Result<Simulation<N>, String> {
    super::dmcontrol::simulation(model, &line.qpos, &line.qvel)
}

fn some<const M: usize>(numbers: &[f64], name: &str) -> Result<[f64; M], String> {
    numbers
        .try_into()
        .map_err(|_| format!("{name} has {} numbers, not {M}", numbers.len()))
}

#[cfg(test)]
mod tests {
    use std::fs;
    use std::path::Path;

    use super::*;

    fn errors(task: &str) -> Vec<Errors> {
        let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../tests/golden");
        let text = fs::read_to_string(folder.join(format!("{task}.jsonl")));
        let text = text.expect("the recording is part of the repository");
        one_step_errors(task, &text).expect("its lines are whole")
    }

    #[test]
    fn a_step_ends_where_the_originals_step_ended() {
        for task in [
            "walker_run",
            "cheetah_run",
            "quadruped_walk",
            "quadruped_run",
        ] {
            let errors = errors(task);
            for number in &errors {
                let n_steps = number.errors.len();
                assert!(n_steps >= 10, "{task}: {n_steps} steps");
                // Of coordinates and rates; forces are in newtons and reach thousands.
                let allowed = if number.name.starts_with("felt") {
                    0.05
                } else {
                    1e-3
                };
                let largest = number.largest();
                assert!(largest < allowed, "{task} {}: {largest}", number.name);
            }
        }
    }

    #[test]
    fn a_recording_without_states_and_a_broken_line_are_named() {
        let error = one_step_errors("window-open", "").expect_err("no states");
        assert!(error.contains("window-open"), "{error}");
        let error = one_step_errors("walker_run", "{}").expect_err("no state");
        assert!(error.starts_with("line 1: missing field"), "{error}");
    }
}
