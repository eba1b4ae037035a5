//! Answering: by keys only, changing one's mind, and through a lost connection or a lost cookie.

use std::time::Duration;

use serde_json::json;

use super::driver::{Browser, Scheme};
use super::labeler::{Desk, answer, answer_any, say_name, until_judged};

pub(super) const SCREEN: (u32, u32) = (1280, 900);
pub(super) const ESCAPE: &str = "\u{E00C}";
const TAB: char = '\u{E004}';
const LEFT: char = '\u{E012}';
const RIGHT: char = '\u{E014}';

/// Everything is answered, and the server knows.
pub(super) const IS_DONE: &str = "document.body.dataset.stage === 'waiting' && document.querySelector('#waiting').dataset.kind === 'done'";
const IS_KEPT_HERE: &str = "document.querySelector('#saved').textContent.includes('kept here')";

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
async fn the_last_answer_can_be_gone_back_to_and_changed() {
    let Some(browser) = Browser::open(Scheme::Light, SCREEN).await else {
        return;
    };
    let desk = Desk::set_up(1).await;
    desk.sit_down(&browser).await;
    for index in 0..2 {
        answer_any(&browser, index).await;
    }
    browser.until(IS_DONE).await;

    browser.click("#undo-waiting").await;
    browser
        .until(
            "document.body.dataset.stage === 'working' && !document.querySelector('#again').hidden",
        )
        .await;
    assert_eq!(browser.text("#before").await, "different stages");
    browser.press(ESCAPE).await;
    browser.until(IS_DONE).await;
    browser.press("z").await;
    answer(&browser, "s").await;

    browser.until(IS_DONE).await;
    wait_until_stored(&browser).await;
    let answers = desk.stored();
    let n_changed = answers
        .iter()
        .filter(|row| !row["supersedes"].is_null())
        .count();
    assert_eq!((answers.len(), n_changed), (3, 1), "{answers:?}");
}

#[tokio::test(flavor = "multi_thread")]
async fn arrows_step_frames_on_the_slider_that_keys_led_to_and_answer_on_one_that_was_dragged() {
    let Some(browser) = Browser::open(Scheme::Light, SCREEN).await else {
        return;
    };
    let desk = Desk::set_up(2).await;
    desk.sit_down(&browser).await;
    let is_on_slider = "document.activeElement.dataset.do === 'scrub'";
    for _ in 0..20 {
        if browser.value(is_on_slider).await == json!(true) {
            break;
        }
        browser.strike(TAB).await;
    }
    until_judged(&browser).await;
    let shown = browser.value("document.body.dataset.shown").await;

    browser.strike(RIGHT).await;
    let seek = "document.getElementById('pair').seek(10);";
    browser.run(seek, vec![]).await; // it holds still since the first arrow
    for key in [RIGHT, RIGHT, LEFT] {
        browser.strike(key).await;
    }
    let seen = "[document.getElementById('pair').frame, document.body.dataset.shown]";
    assert_eq!(browser.value(seen).await, json!([11, shown]));
    assert_eq!(n_unsent(&browser).await + desk.stored().len(), 0);

    browser.click("[data-do=scrub]").await;
    browser.strike(RIGHT).await;
    browser
        .until(&format!("document.body.dataset.shown !== {shown}"))
        .await;
    wait_until_stored(&browser).await;
    assert_eq!(desk.stored().len(), 1);
}

#[tokio::test(flavor = "multi_thread")]
async fn the_stages_of_a_skipped_pair_are_not_asked_about_though_the_server_offers_them_still() {
    let Some(browser) = Browser::open(Scheme::Light, SCREEN).await else {
        return;
    };
    let desk = Desk::set_up(2).await;
    desk.sit_down(&browser).await;
    let delay = "const send = fetch; window.fetch = async (url, how) => {
        if (how?.method === 'PUT') await new Promise((resolve) => setTimeout(resolve, 900));
        return send(url, how);
    };";
    browser.run(delay, vec![]).await;

    until_judged(&browser).await;
    let before = browser.value("document.body.dataset.shown").await;
    browser.press("u").await;
    browser
        .until("document.querySelector('#reasons[open]') !== null")
        .await;
    browser.press("3").await; // a clip is broken
    browser
        .until(&format!(
            "document.body.dataset.shown && document.body.dataset.shown !== {before}"
        ))
        .await;
    answer(&browser, "1").await;

    browser.until(IS_DONE).await;
    wait_until_stored(&browser).await;
    let answers = desk.stored();
    let told: Vec<_> = answers.iter().map(|row| &row["question"]).collect();
    assert_eq!(told, ["preference", "preference"], "{answers:?}");
}

