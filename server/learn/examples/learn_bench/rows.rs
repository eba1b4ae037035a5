//! What is measured, and what others need for the same.
//!
//! The peers' times are of two Zen5 cores: B-Pref's and STAIR's released Python (PyTorch 2.11),
//! and the same SAC update in JAX, jitted.

use std::path::PathBuf;

use domain::answer::{Preference, Which};
use domain::query::Query;
use domain::random::{Rng, Stream};
use learn::Precision;
use learn::checkpoint::Archive;
use learn::device::Device;
use learn::exploration::{ExplorationConfig, StateEntropy};
use learn::replay::Replay;
use learn::reward::{Labeled, RewardConfig, RewardEnsemble};
use learn::sac::{Sac, SacConfig};
use learn::temporal::{TemporalConfig, TemporalDistance};

use crate::experience::{push_episodes, random_batch, random_queries, random_replay};

/// One row of the table, before its work is set up.
pub(crate) struct Row {
    /// What is done.
    pub(crate) name: &'static str,
    /// CPU milliseconds of others, and whose.
    pub(crate) peer: &'static str,
    /// Sets it up.
    pub(crate) prepare: Box<dyn Fn() -> Work>,
}

/// What is timed.
pub(crate) struct Work {
    /// Matrix products, 10⁹ multiplications and additions.
    pub(crate) gigaflop: f64,
    /// How often it runs in a round.
    pub(crate) n_repeats: u32,
    /// Once.
    pub(crate) run: Box<dyn FnMut()>,
}

fn row(name: &'static str, peer: &'static str, prepare: impl Fn() -> Work + 'static) -> Row {
    Row {
        name,
        peer,
        prepare: Box::new(prepare),
    }
}

fn work(gigaflop: f64, n_repeats: u32, run: impl FnMut() + 'static) -> Work {
    Work {
        gigaflop,
        n_repeats,
        run: Box::new(run),
    }
}

/// All rows, in the table's order.
pub(crate) fn all(device: Device) -> Vec<Row> {
    let sac =
        |name, peer, sizes, config: SacConfig| row(name, peer, move || sac(sizes, &config, device));
    let bf16 = |config: SacConfig| SacConfig {
        precision: Precision::Bf16,
        ..config
    };
    let metaworld = SacConfig::default;
    let normalised = || SacConfig {
        layer_norm: true,
        ..metaworld()
    };
    let quick = || SacConfig {
        batch: 256,
        ..normalised()
    };
    let dmc = || SacConfig {
        hidden: vec![1024; 2],
        batch: 1024,
        ..metaworld()
    };
    let (small, walker, quadruped) = ((39, 4), (24, 6), (78, 12));
    vec![
        sac(
            "SAC update, MetaWorld 39/4, batch 512, 3×256",
            "41–46 (BPref), 16.7 (JAX)",
            small,
            metaworld(),
        ),
        sac("– in bf16", "–", small, bf16(metaworld())),
        sac("– with LayerNorm", "–", small, normalised()),
        sac("– with LayerNorm in bf16", "–", small, bf16(normalised())),
        sac("– with LayerNorm, batch 256", "–", small, quick()),
        sac(
            "– with LayerNorm, batch 256, in bf16",
            "–",
            small,
            bf16(quick()),
        ),
        sac(
            "SAC update, DMC 24/6, batch 1024, 2×1024",
            "477 (BPref), 229 (JAX)",
            walker,
            dmc(),
        ),
        sac("– DMC 24/6 in bf16", "–", walker, bf16(dmc())),
        sac(
            "SAC update, DMC 78/12, batch 1024, 2×1024",
            "495 (BPref), 239 (JAX)",
            quadruped,
            dmc(),
        ),
        sac("– DMC 78/12 in bf16", "–", quadruped, bf16(dmc())),
        row(
            "temporal-distance step, batch 416",
            "146–517 as released, 35 for its one useful minibatch",
            move || temporal(device),
        ),
        row("unsupervised step, 10,000 rows", "108–683", move || {
            unsupervised(device)
        }),
        row(
            "reward training, one epoch of 2,000 pairs",
            "6,400",
            move || reward(Precision::F32, device),
        ),
        row("– one epoch in bf16", "–", move || {
            reward(Precision::Bf16, device)
        }),
        row(
            "relabelling 1,000,000 transitions",
            "10,400–12,600",
            move || relabel(Precision::F32, device),
        ),
        row("– relabelling in bf16", "–", move || {
            relabel(Precision::Bf16, device)
        }),
        row("query selection, 500 candidates", "220–790", move || {
            selection(device)
        }),
        row("checkpoint of 500,000 transitions", "cannot", move || {
            checkpoint(device)
        }),
    ]
}

/// Weights of a perceptron without its biases.
fn weights(sizes: &[i64]) -> f64 {
    sizes
        .windows(2)
        .map(|pair| (pair[0] * pair[1]) as f64)
        .sum()
}

