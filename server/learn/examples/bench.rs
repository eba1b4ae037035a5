//! CPU time of what learning does, on one thread, beside the floor of its arithmetic.
//!
//! `cargo run --release -p learn --example bench [-- NAME…]` prints the table of
//! `PERFORMANCE.md` for the machine it runs on; names pick rows. Times are CPU time of the
//! thread, the least of interleaved rounds, so that other work on the machine disturbs little.
//! The floor is the row's matrix products at the rate of a 1024³ f32 product in the same round.

#![expect(
    clippy::cast_possible_wrap,
    reason = "sizes of tensors and floating-point counts"
)]

use domain::answer::{Preference, Which};
use domain::environment::{EpisodeEnd, TaskReward};
use domain::episode::{EpisodeId, Segment};
use domain::query::Query;
use domain::random::{Rng, Stream};
use learn::checkpoint::Archive;
use learn::device::Device;
use learn::exploration::{ExplorationConfig, StateEntropy};
use learn::replay::{Batch, NewStep, Replay, ReplayShape};
use learn::reward::{Labeled, RewardConfig, RewardEnsemble};
use learn::sac::{Sac, SacConfig};
use learn::temporal::{TemporalConfig, TemporalDistance};

const N_ROUNDS: usize = 5;

/// One row of the table.
struct Row {
    name: &'static str,
    /// Matrix products, 10⁹ multiplications and additions.
    gigaflop: f64,
    /// How often it runs in a round.
    n_repeats: u32,
    work: Box<dyn FnMut()>,
    /// Seconds of one run in the fastest round.
    least: f64,
}

fn main() {
    learn::device::init();
    let wanted: Vec<String> = std::env::args().skip(1).collect();
    let is_wanted =
        |name: &str| wanted.is_empty() || wanted.iter().any(|w| name.contains(w.as_str()));
    let mut rows: Vec<Row> = all_rows()
        .into_iter()
        .filter(|(name, _)| is_wanted(name))
        .map(|(_, row)| row())
        .collect();
    let mut product = product_of_1024();
    let mut fastest_product = f64::INFINITY;
    for _ in 0..N_ROUNDS {
        fastest_product = fastest_product.min(product());
        for row in &mut rows {
            let before = cpu_time();
            (0..row.n_repeats).for_each(|_| (row.work)());
            let seconds = (cpu_time() - before) / f64::from(row.n_repeats);
            row.least = row.least.min(seconds);
        }
    }
    let rate = 2.0 * 1.024_f64.powi(3) / fastest_product; // GF/s
    println!(
        "1024³ f32 product: {rate:.0} GF/s; MKL asked its switch {} times\n",
        learn::device::n_mkl_switch_calls()
    );
    println!("| what | CPU ms | floor ms | share |\n|---|---|---|---|");
    for row in rows {
        let (ms, floor) = (row.least * 1e3, row.gigaflop / rate * 1e3);
        let (floor, share) = if row.gigaflop > 0.0 {
            (format!("{floor:.1}"), format!("{:.2}", floor / ms))
        } else {
            ("–".into(), "–".into())
        };
        println!("| {} | {ms:.1} | {floor} | {share} |", row.name);
    }
}

type MakeRow = Box<dyn Fn() -> Row>;

fn all_rows() -> Vec<(&'static str, MakeRow)> {
    let sac = |name, sizes, batch, hidden: &'static [i64], layer_norm| -> (&'static str, MakeRow) {
        (
            name,
            Box::new(move || sac_row(name, sizes, batch, hidden, layer_norm)),
        )
    };
    vec![
        sac(
            "SAC update, MetaWorld 39/4, batch 512, 3×256",
            (39, 4),
            512,
            &[256; 3],
            false,
        ),
        sac(
            "SAC update, the same with LayerNorm",
            (39, 4),
            512,
            &[256; 3],
            true,
        ),
        sac(
            "SAC update, quick 39/4, batch 256, LayerNorm",
            (39, 4),
            256,
            &[256; 3],
            true,
        ),
        sac(
            "SAC update, DMC 24/6, batch 1024, 2×1024",
            (24, 6),
            1024,
            &[1024; 2],
            false,
        ),
        sac(
            "SAC update, DMC 78/12, batch 1024, 2×1024",
            (78, 12),
            1024,
            &[1024; 2],
            false,
        ),
        ("temporal-distance step, batch 416", Box::new(temporal_row)),
        ("unsupervised step, 10,000 rows", Box::new(unsupervised_row)),
        (
            "reward training, one epoch of 2,000 pairs",
            Box::new(reward_row),
        ),
        ("relabelling 100,000 transitions", Box::new(relabel_row)),
        ("query selection, 500 candidates", Box::new(selection_row)),
        (
            "checkpoint of 500,000 transitions",
            Box::new(checkpoint_row),
        ),
    ]
}

