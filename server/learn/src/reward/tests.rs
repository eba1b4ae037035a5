use domain::answer::Which;
use domain::environment::{EpisodeEnd, TaskReward};
use domain::episode::{EpisodeId, Segment};

use super::*;
use crate::replay::{NewStep, ReplayShape};

const SHAPE: ReplayShape = ReplayShape {
    observation: 3,
    action: 2,
    pose: 0,
};
const EPISODE_LEN: u32 = 20;

/// Random states and actions; the task reward is the first coordinate of the state.
pub(super) fn replay(n_episodes: u32) -> Replay {
    let mut replay = Replay::new(SHAPE, 1);
    let mut rng = Rng::new(1, Stream::Test, 0);
    let mut normals = |n: usize| {
        let mut values = vec![0.0; n];
        rng.fill_normal(&mut values);
        values
    };
    for seed in 0..n_episodes {
        let mut state = normals(3);
        replay.begin_episode(0, u64::from(seed), &state, &[], None);
        for t in 0..EPISODE_LEN {
            let next = normals(3);
            let end = (t + 1 == EPISODE_LEN).then_some(EpisodeEnd::TimeLimit);
            replay.push(
                0,
                NewStep {
                    action: &normals(2),
                    learned_reward: 0.0,
                    task_reward: TaskReward(f64::from(state[0])),
                    success: false,
                    stage: None,
                    end,
                    next_observation: &next,
                    next_pose: &[],
                },
            );
            state = next;
        }
    }
    replay
}

/// Pairs of segments, labeled by the task reward, every seventh as equal.
pub(super) fn labeled(replay: &Replay, n: u32, len: impl Fn(u32) -> u32) -> Vec<Labeled> {
    let mut rng = Rng::new(2, Stream::Test, 0);
    let mut segment = |len: u32| Segment {
        episode: EpisodeId(rng.below(replay.n_episodes()) as u32),
        start: rng.below((EPISODE_LEN - len + 1) as usize) as u32,
        len,
    };
    let sum = |s: Segment| {
        replay
            .record(s)
            .task_rewards
            .iter()
            .map(|r| r.0)
            .sum::<f64>()
    };
    (0..n)
        .map(|i| {
            let (first, second) = (segment(len(i)), segment(len(i)));
            let better = if sum(first) > sum(second) {
                Which::First
            } else {
                Which::Second
            };
            let preference = if i % 7 == 6 {
                Preference::Equal
            } else {
                Preference::Prefer(better)
            };
            Labeled {
                query: Query { first, second },
                preference,
            }
        })
        .collect()
}

pub(super) fn small() -> RewardConfig {
    RewardConfig {
        members: 2,
        hidden: vec![16, 12],
        batch: 16,
        ..RewardConfig::default()
    }
}

