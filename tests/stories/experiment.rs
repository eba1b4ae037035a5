//! A grid of runs from one file: kept, taken up again, reported.

use std::path::Path;
use std::process::{Command, Output, Stdio};

const FILE: &str = r#"
title = "A small grid"
summary = "Two methods, two seeds."

[[grid]]
tasks = ["go-fetch-return"]
methods = ["stair", "uniform"]
seeds = 2
set = [
    "training.total_steps=2400",
    "training.seed_steps=200",
    "training.checkpoint_every=300",
    "feedback.first_step=600",
    "feedback.every=400",
    "feedback.queries_per_session=4",
    "feedback.budget=12",
    "evaluation.every=600",
    "evaluation.episodes=3",
    "agent.hidden=[32, 32]",
    "agent.batch=64",
    "reward.hidden=[32, 32]",
    "temporal.update_every=8",
    "temporal.batch=64",
]
"#;

fn experiment(action: &str, at: &Path, out: Option<&Path>) -> Command {
    let mut command = Command::new(env!("CARGO_BIN_EXE_stair"));
    command.args(["experiment", action]).arg(at);
    if let Some(out) = out {
        command.arg("--out").arg(out);
    }
    command.stdin(Stdio::null());
    command
}

fn run(file: &Path, out: &Path) -> Output {
    let output = experiment("run", file, Some(out)).output();
    output.expect("stair experiment run")
}

fn said(output: &Output) -> String {
    let streams = [output.stdout.as_slice(), output.stderr.as_slice()].concat();
    String::from_utf8(streams).expect("text")
}

/// The rows of a run without what differs from one time to the next.
fn weights(out: &Path, name: &str) -> String {
    let path = out.join("results").join(format!("{name}.jsonl"));
    let text = std::fs::read_to_string(path).expect("a result");
    let first = text.lines().next().expect("a row");
    let row: serde_json::Value = serde_json::from_str(first).expect("JSON");
    assert_eq!(row["outcome"], "finished", "{row}");
    row["weights"].as_str().expect("weights").to_owned()
}

#[test]
fn a_grid_is_run_once_taken_up_again_and_reported() {
    let root = tempfile::tempdir().expect("a temporary folder");
    let file = root.path().join("grid.toml");
    std::fs::write(&file, FILE).expect("written");
    let (calm, hunted) = (root.path().join("calm"), root.path().join("hunted"));
    let output = run(&file, &calm);
    assert!(output.status.success(), "{}", said(&output));
    let again = said(&run(&file, &calm));
    assert!(again.contains("nothing to do"), "{again}");

    // killed in the middle, its runs stop at checkpoints by themselves and are taken up again
    let mut child = experiment("run", &file, Some(&hunted))
        .stdout(Stdio::null())
        .spawn()
        .expect("stair experiment run");
    let metrics = hunted.join("runs/go-fetch-return-stair-1/metrics.jsonl");
    while !std::fs::read_to_string(&metrics).is_ok_and(|text| text.contains("evaluation")) {
        std::thread::yield_now();
    }
    child.kill().expect("killed");
    child.wait().expect("it ended");
    let runs = || std::fs::read_dir(hunted.join("runs")).expect("runs");
    let is_free = |folder: &Path| {
        // a run that still writes keeps its log growing; the next command would meet it
        let log = folder.file_name().expect("a name");
        let log = hunted.join("logs").join(log).with_extension("log");
        std::fs::read_to_string(log).is_ok_and(|text| text.contains("Stopped at step"))
            || std::fs::read_to_string(folder.join("metrics.jsonl"))
                .is_ok_and(|text| text.contains("\"finished\""))
    };
    while !runs().all(|run| is_free(&run.expect("a run").path())) {
        std::thread::yield_now();
    }
    let output = run(&file, &hunted);
    assert!(output.status.success(), "{}", said(&output));
    for name in ["stair-1", "uniform-1", "stair-2", "uniform-2"] {
        let name = format!("go-fetch-return-{name}");
        assert_eq!(weights(&hunted, &name), weights(&calm, &name), "{name}");
    }

    let output = experiment("report", &calm, None).output().expect("report");
    assert!(output.status.success(), "{}", said(&output));
    let text = said(&output);
    assert!(
        text.contains("# A small grid") && text.contains("| uniform |"),
        "{text}"
    );
    for name in [
        "success.svg",
        "success.png",
        "success.csv",
        "stage-gap.svg",
        "runs.csv",
    ] {
        assert!(calm.join("report").join(name).exists(), "{name}");
    }

    let other = root.path().join("other.toml");
    std::fs::write(&other, FILE.replace("2400", "2600")).expect("written");
    let output = run(&other, &calm);
    assert_eq!(output.status.code(), Some(2), "{}", said(&output));
    assert!(said(&output).contains("total_steps"), "{}", said(&output));
}

#[test]
fn ready_experiments_and_their_small_variants_are_right() {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../assets/experiments");
    let mut n_files = 0;
    for entry in std::fs::read_dir(folder).expect("ready files") {
        let path = entry.expect("an entry").path();
        for small in [false, true] {
            let mut check = experiment("check", &path, None);
            if small {
                check.arg("--small");
            }
            let output = check.output().expect("stair experiment check");
            assert!(
                output.status.success(),
                "{}: {}",
                path.display(),
                said(&output)
            );
            assert!(said(&output).contains("of this machine"));
        }
        n_files += 1;
    }
    assert!(n_files >= 8, "{n_files}");
}
