use domain::stage::{StageProbabilities, TimestepReport, TimestepTally};

use super::*;

const N_STEPS: usize = 20;
const DOUBLE: (Kind, tch::Device) = (Kind::Double, tch::Device::Cpu);

/// A few hundred steps of Adam instead of many thousands.
fn quick() -> TimestepConfig {
    TimestepConfig {
        hidden: vec![64, 64],
        learning_rate: 3e-3,
        batch: 64,
        epochs: 30,
    }
}

/// Episodes whose first two numbers are the hand of a clock, or noise as the third is.
fn episodes(shows_time: bool, first_key: u64, n: u64) -> Vec<Vec<f32>> {
    let episode = |key| {
        let mut rng = Rng::new(4, Stream::Test, key);
        let mut rows = Vec::with_capacity(3 * N_STEPS);
        for step in 0..N_STEPS {
            let mut noise = [0.0; 4];
            rng.fill_normal(&mut noise);
            let (sin, cos) = (std::f32::consts::TAU * step as f32 / N_STEPS as f32).sin_cos();
            if shows_time {
                rows.extend([sin, cos, 0.3 * noise[0]]);
            } else {
                rows.extend(&noise[..3]);
            }
        }
        rows
    };
    (first_key..first_key + n).map(episode).collect()
}

fn timed(episodes: &[Vec<f32>]) -> TimedStates {
    let mut states = TimedStates::new(3);
    for episode in episodes {
        states.push_episode(episode);
    }
    states
}

/// Fits to some episodes and judges on others.
fn judged(shows_time: bool) -> TimestepReport {
    let mut classifier = TimestepClassifier::new(&quick(), 3, N_STEPS, 1, Device::CPU);
    classifier.fit(&timed(&episodes(shows_time, 0, 60)), |_| ());
    let mut tally = TimestepTally::new(N_STEPS);
    for episode in episodes(shows_time, 1_000, 60) {
        let table = classifier.probabilities(&episode);
        tally.add(&StageProbabilities::new(table, N_STEPS).expect("probabilities"));
    }
    tally.report().expect("trajectories")
}

/// In f64, two minibatches of different length with a step twice in one of them.
#[test]
fn the_written_out_gradient_is_autograds() {
    let config = TimestepConfig {
        hidden: vec![8, 6],
        ..quick()
    };
    for steps in [vec![0_i64, 3, 3, 1], vec![2]] {
        let mut ours = TimestepClassifier::with_kind(&config, (3, 5), 1, DOUBLE);
        let mut values = vec![0.0; 3 * steps.len()];
        Rng::new(2, Stream::Test, 0).fill_normal(&mut values);
        let (x, steps) = (matrix(&values, 3, DOUBLE), Tensor::from_slice(&steps));
        ours.parameters.zero_gradient();
        let found = ours.add_gradient(&x, &steps);

        let flat = ours.parameters.values.copy().set_requires_grad(true);
        let mut offset = 0;
        let mut take = |size: [i64; 2]| {
            let len = size[0] * size[1];
            offset += len;
            flat.narrow(0, offset - len, len).view(size)
        };
        let mut h = x;
        for (layer, (n_in, n_out)) in [(3, 8), (8, 6), (6, 5)].into_iter().enumerate() {
            let (weight, bias) = (take([n_in, n_out]), take([1, n_out]));
            h = h.matmul(&weight) + bias;
            if layer < 2 {
                h = h.relu();
            }
        }
        let of_truth = h.log_softmax(-1, Kind::Double);
        let of_truth = of_truth.gather(1, &steps.unsqueeze(1), false);
        let loss = of_truth.mean(Kind::Double).neg();
        loss.backward();
        let error = (&ours.parameters.gradient - flat.grad()).abs().max();
        assert!(error.double_value(&[]) < 1e-12, "{error:?}");
        assert!((found.loss - loss.double_value(&[])).abs() < 1e-12);
    }
}

#[test]
fn steps_that_the_state_shows_are_told_apart() {
    let found = judged(true);
    let steps = found.stages.last().expect("every step a stage");
    assert!(found.within[0].accuracy > 0.99, "{found:?}");
    assert!(steps.measure > 0.95, "{steps:?}");
    assert!(steps.right_confidence <= steps.measure + 1e-6, "{steps:?}");
}

/// 1,200 states, 1/20 right by chance, standard deviation 0.63 %.
#[test]
fn steps_that_no_state_shows_are_guessed_by_chance() {
    let found = judged(false);
    let by_chance = 1.0 / N_STEPS as f64;
    let accuracy = found.within[0].accuracy;
    assert!((accuracy - by_chance).abs() < 0.025, "{accuracy}");
}

#[test]
fn the_loss_falls_from_that_of_a_guess() {
    let mut classifier = TimestepClassifier::new(&quick(), 3, N_STEPS, 1, Device::CPU);
    let mut losses = Vec::new();
    let last = classifier.fit(&timed(&episodes(true, 0, 20)), |fit| losses.push(fit.loss));
    assert_eq!(losses.len(), 30);
    assert!((losses[29] - last.loss).abs() < 1e-12);
    assert!(
        (losses[0] - (N_STEPS as f64).ln()).abs() < 0.2,
        "{losses:?}"
    );
    assert!(last.loss < 0.5 * losses[0], "{losses:?}");
}

#[test]
fn the_same_seed_learns_the_same_bits_and_another_one_does_not() {
    let states = timed(&episodes(true, 0, 5));
    let config = TimestepConfig {
        epochs: 2,
        ..quick()
    };
    let learned = |seed| {
        let mut classifier = TimestepClassifier::new(&config, 3, N_STEPS, seed, Device::CPU);
        classifier.fit(&states, |_| ());
        let table = classifier.probabilities(&episodes(true, 1_000, 1)[0]);
        table.into_iter().map(f32::to_bits).collect::<Vec<_>>()
    };
    assert!(learned(1) == learned(1));
    assert!(learned(1) != learned(2));
}

#[test]
fn without_states_nothing_is_learned() {
    let mut classifier = TimestepClassifier::new(&quick(), 3, N_STEPS, 1, Device::CPU);
    let mut n_told = 0;
    let fit = classifier.fit(&TimedStates::new(3), |_| n_told += 1);
    assert_eq!((fit, n_told), (TimestepFit::default(), 0));
}
