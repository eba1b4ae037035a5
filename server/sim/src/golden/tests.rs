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
    assert!(report.n_checked > 150, "{} lines", report.n_checked);
    for field in &report.fields {
        assert!(field.is_within_tolerance(), "{field:?}");
    }
    let has = |recording: &str, field: &str| {
        let fields = &mut report.fields.iter();
        fields.any(|f| f.recording == recording && f.field == field)
    };
    for recording in ["window-open v2 transitions", "window-open v3 transitions"] {
        for field in ["reward", "success", "observation 0-17"] {
            assert!(has(recording, field), "{recording}: {field}");
        }
    }
    assert!(has("window-open v2 transitions", "observation 18-35"));
    assert!(has("window-open v3 resets", "observation 18-21"));
    assert!(has("window-open v2 trajectories", "reward"));
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
