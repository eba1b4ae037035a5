//! The researcher's ways back to answers: marks on curves that lead to them, and their clips.

use serde_json::json;

use super::driver::{Browser, Scheme};
use super::labeler::{Desk, N_FRAMES, answer};
use super::session::wait_until_stored;

/// Draws a curve up to a step, with a mark that stands alone and two that stand close together.
const DRAW: &str = "const { drawCurve } = await import('/static/chart.js');
    const svg = document.createElementNS('http://www.w3.org/2000/svg', 'svg');
    svg.setAttribute('width', '320');
    document.querySelector('h1').before(svg);
    window.draw = (step) => drawCurve(svg, {
        series: [{ name: 'success', points: [{ x: 0, y: 0 }, { x: step, y: 1 }] }],
        xMax: 100,
        marks: [{ x: 10, y: 0 }, { x: 60, y: 1 }, { x: 64, y: 2 }],
        href: (mark) => `/labels?round=${mark.y + 1}`,
        isTabbed: true,
    });
    draw(70);";
/// Where each mark leads, what it is called, and from where to where it can be pressed.
const MARKS: &str = "[...document.querySelectorAll('main svg a')].map((mark) => {
    const { left, right } = mark.querySelector('.hit').getBoundingClientRect();
    return [mark.getAttribute('href'), mark.getAttribute('aria-label'), left, right];
})";

#[tokio::test(flavor = "multi_thread")]
async fn a_mark_on_a_curve_leads_to_the_answers_of_its_round() {
    let Some(browser) = Browser::open(Scheme::Light, (1280, 900)).await else {
        return;
    };
    let desk = Desk::set_up(1).await;
    browser.goto(&desk.page("/experiments")).await;
    browser.run(DRAW, vec![]).await;
    let marks = browser.value(MARKS).await;
    let sides = |n: usize| [2, 3].map(|side: usize| marks[n][side].as_f64().expect("pixels"));
    assert_eq!(marks[0][0], "/labels?round=1");
    assert_eq!(marks[0][1], "round 1: its pairs");
    let [left, right] = sides(0);
    assert!(right - left >= 24.0, "{marks}");
    let ([_, right], [left, _]) = (sides(1), sides(2));
    assert!(right <= left + 0.1, "none lies over another: {marks}");

    let keeps = "const mark = document.querySelector('main svg a');
        mark.focus();
        draw(80);
        return mark.isConnected && document.activeElement === mark;";
    let is_kept = browser.run(keeps, vec![]).await;
    assert_eq!(is_kept, json!(true), "the focus stays as the curve goes on");
    browser.click("main svg .hit").await;
    browser
        .until("location.pathname === '/labels' && location.search === '?round=1'")
        .await;
}

/// Counts pictures whose memory is given back, and makes the page long.
const PREPARE: &str = "window.nClosed = 0;
    const close = ImageBitmap.prototype.close;
    ImageBitmap.prototype.close = function () { window.nClosed += 1; close.call(this); };
    document.body.style.paddingBottom = '8000px';";
/// Plays the answered pair as soon as its clips are there.
const PLAYS: &str = "(() => {
    const pair = document.querySelector('stair-pair');
    if (!pair.playing) pair.do('toggle');
    return pair.playing;
})()";

#[tokio::test(flavor = "multi_thread")]
async fn an_answered_pair_out_of_view_gives_its_memory_back_and_plays_again_in_view() {
    let Some(browser) = Browser::open(Scheme::Light, (1280, 900)).await else {
        return;
    };
    let desk = Desk::set_up(2).await;
    desk.sit_down(&browser).await;
    answer(&browser, "1").await;
    wait_until_stored(&browser).await;
    browser.goto(&desk.page("/labels")).await;
    browser
        .run(
            "document.querySelector('stair-pair').scrollIntoView();",
            vec![],
        )
        .await;
    browser.until(PLAYS).await;
    browser.run(PREPARE, vec![]).await;
    let leave = "scrollTo(0, document.documentElement.scrollHeight);";
    browser.run(leave, vec![]).await;
    browser
        .until(&format!("nClosed === {}", 2 * N_FRAMES))
        .await;
    let come_back = "document.querySelector('stair-pair').scrollIntoView();";
    browser.run(come_back, vec![]).await;
    browser.until(PLAYS).await;
}
