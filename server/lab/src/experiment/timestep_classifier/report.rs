//! The experiment's tables, as Markdown.

use std::fmt::Write as _;

use super::Outcome;

/// Steps that a guess may be off, of the first table; rows have more.
const SHOWN_OFF_BY: [usize; 6] = [0, 1, 5, 10, 20, 50];

/// Accuracy and calibration, then the bounds beside the exact measure by number of stages.
pub(super) fn table(outcomes: &[Outcome]) -> String {
    let mut text = String::from(
        "# Timestep classifier\n\nOn the states of held-out episodes. Right within ±k: the most likely step is at most \
         k steps off; k = 0 is the accuracy, by chance 1/T. ECE: expected calibration error, 15 bins of equal width. \
         Released: what the released script would print for this classifier.\n\n\
         | task | seed | expert succeeds | T | states |",
    );
    for k in SHOWN_OFF_BY {
        write!(text, " ±{k} |").expect("writing to a string cannot fail");
    }
    text.push_str(" fitted | ECE | released |\n|---|---:|---:|---:|---:|");
    text.push_str(&"---:|".repeat(SHOWN_OFF_BY.len() + 3));
    for outcome in outcomes {
        text.push_str(&accuracy_row(outcome));
    }
    text.push_str(
        "\n\nF: mean probability along the best segmentation of each episode into N stages of steps in a row, exactly. \
         acc² ≤ E[m²] ≤ F holds of a calibrated classifier, E[m where right] ≤ F of any; m is the probability of the \
         most likely stage, acc how often it is right.\n\n\
         | task | seed | N | acc | E[m] | acc² | E[m²] | E[m where right] | F |\n\
         |---|---:|---:|---:|---:|---:|---:|---:|---:|\n",
    );
    for outcome in outcomes {
        text.push_str(&stage_rows(outcome));
    }
    text
}

fn accuracy_row(outcome: &Outcome) -> String {
    let held_out = &outcome.held_out;
    let success = outcome.expert_success_rate;
    let mut row = format!(
        "\n| {} | {} | {} | {} | {} |",
        outcome.task,
        outcome.seed,
        success.map_or("–".into(), |rate| format!("{rate:.3}")),
        held_out.n_steps,
        held_out.n_states,
    );
    for k in SHOWN_OFF_BY {
        let within = held_out.within.iter().find(|within| within.k == k);
        let told = within.map_or("–".into(), |within| format!("{:.3}", within.accuracy));
        write!(row, " {told} |").expect("writing to a string cannot fail");
    }
    let (fitted, ece) = (outcome.last_pass.accuracy, held_out.calibration.ece);
    let released = held_out.as_released;
    row + &format!(" {fitted:.3} | {ece:.3} | {released:.4} |")
}

fn stage_rows(outcome: &Outcome) -> String {
    let mut rows = String::new();
    for m in &outcome.held_out.stages {
        writeln!(
            rows,
            "| {} | {} | {} | {:.3} | {:.3} | {:.3} | {:.3} | {:.3} | {:.3} |",
            outcome.task,
            outcome.seed,
            m.n_stages,
            m.accuracy,
            m.confidence,
            m.accuracy_squared,
            m.confidence_squared,
            m.right_confidence,
            m.measure
        )
        .expect("writing to a string cannot fail");
    }
    rows
}