fn row(name: &'static str, gigaflop: f64, n_repeats: u32, work: impl FnMut() + 'static) -> Row {
    Row {
        name,
        gigaflop,
        n_repeats,
        work: Box::new(work),
        least: f64::INFINITY,
    }
}

/// Weights of a perceptron without its biases.
fn weights(sizes: &[i64]) -> f64 {
    sizes
        .windows(2)
        .map(|pair| (pair[0] * pair[1]) as f64)
        .sum()
}

fn sac_row(
    name: &'static str,
    (s, a): (usize, usize),
    batch: usize,
    hidden: &[i64],
    layer_norm: bool,
) -> Row {
    let config = SacConfig {
        hidden: hidden.to_vec(),
        batch,
        layer_norm,
        ..SacConfig::default()
    };
    let mut sac = Sac::new(&config, s, a, 1, Device::CPU);
    let rows = random_batch(batch, s, a);
    let net = |input: usize, output: usize| {
        weights(&[&[input as i64], hidden, &[output as i64]].concat())
    };
    let (actor, critic) = (net(s, 2 * a), 2.0 * net(s + a, 1));
    let input_of_critic = 2.0 * ((s + a) as i64 * hidden[0]) as f64;
    let input_of_actor = (s as i64 * hidden[0]) as f64;
    // forward: π(s′), Q̄, Q, π(s), Q; back: Q's weights and inputs, Q's inputs, π's both
    let products = 2.0 * actor
        + 3.0 * critic
        + (2.0 * critic - input_of_critic)
        + (critic - input_of_critic * (s as f64) / ((s + a) as f64))
        + (2.0 * actor - input_of_actor);
    row(name, 2e-9 * batch as f64 * products, 10, move || {
        sac.update(&rows);
    })
}

fn temporal_row() -> Row {
    let replay = random_replay(8, 500, 1);
    let mut temporal = TemporalDistance::new(&TemporalConfig::default(), 39, 1, Device::CPU);
    let trunk = weights(&[39, 256, 256, 256, 64]);
    let heads = weights(&[64, 64, 64]) + 0.5 * weights(&[64, 64, 1]);
    let products = 832.0 * (3.0 * (trunk + heads) - 39.0 * 256.0) + 3.0 * 416.0 * 416.0 * 32.0;
    row(
        "temporal-distance step, batch 416",
        2e-9 * products,
        20,
        move || {
            temporal.update(&replay);
        },
    )
}

fn unsupervised_row() -> Row {
    let replay = random_replay(20, 500, 1);
    let config = SacConfig::default();
    let mut sac = Sac::new(&config, 39, 4, 1, Device::CPU);
    let mut exploration = StateEntropy::new(&ExplorationConfig::default());
    let update = sac_row("", (39, 4), 512, &[256; 3], false).gigaflop;
    let neighbours = 2e-9 * 512.0 * 10_000.0 * 39.0;
    row(
        "unsupervised step, 10,000 rows",
        update + neighbours,
        10,
        move || {
            let mut batch = replay.sample(512, &mut Rng::new(1, Stream::Batch, sac.n_updates()));
            batch.reward = exploration.intrinsic(&batch.observation, &replay);
            sac.update(&batch);
        },
    )
}

fn reward_net() -> f64 {
    3.0 * weights(&[43, 256, 256, 256, 1])
}

fn reward_row() -> Row {
    let replay = random_replay(20, 500, 1);
    let queries = random_queries(2_000, 20);
    let label = |query: &Query| Labeled {
        query: *query,
        preference: Preference::Prefer(Which::First),
    };
    let labeled: Vec<Labeled> = queries.iter().map(label).collect();
    let config = RewardConfig {
        max_epochs: 1,
        ..RewardConfig::default()
    };
    let mut ensemble = RewardEnsemble::new(&config, 39, 4, 1, Device::CPU);
    let products = 200_000.0 * (3.0 * reward_net() - 3.0 * 43.0 * 256.0);
    row(
        "reward training, one epoch of 2,000 pairs",
        2e-9 * products,
        1,
        move || {
            ensemble.fit(&replay, &labeled);
        },
    )
}

fn relabel_row() -> Row {
    let mut replay = random_replay(200, 500, 1);
    let ensemble = RewardEnsemble::new(&RewardConfig::default(), 39, 4, 1, Device::CPU);
    row(
        "relabelling 100,000 transitions",
        2e-9 * 100_000.0 * reward_net(),
        1,
        move || {
            ensemble.relabel(&mut replay);
        },
    )
}

fn selection_row() -> Row {
    let replay = random_replay(100, 500, 1);
    let queries = random_queries(500, 100);
    let ensemble = RewardEnsemble::new(&RewardConfig::default(), 39, 4, 1, Device::CPU);
    let temporal = TemporalDistance::new(&TemporalConfig::default(), 39, 1, Device::CPU);
    row(
        "query selection, 500 candidates",
        2e-9 * 50_000.0 * reward_net(),
        1,
        move || {
            ensemble.probabilities(&replay, &queries);
            temporal.stage_gap(&replay, &queries);
        },
    )
}

