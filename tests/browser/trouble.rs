//! What goes wrong in a browser: no room for an answer, no data kept at all, clips that are gone, late
//! or never there.

use serde_json::json;

use super::driver::{Browser, Scheme};
use super::labeler::{Desk, answer, answer_any, until_judged};
use super::session::{ESCAPE, IS_DONE, SCREEN, n_unsent, wait_until_stored};

/// From now on nothing more can be kept.
const FILL: &str = "window.add = IDBObjectStore.prototype.add;
    IDBObjectStore.prototype.add = () => { throw new DOMException('no room', 'QuotaExceededError'); };";
/// There is room again.
const FREE: &str = "IDBObjectStore.prototype.add = window.add;";
const COULD_NOT_KEEP: &str =
    "document.querySelector('#notice').textContent.includes('could not keep the answer')";
const IS_GONE_BACK: &str =
    "document.body.dataset.stage === 'working' && !document.querySelector('#again').hidden";

#[tokio::test(flavor = "multi_thread")]
async fn an_answer_that_the_browser_cannot_keep_is_asked_for_again() {
    let Some(browser) = Browser::open(Scheme::Light, SCREEN).await else {
        return;
    };
    let desk = Desk::set_up(1).await;
    desk.sit_down(&browser).await;
    until_judged(&browser).await;
    browser.run(FILL, vec![]).await;
    browser.press("1").await;
    browser.until(COULD_NOT_KEEP).await;
    assert_eq!(n_unsent(&browser).await + desk.stored().len(), 0);

    browser.run(FREE, vec![]).await;
    for _ in 0..2 {
        until_judged(&browser).await;
        answer_any(&browser, 0).await; // the pair, and its stages
    }
    browser.until(IS_DONE).await;
    wait_until_stored(&browser).await;
    assert_answered_without_skips(&desk, 2);
}

#[tokio::test(flavor = "multi_thread")]
async fn an_answer_stands_where_the_browser_cannot_keep_its_change() {
    let Some(browser) = Browser::open(Scheme::Light, SCREEN).await else {
        return;
    };
    let desk = Desk::set_up(2).await;
    desk.sit_down(&browser).await;
    answer(&browser, "1").await;
    wait_until_stored(&browser).await;
    browser.run(FILL, vec![]).await;
    browser.press("z").await;
    browser.until(IS_GONE_BACK).await;
    answer(&browser, "2").await;
    browser.until(COULD_NOT_KEEP).await;
    assert!(browser.text("#notice").await.contains("left is better"));

    browser.press("z").await;
    browser.until(IS_GONE_BACK).await;
    assert_eq!(browser.text("#before").await, "left is better");
    assert_eq!((n_unsent(&browser).await, desk.stored().len()), (0, 1));
}

#[tokio::test(flavor = "multi_thread")]
async fn a_browser_that_keeps_no_data_is_told_so_and_asked_nothing() {
    let Some(browser) = Browser::open(Scheme::Light, SCREEN).await else {
        return;
    };
    let desk = Desk::set_up(2).await;
    desk.sit_down(&browser).await;
    // The page's script once more, as it starts where nothing may be kept.
    let again = "for (const name of ['indexedDB', 'localStorage']) {
            Object.defineProperty(window, name, { get() { throw new DOMException('denied', 'SecurityError'); } });
        }
        const script = document.createElement('script');
        script.type = 'module';
        script.src = '/static/label.js?again';
        document.head.append(script);";
    browser.run(again, vec![]).await;
    browser
        .until("document.querySelector('#waiting').dataset.kind === 'keepless' && document.querySelector('#waiting').checkVisibility()")
        .await;
    assert!(browser.text("#waiting-text").await.contains("Allow it"));
    let sees_pair = "document.querySelector('#working').checkVisibility()";
    assert_eq!(browser.value(sees_pair).await, json!(false));
}

