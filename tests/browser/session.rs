//! Answering: by keys only, changing one's mind, and through a lost connection.

use std::time::Duration;

use serde_json::json;

use super::driver::{Browser, Scheme};
use super::labeler::{Desk, answer, answer_any};

const SCREEN: (u32, u32) = (1280, 900);

#[tokio::test(flavor = "multi_thread")]
async fn a_person_answers_a_whole_run_by_keys_only() {
    let Some(browser) = Browser::open(Scheme::Light, SCREEN).await else {
        return;
    };
    let desk = Desk::set_up(12).await;
    desk.sit_down(&browser).await;

    for index in 0.. {
        browser.until("document.body.dataset.stage === 'working' || document.querySelector('#waiting').dataset.kind === 'done'").await;
        if browser.value("document.body.dataset.stage").await == json!("waiting") {
            break;
        }
        answer_any(&browser, index).await;
    }

    assert!(browser.text("#waiting-title").await.contains("thank you"));
    let answers = desk.stored();
    let n_of = |question: &str| {
        answers
            .iter()
            .filter(|row| row["question"] == question)
            .count()
    };
    assert_eq!(
        (n_of("preference"), n_of("same_stage")),
        (12, 3),
        "{answers:?}"
    );
    assert!(
        answers
            .iter()
            .all(|row| row["input"] == "key" && row["visible_ms"].as_i64() > Some(100))
    );
    print_key_to_first_frame(&browser).await;
}

/// The benchmark behind "≤ 100 ms at the 95th percentile"; a loaded machine must not fail a test.
async fn print_key_to_first_frame(browser: &Browser) {
    let mut times: Vec<f64> = browser
        .value("performance.getEntriesByName('key-to-first-frame').map((entry) => entry.duration)")
        .await
        .as_array()
        .map(|list| list.iter().filter_map(serde_json::Value::as_f64).collect())
        .unwrap_or_default();
    times.sort_by(f64::total_cmp);
    let at = |share: f64| {
        times
            .get((share * times.len() as f64) as usize)
            .copied()
            .unwrap_or(f64::NAN)
    };
    println!(
        "key press to first frame of the next pair, {} presses: median {:.1} ms, 95th percentile {:.1} ms",
        times.len(),
        at(0.5),
        at(0.95)
    );
}

#[tokio::test(flavor = "multi_thread")]
async fn an_answer_can_be_gone_back_to_and_changed() {
    let Some(browser) = Browser::open(Scheme::Light, SCREEN).await else {
        return;
    };
    let desk = Desk::set_up(12).await;
    desk.sit_down(&browser).await;
    for index in [0, 0, 0] {
        answer_any(&browser, index).await;
    }
    let ahead = browser.value("document.body.dataset.shown").await;

    for _ in 0..2 {
        let before = browser.value("document.body.dataset.shown").await;
        browser.press("z").await;
        browser
            .until(&format!(
                "document.body.dataset.shown && document.body.dataset.shown !== {before}"
            ))
            .await;
    }
    assert_eq!(browser.text("#before").await, "same stage");
    answer(&browser, "d").await;

    assert_eq!(
        browser.value("document.body.dataset.shown").await,
        ahead,
        "back to the newest pair"
    );
    wait_until_stored(&browser).await;
    let answers = desk.stored();
    let changed: Vec<_> = answers
        .iter()
        .filter(|row| !row["supersedes"].is_null())
        .collect();
    assert_eq!((answers.len(), changed.len()), (4, 1), "{answers:?}");
}

