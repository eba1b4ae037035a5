use super::*;

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

#[test]
fn the_recordings_of_the_originals_are_reproduced() {
    let mut replay = Replay::new();
    for file in find_recordings(&[repository().join("tests/golden")]).expect("the folder is there")
    {
        replay.file(&file).expect("recordings can be read");
    }
    let report = replay.finish();
    assert_eq!(report.malformed, Vec::<String>::new());
    assert!(report.n_checked > 1000, "{} lines", report.n_checked);
    for field in &report.fields {
        assert!(field.is_within_tolerance(), "{field:?}");
    }
    let has = |recording: &str, field: &str| {
        let fields = &mut report.fields.iter();
        fields.any(|f| f.recording == recording && f.field == field)
    };
    for task in figures::REFERENCES.map(|reference| reference.task) {
        for version in ["v2", "v3"] {
            for field in ["reward", "success", "observation 0-17"] {
                let recording = format!("{task} {version} transitions");
                assert!(has(&recording, field), "{recording}: {field}");
            }
        }
        assert!(has(&format!("{task} v2 transitions"), "observation 18-35"));
        assert!(has(&format!("{task} v3 resets"), "observation 18-21"));
        assert!(has(&format!("{task} v2 trajectories"), "success"));
    }
    for field in [
        "reward",
        "success",
        "observation 34-67",
        "target, end effector",
    ] {
        assert!(has("push-green steps", field), "{field}");
    }
    assert!(has("push-green states", "success"));
    assert!(has("panda kinematics", "inertia"));
    for task in [
        "walker_run",
        "cheetah_run",
        "quadruped_walk",
        "quadruped_run",
    ] {
        for field in ["reward", "observation"] {
            assert!(has(&format!("{task} states"), field), "{task}: {field}");
        }
    }
    for robot in ["walker", "cheetah", "quadruped"] {
        for field in ["positions", "inertia matrix", "gravity load"] {
            let recording = format!("{robot}_kinematics");
            assert!(has(&recording, field), "{recording}: {field}");
        }
    }
}

/// One expert's episode of each task. Others can end elsewhere: where a fist slips off a handle,
/// a millimetre decides.
#[test]
fn our_physics_follows_the_recorded_actions() {
    let mut replay = Replay::new();
    for file in find_recordings(&[repository().join("tests/golden")]).expect("the folder is there")
    {
        replay.file(&file).expect("recordings can be read");
    }
    let report = replay.finish();
    for task in figures::REFERENCES.map(|reference| reference.task) {
        let is_its = |d: &&DynamicsReport| d.recording.starts_with(task);
        let dynamics = report.dynamics.iter().find(is_its).expect("a trajectory");
        assert!(dynamics.n_free > 5, "{dynamics:?}");
        assert!(dynamics.is_within_tolerance(), "{dynamics:?}");
    }
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
