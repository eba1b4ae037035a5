//! A grid of runs: run once, killed in between, gone on with, reported.

use std::path::Path;
use std::process::{Command, Stdio};

use super::server_process::{ServerProcess, stair, wait_for};

/// Two methods, two seeds, a second or two each.
const GRID: &str = r#"
title = "A small grid"
set = [
  "training.total_steps=1500", "training.seed_steps=300", "training.checkpoint_every=150",
  "feedback.first_step=600", "feedback.every=300", "feedback.queries_per_session=5",
  "feedback.budget=10", "evaluation.every=300", "evaluation.episodes=5",
  "agent.hidden=[32, 32]", "agent.batch=64", "reward.hidden=[32, 32]",
  "temporal.update_every=8", "temporal.batch=64", "temporal.block_episodes=2",
  "environment.n_envs=2",
]

[axes]
tasks = ["go-fetch-return"]
methods = ["stair", "pebble"]
seeds = 2
"#;

fn run(here: &Path, out: &str) -> Command {
    let mut command = stair();
    command
        .args([
            "experiment",
            "run",
            "grid.toml",
            "--jobs",
            "2",
            "--out",
            out,
        ])
        .current_dir(here)
        .stdout(Stdio::piped());
    command
}

fn said(mut command: Command) -> String {
    let output = command.stderr(Stdio::piped()).output().expect("stair");
    let errors = String::from_utf8_lossy(&output.stderr).into_owned();
    assert!(output.status.success(), "{errors}");
    String::from_utf8_lossy(&output.stdout).into_owned()
}

/// Name of each finished run with the fingerprint of its weights, in order of names.
fn finished(rows: &Path) -> Vec<(String, String)> {
    let text = std::fs::read_to_string(rows).unwrap_or_default();
    let mut runs: Vec<(String, String)> = text
        .lines()
        .map(|line| serde_json::from_str::<serde_json::Value>(line).expect("JSON"))
        .filter(|row| row["kind"] == "finished")
        .map(|row| {
            (
                format!("{} {}", row["method"], row["seed"]),
                row["weights"].to_string(),
            )
        })
        .collect();
    runs.sort();
    runs
}

#[test]
fn a_grid_that_is_killed_in_between_ends_as_one_left_alone_and_is_reported() {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let here = folder.path();
    std::fs::write(here.join("grid.toml"), GRID).expect("a file");

    let first = said(run(here, "calm"));
    assert!(
        first.contains("4 of 4 runs are finished, 0 of them before"),
        "{first}"
    );
    let rows = here.join("calm/results.jsonl");
    let before = std::fs::read(&rows).expect("rows");
    let again = said(run(here, "calm"));
    assert!(again.contains("4 of them before this start"), "{again}");
    assert_eq!(
        std::fs::read(&rows).expect("rows"),
        before,
        "nothing was run twice"
    );

    let mut hunted = run(here, "hunted").spawn().expect("stair");
    let started = here.join("hunted/runs/go-fetch-return.stair.oracle.1/config.toml");
    wait_for("a run to have begun", || started.exists());
    hunted.kill().expect("SIGKILL");
    hunted.wait().expect("an ended process");
    let after_kill = finished(&here.join("hunted/results.jsonl")).len();
    assert!(after_kill < 4, "the kill came too late to mean anything");
    let on = said(run(here, "hunted"));
    assert!(on.contains("4 of 4 runs are finished"), "{on}");
    let (calm, hunted) = (
        finished(&rows),
        finished(&here.join("hunted/results.jsonl")),
    );
    assert_eq!(calm.len(), 4);
    assert_eq!(hunted, calm, "the same weights");

    let report = || {
        let mut command = stair();
        command
            .args(["experiment", "report", "calm"])
            .current_dir(here);
        said(command);
        [
            "report.md",
            "success.svg",
            "success.png",
            "success.csv",
            "stage-gaps.svg",
        ]
        .map(|name| std::fs::read(here.join("calm/report").join(name)).expect("a file"))
    };
    let once = report();
    assert!(report() == once, "the same bytes");
    let table = String::from_utf8_lossy(&once[0]).into_owned();
    assert!(table.contains("| stair − pebble | 2 |"), "{table}");
    look_at_the_pages(here);
}

