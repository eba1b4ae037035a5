//! Pages are light and speak to no other host.

use serde_json::json;

use super::driver::{Browser, Scheme};
use super::labeler::{run_for_people, sit_down};
use crate::stories::server_process::ServerProcess;

const LIMIT: u64 = 100_000;

/// Bytes on the wire of the page and all that it loads, clips apart; and other hosts asked.
const WEIGH: &str = "(() => {
    const all = [...performance.getEntriesByType('navigation'), ...performance.getEntriesByType('resource')];
    const own = all.filter((entry) => !entry.name.includes('/clips/') && !entry.name.includes('/api/'));
    return [own.reduce((sum, entry) => sum + entry.encodedBodySize, 0), all.map((entry) => new URL(entry.name).host).filter((host) => host !== location.host)];
})()";

#[tokio::test(flavor = "multi_thread")]
async fn a_first_page_weighs_at_most_100_kb_and_asks_no_other_host() {
    let Some(browser) = Browser::open(Scheme::Light, (1280, 900)).await else { return };
    let data = tempfile::tempdir().expect("a temporary folder");
    let server = ServerProcess::start(data.path());
    let run = run_for_people(&server, 0.0);
    let root = format!("http://{}", server.address);
    browser.goto(&root).await;
    weigh("home", &browser).await;
    sit_down(&browser, &server, &run).await;
    weigh("label", &browser).await;
    browser.goto(&format!("{root}/runs/{run}")).await;
    weigh("run", &browser).await;
}

async fn weigh(page: &str, browser: &Browser) {
    let found = browser.value(WEIGH).await;
    println!("{page}: {} bytes compressed", found[0]);
    assert!(found[0].as_u64().is_some_and(|bytes| bytes <= LIMIT), "{page} weighs {}", found[0]);
    assert_eq!(found[1], json!([]), "{page} asks another host");
}
