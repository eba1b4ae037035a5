//! The experiment's table, as Markdown.

use std::fmt::Write as _;

use super::{Outcome, Selection, over_seeds};

/// Epochs after which the table reports.
pub(super) const EPOCHS: [usize; 4] = [10, 25, 50, 100];

/// Mean [95 % interval] over seeds by R_bias and selection.
pub(super) fn table(outcomes: &[Outcome]) -> String {
    let n_seeds = outcomes.iter().map(|o| o.seed + 1).max().unwrap_or(0);
    let mut text = format!(
        "# Abstract MDP\n\nMean and 95 % bootstrap interval over {n_seeds} seeds. Reward: normalised episode reward \
         after so many epochs of 200 queries. E1: mean absolute difference of the standardised tables; E2: mean \
         squared difference within stages; E3: share of misordered pairs of actions of one stage.\n\n\
         | R_bias | queries |"
    );
    for epoch in EPOCHS {
        write!(text, " reward {epoch} |").expect("writing to a string cannot fail");
    }
    text.push_str(" E1 | E2 | E3 |\n|---:|---|---|---|---|---|---|---|---|\n");
    let mut biases: Vec<f64> = outcomes.iter().map(|o| o.bias).collect();
    biases.dedup();
    for bias in biases {
        for selection in [Selection::Aligned, Selection::Conventional] {
            let group: Vec<&Outcome> = outcomes
                .iter()
                .filter(|o| o.bias.total_cmp(&bias).is_eq() && o.selection == selection)
                .collect();
            write!(text, "| {bias} | {} |", selection.name())
                .expect("writing to a string cannot fail");
            for epoch in EPOCHS {
                text.push_str(&cell(&group, |o| o.rewards[epoch]));
            }
            text.push_str(&cell(&group, |o| o.errors.global_error));
            text.push_str(&cell(&group, |o| o.errors.within_error));
            text.push_str(&cell(&group, |o| o.errors.misordered));
            text.push('\n');
        }
    }
    text
}

fn cell(group: &[&Outcome], of: impl Fn(&Outcome) -> f64) -> String {
    over_seeds(group, of).map_or_else(
        || " – |".into(),
        |e| {
            format!(
                " {:.3} [{:.3}, {:.3}] |",
                e.value, e.interval.lo, e.interval.hi
            )
        },
    )
}
