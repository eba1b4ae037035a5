use std::sync::OnceLock;

use super::trajectory::{HAND_TOLERANCE_M, OBJECT_TOLERANCE};
use super::*;
use crate::tasks::tasks;

fn repository() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../..")
}

fn replay(text: &str) -> Report {
    let mut replay = Replay::new();
    replay.text("recording.jsonl", text.as_bytes());
    replay.finish()
}

fn a_transition() -> String {
    let path = repository().join("tests/golden/window-open_v3.jsonl");
    let text = fs::read_to_string(path).expect("the recording is part of the repository");
    text.lines().next().expect("it has a line").into()
}

/// What the repository's recordings come to, replayed once.
fn packed() -> &'static Report {
    static REPORT: OnceLock<Report> = OnceLock::new();
    REPORT.get_or_init(|| {
        let folder = repository().join("tests/golden");
        let mut replay = Replay::new();
        for file in find_recordings(&[folder]).expect("the folder is there") {
            replay.file(&file).expect("recordings can be read");
        }
        replay.finish()
    })
}

/// Recordings and fields that have to be compared before a task counts as reproduced.
fn wanted(task: &str) -> Vec<(String, &'static str)> {
    if metaworld::knows(task) {
        let mut wanted = vec![
            (format!("{task} v2 transitions"), "observation 18-35"),
            (format!("{task} v2 resets"), "observation 0-3"),
            (format!("{task} v3 resets"), "observation 18-21"),
            (format!("{task} v2 trajectories"), "success"),
        ];
        for version in ["v2", "v3"] {
            for field in ["reward", "success", "observation 0-17"] {
                wanted.push((format!("{task} {version} transitions"), field));
            }
        }
        return wanted;
    }
    if robodesk::knows(task) {
        return vec![
            (format!("{task} steps"), "reward"),
            (format!("{task} steps"), "success"),
            (format!("{task} steps"), "observation 34-67"),
            (format!("{task} steps"), "target, end effector"),
            (format!("{task} states"), "success"),
            ("panda kinematics".into(), "inertia"),
        ];
    }
    // The control suite's, whose names have underscores and begin with the robot's.
    let robot = task.split('-').next().unwrap_or_default();
    let (states, kinematics) = (
        format!("{} states", task.replace('-', "_")),
        format!("{robot}_kinematics"),
    );
    vec![
        (states.clone(), "reward"),
        (states, "observation"),
        (kinematics.clone(), "positions"),
        (kinematics.clone(), "inertia matrix"),
        (kinematics, "gravity load"),
    ]
}

/// What is [`wanted`] of a task and was not compared.
fn missing(report: &Report, task: &str) -> Vec<(String, &'static str)> {
    let was_compared = |recording: &str, field: &str| {
        let fields = &mut report.fields.iter();
        fields.any(|f| f.recording == recording && f.field == field)
    };
    let mut wanted = wanted(task);
    wanted.retain(|(recording, field)| !was_compared(recording, field));
    wanted
}

#[test]
fn the_recordings_of_the_originals_are_reproduced() {
    let report = packed();
    assert_eq!(report.malformed, Vec::<String>::new());
    assert!(report.n_checked > 1000, "{} lines", report.n_checked);
    for field in &report.fields {
        assert!(field.is_within_tolerance(), "{field:?}");
    }
}

#[test]
fn every_task_that_has_an_original_is_compared_with_it() {
    for task in tasks() {
        // Our own, which has no original.
        if task.name != "go-fetch-return" {
            assert_eq!(missing(packed(), task.name), [], "{}", task.name);
        }
    }
}

#[test]
fn a_task_without_recordings_is_noticed() {
    assert!(!missing(packed(), "humanoid-run").is_empty());
    for task in ["sweep-into", "push-green", "walker-run"] {
        let stem = task.replace('-', "_");
        let mut report = packed().clone();
        let is_its =
            |f: &FieldReport| f.recording.starts_with(task) || f.recording.starts_with(&stem);
        report.fields.retain(|f| !is_its(f));
        assert!(!missing(&report, task).is_empty(), "{task}");
    }
}

