//! A scripted teacher that uses documented routes only teaches an agent from nothing.

use serde_json::json;

use super::server_process::{ServerProcess, stair, wait_for};

/// Task return by which the agent must have got better since its first trial, on a scale where
/// chance earns about 110 and the expert about 850.
const BETTER_BY: f64 = 150.0;

#[test]
fn a_teacher_over_http_makes_an_agent_of_go_fetch_return_better() {
    let data = tempfile::tempdir().expect("a temporary folder");
    let server = ServerProcess::start(data.path());
    let returns = returns_while_taught(&server, 1);
    let (first, last) = (returns[0], returns[returns.len() - 1]);
    assert!(
        last > first + BETTER_BY,
        "returns of the trials: {returns:?}"
    );
}

/// Mean task return of each evaluation of a run that a scripted teacher answers over HTTP.
fn returns_while_taught(server: &ServerProcess, seed: u64) -> Vec<f64> {
    let run = server.create_run("stair", seed, "quick", &json!({}));
    let url = format!("http://{}", server.address);
    let taught = stair()
        .args([
            "teach",
            "--server",
            &url,
            "--run",
            &run,
            "--teacher",
            "oracle",
        ])
        .output();
    let taught = taught.expect("stair teach");
    assert!(taught.status.success(), "{taught:?}");
    let path = format!("/api/v1/runs/{run}");
    wait_for("the run to finish", || {
        server.ask("GET", &path, None)["state"]["kind"] == "finished"
    });
    let rows = server.ask("GET", &format!("{path}/metrics"), None);
    let rows = rows.as_array().expect("a list of events");
    let trials = rows.iter().filter(|row| row["kind"] == "evaluation");
    trials
        .map(|row| row["return_mean"].as_f64().expect("a number"))
        .collect()
}
