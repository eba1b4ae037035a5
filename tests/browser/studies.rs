//! A labeler of a study, from the link to the thanks, by keys only; and what the researcher sees.

use serde_json::json;

use super::driver::{Browser, Scheme};
use super::labeler::{answer, until_judged};
use crate::api::studies::Open;

const ENTER: &str = "\u{E007}";
const ESCAPE: &str = "\u{E00C}";

/// The last pair is answered, the answer is with the server, and Enter goes on.
const CAN_GO_ON: &str =
    "document.activeElement?.id === 'to-seat' && document.activeElement.checkVisibility()";

/// * `n_practice`, `n` – pairs that are practice, and all
async fn answers_everything(name: &str, key: &str, (n_practice, n): (usize, usize), figure: &str) {
    let Some(browser) = Browser::open(Scheme::Light, (1280, 900)).await else {
        return;
    };
    let name = name.to_owned();
    let study = tokio::task::spawn_blocking(move || Open::ready(&name));
    let study = study.await.expect("a study");
    let page = |path: &str| format!("http://{}{path}", study.server.address);
    let link = page(&format!("/join?code={}", study.code()));
    browser.goto(&link).await;
    browser.press(" ").await; // agrees: the box has the focus
    browser.press(ENTER).await;
    browser
        .until("document.querySelector('#begin') !== null")
        .await;
    browser.press(ENTER).await;
    browser
        .until("document.querySelector('#go-on') !== null")
        .await;
    browser.press(ENTER).await;
    browser
        .until("document.querySelector('#guidance[open]') !== null")
        .await;
    browser.press(ENTER).await;

    for _ in 0..n_practice {
        browser
            .until("document.body.dataset.shown && !document.querySelector('#practice').hidden")
            .await;
        answer(&browser, key).await;
        browser
            .until("document.querySelector('#feedback[open]') !== null")
            .await;
        assert!(!browser.text("#feedback-text").await.is_empty());
        browser.press(ENTER).await;
    }
    loop {
        browser
            .until(&format!("({CAN_GO_ON}) || (document.body.dataset.stage === 'working' && document.body.dataset.shown)"))
            .await;
        if browser.value(CAN_GO_ON).await == json!(true) {
            break;
        }
        let before = browser.value("document.body.dataset.shown").await;
        until_judged(&browser).await;
        browser.press(key).await;
        browser
            .until(&format!(
                "({CAN_GO_ON}) || document.body.dataset.shown !== {before}"
            ))
            .await;
    }
    browser.press("z").await; // the last answer can be gone back to
    browser
        .until(
            "document.body.dataset.stage === 'working' && !document.querySelector('#again').hidden",
        )
        .await;
    browser.press(ESCAPE).await; // and left as it is
    browser.until(CAN_GO_ON).await;
    browser.press(ENTER).await;
    browser
        .until("document.querySelector('#seat') !== null")
        .await;
    assert!(browser.text("#seat h1").await.contains("Thank you"));
    assert_eq!(study.labels().len(), n);
    let timed = study.labels();
    let is_timed =
        |row: &serde_json::Value| row["input"] == "key" && row["visible_ms"].as_i64() > Some(100);
    assert!(timed.iter().all(is_timed), "{timed:?}");

    study.close();
    browser.goto(&page("/studies/1")).await;
    let drawn = format!("document.querySelector('img[src*=\"{figure}\"]')?.naturalWidth > 0");
    browser.until(&drawn).await;
    let results = browser.text("[aria-labelledby=results-title]").await;
    assert!(results.contains("same answer to a repeat"), "{results}");
    let names = "[...document.querySelectorAll('.wide')].map((table) => table.matches('[tabindex=\"0\"][role=region]') && table.ariaLabel)";
    let names = browser.value(names).await;
    assert_eq!(names, json!(["Table of pairs", "Table of results"])); // keys scroll them
    browser.goto(&link).await;
    assert!(browser.text("h1").await.contains("over"));
}

#[tokio::test(flavor = "multi_thread")]
async fn a_person_answers_a_study_of_preferences_by_keys_only() {
    answers_everything("task-1-demo", "1", (1, 24), "preference-scatter").await;
}

#[tokio::test(flavor = "multi_thread")]
async fn a_person_answers_a_study_of_stages_by_keys_only() {
    answers_everything("task-2-demo", "s", (2, 44), "same-stage-bars").await;
}
