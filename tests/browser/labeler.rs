//! A person at the labeler's page, over a collection of queries whose clips carry their frame
//! numbers as bars.

use std::path::Path;

use serde_json::{Value, json};
use store::{NewClip, RunId, Store};

use super::driver::Browser;
use crate::stories::server_process::ServerProcess;
use crate::support::{collection, query};

/// Frames of every clip.
pub(crate) const N_FRAMES: u16 = 50;

/// A server with a run whose queries are ready; every fourth also asks the stage question.
pub(crate) struct Desk {
    pub(crate) server: ServerProcess,
    /// The run's number.
    pub(crate) run: RunId,
    folder: tempfile::TempDir,
}

impl Desk {
    /// A server over `n_queries` queries.
    pub(crate) async fn set_up(n_queries: u32) -> Self {
        let folder = tempfile::tempdir().expect("a temporary folder");
        let run = fill(folder.path(), n_queries).await;
        let server = ServerProcess::start(folder.path());
        Self {
            server,
            run,
            folder,
        }
    }

    /// Loses the bytes of all clips, as a data folder has that was copied without them.
    pub(crate) fn lose_clips(&self) {
        let clips = self.folder.path().join("clips");
        std::fs::remove_dir_all(clips).expect("a folder with clips");
    }

    /// Address of a page.
    pub(crate) fn page(&self, path: &str) -> String {
        format!("http://{}{path}", self.server.address)
    }

    /// Address of the labeler's page.
    pub(crate) fn label_page(&self) -> String {
        self.page(&format!("/runs/{}/label", self.run))
    }

    /// Opens the labeler's page, gives a name, reads the guidance, and waits for the first pair.
    pub(crate) async fn sit_down(&self, browser: &Browser) {
        browser.goto(&self.label_page()).await;
        if browser
            .value("document.querySelector('input[name=name]') !== null")
            .await
            == json!(true)
        {
            browser.press("Ada\u{E007}").await; // the field has the focus; Enter sends the form
        }
        browser
            .until("document.querySelector('#guidance[open]') !== null")
            .await;
        browser.press("\u{E007}").await;
        browser.until("document.body.dataset.shown").await;
    }

    /// The stored answers, as the export has them.
    pub(crate) fn stored(&self) -> Vec<Value> {
        let path = format!("/api/v1/runs/{}/labels?format=jsonl", self.run);
        match self.server.ask("GET", &path, None) {
            Value::String(lines) => lines
                .lines()
                .map(|line| serde_json::from_str(line).expect("a JSON line"))
                .collect(),
            one_line => vec![one_line],
        }
    }
}

/// Says a name where it is asked for, in a browser that has read the guidance, and waits for a pair.
pub(crate) async fn say_name(browser: &Browser, name: &str) {
    browser
        .until("document.querySelector('input[name=name]') !== null")
        .await;
    browser.press(&format!("{name}\u{E007}")).await;
    browser.until("document.body.dataset.shown").await;
}

/// Presses `key` when the pair that is on can be judged, and waits for what comes next.
pub(crate) async fn answer(browser: &Browser, key: &str) {
    until_judged(browser).await;
    let before = browser.value("document.body.dataset.shown").await;
    browser.press(key).await;
    browser
        .until(&format!(
            "document.body.dataset.stage === 'waiting' || (document.body.dataset.shown && document.body.dataset.shown !== {before})"
        ))
        .await;
}

/// Waits until a pair has been on for so long that the page takes an answer to it.
pub(crate) async fn until_judged(browser: &Browser) {
    let is_on = "document.body.dataset.stage === 'working' && document.body.dataset.shown";
    let is_old = "performance.now() - Number(document.body.dataset.shownAt) > 200";
    browser.until(&format!("{is_on} && {is_old}")).await;
}

/// Presses a key that answers the question which is on.
pub(crate) async fn answer_any(browser: &Browser, index: usize) {
    let question = browser.value("document.body.dataset.question").await;
    let keys = if question == json!("same_stage") {
        ["s", "d", "s"]
    } else {
        ["1", "\u{E014}", "3"]
    };
    answer(browser, keys[index % keys.len()]).await;
}

async fn fill(folder: &Path, n_queries: u32) -> RunId {
    let store = Store::open(folder).await.expect("a store");
    let run = store.add_run(collection()).await.expect("a run");
    let queries: Vec<_> = (0..n_queries).map(query).collect();
    store
        .offer(run, &queries, true)
        .await
        .expect("stored queries");
    let clip = bar_codes();
    while let Some(job) = store.next_clip_job().await.expect("a job") {
        store
            .attach_clips(job.query, &clip, &clip)
            .await
            .expect("stored clips");
    }
    run
}

fn bar_codes() -> NewClip {
    let pictures: Vec<_> = (0..N_FRAMES)
        .map(|n| render::bar_code::frame(n, (480, 360)))
        .collect();
    let clip = render::clip::encode(&pictures, 25).expect("a clip");
    NewClip {
        bytes: clip.bytes,
        sha256: clip.sha256,
        n_frames: clip.n_frames,
        fps: clip.fps,
        width: clip.width,
        height: clip.height,
    }
}
