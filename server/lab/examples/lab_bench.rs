//! What a run costs: `cargo run --release -p lab --example lab_bench [ROW…]`.
//!
//! 1. 64 environments of each task stepped on one thread and on two. Two threads can only be seen
//!    in wall time, so the machine should be idle; rounds are interleaved, the least of each counts.
//! 2. Runs with everything on, shortened: steps per second of wall time and of processor time from
//!    the first fit of the reward to the end. Sessions come as often as in the whole run; the replay
//!    is smaller than there, and with it what relabelling costs.

use std::fs;
use std::sync::mpsc::channel;
use std::time::Instant;

use cpu_time::ProcessTime;
use domain::environment::{EnvError, Environment};
use domain::random::{Rng, Stream};
use domain::teacher::{Oracle, Scripted};
use lab::config::{Layers, RunConfig};
use lab::message::Event;
use lab::run::Run;
use lab::stepping::step_all;
use rayon::ThreadPoolBuilder;
use sim::tasks::{Task, tasks};

const N_ENVS: usize = 64;
const N_ROUNDS: usize = 9;
const N_STEPS: usize = 100;

/// A run of this many steps stands for a whole one.
struct Sample {
    name: &'static str,
    task: &'static str,
    presets: &'static [&'static str],
    settings: &'static [&'static str],
}

const SAMPLES: [Sample; 3] = [
    Sample {
        name: "window-open, stair, as released",
        task: "window-open",
        presets: &[],
        settings: &["feedback.first_step=2000", "training.total_steps=7000"],
    },
    Sample {
        name: "window-open, stair, quick",
        task: "window-open",
        presets: &["quick"],
        settings: &["training.total_steps=34000"],
    },
    Sample {
        name: "go-fetch-return, stair, quick",
        task: "go-fetch-return",
        presets: &["quick"],
        settings: &["training.total_steps=16000"],
    },
];

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let wanted: Vec<String> = std::env::args().skip(1).collect();
    let is_wanted =
        |name: &str| wanted.is_empty() || wanted.iter().any(|w| name.contains(w.as_str()));
    println!(
        "| {N_ENVS} environments, random actions | steps/s, one thread | two threads | ratio |\n|---|---|---|---|"
    );
    for task in tasks().iter().filter(|task| is_wanted(task.name)) {
        let (one, two) = side_by_side(task)?;
        println!("| {} | {one:.0} | {two:.0} | {:.2} |", task.name, two / one);
    }
    println!("\n| run | steps/s | CPU s per 1,000 steps | steps |\n|---|---|---|---|");
    for sample in SAMPLES.iter().filter(|sample| is_wanted(sample.name)) {
        let (n_steps, wall, cpu) = run(sample)?;
        println!(
            "| {} | {:.0} | {:.2} | {n_steps} |",
            sample.name,
            n_steps as f64 / wall,
            cpu / n_steps as f64 * 1000.0
        );
    }
    Ok(())
}

/// Steps per second of wall time on one thread and on two.
fn side_by_side(task: &Task) -> Result<(f64, f64), Box<dyn std::error::Error>> {
    let pool = |n| ThreadPoolBuilder::new().num_threads(n).build();
    let pools = [pool(1)?, pool(2)?];
    let mut least = [f64::INFINITY; 2];
    let mut rng = Rng::new(1, Stream::Rollout, 0);
    for _ in 0..N_ROUNDS {
        for (pool, least) in pools.iter().zip(&mut least) {
            let mut envs: Vec<Box<dyn Environment>> = (0..N_ENVS).map(|_| (task.make)()).collect();
            for (seed, env) in envs.iter_mut().enumerate() {
                env.reset(seed as u64);
            }
            let size = envs[0].spec().action_size;
            let actions: Vec<f32> = (0..N_ENVS * size)
                .map(|_| rng.uniform_in(-1.0, 1.0) as f32)
                .collect();
            let before = Instant::now();
            pool.install(|| -> Result<(), EnvError> {
                for _ in 0..N_STEPS {
                    let envs = envs.iter_mut();
                    let envs = envs.map(|env| &mut **env as &mut dyn Environment);
                    step_all(envs.zip(actions.chunks(size)).collect())?;
                }
                Ok(())
            })?;
            *least = least.min(before.elapsed().as_secs_f64());
        }
    }
    let per_second = |seconds: f64| (N_ENVS * N_STEPS) as f64 / seconds;
    Ok((per_second(least[0]), per_second(least[1])))
}

/// Steps from the first fit to the end, and what they took: seconds of wall and processor time.
fn run(sample: &Sample) -> Result<(u64, f64, f64), Box<dyn std::error::Error>> {
    let config = RunConfig::resolve(&Layers {
        task: Some(sample.task.into()),
        method: Some("stair".into()),
        presets: sample.presets.iter().map(ToString::to_string).collect(),
        overrides: sample.settings.iter().map(ToString::to_string).collect(),
        file: None,
    })?;
    let folder = std::env::temp_dir().join(format!("stair-bench-{}", std::process::id()));
    let mut run = Run::start(config, &folder)?;
    let mut teacher = Scripted::new(Box::new(Oracle), 0);
    let (_commands, receiver) = channel();
    let mut since = None;
    let outcome = run.drive(&mut teacher, &receiver, &mut |event| {
        if let Event::SessionClosed(session) = &event
            && session.session == 0
        {
            since = Some((session.step, Instant::now(), ProcessTime::now()));
        }
    });
    let _ = fs::remove_dir_all(&folder); // best effort: it is a temporary folder
    outcome?;
    let (step, wall, cpu) = since.ok_or("the run ended before its first session")?;
    Ok((
        run.step() - step,
        wall.elapsed().as_secs_f64(),
        cpu.elapsed().as_secs_f64(),
    ))
}
