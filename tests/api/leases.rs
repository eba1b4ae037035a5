//! The submit protocol: leases, answers, undo.

use std::collections::BTreeMap;

use serde_json::json;

use crate::support::TestApp;

#[test]
fn asked_again_the_leases_are_the_same_in_any_browser_of_the_labeler() {
    let app = TestApp::start(6);
    let ada = app.labeler("Ada");
    let first = ada.leases(3);
    assert_eq!(first.len(), 3);
    let without_time = |leases: Vec<serde_json::Value>| -> Vec<_> {
        leases
            .into_iter()
            .map(|l| (l["lease_id"].clone(), l["left"].clone(), l["right"].clone()))
            .collect()
    };
    assert_eq!(without_time(ada.leases(3)), without_time(first.clone()));
    assert_eq!(
        without_time(app.labeler(" ada ").leases(3)),
        without_time(first)
    );
}

#[test]
fn an_answer_is_stored_once_however_often_it_is_sent() {
    let app = TestApp::start(4);
    let ada = app.labeler("Ada");
    let lease = &ada.leases(1)[0];
    let stored = ada
        .answers(lease, &json!({"answer": "left"}))
        .expect(201)
        .json();
    let again = ada
        .answers(lease, &json!({"answer": "left"}))
        .expect(200)
        .json();
    assert_eq!(
        (&stored["answer_id"], &stored["sequence"]),
        (&again["answer_id"], &again["sequence"])
    );
    let other = ada
        .answers(lease, &json!({"answer": "right"}))
        .expect(409)
        .json();
    assert_eq!(other["existing"]["answer_id"], stored["answer_id"]);
    assert_eq!(other["existing"]["answer"], "left");
    assert_eq!(ada.labels().len(), 1);
}

#[test]
fn a_changed_mind_is_a_new_row_that_supersedes_the_old_one() {
    let app = TestApp::start(4);
    let ada = app.labeler("Ada");
    let lease = &ada.leases(1)[0];
    let first = ada
        .answers(lease, &json!({"answer": "left"}))
        .expect(201)
        .json();
    let change = json!({"answer": "equal", "supersedes": first["answer_id"]});
    let second = ada.answers(lease, &change).expect(201).json();
    assert_eq!(second["sequence"], 2);
    ada.answers(lease, &change).expect(200);
    ada.answers(lease, &json!({"answer": "left"})).expect(200); // the first one, delivered late
    ada.answers(
        lease,
        &json!({"answer": "right", "supersedes": first["answer_id"]}),
    )
    .expect(409);
    ada.answers(lease, &json!({"answer": "right", "supersedes": "nonsense"}))
        .expect(422);
    let labels = ada.labels();
    assert_eq!(labels.len(), 2);
    assert_eq!(
        (&labels[0]["is_current"], &labels[1]["is_current"]),
        (&json!(false), &json!(true))
    );
}

#[test]
fn a_word_that_does_not_answer_the_question_is_refused_with_the_words_that_do() {
    let app = TestApp::start(1);
    let ada = app.labeler("Ada");
    let leases = ada.leases(2);
    assert_eq!(leases[0]["question"], "preference");
    assert_eq!(leases[1]["question"], "same_stage");
    assert_eq!(
        leases[0]["left"], leases[1]["left"],
        "both questions show the same sides"
    );
    let told = ada
        .answers(&leases[0], &json!({"answer": "same"}))
        .expect(422)
        .json();
    assert!(
        told["detail"]
            .as_str()
            .is_some_and(|d| d.contains("left, right, equal or skip")),
        "{told}"
    );
    ada.answers(&leases[1], &json!({"answer": "left"}))
        .expect(422);
    ada.answers(&leases[0], &json!({"answer": "skip"}))
        .expect(422);
    ada.answers(&leases[0], &json!({"answer": "left", "unknown": 1}))
        .expect(422);
    let path = format!(
        "/api/v1/leases/{}/answer",
        leases[0]["lease_id"].as_str().expect("an id")
    );
    ada.send_with("PUT", &path, Some("{no json".into()), &[])
        .expect(400);
    ada.answers(&json!({"lease_id": "0123"}), &json!({"answer": "left"}))
        .expect(404);
    app.labeler("Bo")
        .answers(&leases[0], &json!({"answer": "left"}))
        .expect(403);
    app.stranger()
        .answers(&leases[0], &json!({"answer": "left"}))
        .expect(401);
    assert!(ada.labels().is_empty());
}