/// There the hand slips in behind the handle and turns it back, here friction holds it: only the
/// hand is compared.
const SLIPS_IN: &str = "faucet-open v2 expert, seed 301";
/// The hand is free for one step, over which an rms says nothing: only the object is compared.
const HARDLY_FREE: &str = "door-unlock v2 expert, seed 300";

/// Where a fist slips off a handle, a millimetre decides: of the larger set that the packed
/// recordings are taken from, two episodes are compared in part.
#[test]
fn our_physics_follows_the_recorded_experts() {
    let experts = || packed().dynamics.iter().filter(|d| d.is_expert);
    for d in experts() {
        if d.recording != HARDLY_FREE {
            assert!(d.n_free > 5 && d.hand_rms_m <= HAND_TOLERANCE_M, "{d:?}");
        }
        if d.recording != SLIPS_IN {
            assert!(d.object_error() <= OBJECT_TOLERANCE, "{d:?}");
        }
    }
    for known in metaworld::TASKS {
        let is_its = |d: &DynamicsReport| d.recording.starts_with(&format!("{} ", known.name));
        assert!(experts().any(is_its), "{} has no trajectory", known.name);
    }
}

#[test]
fn a_reset_shows_the_object_unless_the_original_shows_the_one_before() {
    for (task, is_compared) in [
        ("door-open", true),
        ("door-unlock", true),
        ("sweep-into", true),
        ("window-open", false),
        ("window-close", false),
        ("drawer-open", false),
        ("faucet-open", false),
    ] {
        let path = repository().join(format!("tests/golden/{task}_resets.jsonl"));
        let text = fs::read_to_string(path).expect("the recording is part of the repository");
        for line in text.lines() {
            let mut reset: serde_json::Value = serde_json::from_str(line).expect("it is JSON");
            assert!(replay(&reset.to_string()).is_within_tolerance(), "{task}");
            let shown = reset["obs"][5].as_f64().expect("a number");
            reset["obs"][5] = serde_json::json!(shown + 2e-5);
            let report = replay(&reset.to_string());
            let wrong = report.fields.iter().filter(|f| !f.is_within_tolerance());
            let wrong: Vec<_> = wrong.map(|f| f.field).collect();
            let found = ["observation 4-6"];
            assert_eq!(wrong, &found[..usize::from(is_compared)], "{task}");
        }
    }
}

#[test]
fn what_is_no_number_is_out_of_any_tolerance() {
    let mut checks = Checks::new("a recording".into());
    checks.numbers("reward", &[1.0, f64::NAN], &[1.0, 1.0], 10.0);
    assert!(checks.checks[0].error > 10.0);
    let errors = one_step::Errors {
        name: "q0".into(),
        errors: vec![0.1, f64::NAN],
    };
    assert!(errors.largest() > 0.1);
}

#[test]
fn a_wrong_reward_and_a_wrong_success_are_found() {
    let line = a_transition();
    let mut value: serde_json::Value = serde_json::from_str(&line).expect("it is JSON");
    assert!(replay(&line).is_within_tolerance());
    value["r"] = serde_json::json!(value["r"].as_f64().expect("a number") + 2e-6);
    value["success"] = serde_json::json!(1);
    let report = replay(&value.to_string());
    let wrong: Vec<_> = report
        .fields
        .iter()
        .filter(|f| !f.is_within_tolerance())
        .collect();
    assert_eq!(wrong.len(), 2, "{wrong:?}");
    assert!(wrong.iter().all(|f| f.worst == "recording.jsonl:1"));
}