#[tokio::test(flavor = "multi_thread")]
async fn time_under_the_guidance_does_not_count() {
    let Some(browser) = Browser::open(Scheme::Light, SCREEN).await else {
        return;
    };
    let desk = Desk::set_up(2).await;
    desk.sit_down(&browser).await;
    until_judged(&browser).await;
    let shown_at = browser.value("Number(document.body.dataset.shownAt)").await;
    browser.press("?").await;
    let is_open = "document.querySelector('#guidance[open]') !== null";
    browser.until(is_open).await;
    let note = "window.coveredAt = performance.now();";
    browser.run(note, vec![]).await;
    browser.until("performance.now() - coveredAt > 3000").await;
    browser.press("?").await;
    browser.until(&format!("!({is_open})")).await;
    answer(&browser, "1").await;
    let answered_by = browser.value("performance.now()").await;

    wait_until_stored(&browser).await;
    let answers = desk.stored();
    let ms = |value: &serde_json::Value| value.as_f64().expect("milliseconds");
    let at_most = ms(&answered_by) - ms(&shown_at) - 3000.0;
    let visible = ms(&answers[0]["visible_ms"]);
    assert!((200.0..=at_most).contains(&visible), "{visible}, {at_most}");
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
async fn answers_of_a_browser_that_lost_its_cookie_are_stored_once_the_name_is_said_again() {
    let Some(browser) = Browser::open(Scheme::Light, SCREEN).await else {
        return;
    };
    let desk = Desk::set_up(12).await;
    desk.sit_down(&browser).await;
    browser.lose_cookies().await;
    for index in 0..2 {
        answer_any(&browser, index).await;
    }
    browser
        .until(&format!(
            "{IS_KEPT_HERE} && !document.querySelector('#stranger').hidden"
        ))
        .await;
    assert!(desk.stored().is_empty());

    browser.click("#stranger a").await;
    say_name(&browser, "Ada").await;
    wait_until_stored(&browser).await;
    assert_eq!(desk.stored().len(), 2);
}

#[tokio::test(flavor = "multi_thread")]
async fn an_answer_that_cannot_be_delivered_is_kept_and_holds_up_no_other() {
    let Some(browser) = Browser::open(Scheme::Light, SCREEN).await else {
        return;
    };
    let desk = Desk::set_up(12).await;
    desk.sit_down(&browser).await;
    browser.lose_cookies().await;
    answer_any(&browser, 0).await;
    browser.until(IS_KEPT_HERE).await;

    browser.goto(&desk.label_page()).await;
    say_name(&browser, "Bob").await;
    browser.press("\u{E007}").await; // Bob has not read the guidance yet
    browser
        .until("!document.querySelector('#undelivered').hidden")
        .await;
    answer_any(&browser, 0).await;
    browser
        .until("document.querySelector('#saved').dataset.state === 'saved'")
        .await;
    assert_eq!((n_unsent(&browser).await, desk.stored().len()), (1, 1));

    browser.lose_cookies().await;
    browser.goto(&desk.label_page()).await;
    say_name(&browser, "Ada").await;
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
pub(super) async fn wait_until_stored(browser: &Browser) {
    for _ in 0..1_000 {
        if n_unsent(browser).await == 0 {
            return;
        }
        tokio::time::sleep(Duration::from_millis(50)).await;
    }
    panic!("answers stay unsent");
}

/// Answers that this browser keeps for the server.
pub(super) async fn n_unsent(browser: &Browser) -> usize {
    let n_unsent = "return new Promise((resolve, reject) => {
        const opening = indexedDB.open('stair', 1);
        opening.onerror = () => reject(opening.error);
        opening.onsuccess = () => {
            const counting = opening.result.transaction('unsent').objectStore('unsent').count();
            counting.onsuccess = () => { opening.result.close(); resolve(counting.result); };
        };
    })";
    let n_unsent = browser.run(n_unsent, vec![]).await;
    n_unsent
        .as_u64()
        .and_then(|n| n.try_into().ok())
        .expect("a number")
}