fn sac((s, a): (usize, usize), config: &SacConfig, device: Device) -> Work {
    let (batch, hidden) = (config.batch, &config.hidden[..]);
    let mut sac = Sac::new(config, s, a, 1, device);
    let rows = random_batch(batch, s, a);
    work(sac_gigaflop((s, a), batch, hidden), 10, move || {
        sac.update(&rows);
    })
}

fn sac_gigaflop((s, a): (usize, usize), batch: usize, hidden: &[i64]) -> f64 {
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
    2e-9 * batch as f64 * products
}

fn temporal(device: Device) -> Work {
    let replay = random_replay(8, 500, 1);
    let mut temporal = TemporalDistance::new(&TemporalConfig::default(), 39, 1, device);
    let trunk = weights(&[39, 256, 256, 256, 64]);
    let heads = weights(&[64, 64, 64]) + 0.5 * weights(&[64, 64, 1]);
    let products = 832.0 * (3.0 * (trunk + heads) - 39.0 * 256.0) + 3.0 * 416.0 * 416.0 * 32.0;
    work(2e-9 * products, 20, move || {
        temporal.update(&replay);
    })
}

fn unsupervised(device: Device) -> Work {
    let replay = random_replay(20, 500, 1);
    let mut sac = Sac::new(&SacConfig::default(), 39, 4, 1, device);
    let mut exploration = StateEntropy::new(&ExplorationConfig::default());
    let update = sac_gigaflop((39, 4), 512, &[256; 3]);
    let neighbours = 2e-9 * 512.0 * 10_000.0 * 39.0;
    work(update + neighbours, 10, move || {
        let mut batch = replay.sample(512, &mut Rng::new(1, Stream::Batch, sac.n_updates()));
        batch.reward = exploration.intrinsic(&batch.observation, &replay);
        sac.update(&batch);
    })
}

fn reward_net() -> f64 {
    3.0 * weights(&[43, 256, 256, 256, 1])
}

fn ensemble(config: &RewardConfig, device: Device) -> RewardEnsemble {
    RewardEnsemble::new(config, 39, 4, 1, device)
}

fn reward(precision: Precision, device: Device) -> Work {
    let replay = random_replay(20, 500, 1);
    let label = |query: &Query| Labeled {
        query: *query,
        preference: Preference::Prefer(Which::First),
    };
    let labeled: Vec<Labeled> = random_queries(2_000, 20).iter().map(label).collect();
    let mut ensemble = ensemble(
        &RewardConfig {
            max_epochs: 1,
            precision,
            ..RewardConfig::default()
        },
        device,
    );
    let products = 200_000.0 * (3.0 * reward_net() - 3.0 * 43.0 * 256.0);
    work(2e-9 * products, 1, move || {
        ensemble.fit(&replay, &labeled);
    })
}

fn relabel(precision: Precision, device: Device) -> Work {
    let mut replay = random_replay(2_000, 500, 1);
    let mut ensemble = ensemble(
        &RewardConfig {
            precision,
            ..RewardConfig::default()
        },
        device,
    );
    work(2e-9 * 1e6 * reward_net(), 1, move || {
        ensemble.relabel(&mut replay);
    })
}

fn selection(device: Device) -> Work {
    let replay = random_replay(100, 500, 1);
    let queries = random_queries(500, 100);
    let ensemble = ensemble(&RewardConfig::default(), device);
    let temporal = TemporalDistance::new(&TemporalConfig::default(), 39, 1, device);
    work(2e-9 * 50_000.0 * reward_net(), 1, move || {
        ensemble.probabilities(&replay, &queries);
        temporal.stage_gap(&replay, &queries);
    })
}

/// What a run writes after 5,000 further steps, to a temporary folder that goes afterwards.
fn checkpoint(device: Device) -> Work {
    let mut run = Checkpointed {
        replay: random_replay(1_000, 500, 8),
        sac: Sac::new(&SacConfig::default(), 39, 4, 1, device),
        ensemble: ensemble(&RewardConfig::default(), device),
        folder: std::env::temp_dir().join(format!("stair-bench-{}", std::process::id())),
    };
    run.write();
    work(0.0, 1, move || {
        push_episodes(&mut run.replay, 10, 500, 8);
        run.write();
    })
}

struct Checkpointed {
    replay: Replay,
    sac: Sac,
    ensemble: RewardEnsemble,
    folder: PathBuf,
}

impl Checkpointed {
    fn write(&mut self) {
        let mut archive = Archive::new();
        self.sac.save(&mut archive);
        self.ensemble.save(&mut archive);
        let mark = self.replay.sync(&self.folder).expect("written");
        archive.put_json("replay", &mark);
        archive
            .write(&self.folder.join("bench.ckpt"))
            .expect("written");
    }
}

impl Drop for Checkpointed {
    fn drop(&mut self) {
        let _ = std::fs::remove_dir_all(&self.folder); // best effort: it is a temporary folder
    }
}