#[test]
fn a_state_of_the_control_suite_that_differs_is_found() {
    let path = repository().join("tests/golden/walker_run.jsonl");
    let text = fs::read_to_string(path).expect("the recording is part of the repository");
    let line = text
        .lines()
        .find(|line| line.contains("\"step\""))
        .expect("it has a step");
    let replay = |line: &str| {
        let mut replay = Replay::new();
        replay.text("walker_run.jsonl", line.as_bytes());
        replay.finish()
    };
    assert!(replay(line).is_within_tolerance());
    let mut value: serde_json::Value = serde_json::from_str(line).expect("it is JSON");
    value["qvel"][1] = serde_json::json!(value["qvel"][1].as_f64().expect("a number") + 0.01);
    let report = replay(&value.to_string());
    let wrong = report.fields.iter().filter(|f| !f.is_within_tolerance());
    let wrong: Vec<_> = wrong.map(|f| f.field).collect();
    assert!(
        wrong.contains(&"observation") && wrong.contains(&"speed"),
        "{wrong:?}"
    );
    value["qpos"] = serde_json::json!([1.0]);
    let report = replay(&value.to_string());
    assert_eq!(
        report.malformed,
        ["walker_run.jsonl:1: qpos has 1 numbers, not 9"]
    );
}

#[test]
fn lines_that_make_no_sense_are_named_and_the_rest_is_still_checked() {
    let line = a_transition();
    let missing = line.replace("\"tcp\"", "\"tcq\"");
    let text = format!("{{\"task\":\n\n{line}\n[1]\n{missing}\n");
    let report = replay(&text);
    assert_eq!(report.n_checked, 1);
    assert_eq!(report.malformed.len(), 3, "{:?}", report.malformed);
    assert!(report.malformed[0].starts_with("recording.jsonl:1: this is no JSON"));
    assert!(report.malformed[1].starts_with("recording.jsonl:4: "));
    assert!(
        report.malformed[2].contains("missing field `tcp`"),
        "{:?}",
        report.malformed
    );
}

#[test]
fn other_tasks_and_kinds_are_skipped_with_a_word() {
    let report = replay("{\"task\":\"chess\"}\n{\"kind\":\"reset\"}\n{\"task\":\"window-open\"}\n");
    assert_eq!((report.n_checked, report.malformed.len()), (0, 0));
    let reasons: Vec<_> = report.skipped.keys().map(String::as_str).collect();
    assert_eq!(
        reasons,
        [
            "task chess is not known",
            "task recording is not known",
            "window-open: neither a transition, a reset nor a trajectory",
        ]
    );
}

#[test]
fn a_path_that_is_not_there_is_named() {
    let error = find_recordings(&[PathBuf::from("no/such/folder")]).expect_err("it is not there");
    assert!(error.to_string().contains("no/such/folder"));
}

#[test]
fn a_light_on_the_wrong_side_and_a_heavier_link_are_found() {
    let lines = |file: &str| {
        let path = repository().join("tests/golden").join(file);
        fs::read_to_string(path).expect("the recording is part of the repository")
    };
    let states = lines("push-green.jsonl");
    let mut state = states
        .lines()
        .map(|line| serde_json::from_str::<serde_json::Value>(line).expect("it is JSON"))
        .find(|line| line["kind"] == "state")
        .expect("some lines are states");
    state["task"] = "push-green".into();
    assert!(replay(&state.to_string()).is_within_tolerance());
    let is_lit = state["reward_sparse"].as_f64() == Some(1.0);
    state["light"] = if is_lit { 0.0 } else { -0.005 }.into();
    let report = replay(&state.to_string());
    let wrong = |field| {
        report
            .fields
            .iter()
            .find(|f| f.field == field)
            .map(|f| !f.is_within_tolerance())
    };
    assert_eq!(wrong("success"), Some(true));

    let mut arm: serde_json::Value = serde_json::from_str(
        lines("panda_kinematics.jsonl")
            .lines()
            .next()
            .expect("a line"),
    )
    .expect("it is JSON");
    arm["task"] = "panda_kinematics".into();
    assert!(replay(&arm.to_string()).is_within_tolerance());
    arm["mass_matrix"][1][1] =
        (arm["mass_matrix"][1][1].as_f64().expect("a number") * 1.001).into();
    let report = replay(&arm.to_string());
    let wrong = report.fields.iter().filter(|f| !f.is_within_tolerance());
    assert_eq!(wrong.map(|f| f.field).collect::<Vec<_>>(), ["inertia"]);
}
