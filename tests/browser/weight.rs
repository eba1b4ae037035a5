//! Pages are light and speak to no other host.

use serde_json::json;

use super::driver::{Browser, Scheme};
use super::labeler::Desk;

const LIMIT: u64 = 100_000;

/// Bytes on the wire of the page and all that it loads, clips apart; and other hosts asked.
const WEIGH: &str = "(() => {
    const all = [...performance.getEntriesByType('navigation'), ...performance.getEntriesByType('resource')];
    const own = all.filter((entry) => !entry.name.includes('/clips/') && !entry.name.includes('/api/'));
    return [own.reduce((sum, entry) => sum + entry.encodedBodySize, 0), all.map((entry) => new URL(entry.name).host).filter((host) => host !== location.host)];
})()";

#[tokio::test(flavor = "multi_thread")]
async fn a_first_page_weighs_at_most_100_kb_and_asks_no_other_host() {
    let Some(browser) = Browser::open(Scheme::Light, (1280, 900)).await else {
        return;
    };
    let desk = Desk::set_up(4).await;
    browser.goto(&desk.page("/")).await;
    weigh("home", &browser).await;
    desk.sit_down(&browser).await;
    weigh("label", &browser).await;
    browser
        .goto(&desk.page(&format!("/runs/{}", desk.run)))
        .await;
    weigh("run", &browser).await;
}

async fn weigh(page: &str, browser: &Browser) {
    let found = browser.value(WEIGH).await;
    println!("{page}: {} bytes compressed", found[0]);
    assert!(
        found[0].as_u64().is_some_and(|bytes| bytes <= LIMIT),
        "{page} weighs {}",
        found[0]
    );
    assert_eq!(found[1], json!([]), "{page} asks another host");
}
