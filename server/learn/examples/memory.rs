//! What a long run holds in memory, without waiting for one.
//!
//! `cargo run -p learn --example memory [STEPS [LANES]]` fills a replay with that many steps of
//! window-open (a million by default, from one environment), lets every learner work on
//! it, with few labels and with many, and prints what the process holds after each.

use domain::answer::{Preference, Which};
use domain::environment::{EpisodeEnd, TaskReward};
use domain::episode::{EpisodeId, Segment};
use domain::query::Query;
use domain::random::{Rng, Stream};
use learn::checkpoint::Archive;
use learn::device::Device;
use learn::replay::{NewStep, Replay, ReplayShape, RewardSource};
use learn::reward::{Labeled, RewardConfig, RewardEnsemble};
use learn::sac::{Sac, SacConfig};
use learn::temporal::{TemporalConfig, TemporalDistance};

const SHAPE: ReplayShape = ReplayShape {
    observation: 39,
    action: 4,
    pose: 9,
};
const EPISODE_LEN: usize = 500;

fn main() {
    learn::device::init();
    let argument = |place: usize, or: usize| {
        let given = std::env::args().nth(place);
        given.map_or(or, |text| text.parse().expect("a number"))
    };
    let (n_steps, n_lanes) = (argument(1, 1_000_000), argument(2, 1));
    let mut replay = Replay::new(SHAPE, n_lanes);
    say("nothing yet");
    fill(&mut replay, n_steps, n_lanes);
    say(&format!("{n_steps} steps in {n_lanes} lanes"));
    println!(
        "  of which the replay says {:.0} MB ({} bytes a step)",
        (n_steps * SHAPE.step_bytes()) as f64 / 1e6,
        SHAPE.step_bytes()
    );
    let mut sac = Sac::new(&SacConfig::default(), 39, 4, 1, Device::CPU);
    let mut temporal = TemporalDistance::new(&TemporalConfig::default(), 39, 1, Device::CPU);
    for step in 0..20 {
        let mut rng = Rng::new(1, Stream::Batch, step);
        sac.update(&replay.sample_with(512, &mut rng, RewardSource::Learned));
        temporal.update(&replay);
    }
    say("20 updates of agent and temporal distance");
    let config = RewardConfig {
        max_epochs: 1,
        ..RewardConfig::default()
    };
    let mut ensemble = RewardEnsemble::new(&config, 39, 4, 1, Device::CPU);
    for n_labels in [100, 2_000, 10_000] {
        ensemble.fit(&replay, &labels(n_labels, replay.n_episodes()));
        ensemble.relabel(&mut replay);
        say(&format!("a fit to {n_labels} labels and a relabelling"));
    }
    let folder = std::env::temp_dir().join(format!("stair-memory-{}", std::process::id()));
    let mark = replay
        .sync(&folder)
        .expect("the temporary folder can be written");
    let mut archive = Archive::new();
    sac.save(&mut archive);
    archive.put_json("replay", &mark);
    archive
        .write(&folder.join("memory.stair"))
        .expect("written");
    say("a checkpoint of everything at once");
    drop(replay);
    let replay = Replay::open(&folder, SHAPE, n_lanes, &mark).expect("what was written");
    say(&format!("{} steps read back", replay.len()));
    std::fs::remove_dir_all(folder).expect("removed");
}

fn fill(replay: &mut Replay, n_steps: usize, n_lanes: usize) {
    let mut noise = vec![0.0; 4_096];
    Rng::new(2, Stream::Test, 0).fill_normal(&mut noise);
    for k in 0..n_steps {
        let (lane, t) = (k % n_lanes, k / n_lanes % EPISODE_LEN);
        let row = &noise[k * 7 % 4_000..];
        if t == 0 {
            replay.begin_episode(lane, k as u64, &row[..39], &row[..9], None);
        }
        let step = NewStep {
            action: &row[..4],
            learned_reward: 0.0,
            task_reward: TaskReward(0.0),
            success: false,
            stage: None,
            end: (t + 1 == EPISODE_LEN).then_some(EpisodeEnd::TimeLimit),
            next_observation: &row[..39],
            next_pose: &row[..9],
        };
        replay.push(lane, step);
    }
}

fn labels(n: usize, n_episodes: usize) -> Vec<Labeled> {
    let mut rng = Rng::new(3, Stream::Test, 0);
    let mut segment = || Segment {
        episode: EpisodeId(rng.below(n_episodes) as u32),
        start: rng.below(450) as u32,
        len: 50,
    };
    let mut label = || Labeled {
        query: Query {
            first: segment(),
            second: segment(),
        },
        preference: Preference::Prefer(Which::First),
    };
    (0..n).map(|_| label()).collect()
}

/// What the process holds now, and the most that it ever held.
fn say(after: &str) {
    let status = std::fs::read_to_string("/proc/self/status").expect("Linux tells");
    let megabytes = |key: &str| {
        let line = status.lines().find_map(|l| l.strip_prefix(key));
        let kib = line.and_then(|l| l.trim().strip_suffix("kB")?.trim().parse::<f64>().ok());
        kib.expect("a number of kB") * 1024.0 / 1e6
    };
    println!(
        "{:>6.0} MB, at most {:>6.0} MB: after {after}",
        megabytes("VmRSS:"),
        megabytes("VmHWM:")
    );
}