/// In f64, over segments of different lengths and with equal preferences among them, at another
/// temperature than 1.
#[test]
fn the_written_out_gradient_is_autograds() {
    let replay = replay(6);
    let labeled = labeled(&replay, 14, |i| 4 + i % 3);
    let config = RewardConfig {
        temperature: 2.5,
        ..small()
    };
    let mut ours = RewardEnsemble::with_kind(&config, (3, 2), 1, (Kind::Double, tch::Device::Cpu));
    let mut passes = vec![
        Pass::new((0..14).collect()),
        Pass::new((0..14).rev().collect()),
    ];
    ours.gradient(&replay, &labeled, &mut passes, 0..14);

    let flat = ours.parameters.values.copy().set_requires_grad(true);
    let mut offset = 0;
    let mut take = |size: [i64; 3]| {
        let len = size.iter().product();
        offset += len;
        flat.narrow(0, offset - len, len).view(size)
    };
    let layers: Vec<_> = [(5, 16), (16, 12), (12, 1)]
        .map(|(n_in, n_out)| (take([2, n_in, n_out]), take([2, 1, n_out])))
        .into();
    let sum = |segment: Segment| {
        let mut rows = Vec::new();
        replay.append_segment_rows(segment, &mut rows);
        let mut x = matrix(&rows, 5, (Kind::Double, tch::Device::Cpu));
        for (i, (weight, bias)) in layers.iter().enumerate() {
            x = x.matmul(weight) + bias;
            x = if i < 2 {
                x.maximum(&(&x * 0.01))
            } else {
                x.tanh()
            };
        }
        x.sum_dim_intlist([1_i64, 2].as_slice(), false, Kind::Double)
    };
    let losses: Vec<Tensor> = labeled
        .iter()
        .map(|l| {
            let logits = Tensor::stack(&[sum(l.query.first), sum(l.query.second)], 1) / 2.5;
            let target = f64::from(l.preference.target());
            let target = Tensor::from_slice(&[1.0 - target, target]);
            -(logits.log_softmax(1, Kind::Double) * target).sum(Kind::Double)
        })
        .collect();
    let loss = Tensor::stack(&losses, 0).mean(Kind::Double);
    let summed = passes[0].loss + passes[1].loss; // of logits in f32
    assert!((loss.double_value(&[]) - summed / 14.0).abs() < 1e-6);
    loss.backward();
    let theirs = flat.grad();
    let error = (&ours.parameters.gradient - &theirs).abs().max() / theirs.abs().max();
    assert!(error.double_value(&[]) < 1e-6, "off by {error:?}");
}

#[test]
fn the_learned_reward_follows_the_preferences() {
    let mut replay = replay(40);
    let labeled = labeled(&replay, 400, |_| 5);
    let config = RewardConfig {
        learning_rate: 3e-3,
        max_epochs: 40,
        ..small()
    };
    let mut ensemble = RewardEnsemble::new(&config, 3, 2, 1, Device::CPU);
    let before = ensemble.fit(&replay, &labeled[..1]);
    let fit = ensemble.fit(&replay, &labeled);
    assert!(fit.accuracy > 0.9, "{fit:?} after {before:?}");
    ensemble.relabel(&mut replay);
    let mut sums = [0.0_f64; 5];
    for episode in 0..40 {
        for t in 0..EPISODE_LEN as usize {
            let id = EpisodeId(episode);
            let (x, y) = (
                replay.task_reward(id, t).0,
                f64::from(replay.learned_reward(id, t)),
            );
            let terms = [x, y, x * x, y * y, x * y];
            sums.iter_mut()
                .zip(terms)
                .for_each(|(sum, term)| *sum += term / 800.0);
        }
    }
    let [x, y, xx, yy, xy] = sums;
    let correlation = (xy - x * y) / ((xx - x * x) * (yy - y * y)).sqrt();
    assert!(correlation > 0.8, "{correlation}");
}

#[test]
fn fitting_stops_when_the_members_are_right_often_enough() {
    let replay = replay(6);
    let labeled = labeled(&replay, 4, |_| 5);
    let config = RewardConfig {
        learning_rate: 3e-3,
        max_epochs: 500,
        ..small()
    };
    let mut ensemble = RewardEnsemble::new(&config, 3, 2, 1, Device::CPU);
    let fit = ensemble.fit(&replay, &labeled);
    assert!(fit.n_epochs < 500 && fit.accuracy > 0.97, "{fit:?}");
    assert_eq!(ensemble.fit(&replay, &[]), RewardFit::default());
}