/// What a run writes after 5,000 further steps, to a temporary folder.
fn checkpoint_row() -> Row {
    let mut replay = random_replay(1_000, 500, 8);
    let sac = Sac::new(&SacConfig::default(), 39, 4, 1, Device::CPU);
    let ensemble = RewardEnsemble::new(&RewardConfig::default(), 39, 4, 1, Device::CPU);
    let folder = std::env::temp_dir().join(format!("stair-bench-{}", std::process::id()));
    replay
        .sync(&folder)
        .expect("the temporary folder can be written");
    row("checkpoint of 500,000 transitions", 0.0, 1, move || {
        push_episodes(&mut replay, 10, 500, 8);
        let mut archive = Archive::new();
        sac.save(&mut archive);
        ensemble.save(&mut archive);
        archive.put_json("replay", &replay.sync(&folder).expect("written"));
        archive.write(&folder.join("bench.ckpt")).expect("written");
    })
}

fn random_batch(n: usize, s: usize, a: usize) -> Batch {
    let mut rng = Rng::new(1, Stream::Test, 0);
    let mut normals = |n: usize| {
        let mut values = vec![0.0; n];
        rng.fill_normal(&mut values);
        values
    };
    Batch {
        observation: normals(n * s),
        action: normals(n * a).iter().map(|x| x.tanh()).collect(),
        reward: normals(n),
        next_observation: normals(n * s),
        not_terminal: vec![1.0; n],
    }
}

fn random_replay(n_episodes: usize, len: usize, n_lanes: usize) -> Replay {
    let shape = ReplayShape {
        observation: 39,
        action: 4,
        pose: 12,
    };
    let mut replay = Replay::new(shape, n_lanes);
    push_episodes(&mut replay, n_episodes, len, n_lanes);
    replay
}

fn push_episodes(replay: &mut Replay, n_episodes: usize, len: usize, n_lanes: usize) {
    let mut noise = vec![0.0; 4_096];
    for episode in 0..n_episodes {
        let lane = episode % n_lanes;
        Rng::new(2, Stream::Test, replay.n_episodes() as u64).fill_normal(&mut noise);
        replay.begin_episode(lane, episode as u64, &noise[..39], &noise[..12], None);
        for t in 0..len {
            let row = &noise[t * 7 % 4_000..];
            let end = (t + 1 == len).then_some(EpisodeEnd::TimeLimit);
            let step = NewStep {
                action: &row[..4],
                learned_reward: 0.0,
                task_reward: TaskReward(0.0),
                success: false,
                stage: None,
                end,
                next_observation: &row[..39],
                next_pose: &row[..12],
            };
            replay.push(lane, step);
        }
    }
}

fn random_queries(n: usize, n_episodes: usize) -> Vec<Query> {
    let mut rng = Rng::new(3, Stream::Test, 0);
    let mut segment = || Segment {
        episode: EpisodeId(rng.below(n_episodes) as u32),
        start: rng.below(450) as u32,
        len: 50,
    };
    (0..n)
        .map(|_| Query {
            first: segment(),
            second: segment(),
        })
        .collect()
}

/// Seconds of CPU time of one 1024³ product, as libtorch multiplies.
fn product_of_1024() -> impl FnMut() -> f64 {
    let numbers = (tch::Kind::Float, tch::Device::Cpu);
    let (a, b) = (
        tch::Tensor::ones([1024, 1024], numbers),
        tch::Tensor::ones([1024, 1024], numbers),
    );
    let c = tch::Tensor::zeros([1024, 1024], numbers);
    move || {
        let time = |_| {
            let before = cpu_time();
            let _ = a.matmul_out(&c, &b);
            cpu_time() - before
        };
        (0..10).map(time).fold(f64::INFINITY, f64::min)
    }
}

/// Seconds of CPU time that this thread has used.
#[expect(
    unsafe_code,
    reason = "the thread's own clock is read through a C function"
)]
fn cpu_time() -> f64 {
    const CLOCK_THREAD_CPUTIME_ID: i32 = 3;
    unsafe extern "C" {
        fn clock_gettime(clock: i32, time: *mut [i64; 2]) -> i32;
    }
    let mut time = [0_i64; 2];
    // SAFETY: on 64-bit Linux a timespec is two 64-bit numbers, which it fills.
    let failed = unsafe { clock_gettime(CLOCK_THREAD_CPUTIME_ID, &raw mut time) };
    assert_eq!(failed, 0, "the thread's clock can be read");
    time[0] as f64 + 1e-9 * time[1] as f64
}
