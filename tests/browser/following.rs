//! Pages of the researcher that follow what goes on: their clips, and what changes on them.

use serde_json::json;

use super::driver::{Browser, Scheme};
use super::labeler::{Desk, N_FRAMES, answer};
use super::session::wait_until_stored;

/// So low that answered pairs are not in view at first.
const LOW_SCREEN: (u32, u32) = (1280, 500);
/// Counts pictures whose memory is given back.
const COUNT_CLOSED: &str = "window.nClosed = 0;
    const close = ImageBitmap.prototype.close;
    ImageBitmap.prototype.close = function () { window.nClosed += 1; close.call(this); };";
/// Plays the answered pair as soon as its clips are there.
const PLAYS: &str = "(() => {
    const pair = document.querySelector('#pairs stair-pair');
    if (!pair.playing) pair.do('toggle');
    return pair.playing;
})()";

/// The page of a run with one answered pair, before that comes into view.
async fn open_run(browser: &Browser) -> Desk {
    let desk = Desk::set_up(2).await;
    desk.sit_down(browser).await;
    answer(browser, "1").await;
    wait_until_stored(browser).await;
    let page = desk.page(&format!("/runs/{}", desk.run));
    browser.goto(&page).await;
    desk
}

#[tokio::test(flavor = "multi_thread")]
async fn clips_of_a_run_that_cannot_be_loaded_say_so_and_are_loaded_when_played() {
    let Some(browser) = Browser::open(Scheme::Light, LOW_SCREEN).await else {
        return;
    };
    let _desk = open_run(&browser).await;
    let cut = "window.send = fetch;
        window.fetch = (url, how) => (String(url).includes('/clips/') ? Promise.reject(new TypeError('cut')) : send(url, how));
        document.querySelector('#pairs').scrollIntoView();";
    browser.run(cut, vec![]).await;
    browser
        .until("document.querySelector('#pairs .trouble')?.checkVisibility()")
        .await;
    let words = browser.text("#pairs .trouble").await;
    assert!(
        words.contains("could not be loaded") && words.contains("cut"),
        "{words}"
    );

    browser.run("window.fetch = send;", vec![]).await;
    browser.click("#pairs [data-do=toggle]").await;
    browser.until(PLAYS).await;
    let troubles = "document.querySelectorAll('.trouble, stair-pair[broken]').length";
    assert_eq!(browser.value(troubles).await, json!(0));
}

#[tokio::test(flavor = "multi_thread")]
async fn a_pair_that_leaves_the_page_of_a_run_gives_its_memory_back() {
    let Some(browser) = Browser::open(Scheme::Light, LOW_SCREEN).await else {
        return;
    };
    let _desk = open_run(&browser).await;
    let scroll = "document.querySelector('#pairs').scrollIntoView();";
    browser.run(scroll, vec![]).await;
    browser.until(PLAYS).await;
    browser.run(COUNT_CLOSED, vec![]).await;
    // A copy that loads anew takes its place, and leaves before its clips are there.
    let replace = "window.send = fetch;
        window.fetch = async (url, how) => {
            if (String(url).includes('/clips/')) await new Promise((resolve) => { (window.gates ??= []).push(resolve); });
            return send(url, { ...how, signal: null });
        };
        const pair = document.querySelector('#pairs stair-pair');
        window.copy = pair.cloneNode(true);
        copy.removeAttribute('loaded');
        pair.replaceWith(copy);
        copy.scrollIntoView();
        return nClosed;";
    let n_closed = browser.run(replace, vec![]).await;
    assert_eq!(n_closed, json!(2 * N_FRAMES), "both clips");

    browser.until("window.gates?.length === 2").await;
    let leave = "copy.remove(); for (const open of gates) open();";
    browser.run(leave, vec![]).await;
    browser
        .until(&format!("nClosed === {}", 4 * N_FRAMES))
        .await;
    assert_eq!(browser.value("copy.playing").await, json!(false));
}

/// A page of an experiment as the server would tell it, and looks at it that wait to be taken.
const TELL: &str = "window.told = { nSteps: 1, isUp: true };
    const main = () => `<p id=\"steps\">${told.nSteps} steps</p><p><a href=\"#\" id=\"here\">here</a></p>
        <div class=\"wide\" tabindex=\"0\"><p>a table</p></div>${told.isUp ? '' : '<p id=\"over\">over</p>'}`;
    const script = '<script type=\"module\" src=\"/static/experiment.js\"></script>';
    window.fetch = async () => new Response(`<head>${told.isUp ? script : ''}</head><main id=\"main\">${main()}</main>`);
    const wait = setTimeout;
    window.setTimeout = (what, ms) => (ms === 15000 ? (window.next = what) : wait(what, ms));
    document.querySelector('#main').innerHTML = main();
    document.querySelector('#here').focus();
    window.marked = [...document.querySelectorAll('#here, .wide')];
    const element = document.createElement('script');
    element.type = 'module';
    element.src = '/static/experiment.js';
    document.head.append(element);";
/// Takes the look that waits.
const LOOK: &str = "const look = next; window.next = null; await look();
    const isMarked = marked.every((part) => part.isConnected);
    return [document.querySelector('#steps').textContent, document.activeElement.id, isMarked, next !== null];";

#[tokio::test(flavor = "multi_thread")]
async fn an_experiments_page_changes_only_what_changed_and_stops_looking_when_it_is_over() {
    let Some(browser) = Browser::open(Scheme::Light, (1280, 900)).await else {
        return;
    };
    let desk = Desk::set_up(1).await;
    browser.goto(&desk.page("/experiments")).await;
    browser.run(TELL, vec![]).await;
    browser.until("window.next").await;
    assert_eq!(
        browser.run(LOOK, vec![]).await,
        json!(["1 steps", "here", true, true])
    );

    browser.run("told.nSteps = 2;", vec![]).await;
    assert_eq!(
        browser.run(LOOK, vec![]).await,
        json!(["2 steps", "here", true, true]),
        "focus and scrolled parts stay"
    );

    browser
        .run("told.nSteps = 3; told.isUp = false;", vec![])
        .await;
    assert_eq!(
        browser.run(LOOK, vec![]).await,
        json!(["3 steps", "here", false, false]),
        "the last look; focus is found again by its id"
    );
    assert_eq!(browser.text("#over").await, "over");
}
