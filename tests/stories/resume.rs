//! A run that is killed at any moment ends as if nobody had touched it.

use std::path::Path;
use std::process::{Command, Stdio};
use std::time::Duration;

use domain::random::{Rng, Stream};

const N_KILLS: u64 = 20;

const SETTINGS: &[&str] = &[
    "training.total_steps=6000",
    "training.seed_steps=300",
    "training.checkpoint_every=150",
    "feedback.first_step=900",
    "feedback.every=400",
    "feedback.queries_per_session=5",
    "feedback.budget=50",
    "evaluation.every=1500",
    "evaluation.episodes=5",
    "agent.hidden=[64, 64]",
    "agent.batch=128",
    "reward.hidden=[64, 64]",
    "temporal.update_every=8",
    "temporal.batch=64",
    "environment.n_envs=2",
];

fn stair() -> Command {
    let mut command = Command::new(env!("CARGO_BIN_EXE_stair"));
    command.stdin(Stdio::null()).stderr(Stdio::null());
    command
}

fn start(folder: &Path) -> Command {
    let mut command = stair();
    command
        .args([
            "train",
            "go-fetch-return",
            "--method",
            "stair",
            "--json",
            "--out",
        ])
        .arg(folder);
    for setting in SETTINGS {
        command.args(["--set", setting]);
    }
    command
}

fn go_on(folder: &Path) -> Command {
    let mut command = stair();
    command.args(["train", "--json", "--resume"]).arg(folder);
    command
}

/// The final weights' fingerprint from the JSON object that `stair train --json` ends with.
fn weights(output: &[u8]) -> String {
    let row: serde_json::Value = serde_json::from_slice(output).expect("one JSON object");
    row["weights"]
        .as_str()
        .expect("the fingerprint of the weights")
        .to_owned()
}

#[test]
fn a_run_killed_twenty_times_ends_with_the_weights_of_one_left_alone() {
    let root = tempfile::tempdir().expect("a temporary folder");
    let (calm, hunted) = (root.path().join("calm"), root.path().join("hunted"));
    let began = std::time::Instant::now();
    let output = start(&calm).output().expect("stair train");
    let whole = began.elapsed();
    assert!(output.status.success(), "{output:?}");
    let expected = weights(&output.stdout);

    let mut rng = Rng::new(1, Stream::Test, 0);
    let mut n_killed = 0;
    while n_killed < N_KILLS {
        let is_started = hunted.join("config.toml").exists();
        let mut command = if is_started {
            go_on(&hunted)
        } else {
            start(&hunted)
        };
        let mut child = command.stdout(Stdio::null()).spawn().expect("stair train");
        let patience = Duration::from_secs_f64(whole.as_secs_f64() * rng.uniform_in(0.02, 0.25));
        std::thread::sleep(patience); // the moment of the kill is the point of this story
        child.kill().expect("SIGKILL");
        child.wait().expect("an ended process");
        n_killed += 1;
    }
    let output = go_on(&hunted).output().expect("stair train");
    assert!(output.status.success(), "{output:?}");
    assert_eq!(weights(&output.stdout), expected);
}