#[tokio::test(flavor = "multi_thread")]
async fn pairs_whose_clips_are_gone_are_passed_over_in_nobodys_name() {
    let Some(browser) = Browser::open(Scheme::Light, SCREEN).await else {
        return;
    };
    let desk = Desk::set_up(2).await;
    desk.lose_clips();
    browser.goto(&desk.label_page()).await;
    browser.press("Ada\u{E007}").await;
    browser.until(IS_DONE).await;
    wait_until_stored(&browser).await;
    let answers = desk.stored();
    let is_told = |row: &serde_json::Value| {
        let reason = row["reason"].as_str().unwrap_or_default();
        row["pressed"] == "skip" && row["input"].is_null() && reason.contains("gone")
    };
    let pairs = answers.iter().filter(|row| row["question"] == "preference");
    assert_eq!(pairs.count(), 2, "{answers:?}");
    assert!(answers.iter().all(is_told), "{answers:?}");
}

#[tokio::test(flavor = "multi_thread")]
async fn clips_that_are_late_are_waited_for_and_not_passed_over() {
    let Some(browser) = Browser::open(Scheme::Light, SCREEN).await else {
        return;
    };
    let desk = Desk::set_up(6).await;
    desk.sit_down(&browser).await;
    let busy = "const send = fetch; window.late = [429, 403, 408, 404, 401, 503];
        window.fetch = async (url, how) => {
            const isLate = String(url).includes('/clips/') && late.length > 0;
            return isLate ? new Response('slow down', { status: late.shift() }) : send(url, how);
        };";
    browser.run(busy, vec![]).await;
    for index in 0..5 {
        until_judged(&browser).await;
        answer_any(&browser, index).await;
    }
    browser.until("late.length === 0").await;
    wait_until_stored(&browser).await;
    assert_answered_without_skips(&desk, 5);
}

#[tokio::test(flavor = "multi_thread")]
async fn a_page_that_cannot_show_several_pairs_in_a_row_asks_no_more_and_the_researcher_is_told() {
    let Some(browser) = Browser::open(Scheme::Light, SCREEN).await else {
        return;
    };
    let desk = Desk::set_up(7).await;
    desk.lose_clips();
    browser.goto(&desk.label_page()).await;
    browser.press("Ada\u{E007}").await;
    browser
        .until("document.querySelector('#waiting').dataset.kind === 'undecodable'")
        .await;
    let told = browser.text("#waiting-text").await;
    assert!(told.contains("3 pairs in a row"), "{told}");
    wait_until_stored(&browser).await;
    let skipped = desk.stored();
    let pairs = skipped.iter().filter(|row| row["question"] == "preference");
    assert_eq!(pairs.count(), 3, "{skipped:?}");

    browser
        .goto(&desk.page(&format!("/runs/{}", desk.run)))
        .await;
    let told = browser.text("#broken").await;
    let n = told.matches("could not be shown to Ada").count();
    assert!(n >= 3, "{told}");
}

/// A browser without a decoder for the clips asks about none: nothing is skipped in anybody's name.
#[tokio::test(flavor = "multi_thread")]
async fn a_browser_that_cannot_play_the_clips_is_told_so_and_asked_nothing() {
    let Some(browser) = Browser::open(Scheme::Light, SCREEN).await else {
        return;
    };
    let desk = Desk::set_up(2).await;
    desk.sit_down(&browser).await;
    // The page's script once more, as it starts where nothing can be decoded.
    let again = "HTMLMediaElement.prototype.canPlayType = () => '';
        delete window.VideoDecoder;
        const script = document.createElement('script');
        script.type = 'module';
        script.src = '/static/label.js?again';
        document.head.append(script);";
    browser.run(again, vec![]).await;
    browser
        .until("document.querySelector('#waiting').dataset.kind === 'undecodable' && document.querySelector('#waiting').checkVisibility()")
        .await;
    assert!(browser.text("#waiting-text").await.contains("H.264"));
    assert!(desk.stored().is_empty());
}

