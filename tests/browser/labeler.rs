//! A person at the labeler's page of a run that asks at once.

use serde_json::{Value, json};

use super::driver::Browser;
use crate::stories::server_process::{ServerProcess, id_text};

/// Two rounds of six pairs, the first after seconds; the second pair of most is about stages.
fn settings(same_stage_fraction: f64) -> Value {
    json!({
        "training": {"total_steps": 1500, "seed_steps": 200, "updates_per_step": 0.02},
        "agent": {"hidden": [16, 16], "batch": 32},
        "feedback": {"first_step": 400, "every": 200, "queries_per_session": 6, "budget": 12},
        "queries": {"same_stage_fraction": same_stage_fraction},
        "evaluation": {"every": 100_000, "episodes": 1},
    })
}

/// Starts a run that people answer and gives its id.
pub fn run_for_people(server: &ServerProcess, same_stage_fraction: f64) -> String {
    let wanted = json!({
        "task": "go-fetch-return", "method": "stair", "preset": "quick", "seed": 1,
        "teacher": "human", "settings": settings(same_stage_fraction),
    });
    id_text(&server.ask("POST", "/api/v1/runs", Some(&wanted))["id"])
}

/// Opens the page, gives a name, reads the guidance, and waits for the first pair.
pub async fn sit_down(browser: &Browser, server: &ServerProcess, run: &str) {
    browser.goto(&format!("http://{}/runs/{run}/label", server.address)).await;
    if browser.value("document.querySelector('input[name=name]') !== null").await == json!(true) {
        browser.press("Ada\u{E007}").await; // the field has the focus; Enter sends the form
    }
    browser.until("document.querySelector('#guidance[open]') !== null").await;
    browser.press("\u{E007}").await;
    browser.until("document.body.dataset.shown").await;
}

/// Presses `key` when the pair that is on can be judged, and waits for what comes next.
pub async fn answer(browser: &Browser, key: &str) {
    browser.until("document.body.dataset.stage === 'working' && performance.now() - Number(document.body.dataset.shownAt) > 200").await;
    let before = browser.value("document.body.dataset.shown").await;
    browser.press(key).await;
    browser.until(&format!("document.body.dataset.stage === 'waiting' || document.body.dataset.shown !== {before}")).await;
}

/// Presses a key that answers the question which is on.
pub async fn answer_any(browser: &Browser, index: usize) {
    browser.until("document.body.dataset.stage === 'working'").await;
    let question = browser.value("document.body.dataset.question").await;
    let keys = if question == json!("same_stage") { ["s", "d", "s"] } else { ["1", "\u{E014}", "3"] };
    answer(browser, keys[index % keys.len()]).await;
}

/// The stored answers of a run, as the export has them.
pub fn stored(server: &ServerProcess, run: &str) -> Vec<Value> {
    let path = format!("/api/v1/runs/{run}/labels?format=jsonl");
    match server.ask("GET", &path, None) {
        Value::String(lines) => {
            lines.lines().map(|line| serde_json::from_str(line).expect("a JSON line")).collect()
        }
        one_line => vec![one_line],
    }
}
