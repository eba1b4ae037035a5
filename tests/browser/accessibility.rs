//! axe-core finds nothing on any page, in light and dark, contrast included; everything that can
//! be pressed is a finger wide; no page is wider than a small phone.

use serde_json::json;

use super::driver::{Browser, Scheme};
use super::labeler::{Desk, answer, answer_any};
use crate::api::compare::two_runs;
use crate::api::studies::Open;

/// axe-core, unchanged; its version, hash and licence lie beside it.
const AXE: &str = include_str!("vendor/axe.min.js");

#[tokio::test(flavor = "multi_thread")]
async fn axe_finds_nothing_in_light() {
    look_at_every_page(Scheme::Light, (1280, 900)).await;
}

#[tokio::test(flavor = "multi_thread")]
async fn axe_finds_nothing_in_dark_on_a_small_phone() {
    look_at_every_page(Scheme::Dark, (360, 740)).await;
}

async fn look_at_every_page(scheme: Scheme, size: (u32, u32)) {
    let Some(browser) = Browser::open(scheme, size).await else {
        return;
    };
    let desk = Desk::set_up(4).await;

    browser.goto(&desk.page("/")).await;
    unfold(&browser).await;
    look("home", &browser).await;
    browser.goto(&desk.page("/api")).await;
    unfold(&browser).await;
    look("api", &browser).await;
    browser.goto(&desk.page("/experiments")).await;
    look("experiments", &browser).await;
    browser.goto(&desk.page("/studies")).await;
    look("studies", &browser).await;
    browser.goto(&desk.page("/join")).await;
    look("return", &browser).await;
    browser.goto(&desk.page("/runs/no-such-run")).await;
    look("problem", &browser).await;
    browser.goto(&desk.label_page()).await;
    look("name", &browser).await;
    desk.sit_down(&browser).await;
    look("label", &browser).await;
    browser.press("?").await;
    look("guidance", &browser).await;
    browser.press("?").await;
    browser.press("u").await;
    look("reasons", &browser).await;
    browser.press("\u{E00C}").await;
    for index in 0..5 {
        answer_any(&browser, index).await; // four pairs, and the stages of the first
    }
    browser
        .until("document.querySelector('#waiting').dataset.kind === 'done'")
        .await;
    look("all answered", &browser).await;
    browser.lose_cookies().await;
    browser
        .until("!document.querySelector('#stranger').hidden")
        .await;
    look("not known any more", &browser).await;
    browser
        .goto(&desk.page(&format!("/runs/{}", desk.run)))
        .await;
    look("run", &browser).await;
    browser
        .goto(&desk.page(&format!("/labels?run={}", desk.run)))
        .await; // its filters are open
    look("answers", &browser).await;
}

/// Every page of a study, from its preparation to its results.
#[tokio::test(flavor = "multi_thread")]
async fn axe_finds_nothing_on_the_pages_of_a_study() {
    let Some(browser) = Browser::open(Scheme::Dark, (360, 740)).await else {
        return;
    };
    let study = tokio::task::spawn_blocking(|| Open::start("preference"));
    let study = study.await.expect("a study");
    let page = |path: &str| format!("http://{}{path}", study.server.address);
    browser.goto(&page("/studies/1")).await;
    look("study", &browser).await;
    browser
        .value("(document.querySelector('.invite button').click(), true)")
        .await;
    browser
        .until("document.querySelector('[data-link]') !== null")
        .await;
    look("invited", &browser).await;
    let link = browser
        .value("document.querySelector('[data-link]').value")
        .await;
    browser.goto(link.as_str().expect("a link")).await;
    look("join", &browser).await;
    browser.press(" ").await;
    browser.press("\u{E007}").await;
    browser
        .until("document.querySelector('#begin') !== null")
        .await;
    look("welcome", &browser).await;
    browser.goto(&page("/seat")).await;
    look("seat", &browser).await;
    browser.press("\u{E007}").await;
    browser
        .until("document.querySelector('#guidance[open]') !== null")
        .await;
    browser.press("\u{E007}").await;
    browser.until("document.body.dataset.shown").await;
    look("practice", &browser).await;
    answer(&browser, "1").await;
    browser
        .until("document.querySelector('#feedback[open]') !== null")
        .await;
    look("feedback", &browser).await;
    study.close();
    browser.goto(&page("/seat")).await;
    look("closed", &browser).await;
}

/// The list of runs with a box at each, and the runs that were ticked side by side.
#[tokio::test(flavor = "multi_thread")]
async fn axe_finds_nothing_where_runs_are_compared() {
    let Some(browser) = Browser::open(Scheme::Dark, (360, 740)).await else {
        return;
    };
    let app = tokio::task::spawn_blocking(|| two_runs([3, 2]));
    let app = app.await.expect("two runs");
    browser
        .goto(&format!("http://{}/", app.server.address))
        .await;
    look("runs to choose", &browser).await;
    browser
        .value(
            "(document.querySelectorAll('input[name=run]').forEach((box) => box.click()),
              document.querySelector('#compare button').click(), true)",
        )
        .await;
    browser
        .until(
            "location.pathname === '/compare' && document.images.length === 3
             && [...document.images].every((image) => image.naturalWidth > 0)",
        )
        .await;
    look("compare", &browser).await;
}

/// Opens all that a page keeps folded.
async fn unfold(browser: &Browser) {
    browser
        .run(
            "document.querySelectorAll('details').forEach((part) => { part.open = true; })",
            vec![],
        )
        .await;
}

async fn look(page: &str, browser: &Browser) {
    browser
        .client
        .execute(AXE, vec![])
        .await
        .expect("axe is there");
    let violations = browser
        .run(
            "const found = await axe.run(document, { runOnly: ['wcag2a', 'wcag2aa', 'wcag21a', 'wcag21aa', 'wcag22aa'] });
             return found.violations.map((v) => [v.id, v.nodes.map((node) => node.html.slice(0, 120))]);",
            vec![],
        )
        .await;
    assert_eq!(violations, json!([]), "axe on {page}");
    let small = browser
        .value(
            "[...document.querySelectorAll('a, button, select, summary, input:not([type=checkbox], [type=hidden])')]
             .filter((item) => item.checkVisibility() && !item.closest('h3, p') && !item.matches('.skip-link'))
             .map((item) => [item.outerHTML.slice(0, 80), item.getBoundingClientRect().height])
             .filter(([, height]) => height < 43.9)",
        )
        .await;
    assert_eq!(small, json!([]), "smaller than a finger on {page}");
    let too_wide = browser
        .value("document.documentElement.scrollWidth - innerWidth")
        .await;
    assert!(
        too_wide.as_i64().is_some_and(|by| by <= 0),
        "{page} is too wide by {too_wide}"
    );
}
