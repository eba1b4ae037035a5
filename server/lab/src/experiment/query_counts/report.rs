//! The table of counts, as Markdown.

use std::fmt::Write as _;

use domain::agreement::{Bootstrap, mean};

use super::{Asked, SIZES, World, counts};

/// Formulas beside means over seeds with their 95 % bootstrap intervals.
pub(super) fn table(asked: &[Asked]) -> String {
    let mut text = String::from(
        "# Query counts\n\nQueries until the actions of every stage are in order. Formulas: the paper's worst cases. \
         Asked: random queries answered by the reward until the order follows from the answers, mean and 95 % \
         bootstrap interval over seeds.\n\n\
         | stages | actions | aligned | conventional | under bias | aligned, asked | conventional, asked | under bias, asked |\n\
         |---:|---:|---:|---:|---:|---:|---:|---:|\n",
    );
    for (n_stages, n_actions) in SIZES {
        let bounds = counts(n_stages, n_actions);
        write!(
            text,
            "| {n_stages} | {n_actions} | {:.1} | {:.1} | {:.0} |",
            bounds.aligned, bounds.conventional, bounds.conventional_under_bias
        )
        .expect("writing to a string cannot fail");
        for world in World::ALL {
            let of_size = asked
                .iter()
                .filter(|a| (a.n_stages, a.n_actions, a.world) == (n_stages, n_actions, world));
            let values: Vec<f64> = of_size.map(|a| a.n_queries as f64).collect();
            text.push_str(&cell(&values));
        }
        text.push('\n');
    }
    text
}

fn cell(values: &[f64]) -> String {
    Bootstrap::default().center(values, mean).map_or_else(
        || " – |".into(),
        |e| {
            format!(
                " {:.0} [{:.0}, {:.0}] |",
                e.value, e.interval.lo, e.interval.hi
            )
        },
    )
}
