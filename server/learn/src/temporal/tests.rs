use super::*;
use crate::replay::walked::walked;

const DOUBLE: (Kind, tch::Device) = (Kind::Double, tch::Device::Cpu);

fn small() -> TemporalConfig {
    TemporalConfig {
        hidden: vec![24, 16],
        latent: 8,
        batch: 12,
        ..TemporalConfig::default()
    }
}

fn normals(n: usize, step: u64) -> Vec<f32> {
    let mut values = vec![0.0; n];
    Rng::new(8, Stream::Test, step).fill_normal(&mut values);
    values
}

/// The same in the library's own operations, over one flat vector.
fn reference_loss(config: &TemporalConfig, flat: &Tensor, x: &Tensor, y: &Tensor) -> Tensor {
    let mut offset = 0;
    let mut layers = |sizes: &[i64]| -> Vec<(Tensor, Tensor)> {
        let mut take = |size: &[i64]| {
            let len = size.iter().product();
            offset += len;
            flat.narrow(0, offset - len, len).view(size)
        };
        sizes
            .windows(2)
            .map(|s| (take(&[s[0], s[1]]), take(&[s[1]])))
            .collect()
    };
    let d = config.latent;
    let trunk = layers(&[&[4][..], &config.hidden, &[d]].concat());
    let (encoder, potential) = (layers(&[d, d, d]), layers(&[d, d, 1]));
    let run = |layers: &[(Tensor, Tensor)], x: &Tensor| {
        let mut x = x.shallow_clone();
        for (i, (weight, bias)) in layers.iter().enumerate() {
            x = x.matmul(weight) + bias;
            if i + 1 < layers.len() {
                x = x.relu();
            }
        }
        x
    };
    let (x, y) = (run(&trunk, x), run(&trunk, y));
    let c = run(&potential, &y).transpose(0, 1);
    let (x, y) = (
        run(&encoder, &x).unsqueeze(1),
        run(&encoder, &y).unsqueeze(0),
    );
    let logits = c - distance(&x, &y);
    let diagonal = |log: Tensor| -log.diagonal(0, 0, 1).mean(Kind::Double);
    let (forward, backward) = config.loss.weights();
    diagonal(logits.log_softmax(1, Kind::Double)) * forward
        + diagonal(logits.log_softmax(0, Kind::Double)) * backward
}

fn distance(x: &Tensor, y: &Tensor) -> Tensor {
    pairwise::distance(x, y)
}

#[test]
fn the_written_out_gradient_is_autograds() {
    for loss in [
        ContrastiveLoss::Symmetric,
        ContrastiveLoss::Forward,
        ContrastiveLoss::Backward,
    ] {
        let config = TemporalConfig { loss, ..small() };
        let mut ours = TemporalDistance::with_kind(&config, 4, 1, DOUBLE);
        let (x, y) = (normals(48, 1), normals(48, 2));
        let (value, _) = ours.gradient(&x, &y);
        let flat = ours.parameters.values.copy().set_requires_grad(true);
        let theirs = reference_loss(
            &config,
            &flat,
            &matrix(&x, 4, DOUBLE),
            &matrix(&y, 4, DOUBLE),
        );
        assert!((theirs.double_value(&[]) - value).abs() < 1e-9);
        theirs.backward();
        let error = (&ours.parameters.gradient - flat.grad()).abs().max() / flat.grad().abs().max();
        assert!(error.double_value(&[]) < 1e-6, "{loss:?} off by {error:?}");
    }
}

#[test]
fn distances_obey_the_triangle_inequality() {
    let temporal = TemporalDistance::new(&small(), 4, 1, Device::CPU);
    let (a, b, c) = (normals(400, 1), normals(400, 2), normals(400, 3));
    let (ab, bc, ac) = (
        temporal.distance(&a, &b),
        temporal.distance(&b, &c),
        temporal.distance(&a, &c),
    );
    for i in 0..100 {
        assert!(ac[i] <= ab[i] + bc[i] + 1e-4);
    }
    assert!(temporal.distance(&a, &a).iter().all(|d| *d < 2e-4));
}

#[test]
fn positives_lie_ahead_and_near_ones_are_likelier() {
    let draws = |left| (0..=1000).map(move |i| steps_ahead(left, 0.99, f64::from(i) / 1000.0));
    assert!(draws(0).all(|k| k == 0));
    assert!(draws(7).all(|k| (1..=7).contains(&k)));
    let n_near = draws(400).filter(|k| *k <= 69).count();
    assert!((490..=530).contains(&n_near), "{n_near}"); // half of 0.99^k lies below 69
}

/// 30 states in three rooms of ten in a row; inside a room the next state is any of its, and
/// two doors, each taken one time in ten, join the last state of a room and the first of the
/// next in both directions.
struct Rooms;

impl Rooms {
    const N: usize = 30;

    fn row(state: usize) -> [f64; Self::N] {
        let room = state / 10 * 10;
        let door = match state {
            9 | 19 => Some(state + 1),
            10 | 20 => Some(state - 1),
            _ => None,
        };
        let mut row = [0.0; Self::N];
        row[room..room + 10].fill(if door.is_some() { 0.09 } else { 0.1 });
        if let Some(beyond) = door {
            row[beyond] = 0.1;
        }
        row
    }