/// What the browser shows of a folder of results.
fn look_at_the_pages(here: &Path) {
    let data = here.join("data");
    std::fs::create_dir_all(data.join("experiments")).expect("a folder");
    std::fs::rename(here.join("calm"), data.join("experiments/calm")).expect("moved results");
    std::fs::create_dir_all(data.join("experiments/empty")).expect("a folder");
    let server = ServerProcess::start(&data);
    let page = |path: &str| {
        server
            .ask("GET", path, None)
            .as_str()
            .unwrap_or_default()
            .to_owned()
    };
    let list = page("/experiments");
    assert!(
        list.contains("A small grid") && list.contains("/experiments/calm"),
        "{list}"
    );
    let one = page("/experiments/calm");
    for word in [
        "4 of 4 runs",
        "stair − pebble",
        "/experiments/calm/success.svg",
        "stage-gaps.svg",
    ] {
        assert!(one.contains(word), "'{word}' is not in: {one}");
    }
    assert!(page("/experiments/calm/success.svg").starts_with("<svg"));
    assert!(page("/experiments/calm/success.csv").starts_with("task,method"));
    assert!(page("/experiments/empty").contains("No run is finished yet"));
}

/// As after `stair experiment run robodesk --out robodesk`.
#[test]
fn a_folder_does_not_hide_the_grid_of_its_name() {
    let folder = tempfile::tempdir().expect("a temporary folder");
    std::fs::create_dir(folder.path().join("robodesk")).expect("a folder");
    let mut command = stair();
    command
        .args(["experiment", "check", "robodesk"])
        .current_dir(folder.path());
    let told = said(command);
    assert!(told.contains("push-green.stair.oracle.1"), "{told}");
}

#[test]
fn a_run_that_fails_is_marked_and_stops_no_other() {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let here = folder.path();
    let fails = GRID.replace("seeds = 2", "seeds = 1")
        + "\n[[setting]]\nname = \"small\"\n\n[[setting]]\nname = \"on no card\"\nset = [\"device=cuda:7\"]\n";
    std::fs::write(here.join("grid.toml"), fails).expect("a file");
    let output = run(here, "out").output().expect("stair");
    assert_eq!(output.status.code(), Some(1));
    let told = String::from_utf8_lossy(&output.stdout).into_owned();
    assert!(told.contains("2 of 4 runs are finished"), "{told}");
    assert!(
        told.contains("Failed: go-fetch-return.stair.oracle.on-no-card.1:"),
        "{told}"
    );
    // With libtorch's part for cards, how many there are; without, where it would be looked for.
    let says_why = told.contains("CUDA cards") || told.contains("LD_LIBRARY_PATH");
    assert!(says_why, "{told}");
    let rows = std::fs::read_to_string(here.join("out/results.jsonl")).expect("rows");
    assert_eq!(rows.matches("\"kind\":\"failed\"").count(), 2, "{rows}");
}

#[test]
fn an_experts_steps_are_told_apart_twice_with_the_same_bytes() {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let here = folder.path();
    let watched = |out: &str| {
        let mut command = stair();
        command
            .args(["experiment", "timestep-classifier", "--out", out])
            .args(["--task", "go-fetch-return", "--episodes", "4"])
            .current_dir(here);
        let said = said(command);
        let names = [
            "timestep-classifier.jsonl",
            "timestep-classifier.md",
            "timestep-classifier.svg",
            "timestep-classifier.png",
            "go-fetch-return.jsonl",
            "stage-map.svg",
        ];
        names.map(|name| {
            assert!(said.contains(&format!("{out}/{name}")), "{said}");
            std::fs::read(here.join(out).join(name)).expect("a file")
        })
    };
    let once = watched("once");
    assert!(watched("again") == once, "the same bytes");
    let row: serde_json::Value = serde_json::from_slice(&once[0]).expect("JSON");
    assert_eq!(row["held_out"]["n_states"], 200);

    let mut figure = stair();
    let rows = ["figure", "stage-map", "once/go-fetch-return.jsonl"];
    figure.args(rows).args(["--out", "map.svg"]);
    figure.current_dir(here);
    said(figure);
    let map = std::fs::read(here.join("map.svg")).expect("a figure");
    assert!(
        map == once[5],
        "the figure maker draws the same from the rows"
    );
}
