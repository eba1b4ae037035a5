//! A scripted teacher that uses documented routes only teaches an agent from nothing.

use serde_json::json;

use super::server_process::{ServerProcess, stair, wait_for};

const SEEDS: [u64; 3] = [1, 2, 3];
const GOOD: f64 = 0.8;

#[test]
fn a_teacher_over_http_drives_go_fetch_return_from_nothing_to_success_in_two_of_three_seeds() {
    let data = tempfile::tempdir().expect("a temporary folder");
    let server = ServerProcess::start(data.path());
    let mut successes = Vec::new();
    for seed in SEEDS {
        successes.push(success_after_teaching(&server, seed));
        let n_good = successes.iter().filter(|s| **s >= GOOD).count();
        if n_good >= 2 {
            return; // the third seed could not change the verdict
        }
    }
    panic!("success rates by seed: {successes:?}");
}

fn success_after_teaching(server: &ServerProcess, seed: u64) -> f64 {
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
    let last = rows
        .iter()
        .rev()
        .find(|row| row["kind"] == "evaluation")
        .expect("an evaluation");
    last["success_rate"].as_f64().expect("a number")
}