    fn next(state: usize, rng: &mut Rng) -> usize {
        let mut u = rng.uniform();
        let row = Self::row(state);
        row.iter()
            .position(|p| {
                u -= p;
                u < 0.0
            })
            .unwrap_or(Self::N - 1)
    }

    /// −log of the ratio of discounted visits of y from x to those from y itself.
    fn exact() -> Vec<f64> {
        let (n, discount) = (Self::N as i64, 0.99);
        let p: Vec<f64> = (0..Self::N).flat_map(Self::row).collect();
        let p = Tensor::from_slice(&p).view([n, n]);
        let visits = (Tensor::eye(n, DOUBLE) - &p * discount).inverse();
        let visits = p.matmul(&visits); // from the next step on
        let from_itself = visits.diagonal(0, 0, 1).unsqueeze(0);
        let distance: Tensor = -(visits / from_itself).log();
        Vec::try_from(distance.view([-1])).expect("numbers")
    }
}

fn chain_replay(n_episodes: usize, len: usize) -> Replay {
    let one_hot = |state: usize| {
        let mut row = vec![0.0; Rooms::N];
        row[state] = 1.0;
        row
    };
    let episode = |episode: usize| {
        let mut rng = Rng::new(3, Stream::Test, episode as u64);
        let first = rng.below(Rooms::N);
        let states =
            std::iter::successors(Some(first), |&state| Some(Rooms::next(state, &mut rng)));
        states.take(len + 1).map(one_hot).collect()
    };
    walked(Rooms::N, (0..n_episodes).map(episode))
}

fn ranks(values: &[f64]) -> Vec<f64> {
    let mut order: Vec<usize> = (0..values.len()).collect();
    order.sort_by(|&a, &b| values[a].total_cmp(&values[b]));
    let mut ranks = vec![0.0; values.len()];
    order
        .into_iter()
        .enumerate()
        .for_each(|(rank, i)| ranks[i] = rank as f64);
    ranks
}

fn correlation(a: &[f64], b: &[f64]) -> f64 {
    let n = a.len() as f64;
    let mean = |v: &[f64]| v.iter().sum::<f64>() / n;
    let (ma, mb) = (mean(a), mean(b));
    let moment = |f: &dyn Fn(usize) -> f64| (0..a.len()).map(f).sum::<f64>();
    let ab = moment(&|i| (a[i] - ma) * (b[i] - mb));
    let (aa, bb) = (
        moment(&|i| (a[i] - ma).powi(2)),
        moment(&|i| (b[i] - mb).powi(2)),
    );
    ab / (aa * bb).sqrt()
}

#[test]
fn on_a_chain_with_bottlenecks_it_learns_the_successor_distance() {
    let replay = chain_replay(40, 1_000);
    let config = TemporalConfig {
        hidden: vec![64, 64],
        learning_rate: 1e-3,
        batch: 192,
        block_episodes: 40,
        ..TemporalConfig::default()
    };
    let mut temporal = TemporalDistance::new(&config, Rooms::N, 1, Device::CPU);
    for _ in 0..2_500 {
        temporal.update(&replay).expect("the block is closed");
    }
    let (mut from, mut to) = (Vec::new(), Vec::new());
    for x in 0..Rooms::N {
        for y in 0..Rooms::N {
            from.extend((0..Rooms::N).map(|i| f32::from(u8::from(i == x))));
            to.extend((0..Rooms::N).map(|i| f32::from(u8::from(i == y))));
        }
    }
    let learned: Vec<f64> = temporal
        .distance(&from, &to)
        .into_iter()
        .map(f64::from)
        .collect();
    let spearman = correlation(&ranks(&learned), &ranks(&Rooms::exact()));
    println!("Spearman correlation with the exact distance: {spearman:.3}");
    assert!(spearman > 0.9, "{spearman}");
}

#[test]
fn nothing_is_learned_before_a_block_closes_and_an_interrupted_run_goes_on_bit_for_bit() {
    let replay = chain_replay(9, 30);
    let new = || TemporalDistance::new(&small(), Rooms::N, 1, Device::CPU);
    assert!(new().update(&chain_replay(7, 30)).is_none());
    let (mut whole, mut archive) = (new(), Archive::new());
    for step in 0..6 {
        if step == 3 {
            whole.save(&mut archive);
        }
        whole.update(&replay);
    }
    let mut resumed = new();
    resumed.load(&archive).expect("loads");
    for _ in 0..3 {
        resumed.update(&replay);
    }
    let fingerprint = |t: &TemporalDistance| {
        let mut archive = Archive::new();
        t.save(&mut archive);
        archive.fingerprint()
    };
    assert_eq!(fingerprint(&resumed), fingerprint(&whole));
}

#[test]
fn the_stage_gap_is_the_mean_over_both_ends_of_both_segments() {
    let replay = chain_replay(2, 30);
    let temporal = TemporalDistance::new(&small(), Rooms::N, 1, Device::CPU);
    let segment = |episode, start| Segment {
        episode: EpisodeId(episode),
        start,
        len: 5,
    };
    let query = Query {
        first: segment(0, 2),
        second: segment(1, 20),
    };
    let gap = temporal.stage_gap(&replay, &[query])[0];
    let mut sum = 0.0;
    for x in [2, 6] {
        for y in [20, 24] {
            let from = replay.observation(EpisodeId(0), x);
            sum += temporal.distance(from, replay.observation(EpisodeId(1), y))[0];
        }
    }
    assert!((gap - sum / 4.0).abs() < 1e-5);
}