#[test]
fn a_fits_rate_falls_evenly_to_its_last_pass() {
    let replay = replay(20);
    let labeled = labeled(&replay, 40, |_| 5);
    let rates = |final_rate: f64, n: usize| {
        let config = RewardConfig {
            final_rate,
            ..small()
        };
        config.rates(n).collect::<Vec<_>>()
    };
    assert_eq!(rates(0.5, 3), [1.0, 0.75, 0.5]);
    assert_eq!((rates(0.5, 1), rates(1.0, 2)), (vec![1.0], vec![1.0; 2]));
    let fitted = |final_rate: f64, max_epochs: u32| {
        let config = RewardConfig {
            final_rate,
            max_epochs,
            stop_accuracy: 1.0,
            ..small()
        };
        let mut ensemble = RewardEnsemble::new(&config, 3, 2, 1, Device::CPU);
        let fit = ensemble.fit(&replay, &labeled);
        assert_eq!(fit.n_epochs, max_epochs);
        f64::from(ensemble.predict(&[0.3, -0.2, 0.5], &[0.1, 0.4])[0])
    };
    let (once, twice) = (fitted(1.0, 1), fitted(1.0, 2));
    let moved = (twice - once).abs();
    assert!(moved > 1e-4, "{once} {twice}");
    assert!((fitted(1e-3, 2) - once).abs() < 0.05 * moved);
}

#[test]
fn every_way_to_fit_comes_to_rest() {
    let replay = replay(20);
    let labeled = labeled(&replay, 40, |_| 10);
    let lesson = Lesson {
        replay: &replay,
        labeled: &labeled,
        unlabeled: &[],
    };
    let fitters: [fn() -> Box<dyn RewardLearner>; 3] = [
        || Box::new(Supervised),
        || Box::new(Denoising::new(&DenoisingConfig::default(), 1.0)),
        || Box::new(SemiSupervised::new(&SemiSupervisedConfig::default(), 1)),
    ];
    for (index, fitter) in fitters.iter().enumerate() {
        let loss = |final_rate: f64| {
            let config = RewardConfig {
                final_rate,
                learning_rate: 3e-3,
                max_epochs: 12,
                stop_accuracy: 1.0,
                ..small()
            };
            let mut ensemble = RewardEnsemble::new(&config, 3, 2, 1, Device::CPU);
            fitter().fit(&mut ensemble, &lesson).loss
        };
        // it has moved less
        assert!(loss(0.01) > loss(1.0), "{index}");
    }
}

#[test]
fn an_interrupted_ensemble_goes_on_bit_for_bit() {
    let replay = replay(6);
    let labeled = labeled(&replay, 40, |_| 5);
    let new = || RewardEnsemble::new(&small(), 3, 2, 1, Device::CPU);
    let (mut whole, mut archive) = (new(), Archive::new());
    whole.fit(&replay, &labeled[..20]);
    whole.save(&mut archive);
    whole.fit(&replay, &labeled);
    let mut resumed = new();
    resumed.load(&archive).expect("loads");
    resumed.fit(&replay, &labeled);
    let fingerprint = |e: &RewardEnsemble| {
        let mut archive = Archive::new();
        e.save(&mut archive);
        archive.fingerprint()
    };
    assert_eq!(fingerprint(&resumed), fingerprint(&whole));
}

#[test]
fn swapped_segments_swap_the_probability() {
    let replay = replay(6);
    let queries: Vec<Query> = labeled(&replay, 9, |_| 5).iter().map(|l| l.query).collect();
    let swapped: Vec<Query> = queries
        .iter()
        .map(|q| Query {
            first: q.second,
            second: q.first,
        })
        .collect();
    let ensemble = RewardEnsemble::new(&small(), 3, 2, 1, Device::CPU);
    let (p, q) = (
        ensemble.probabilities(&replay, &queries),
        ensemble.probabilities(&replay, &swapped),
    );
    assert_eq!((p.len(), p[0].len()), (2, 9));
    for (p, q) in p.iter().flatten().zip(q.iter().flatten()) {
        assert!((p + q - 1.0).abs() < 1e-5, "{p} {q}");
    }
    let std = disagreement(&[vec![0.2, 0.5], vec![0.6, 0.5]]);
    assert!((std[0] - 0.2).abs() < 1e-6 && std[1] == 0.0);
    let unsure = entropy(&[vec![0.5, 1.0], vec![0.5, 0.5]]);
    let ln_2 = std::f32::consts::LN_2;
    assert!((unsure[0] - ln_2).abs() < 1e-6 && (unsure[1] - 0.5 * ln_2).abs() < 1e-6);
}

