//! How far one control step of ours ends from the original's, per coordinate and rate:
//! `cargo run -p sim --example one_step_errors RECORDING.jsonl...`.
//!
//! Takes neighbouring lines of the control suite's recordings (`walker_run.jsonl`, …): puts the
//! first one's state into our simulation, plays the second one's action, and compares. Prints the
//! median and the largest error of each coordinate (q) and rate (v) over all such pairs.

use std::fs;

use serde_json::Value;
use sim::articulated::model::Model;
use sim::articulated::simulation::Simulation;
use sim::robots::{cheetah, quadruped, walker};

/// State before, the line after.
type Play = fn(&Value, &Value) -> Vec<f64>;

fn main() {
    for path in std::env::args().skip(1) {
        let text = fs::read_to_string(&path).unwrap_or_else(|error| panic!("{path}: {error}"));
        let lines: Vec<Value> = text
            .lines()
            .map(|line| serde_json::from_str(line).expect("a line of JSON"))
            .collect();
        let play = player(&path);
        let mut errors: Vec<Vec<f64>> = Vec::new();
        let mut n_pairs = 0;
        for pair in lines.windows(2) {
            let [before, after] = pair else { continue };
            if !follows(before, after) {
                continue;
            }
            n_pairs += 1;
            let ours = play(before, after);
            let theirs = [numbers(after, "qpos"), numbers(after, "qvel")].concat();
            let worst = ours.iter().zip(&theirs).map(|(a, b)| (a - b).abs());
            let worst = worst.fold(0.0, f64::max);
            if worst > 1e-3 {
                let told = ["controller", "seed", "ep", "t"].map(|key| after[key].to_string());
                println!("{worst:8.1e} at {}", told.join(" "));
            }
            errors.resize(ours.len(), Vec::new());
            for (errors, (a, b)) in errors.iter_mut().zip(ours.iter().zip(&theirs)) {
                errors.push((a - b).abs());
            }
        }
        println!("{path}: {n_pairs} steps\n       median   largest");
        let n_coordinates = lines[0]["qpos"].as_array().map_or(0, Vec::len);
        for (index, errors) in errors.iter_mut().enumerate() {
            errors.sort_by(f64::total_cmp);
            let name = if index < n_coordinates {
                format!("q{index}")
            } else {
                format!("v{}", index - n_coordinates)
            };
            let (median, largest) = (errors[errors.len() / 2], errors[errors.len() - 1]);
            println!("{name:<4} {median:8.1e}  {largest:8.1e}");
        }
    }
}

fn follows(before: &Value, after: &Value) -> bool {
    let same = |key: &str| before[key] == after[key];
    let t = |line: &Value| line["t"].as_i64();
    after["kind"] == "step"
        && before["kind"] != "state"
        && same("seed")
        && same("ep")
        && same("controller")
        && t(before).is_some_and(|t_before| t(after) == Some(t_before + 1))
}

fn player(path: &str) -> Play {
    if path.contains("walker") {
        |before, after| {
            planar(
                walker::model(),
                &walker::GEARS,
                walker::N_SUBSTEPS,
                before,
                after,
            )
        }
    } else if path.contains("cheetah") {
        |before, after| planar(cheetah::model(), &cheetah::GEARS, 1, before, after)
    } else {
        four_legged
    }
}

fn planar(
    model: &Model<9>,
    gears: &[f64; 6],
    n_substeps: usize,
    before: &Value,
    after: &Value,
) -> Vec<f64> {
    let mut simulation = start(before);
    let mut torques = [0.0; 9];
    let action = numbers(after, "action");
    for (torque, (gear, action)) in torques[3..].iter_mut().zip(gears.iter().zip(action)) {
        *torque = gear * action;
    }
    for _ in 0..n_substeps {
        simulation.step(model, &torques);
    }
    [simulation.q, simulation.v].concat()
}

fn four_legged(before: &Value, after: &Value) -> Vec<f64> {
    let mut simulation = start(before);
    let twelve =
        |line: &Value, key| -> [f64; 12] { numbers(line, key).try_into().expect("twelve motors") };
    let commands = quadruped::commands(&twelve(after, "action"));
    let mut activations = twelve(before, "act");
    for _ in 0..quadruped::N_SUBSTEPS {
        let torques = quadruped::torques(&simulation.q, &activations);
        simulation.step(quadruped::model(), &torques);
        activations = quadruped::activations_after_a_step(&activations, &commands);
    }
    [simulation.q, simulation.v].concat()
}

fn start<const N: usize>(line: &Value) -> Simulation<N> {
    let mut simulation = Simulation::new(numbers(line, "qpos"));
    simulation.v = numbers(line, "qvel");
    simulation
}

fn numbers(line: &Value, key: &str) -> Vec<f64> {
    let numbers = line[key].as_array().into_iter().flatten();
    numbers.filter_map(Value::as_f64).collect()
}