#[tokio::test(flavor = "multi_thread")]
async fn what_somebody_on_the_way_says_to_an_answer_is_not_the_servers_word() {
    let Some(browser) = Browser::open(Scheme::Light, SCREEN).await else {
        return;
    };
    let desk = Desk::set_up(3).await;
    desk.sit_down(&browser).await;
    let meddle = "const send = fetch; window.others = [403, 400, 404, 413, 200];
        window.fetch = async (url, how) => {
            if (how?.method !== 'PUT' || others.length === 0) return send(url, how);
            const status = others.shift();
            const [body, type] = status === 200 ? ['{}', 'application/json'] : ['<h1>Sign in</h1>', 'text/html'];
            return new Response(body, { status, headers: { 'content-type': type } });
        };";
    browser.run(meddle, vec![]).await;
    until_judged(&browser).await;
    browser.press("1").await;
    browser.until("others.length === 0").await;
    wait_until_stored(&browser).await;
    assert_answered_without_skips(&desk, 1);
    assert_eq!(browser.text("#undelivered").await, "");
}

#[tokio::test(flavor = "multi_thread")]
async fn an_answer_that_stands_already_is_what_going_back_shows() {
    let Some(browser) = Browser::open(Scheme::Light, SCREEN).await else {
        return;
    };
    let desk = Desk::set_up(3).await;
    desk.sit_down(&browser).await;
    until_judged(&browser).await;
    let elsewhere = "const lease = document.body.dataset.shown;
        return fetch(`/api/v1/leases/${lease}/answer`, {
            method: 'PUT', headers: { 'content-type': 'application/json' }, body: JSON.stringify({ answer: 'right' }),
        }).then((reply) => reply.status);";
    assert_eq!(browser.run(elsewhere, vec![]).await, json!(201));
    browser.press("1").await;
    browser
        .until("document.querySelector('#notice').textContent.includes('did not take an answer')")
        .await;
    browser.press("z").await;
    browser.until(IS_GONE_BACK).await;
    assert_eq!(browser.text("#before").await, "right is better");
}

#[tokio::test(flavor = "multi_thread")]
async fn nobody_goes_back_to_what_another_person_answered_in_the_same_browser() {
    let Some(browser) = Browser::open(Scheme::Light, SCREEN).await else {
        return;
    };
    let desk = Desk::set_up(4).await;
    desk.sit_down(&browser).await;
    answer(&browser, "1").await;
    wait_until_stored(&browser).await;
    browser.lose_cookies().await;
    browser.goto(&desk.label_page()).await;
    browser.press("Ben\u{E007}").await;
    browser
        .until("document.querySelector('#guidance[open]') !== null")
        .await; // Ben has not read it
    browser.press("\u{E007}").await;
    browser.until("document.body.dataset.shown").await;
    let can_go_back = "!document.querySelector('#undo').disabled";
    assert_eq!(browser.value(can_go_back).await, json!(false));
}

#[tokio::test(flavor = "multi_thread")]
async fn who_goes_back_can_stay_while_the_pair_is_still_on_its_way() {
    let Some(browser) = Browser::open(Scheme::Light, SCREEN).await else {
        return;
    };
    let desk = Desk::set_up(4).await;
    desk.sit_down(&browser).await;
    answer(&browser, "1").await;
    until_judged(&browser).await;
    let shown = browser.value("document.body.dataset.shown").await;
    let hang = "const send = fetch;
        window.fetch = (url, how) => (String(url).includes('/clips/') ? new Promise(() => {}) : send(url, how));";
    browser.run(hang, vec![]).await;
    let can_stay = "document.querySelector('.after [data-stay]').checkVisibility()";
    browser.press("z").await;
    browser.until(can_stay).await;
    browser.press(ESCAPE).await;
    browser.until(&format!("!{can_stay}")).await;
    browser.click("#undo").await;
    browser.until(can_stay).await;
    browser.click(".after [data-stay]").await;
    browser.until(&format!("!{can_stay}")).await;
    assert_eq!(browser.value("document.body.dataset.shown").await, shown);

    answer_any(&browser, 0).await;
    wait_until_stored(&browser).await;
    assert_eq!(desk.stored().len(), 2);
}

