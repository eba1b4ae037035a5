//! How far one control step of ours ends from the original's, per coordinate, rate and sense:
//! `cargo run -p sim --example one_step_errors RECORDING.jsonl...`.
//!
//! Takes the control suite's recordings (`walker_run.jsonl`, …); see `sim::golden::one_step`.

use std::fs;
use std::path::Path;

use sim::golden::one_step::one_step_errors;

fn main() {
    for path in std::env::args().skip(1) {
        let text = fs::read_to_string(&path).unwrap_or_else(|error| panic!("{path}: {error}"));
        let stem = Path::new(&path).file_stem().unwrap_or_default();
        let errors = one_step_errors(&stem.to_string_lossy(), &text)
            .unwrap_or_else(|error| panic!("{path}: {error}"));
        let n_steps = errors.first().map_or(0, |number| number.errors.len());
        println!("{path}: {n_steps} steps\n         median   largest");
        for number in &errors {
            let (median, largest) = (number.median(), number.largest());
            println!("{:<7} {median:8.1e}  {largest:8.1e}", number.name);
        }
    }
}
