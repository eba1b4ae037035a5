//! A server that is stopped in the middle of a session goes on with it.

use std::collections::BTreeSet;

use serde_json::{Value, json};

use super::server_process::{ServerProcess, ask, id_text, wait_for};

fn settings() -> Value {
    json!({
        "training": {"total_steps": 1500, "seed_steps": 200, "updates_per_step": 0.02},
        "agent": {"hidden": [16, 16], "batch": 32},
        "feedback": {"first_step": 400, "every": 200, "queries_per_session": 6, "budget": 12},
        "queries": {"same_stage_fraction": 0.0},
        "evaluation": {"every": 100_000, "episodes": 1},
    })
}

fn leases(server: &ServerProcess, run: &str, token: &str) -> Vec<Value> {
    let path = format!("/api/v1/runs/{run}/leases");
    let (status, told) = ask(
        &server.address,
        "POST",
        &path,
        Some(token),
        Some(&json!({"count": 50})),
    )
    .expect("an answer");
    assert_eq!(status, 200, "{told}");
    told["leases"].as_array().expect("a list").clone()
}

fn session(server: &ServerProcess, run: &str, token: &str) -> Vec<Value> {
    let mut offered = Vec::new();
    wait_for("a session", || {
        offered = leases(server, run, token);
        !offered.is_empty()
    });
    offered
}

fn answer(server: &ServerProcess, token: &str, lease: &Value) {
    let path = format!("/api/v1/leases/{}/answer", id_text(&lease["lease_id"]));
    let (status, told) = ask(
        &server.address,
        "PUT",
        &path,
        Some(token),
        Some(&json!({"answer": "left"})),
    )
    .expect("an answer");
    assert_eq!(status, 201, "{told}");
}

fn queries(leases: &[Value]) -> BTreeSet<String> {
    leases
        .iter()
        .map(|lease| id_text(&lease["query_id"]))
        .collect()
}

#[test]
fn a_session_goes_on_where_it_was_after_the_server_was_stopped() {
    let data = tempfile::tempdir().expect("a temporary folder");
    let mut server = ServerProcess::start(data.path());
    let run = server.create_run("uniform", 1, "", &settings());
    let token = server.teacher_token(&run);
    let first = session(&server, &run, &token);
    assert_eq!(first.len(), 6);
    let (answered, open) = first.split_at(4);
    for lease in answered {
        answer(&server, &token, lease);
    }

    assert!(
        server.terminate().success(),
        "SIGTERM ends the server in order"
    );
    server.restart();

    let offered = session(&server, &run, &token);
    assert_eq!(
        queries(&offered),
        queries(open),
        "the open queries, none asked twice"
    );
    for lease in &offered {
        answer(&server, &token, lease);
    }
    let second = session(&server, &run, &token);
    assert!(
        queries(&second).is_disjoint(&queries(&first)),
        "the next session asks about other queries"
    );
    for lease in &second {
        answer(&server, &token, lease);
    }
    assert_eq!(server.finished(&run)["labels"], 12);
}

#[test]
fn a_run_that_was_training_when_the_server_was_killed_goes_on_by_itself() {
    let data = tempfile::tempdir().expect("a temporary folder");
    let mut server = ServerProcess::start(data.path());
    let body = json!({
        "task": "go-fetch-return", "method": "uniform", "seed": 1, "teacher": "oracle",
        "settings": {
            "training": {"total_steps": 3000, "seed_steps": 200, "checkpoint_every": 300},
            "agent": {"hidden": [16, 16], "batch": 32},
            "feedback": {"first_step": 600, "every": 600, "queries_per_session": 5, "budget": 15},
            "evaluation": {"every": 100_000, "episodes": 2},
        },
    });
    let run = id_text(&server.ask("POST", "/api/v1/runs", Some(&body))["id"]);
    let path = format!("/api/v1/runs/{run}");
    wait_for("the first answers", || {
        server.ask("GET", &path, None)["labels"].as_u64() >= Some(5)
    });
    server.kill_and_restart();
    assert_eq!(server.finished(&run)["step"], 3000);

    let history = data.path().join("runs").join(&run).join("history.json");
    let history = std::fs::read(&history).expect("the run's history");
    let history: Value = serde_json::from_slice(&history).expect("JSON");
    for told_once in ["revisions", "machines"] {
        assert_eq!(history[told_once].as_array().map(Vec::len), Some(1));
    }
    assert!(history["wall_s"].as_f64() > Some(0.0), "{history}");
}
