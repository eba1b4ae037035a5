//! Runs, exports, events, and requests that do not fit.

use std::io::{BufRead as _, BufReader, Write as _};
use std::net::{TcpListener, TcpStream};

use serde_json::json;
use store::Store;

use crate::stories::server_process::stair;
use crate::support::TestApp;

#[test]
fn every_address_that_answers_is_documented_and_the_other_way_round() {
    let app = TestApp::start(1);
    let document = app
        .stranger()
        .send("GET", "/api/v1/openapi.json", None)
        .expect(200)
        .json();
    assert_eq!(document["openapi"], "3.1.0");
    let paths = document["paths"].as_object().expect("paths");
    let router = include_str!("../../server/app/src/router.rs");
    for path in paths.keys() {
        assert!(
            router.contains(&format!("\"{path}\"")),
            "{path} is documented but not served"
        );
    }
    for line in router
        .lines()
        .filter(|line| line.contains("\"/api/v1/") && !line.contains("openapi.json"))
    {
        let path = line.split('"').nth(1).expect("a quoted path");
        assert!(
            paths.contains_key(path),
            "{path} is served but not documented"
        );
    }
}

#[test]
fn every_address_in_the_description_is_on_the_page_for_people() {
    let app = TestApp::start(1);
    let all = app.stranger();
    let document = all
        .send("GET", "/api/v1/openapi.json", None)
        .expect(200)
        .json();
    let page = all.send("GET", "/api", None).expect(200);
    for path in document["paths"].as_object().expect("paths").keys() {
        let told = format!("<code>{path}</code>");
        assert!(page.text.contains(&told), "{path} is not on the page");
    }
}

#[test]
fn a_run_that_cannot_be_started_says_what_is_wrong() {
    let app = TestApp::start(1);
    let all = app.stranger();
    let refuse = |body: serde_json::Value, word: &str| {
        let told = all
            .send("POST", "/api/v1/runs", Some(&body))
            .expect(422)
            .json();
        assert!(
            told["detail"].as_str().is_some_and(|d| d.contains(word)),
            "{told}"
        );
        assert!(
            told["request_id"].as_str().is_some_and(|id| !id.is_empty()),
            "{told}"
        );
    };
    refuse(json!({"task": "window-opne"}), "window-open");
    refuse(json!({"task": "window-open", "method": "stiar"}), "stair");
    refuse(json!({"task": "window-open", "preset": "quik"}), "quick");
    refuse(
        json!({"task": "window-open", "teacher": "orcale"}),
        "did you mean 'oracle'",
    );
    refuse(
        json!({"task": "window-open", "teacher": "humna"}),
        "did you mean 'human'",
    );
    refuse(
        json!({"task": "window-open", "settings": {"agent": {"bach": 3}}}),
        "bach",
    );
    refuse(json!({"task": "window-open", "colour": "red"}), "colour");
    refuse(
        json!({"task": "window-open", "seed": "seven"}),
        "expected a whole number, 0 or more (line 1",
    );
    refuse(json!({"task": 3}), "expected text in quotes");
    refuse(
        json!({"task": "window-open", "settings": {"feedback": {"budget": 5_000_000_000_u64}}}),
        "settings feedback.budget=5000000000: invalid value: integer `5000000000`, expected a whole number, at most 4294967295",
    );
    refuse(
        json!({"task": "window-open", "seed": u64::MAX}),
        "settings seed=18446744073709551615: a whole number is at most 9223372036854775807",
    );
    all.send("GET", "/api/v1/runs/99", None).expect(404);
    all.send("GET", "/api/v1/runs/none", None).expect(404);
    all.send("DELETE", "/api/v1/runs", None).expect(405);
    all.send("GET", "/api/v1/nowhere", None).expect(404);
}

#[test]
fn damage_to_a_runs_files_is_told_on_its_page() {
    let damage = [
        (
            "damaged_checkpoint",
            "checkpoint of step 300: it ends early",
        ),
        ("damaged_history", "it is no JSON. It is set aside"),
    ];
    let app = TestApp::start_with(1, |folder| {
        let runtime = tokio::runtime::Runtime::new().expect("threads");
        runtime.block_on(async {
            let store = Store::open(folder).await.expect("a store");
            let run = store.runs().await.expect("runs")[0].id;
            for (kind, complaint) in damage {
                let event = json!({"kind": kind, "complaint": complaint});
                store
                    .append_event(run, kind, &event)
                    .await
                    .expect("an event");
            }
        });
    });
    let path = format!("/runs/{}", app.run);
    let page = app.stranger().send("GET", &path, None).expect(200).text;
    for told in [
        "A damaged checkpoint was passed over: checkpoint of step 300: it ends early.",
        "time and revisions was damaged: it is no JSON. It is set aside.",
    ] {
        assert!(page.contains(told), "{page}");
    }
}