#[tokio::test(flavor = "multi_thread")]
async fn a_pair_is_shown_once_however_late_the_server_replies() {
    let Some(browser) = Browser::open(Scheme::Light, SCREEN).await else {
        return;
    };
    let desk = Desk::set_up(12).await;
    desk.sit_down(&browser).await;
    let delay = "const send = fetch; window.fetch = async (url, how) => {
        const reply = await send(url, how);
        if (String(url).endsWith('/leases')) await new Promise((resolve) => setTimeout(resolve, 900));
        return reply;
    };";
    browser.run(delay, vec![]).await;

    let mut shown = Vec::new();
    for index in 0..8 {
        browser
            .until("document.body.dataset.stage === 'working' && document.body.dataset.shown")
            .await;
        shown.push(
            browser
                .value("document.body.dataset.shown")
                .await
                .to_string(),
        );
        answer_any(&browser, index).await;
    }
    wait_until_stored(&browser).await;

    let n_shown = shown.len();
    shown.sort();
    shown.dedup();
    assert_eq!((shown.len(), desk.stored().len()), (n_shown, n_shown));
}

#[tokio::test(flavor = "multi_thread")]
async fn answers_given_without_a_connection_are_stored_once_it_is_back() {
    let Some(browser) = Browser::open(Scheme::Light, SCREEN).await else {
        return;
    };
    let mut desk = Desk::set_up(12).await;
    desk.sit_down(&browser).await;
    let cut = "const send = fetch; window.fetch = (url, how) => how?.method === 'PUT' ? Promise.reject(new TypeError('cut')) : send(url, how);";
    browser.run(cut, vec![]).await;
    for index in 0..2 {
        answer_any(&browser, index).await;
    }
    browser
        .until("document.querySelector('#saved').dataset.state === 'unsent'")
        .await;
    assert!(browser.text("#saved").await.contains("kept here"));
    assert!(desk.stored().is_empty());

    desk.server.kill_and_restart();
    browser.goto(&desk.label_page()).await;
    browser
        .until("document.querySelector('#saved').dataset.state === 'saved'")
        .await;
    wait_until_stored(&browser).await;
    assert_eq!(desk.stored().len(), 2);
}

#[tokio::test(flavor = "multi_thread")]
async fn a_double_click_and_a_second_tab_make_no_second_label() {
    let Some(browser) = Browser::open(Scheme::Light, SCREEN).await else {
        return;
    };
    let desk = Desk::set_up(12).await;
    desk.sit_down(&browser).await;
    browser
        .until("performance.now() - Number(document.body.dataset.shownAt) > 200")
        .await;

    let twice = "const button = document.querySelector('[data-answer=left]');
        for (const detail of [1, 2]) button.dispatchEvent(new MouseEvent('click', { bubbles: true, detail }));";
    browser.run(twice, vec![]).await;
    wait_until_stored(&browser).await;
    assert_eq!(
        desk.stored().len(),
        1,
        "the second click of a double click is no answer"
    );

    let first = browser.client.window().await.expect("a window");
    let second = browser
        .client
        .new_window(true)
        .await
        .expect("a second tab")
        .handle;
    browser
        .client
        .switch_to_window(second)
        .await
        .expect("the second tab");
    browser.goto(&desk.label_page()).await;
    browser.until("document.body.dataset.shown").await;
    answer_any(&browser, 1).await;
    wait_until_stored(&browser).await;
    browser
        .client
        .switch_to_window(first)
        .await
        .expect("the first tab");
    answer_any(&browser, 1).await;
    wait_until_stored(&browser).await;

    let answers = desk.stored();
    let mut queries: Vec<String> = answers
        .iter()
        .map(|row| format!("{} {}", row["query_id"], row["question"]))
        .collect();
    queries.sort();
    queries.dedup();
    assert_eq!((answers.len(), queries.len()), (3, 3), "{answers:?}");
}

/// Until nothing that was answered in this browser is unsent.
async fn wait_until_stored(browser: &Browser) {
    let n_unsent = "return new Promise((resolve, reject) => {
        const opening = indexedDB.open('stair', 1);
        opening.onerror = () => reject(opening.error);
        opening.onsuccess = () => {
            const counting = opening.result.transaction('unsent').objectStore('unsent').count();
            counting.onsuccess = () => { opening.result.close(); resolve(counting.result); };
        };
    })";
    for _ in 0..1_000 {
        if browser.run(n_unsent, vec![]).await == json!(0) {
            return;
        }
        tokio::time::sleep(Duration::from_millis(50)).await;
    }
    panic!("answers stay unsent");
}
