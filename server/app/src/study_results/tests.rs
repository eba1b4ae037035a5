use super::*;

fn label(item: i64, labeler: &str, role: &str, meaning: &str) -> Label {
    let question = if matches!(meaning, "same" | "different") {
        "same_stage"
    } else {
        "preference"
    };
    let pressed = match meaning {
        "first" => "left",
        "second" => "right",
        other => other,
    };
    let row = json!({
        "answer_id": format!("{labeler}{item}{role}"), "run_id": 1, "task": "push", "method": null, "seed": 0,
        "question": question, "sequence": 1, "query_id": item, "session": 1, "position": 0, "labeler": labeler,
        "pressed": pressed, "meaning": meaning, "left_is": "first", "reason": null, "supersedes": null,
        "is_current": true, "first_episode": 0, "first_start": 10, "first_clip": null, "second_episode": 0,
        "second_start": 30, "second_clip": null, "segment_len": 20, "disagreement": null, "stage_gap": null,
        "guidance_sha256": null, "visible_ms": null, "hidden_ms": null, "loops": null, "seeks": null, "speed": null,
        "dropped_frames": null, "input": null, "stored_at": "", "study_id": 1, "item_id": item, "role": role,
        "expects": null,
    });
    serde_json::from_value(row).unwrap()
}

fn value(results: &Results, name: &str) -> f64 {
    let found = results.measures.iter().find(|m| m.name == name);
    found
        .unwrap_or_else(|| panic!("{name} of {:#?}", results.measures))
        .value
}

#[test]
fn practice_checks_repeats_skips_and_replaced_answers_count_for_nothing() {
    let replaced = Label {
        is_current: false,
        ..label(2, "a", "counted", "first")
    };
    let labels = [
        label(1, "a", "counted", "second"),
        replaced,
        label(2, "a", "counted", "equal"),
        label(3, "a", "counted", "skip"),
        label(4, "a", "practice", "first"),
        label(5, "a", "check", "first"),
        label(1, "a", "repeat", "first"),
    ];
    let results = results(&labels);
    assert_eq!(results.n_answers, 2);
    assert_eq!(value(&results, "ties, push").to_bits(), 0.5_f64.to_bits());
    assert_eq!(
        value(&results, "later segment preferred, push").to_bits(),
        1.0_f64.to_bits()
    );
    assert_eq!(
        value(&results, "same answer to a repeat").to_bits(),
        0.0_f64.to_bits()
    );
    let scatter = &results.figures[0];
    assert_eq!(
        (scatter.name, scatter.rows.lines().count()),
        ("preference-scatter", 2)
    );
    assert!(
        scatter
            .rows
            .contains(r#""preference":"second","t_x":10,"t_y":30"#),
        "{}",
        scatter.rows
    );
}

#[test]
fn nothing_is_told_by_method_while_methods_are_hidden() {
    let hidden: Vec<Label> = (0..8)
        .map(|item| {
            label(
                item,
                "a",
                "counted",
                if item < 6 { "same" } else { "different" },
            )
        })
        .collect();
    let blind = results(&hidden);
    assert!(blind.figures.is_empty());
    assert_eq!(
        value(&blind, "same stage, push").to_bits(),
        0.75_f64.to_bits()
    );
    let told: Vec<Label> = hidden
        .into_iter()
        .map(|label| Label {
            method: Some(
                if label.query_id < 4 {
                    "stair"
                } else {
                    "pebble"
                }
                .to_owned(),
            ),
            ..label
        })
        .collect();
    let backwards: Vec<Label> = told.iter().rev().cloned().collect();
    let told = results(&told);
    let difference = "stair − pebble, push";
    let again = results(&backwards);
    for results in [&told, &again] {
        // All of STAIR's pairs and half of PEBBLE's, whoever answered first.
        assert_eq!(value(results, difference).to_bits(), 0.5_f64.to_bits());
    }
    assert_eq!(told.figures[0].name, "same-stage-bars");
    let first = |results: &Results| results.figures[0].rows.lines().next().map(str::to_owned);
    assert!(first(&again).is_some_and(|row| row.contains("stair")));
}

#[test]
fn two_labelers_who_always_agree_have_a_kappa_of_one() {
    let answers = ["first", "second", "equal", "first"];
    let labels: Vec<Label> = ["a", "b"]
        .iter()
        .flat_map(|who| {
            (1..)
                .zip(answers)
                .map(move |(n, word)| label(n, who, "counted", word))
        })
        .collect();
    let results = results(&labels);
    for name in [
        "agreement of two labelers",
        "Fleiss' κ",
        "Krippendorff's α",
        "Cohen's κ",
    ] {
        assert!((value(&results, name) - 1.0).abs() < 1e-12, "{name}");
    }
}