#[test]
fn a_page_of_another_site_can_change_nothing() {
    let app = TestApp::start(1);
    let all = app.stranger();
    let body = Some(json!({"name": "Eve"}).to_string());
    all.send_with(
        "POST",
        "/api/v1/labelers",
        body.clone(),
        &[("origin", "http://evil.example")],
    )
    .expect(403);
    all.send_with(
        "POST",
        "/api/v1/labelers",
        body.clone(),
        &[("sec-fetch-site", "cross-site")],
    )
    .expect(403);
    all.send_with("GET", "/api/v1/runs", None, &[("host", "evil.example")])
        .expect(403);
    let own = format!("http://{}", app.server.address);
    all.send_with("POST", "/api/v1/labelers", body, &[("origin", &own)])
        .expect(201);
}

#[test]
fn both_exports_hold_the_same_rows() {
    let app = TestApp::start(3);
    let ada = app.labeler("Ada, \"the first\"");
    let timing = json!({"visible_ms": 812, "hidden_ms": 0, "loops": 1.5, "seeks": 2, "speed": 1, "dropped_frames": 0, "input": "key"});
    for lease in ada.leases(3) {
        let word = if lease["question"] == "preference" {
            "left"
        } else {
            "same"
        };
        ada.answers(
            &lease,
            &json!({"answer": word, "guidance_sha256": "ab", "timing": timing}),
        )
        .expect(201);
    }
    let labels = ada.labels();
    assert_eq!(labels[0]["visible_ms"], 812);
    assert_eq!(labels[0]["labeler"], "Ada, \"the first\"");
    let csv = ada
        .send(
            "GET",
            &format!("/api/v1/runs/{}/labels?format=csv", app.run),
            None,
        )
        .expect(200)
        .text;
    assert_eq!(csv.lines().count(), 1 + labels.len());
    assert!(csv.contains("\"Ada, \"\"the first\"\"\""), "{csv}");
    let columns = csv.lines().next().expect("a header").split(',').count();
    assert_eq!(columns, labels[0].as_object().expect("a row").len());
    ada.send(
        "GET",
        &format!("/api/v1/runs/{}/labels?format=xls", app.run),
        None,
    )
    .expect(422);
}

#[test]
fn a_table_that_breaks_off_leaves_no_file_behind() {
    let listener = TcpListener::bind("127.0.0.1:0").expect("a port");
    let server = format!("http://{}", listener.local_addr().expect("an address"));
    std::thread::spawn(move || {
        let (mut stream, _) = listener.accept().expect("a request");
        let request = BufReader::new(&stream).lines().map_while(Result::ok);
        request.take_while(|line| !line.is_empty()).for_each(drop);
        let reply = "HTTP/1.1 200 OK\r\ncontent-length: 100\r\n\r\nanswer_id,";
        write!(stream, "{reply}").expect("a part of a table");
    });
    let folder = tempfile::tempdir().expect("a temporary folder");
    let output = stair()
        .args(["export", "--run", "1", "--server", &server])
        .args(["--out", "answers.csv"])
        .current_dir(folder.path())
        .stderr(std::process::Stdio::piped())
        .output()
        .expect("stair export");
    let told = String::from_utf8_lossy(&output.stderr);
    assert_eq!(output.status.code(), Some(1), "{told}");
    assert!(told.contains("broke off after 10 bytes"), "{told}");
    let left = std::fs::read_dir(folder.path()).expect("a folder").count();
    assert_eq!(left, 0, "files that look like the table");
}

#[test]
fn a_follower_that_comes_back_misses_no_event() {
    let app = TestApp::start(4);
    let ada = app.labeler("Ada");
    let leases = ada.leases(4);
    let word = |lease: &serde_json::Value| {
        if lease["question"] == "preference" {
            "left"
        } else {
            "same"
        }
    };
    for lease in &leases[..2] {
        ada.answers(lease, &json!({"answer": word(lease)}))
            .expect(201);
    }
    let seen = answers_seen(&app, 0, 2);
    for lease in &leases[2..] {
        ada.answers(lease, &json!({"answer": word(lease)}))
            .expect(201);
    }
    let later = answers_seen(&app, seen[1], 2);
    assert!(later.iter().all(|id| *id > seen[1]), "{seen:?} {later:?}");
}

/// Ids of the next `n` answers above `last` in the stream of events.
fn answers_seen(app: &TestApp, last: u64, n: usize) -> Vec<u64> {
    let mut stream = TcpStream::connect(&app.server.address).expect("a connection");
    let host = &app.server.address;
    write!(
        stream,
        "GET /api/v1/runs/{}/events HTTP/1.1\r\nhost: {host}\r\nlast-event-id: {last}\r\n\r\n",
        app.run
    )
    .expect("a request");
    let (mut ids, mut id, mut is_answer) = (Vec::new(), 0, false);
    for line in BufReader::new(stream).lines() {
        let line = line.expect("a line");
        if let Some(number) = line.strip_prefix("id: ") {
            id = number.parse().expect("a number");
        } else if let Some(kind) = line.strip_prefix("event: ") {
            is_answer = kind == "answer";
        } else if line.starts_with("data: ") {
            is_answer |= line.contains("\"kind\":\"answer\"");
        } else if line.is_empty() && is_answer {
            ids.push(id);
            is_answer = false;
        }
        if ids.len() == n {
            break;
        }
    }
    ids
}