/// RUNE's bonus: 0 where all members agree, their standard deviation elsewhere.
#[test]
fn the_disagreement_about_a_reward_is_the_members_std_and_goes_to_the_replay() {
    let mut replay = replay(2);
    let twice = RewardConfig {
        members: 1,
        ..small()
    };
    let alone = RewardEnsemble::new(&twice, 3, 2, 1, Device::CPU);
    let mut ensemble = RewardEnsemble::new(&small(), 3, 2, 1, Device::CPU);
    let (id, t) = (EpisodeId(1), 7);
    let (state, action) = (
        replay.observation(id, t).to_vec(),
        replay.action(id, t).to_vec(),
    );
    assert_eq!(alone.estimate(&state, &action).disagreements, [0.0]);
    let rows = ensemble.input(&joined(&state, &action, 1));
    let own = to_vec(&ensemble.net.forward(&rows).tanh());
    let std = ensemble.estimate(&state, &action).disagreements[0];
    assert!((std - 0.5 * (own[0] - own[1]).abs()).abs() < 1e-6);
    replay.keep_disagreement();
    ensemble.relabel(&mut replay);
    let kept = replay.disagreements_mut(0)[EPISODE_LEN as usize + t];
    assert!((kept - std).abs() < 1e-6, "{kept} {std}");
}

#[test]
fn normalised_rewards_keep_their_order_and_their_spread() {
    let mut replay = replay(40);
    replay.keep_disagreement();
    let labeled = labeled(&replay, 100, |_| 5);
    let relabeled = |normalized_std: f64, replay: &mut Replay| {
        let config = RewardConfig {
            normalized_std,
            ..small()
        };
        let mut ensemble = RewardEnsemble::new(&config, 3, 2, 1, Device::CPU);
        ensemble.fit(replay, &labeled);
        ensemble.relabel(replay);
        let rewards = replay.learned_rewards_mut(0).to_vec();
        (ensemble, rewards, replay.disagreements_mut(0).to_vec())
    };
    let (_, plain, plain_doubt) = relabeled(0.0, &mut replay);
    let (ensemble, normal, doubt) = relabeled(0.5, &mut replay);
    let moments = |values: &[f32]| {
        let n = values.len() as f64;
        let mean = values.iter().copied().map(f64::from).sum::<f64>() / n;
        let square = values
            .iter()
            .map(|v| (f64::from(*v) - mean).powi(2))
            .sum::<f64>();
        (mean, (square / n).sqrt())
    };
    let (mean, std) = moments(&normal);
    assert!(
        mean.abs() < 1e-6 && (std - 0.5).abs() < 1e-5,
        "{mean} {std}"
    );
    let (plain_mean, plain_std) = moments(&plain);
    for (own, raw) in normal.iter().zip(&plain) {
        let expected = 0.5 * (f64::from(*raw) - plain_mean) / plain_std;
        assert!((f64::from(*own) - expected).abs() < 1e-5);
    }
    // a bonus for disagreement stays in proportion to the reward
    for (own, raw) in doubt.iter().zip(&plain_doubt) {
        let expected = 0.5 * f64::from(*raw) / plain_std;
        assert!(*raw > 0.0 && (f64::from(*own) - expected).abs() < 1e-5);
    }
    // what is predicted afterwards is on the same scale, also after a restart
    let mut archive = Archive::new();
    ensemble.save(&mut archive);
    let mut restored = RewardEnsemble::new(&ensemble.config, 3, 2, 9, Device::CPU);
    restored.load(&archive).unwrap();
    let mut rows = Vec::new();
    replay.append_lane_rows(0, 0..1, &mut rows);
    let predicted = restored.estimate(&rows[..3], &rows[3..]);
    assert!((predicted.rewards[0] - normal[0]).abs() < 1e-6);
    assert!((predicted.disagreements[0] - doubt[0]).abs() < 1e-6);
}