#[test]
fn a_skipped_query_uses_no_budget_and_withdraws_its_stage_question() {
    let app = TestApp::start(1);
    let ada = app.labeler("Ada");
    let leases = ada.leases(1);
    let skipped = ada
        .answers(&leases[0], &json!({"answer": "skip", "reason": "too dark"}))
        .expect(201)
        .json();
    assert!(ada.leases(3).is_empty());
    let run = ada
        .send("GET", &format!("/api/v1/runs/{}", app.run), None)
        .expect(200)
        .json();
    assert_eq!(run["labels"], 0);
    ada.answers(
        &leases[0],
        &json!({"answer": "left", "supersedes": skipped["answer_id"]}),
    )
    .expect(201);
    assert_eq!(ada.leases(3)[0]["question"], "same_stage");
    let run = ada
        .send("GET", &format!("/api/v1/runs/{}", app.run), None)
        .expect(200)
        .json();
    assert_eq!(run["labels"], 1);
}

#[test]
fn an_answer_about_the_stages_of_a_skipped_pair_is_told_to_be_kept_aside() {
    let app = TestApp::start(1);
    let ada = app.labeler("Ada");
    let leases = ada.leases(2);
    assert_eq!(leases[1]["question"], "same_stage");
    let skip = json!({"answer": "skip", "reason": "too dark"});
    let skipped = ada.answers(&leases[0], &skip).expect(201).json();
    // pressed before the page had heard of it, or in another tab
    let late = ada.answers(&leases[1], &json!({"answer": "same"}));
    let late = late.expect(410).json();
    assert_eq!(late["type"], "/problems/question-withdrawn");
    let told = late["detail"].as_str().expect("words");
    assert!(told.contains("kept aside"), "{told}");
    assert_eq!(ada.labels().len(), 1);

    let taken_back = json!({"answer": "left", "supersedes": skipped["answer_id"]});
    ada.answers(&leases[0], &taken_back).expect(201);
    assert_eq!(ada.leases(2)[0]["lease_id"], leases[1]["lease_id"]);
    ada.answers(&leases[1], &json!({"answer": "different"}))
        .expect(201);
    assert_eq!(ada.labels().len(), 3);
}

#[test]
fn each_question_is_in_one_labelers_hands_and_sides_are_balanced() {
    let app = TestApp::start(20);
    let (ada, bo) = (app.labeler("Ada"), app.labeler("Bo"));
    let (a, b) = (ada.leases(9), bo.leases(20));
    assert_eq!(a.len(), 9);
    let ids = |leases: &[serde_json::Value]| -> Vec<String> {
        leases
            .iter()
            .map(|l| format!("{} {}", l["query_id"], l["question"]))
            .collect()
    };
    assert!(ids(&a).iter().all(|id| !ids(&b).contains(id)));
    for (who, leases) in [(&ada, &a), (&bo, &b)] {
        for lease in leases {
            let word = if lease["question"] == "preference" {
                "left"
            } else {
                "same"
            };
            who.answers(lease, &json!({"answer": word})).expect(201);
        }
    }
    let mut surplus: BTreeMap<String, i32> = BTreeMap::new();
    for label in ada
        .labels()
        .iter()
        .filter(|label| label["question"] == "preference")
    {
        let step = if label["meaning"] == "first" { 1 } else { -1 };
        *surplus.entry(label["labeler"].to_string()).or_default() += step;
    }
    assert!(surplus.values().all(|s| s.abs() <= 1), "{surplus:?}");
}

#[test]
fn sequence_numbers_have_no_gaps() {
    let app = TestApp::start(8);
    let ada = app.labeler("Ada");
    for _ in 0..8 {
        let lease = &ada.leases(1)[0];
        let word = if lease["question"] == "preference" {
            "right"
        } else {
            "different"
        };
        ada.answers(lease, &json!({"answer": word})).expect(201);
    }
    let labels = ada.labels();
    let of = |kind: &str| -> Vec<i64> {
        labels
            .iter()
            .filter(|l| l["question"] == kind)
            .filter_map(|l| l["sequence"].as_i64())
            .collect()
    };
    for kind in ["preference", "same_stage"] {
        let numbers = of(kind);
        assert!(
            numbers.iter().zip(1..).all(|(n, i)| *n == i),
            "{kind}: {numbers:?}"
        );
    }
}
