use super::*;
use crate::random::{Rng, Stream};
use crate::stage::multi_stage_measure;

fn report(trajectories: &[StageProbabilities]) -> TimestepReport {
    let mut tally = TimestepTally::new(trajectories[0].n_stages());
    for table in trajectories {
        tally.add(table);
    }
    tally.report().unwrap()
}

fn close(found: f64, expected: f64) -> bool {
    (found - expected).abs() < 1e-6
}

/// Three states of three steps: right by 0.5, one step off by 0.7, two steps off by 0.6.
fn by_hand() -> StageProbabilities {
    let rows = [0.5, 0.3, 0.2, 0.1, 0.2, 0.7, 0.6, 0.1, 0.3];
    StageProbabilities::new(rows.into(), 3).unwrap()
}

#[test]
fn the_measures_are_those_computed_by_hand() {
    let found = report(&[by_hand()]);
    assert_eq!((found.n_steps, found.n_states), (3, 3));
    let within: Vec<usize> = found.within.iter().map(|w| w.k).collect();
    assert_eq!(within, [0, 1, 2]);
    for (within, of_three) in found.within.iter().zip([1.0, 2.0, 3.0]) {
        assert!(close(within.accuracy, of_three / 3.0), "{within:?}");
    }
    let [merged, steps] = found.stages[..] else {
        panic!("two stages, then three: {:?}", found.stages)
    };
    // Merged: [0.5, 0.5], [0.1, 0.9], [0.6, 0.4] with true stages 0, 1, 1; best way 0, 1, 1.
    let expected = [
        (merged, 2, [2.0, 2.0, 1.42, 1.4, 1.8]),
        (steps, 3, [1.0, 1.8, 1.1, 0.5, 1.2]),
    ];
    for (found, n_stages, [right, sure, squares, right_and_sure, way]) in expected {
        assert_eq!(found.n_stages, n_stages);
        assert!(close(found.accuracy, right / 3.0), "{found:?}");
        assert!(close(found.accuracy_squared, (right / 3.0).powi(2)));
        assert!(close(found.confidence, sure / 3.0), "{found:?}");
        assert!(close(found.confidence_squared, squares / 3.0), "{found:?}");
        let both = right_and_sure / 3.0;
        assert!(close(found.right_confidence, both), "{found:?}");
        assert!(close(found.measure, way / 3.0), "{found:?}");
    }
}

#[test]
fn the_calibration_error_weighs_each_bins_gap_by_its_states() {
    let Calibration { ece, bins } = report(&[by_hand()]).calibration;
    assert!(close(ece, (0.5 + 0.7 + 0.6) / 3.0), "{ece}");
    let bins: Vec<(usize, f64)> = bins.iter().map(|b| (b.n, b.accuracy)).collect();
    assert_eq!(bins, [(1, 1.0), (1, 0.0), (1, 0.0)]);

    // Four states of one bin, three of them right: |0.75 − 0.8| in all.
    let sure_of = |guess: usize| (0..4).map(move |t| if t == guess { 0.8 } else { 0.05 });
    let rows = [0, 1, 2, 0].into_iter().flat_map(sure_of).collect();
    let Calibration { ece, bins } =
        report(&[StageProbabilities::new(rows, 4).unwrap()]).calibration;
    assert_eq!(bins.len(), 1);
    assert!(close(ece, 0.05), "{ece}");
}

#[test]
fn the_ends_of_a_bin_are_its_upper_one() {
    let bins = [1e-9, 1.0 / 15.0, 0.0667, 14.0 / 15.0, 0.934, 1.0].map(bin_of);
    assert_eq!(bins, [0, 0, 1, 13, 14, 14]);
}

/// Trajectories over a few states, each with its true share among the steps at which it is
/// seen: a classifier that is calibrated exactly.
fn calibrated(rng: &mut Rng) -> Vec<StageProbabilities> {
    let (n_trajectories, n_steps) = (1 + rng.below(5), 2 + rng.below(12));
    let n_kinds = 1 + rng.below(8);
    let walks: Vec<Vec<usize>> = (0..n_trajectories)
        .map(|_| (0..n_steps).map(|_| rng.below(n_kinds)).collect())
        .collect();
    let mut seen = vec![vec![0; n_steps]; n_kinds];
    for walk in &walks {
        for (step, &kind) in walk.iter().enumerate() {
            seen[kind][step] += 1;
        }
    }
    let share = |kind: usize| {
        let n: i32 = seen[kind].iter().sum();
        seen[kind].iter().map(move |&at| at as f32 / n as f32)
    };
    let table = |walk: &Vec<usize>| {
        let rows = walk.iter().flat_map(|&kind| share(kind)).collect();
        StageProbabilities::new(rows, n_steps).unwrap()
    };
    walks.iter().map(table).collect()
}

