//! What a labeler's browser receives tells nothing about where a query comes from.

use serde_json::json;

use crate::support::TestApp;

#[test]
fn nothing_in_a_lease_or_its_headers_tells_the_method_or_the_truth() {
    let app = TestApp::start(4);
    let ada = app.labeler("Ada");
    let path = format!("/api/v1/runs/{}/leases", app.run);
    let reply = ada
        .send("POST", &path, Some(&json!({"count": 3})))
        .expect(200);
    let headers = format!("{:?}", reply.headers);
    for word in [
        "stair",
        "pebble",
        "method",
        "disagreement",
        "gap",
        "reward",
        "episode",
        "first",
        "second",
    ] {
        assert!(!reply.text.contains(word), "'{word}' is in {}", reply.text);
        assert!(!headers.contains(word), "'{word}' is in {headers}");
    }
    let keys: Vec<String> = reply.json()["leases"][0]
        .as_object()
        .expect("an object")
        .keys()
        .cloned()
        .collect();
    assert_eq!(
        keys,
        [
            "expires_at",
            "lease_id",
            "left",
            "query_id",
            "question",
            "right"
        ]
    );
}

#[test]
fn task_rewards_are_for_programs_of_the_run_alone() {
    let app = TestApp::start(2);
    let ada = app.labeler("Ada");
    let query = ada.leases(1)[0]["query_id"].to_string();
    let path = format!("/api/v1/queries/{query}/task-rewards");
    ada.send("GET", &path, None).expect(403);
    app.stranger().send("GET", &path, None).expect(401);
    ada.send(
        "POST",
        &format!("/api/v1/runs/{}/teacher-tokens", app.run),
        Some(&json!({})),
    )
    .expect(403);
    let program = app.program();
    let truth = program.send("GET", &path, None).expect(200).json();
    assert_eq!(truth["same_stage"], true);
    assert_eq!(truth["typical_reward"], 3.0);
    let sums = [&truth["left"], &truth["right"]].map(|side| {
        side.as_array()
            .expect("rewards")
            .iter()
            .filter_map(serde_json::Value::as_f64)
            .sum::<f64>()
    });
    let expected = if truth["left_is"] == "first" {
        [4.0, 8.0]
    } else {
        [8.0, 4.0]
    };
    assert!(
        (sums[0] - expected[0]).abs() < 1e-9 && (sums[1] - expected[1]).abs() < 1e-9,
        "{sums:?}"
    );
    program
        .send("GET", "/api/v1/queries/999/task-rewards", None)
        .expect(404);
}