#[tokio::test(flavor = "multi_thread")]
async fn saving_that_takes_long_is_shown_and_not_read_aloud() {
    let Some(browser) = Browser::open(Scheme::Light, SCREEN).await else {
        return;
    };
    let desk = Desk::set_up(4).await;
    desk.sit_down(&browser).await;
    answer(&browser, "1").await;
    let is_saved = "document.querySelector('#saved').dataset.state === 'saved' && document.querySelector('#saved').textContent.startsWith('saved ')";
    browser.until(is_saved).await;
    wait_until_stored(&browser).await;
    let delay = "const send = fetch; window.fetch = async (url, how) => {
        if (how?.method === 'PUT') await new Promise((resolve) => { window.letThrough = resolve; });
        return send(url, how);
    };";
    browser.run(delay, vec![]).await;

    until_judged(&browser).await;
    answer_any(&browser, 0).await;
    browser
        .until("document.querySelector('#saved').textContent === 'saving…'")
        .await;
    let is_hushed = "[...document.querySelector('#saved').childNodes].every((words) => words.ariaHidden === 'true')";
    assert_eq!(browser.value(is_hushed).await, json!(true));
    browser.run("window.letThrough();", vec![]).await;
    browser.until(is_saved).await;
}

#[tokio::test(flavor = "multi_thread")]
async fn of_the_answers_that_the_server_has_the_newest_stay_in_the_browser() {
    let Some(browser) = Browser::open(Scheme::Light, SCREEN).await else {
        return;
    };
    let desk = Desk::set_up(1).await;
    desk.sit_down(&browser).await;
    // Sixty of another run: the server has all but the first, and not yet a change of the second.
    let fill = "return new Promise((resolve, reject) => {
        const opening = indexedDB.open('stair', 1);
        opening.onerror = () => reject(opening.error);
        opening.onsuccess = () => {
            const filling = opening.result.transaction(['answered', 'unsent'], 'readwrite');
            for (let at = 1; at <= 60; at += 1) {
                const answer_id = at === 1 ? null : `answer-${at}`;
                filling.objectStore('answered').put({ lease_id: `old-${at}`, run: 'another', lease: {}, answer: 'left', answer_id, at });
            }
            filling.objectStore('unsent').add({ lease_id: 'old-2', body: { answer: 'right' }, isChange: true });
            filling.oncomplete = () => { opening.result.close(); resolve(); };
        };
    })";
    browser.run(fill, vec![]).await;
    browser.goto(&desk.label_page()).await;
    browser.until("document.body.dataset.shown").await;

    let kept = "return new Promise((resolve, reject) => {
        const opening = indexedDB.open('stair', 1);
        opening.onerror = () => reject(opening.error);
        opening.onsuccess = () => {
            const reading = opening.result.transaction('answered').objectStore('answered').getAll();
            reading.onsuccess = () => {
                opening.result.close();
                resolve(reading.result.map((row) => row.at).sort((a, b) => a - b));
            };
        };
    })";
    let kept = browser.run(kept, vec![]).await;
    let expected: Vec<u32> = (1..=2).chain(11..=60).collect();
    assert_eq!(kept, json!(expected));
}

/// Nothing was passed over.
fn assert_answered_without_skips(desk: &Desk, n_answers: usize) {
    let answers = desk.stored();
    let is_skip = |row: &&serde_json::Value| row["pressed"] == "skip";
    let n_skipped = answers.iter().filter(is_skip).count();
    assert_eq!((answers.len(), n_skipped), (n_answers, 0), "{answers:?}");
}