#[test]
fn calibrated_classifiers_keep_the_chain_of_bounds_at_every_number_of_stages() {
    let mut rng = Rng::new(5, Stream::Test, 0);
    let (mut n_cases, mut n_strict) = (0, 0);
    for _ in 0..400 {
        let found = report(&calibrated(&mut rng));
        for m in &found.stages {
            let told = format!("{m:?}");
            assert!(close(m.accuracy, m.confidence), "{told}");
            assert!(close(m.right_confidence, m.confidence_squared), "{told}");
            assert!(m.accuracy_squared <= m.confidence_squared + 1e-6, "{told}");
            assert!(m.confidence_squared <= m.measure + 1e-6, "{told}");
            n_cases += 1;
            let is_strict = m.accuracy_squared + 1e-3 < m.confidence_squared
                && m.confidence_squared + 1e-3 < m.measure;
            n_strict += usize::from(is_strict);
        }
        assert!(found.calibration.ece < 1e-6, "{:?}", found.calibration);
    }
    assert!(n_strict > n_cases / 2, "{n_strict} of {n_cases}");
}

#[test]
fn any_classifier_keeps_the_bound_that_needs_no_calibration() {
    let mut rng = Rng::new(6, Stream::Test, 0);
    for _ in 0..400 {
        let n_steps = 2 + rng.below(12);
        let values = (0..n_steps * n_steps).map(|_| (rng.uniform() / n_steps as f64) as f32);
        let table = StageProbabilities::new(values.collect(), n_steps).unwrap();
        for m in report(&[table]).stages {
            assert!(m.right_confidence <= m.measure + 1e-6, "{m:?}");
            assert!(m.confidence.powi(2) <= m.confidence_squared + 1e-6, "{m:?}");
        }
    }
    // Sure of the wrong one of two steps: E[m²] is 1, and half of it can be had.
    let wrong = StageProbabilities::new(vec![0.0, 1.0, 1.0, 0.0], 2).unwrap();
    let m = report(&[wrong]).stages[0];
    assert!(close(m.confidence_squared, 1.0) && close(m.measure, 0.5));
    assert!(close(m.right_confidence, 0.0));
}

#[test]
fn the_exact_measure_is_the_multi_stage_measure_of_the_merged_tables() {
    let mut rng = Rng::new(7, Stream::Test, 0);
    for _ in 0..50 {
        let tables = calibrated(&mut rng);
        for m in report(&tables).stages {
            let merged: Vec<_> = tables.iter().map(|t| t.merged(m.n_stages)).collect();
            let exact = multi_stage_measure(&merged).unwrap();
            assert!((m.measure - exact).abs() < 1e-12, "{m:?}, {exact}");
        }
    }
}

/// The released script's comparison, pair by pair: 27 empty rows and the three states.
#[test]
fn the_released_figure_is_that_of_every_guess_against_every_label() {
    let mut guesses = vec![0; 27];
    let mut labels = guesses.clone();
    guesses.extend([0, 2, 0]);
    labels.extend([0, 1, 2]);
    let pairs = guesses
        .iter()
        .flat_map(|guess| labels.iter().map(move |label| guess == label));
    let n_equal = pairs.filter(|is_equal| *is_equal).count();
    let expected = n_equal as f64 / (30.0 * 30.0);
    assert!(close(report(&[by_hand()]).as_released, expected));
}

#[test]
fn the_released_figure_says_nothing_about_the_classifier() {
    const T: usize = 500;
    let sure_of = |guess: usize| (0..T).map(move |t| f32::from(u8::from(t == guess)));
    let guessing = |guess: &dyn Fn(usize) -> usize| {
        let rows = (0..T).flat_map(|step| sure_of(guess(step))).collect();
        report(&[StageProbabilities::new(rows, T).unwrap()])
    };
    let right = guessing(&|step| step);
    let wrong = guessing(&|step| (step + 1) % T);
    assert!(close(right.within[0].accuracy, 1.0) && close(wrong.within[0].accuracy, 0.0));
    for found in [right, wrong] {
        let printed = found.as_released;
        assert!((0.810..0.811).contains(&printed), "{printed}");
    }
}

#[test]
fn without_a_trajectory_there_is_nothing_to_report() {
    assert_eq!(TimestepTally::new(3).report(), None);
}
