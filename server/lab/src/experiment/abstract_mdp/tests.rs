//! The experiment against a reference implementation's table.

use std::num::NonZeroUsize;

use super::report::EPOCHS;
use super::*;

/// R_bias; conventional reward after 10, 25, 50 and 100 epochs; E1 of aligned and conventional;
/// E2 of conventional. Ten seeds of an independent implementation in Python.
const REFERENCE: [(f64, [f64; 4], [f64; 2], f64); 6] = [
    (0.0, [0.920, 0.968, 0.986, 0.995], [0.464, 0.115], 0.020),
    (10.0, [0.856, 0.934, 0.968, 0.986], [0.742, 0.154], 0.073),
    (20.0, [0.770, 0.871, 0.936, 0.970], [0.918, 0.136], 0.135),
    (50.0, [0.657, 0.732, 0.829, 0.919], [1.057, 0.122], 0.388),
    (100.0, [0.598, 0.652, 0.737, 0.807], [1.106, 0.124], 0.785),
    (200.0, [0.564, 0.597, 0.642, 0.694], [1.131, 0.125], 1.218),
];
/// The aligned rewards and E2, the same at every R_bias.
const ALIGNED: ([f64; 4], f64) = ([0.931, 0.984, 0.998, 1.000], 0.182);

fn settings(n_seeds: u64, n_threads: usize) -> Settings {
    Settings {
        n_seeds,
        n_threads: NonZeroUsize::new(n_threads).unwrap(),
    }
}

/// Conventional rewards after 10, 25, 50 and 100 epochs of a second independent implementation
/// (NumPy 2.4.6), a hundred seeds.
const SECOND: [(f64, [f64; 4]); 4] = [
    (0.0, [0.912, 0.965, 0.987, 0.995]),
    (50.0, [0.632, 0.721, 0.824, 0.906]),
    (100.0, [0.573, 0.630, 0.709, 0.804]),
    (200.0, [0.544, 0.575, 0.630, 0.700]),
];

type Number<'a> = &'a dyn Fn(&Outcome) -> f64;

/// Mean over seeds, and what the mean of ten other seeds may differ from the truth by chance.
fn mean_and_error(of_seeds: &[f64]) -> (f64, f64) {
    let centre = mean(of_seeds);
    let squares: Vec<f64> = of_seeds.iter().map(|v| (v - centre).powi(2)).collect();
    (centre, (mean(&squares) / 10.0).sqrt())
}

#[test]
fn rewards_and_errors_are_the_references() {
    let outcomes = outcomes(settings(40, 2), &BIASES);
    let of_seeds = |bias: f64, selection, of: Number| {
        let group = outcomes
            .iter()
            .filter(|o| o.bias.total_cmp(&bias).is_eq() && o.selection == selection);
        mean_and_error(&group.map(of).collect::<Vec<_>>())
    };
    for (bias, conventional, global, within) in REFERENCE {
        let groups = [
            (Selection::Aligned, ALIGNED.0, global[0], ALIGNED.1),
            (Selection::Conventional, conventional, global[1], within),
        ];
        for (selection, rewards, global, within) in groups {
            for (epoch, expected) in EPOCHS.into_iter().zip(rewards) {
                let (found, error) = of_seeds(bias, selection, &|o| o.rewards[epoch]);
                let told = format!("{selection:?} at {bias} after {epoch}: {found} for {expected}");
                assert!((found - expected).abs() < 0.02 + error, "{told}");
            }
            let errors: [(f64, Number); 2] = [
                (global, &|o| o.errors.global_error),
                (within, &|o| o.errors.within_error),
            ];
            for (expected, of) in errors {
                let (found, _) = of_seeds(bias, selection, of);
                let allowed = f64::max(0.03, 0.05 * expected);
                let told = format!("{selection:?} at {bias}: error {found} for {expected}");
                assert!((found - expected).abs() < allowed, "{told}");
            }
        }
    }
    for (bias, rewards) in SECOND {
        for (epoch, expected) in EPOCHS.into_iter().zip(rewards) {
            let (found, _) = of_seeds(bias, Selection::Conventional, &|o| o.rewards[epoch]);
            let told = format!("at {bias} after {epoch}: {found} for {expected}");
            assert!((found - expected).abs() < 0.02, "{told}");
        }
    }
}

#[test]
fn the_number_of_threads_changes_nothing() {
    let of = |n_threads| json_lines(&outcomes(settings(2, n_threads), &[0.0, 50.0]));
    assert_eq!(of(1), of(3));
}

#[test]
fn aligned_queries_learn_the_same_whatever_the_bias() {
    let outcomes = outcomes(settings(3, 1), &[0.0, 200.0]);
    let (none, much) = outcomes.split_at(6);
    for (none, much) in none.iter().zip(much).take(3) {
        assert_eq!(none.selection, Selection::Aligned);
        let mut rewards = none.rewards.iter().zip(&much.rewards).skip(1);
        assert!(
            rewards.all(|(a, b)| (a - b).abs() < 0.02),
            "{:?}",
            none.rewards
        );
        assert!((none.errors.within_error - much.errors.within_error).abs() < 1e-9);
    }
}

#[test]
fn the_run_has_rows_a_table_and_a_figure() {
    let files = run(settings(2, 2)).unwrap();
    let names: Vec<&str> = files.iter().map(|f| f.name.as_str()).collect();
    assert_eq!(
        names,
        ["abstract-mdp.jsonl", "abstract-mdp.md", "abstract-mdp.svg"]
    );
    assert_eq!(files[0].text.lines().count(), 24);
    assert!(files[1].text.contains("| 200 | conventional |"));
    assert_eq!(files, run(settings(2, 1)).unwrap(), "the same bytes");
}
