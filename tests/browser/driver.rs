//! A Chromium of our own, spoken to through ChromeDriver.

use std::io::{BufRead as _, BufReader};
use std::path::PathBuf;
use std::process::{Child, Command, Stdio};
use std::time::{Duration, Instant};

use fantoccini::actions::{InputSource as _, KeyAction, KeyActions};
use fantoccini::wd::Capabilities;
use fantoccini::{Client, ClientBuilder, Locator};
use hyper_util::client::legacy::connect::HttpConnector;
use serde_json::{Value, json};

/// What the browser's owner asked their system for.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Scheme {
    Light,
    Dark,
}

/// One browser window; closing is dropping.
pub(crate) struct Browser {
    pub(crate) client: Client,
    _driver: Driver,
    _profile: tempfile::TempDir,
}

impl Browser {
    /// Opens a window, or says loudly why the story is skipped. Where CI is set, a missing browser
    /// is a failure.
    pub(crate) async fn open(scheme: Scheme, size: (u32, u32)) -> Option<Self> {
        let programs = (found("chromium"), found("chromedriver"));
        let (Some(chromium), Some(chromedriver)) = programs else {
            let how =
                "chromium or chromedriver is missing: apt-get install -y chromium chromium-driver";
            assert!(std::env::var_os("CI").is_none(), "{how}");
            eprintln!("SKIPPED, this story was NOT tested: {how}");
            return None;
        };
        let driver = Command::new(chromedriver)
            .args(["--port=0", "--log-level=SEVERE"])
            .stdout(Stdio::piped())
            .spawn()
            .expect("chromedriver starts");
        let mut driver = Driver {
            process: driver,
            port: 0,
        };
        driver.port = port_of(&mut driver.process);
        let port = driver.port;
        let profile = tempfile::tempdir().expect("a temporary folder");
        let capabilities = capabilities(&chromium, profile.path(), scheme, size);
        let client = ClientBuilder::new(HttpConnector::new())
            .capabilities(capabilities)
            .connect(&format!("http://127.0.0.1:{port}"))
            .await
            .expect("chromedriver opens a window");
        Some(Self {
            client,
            _driver: driver,
            _profile: profile,
        })
    }

    /// Goes to an address.
    pub(crate) async fn goto(&self, url: &str) {
        self.client.goto(url).await.expect("the page loads");
    }

    /// Presses one key, as a person does: once the page has put the focus where it wants it, which
    /// it does a little after it is there, and again when nothing on it could take the key yet.
    pub(crate) async fn press(&self, key: &str) {
        let has_focus = "document.activeElement !== document.body || \
            ![...document.querySelectorAll('[autofocus]')].some((e) => e.checkVisibility())";
        let mut refused = None;
        for _ in 0..20 {
            self.until(has_focus).await;
            let focused = self.client.active_element().await;
            let focused = focused.expect("something has the focus");
            match focused.send_keys(key).await {
                Ok(()) => return,
                Err(error) => refused = Some(error),
            }
            self.until("document.readyState === 'complete'").await;
        }
        panic!("no key could be pressed: {refused:?}");
    }

    /// Presses and releases one key as a keyboard does, wherever the focus is: on a slider, which
    /// takes no text, too.
    pub(crate) async fn strike(&self, key: char) {
        let strike = KeyActions::new("keyboard".into())
            .then(KeyAction::Down { value: key })
            .then(KeyAction::Up { value: key });
        let struck = self.client.perform_actions(strike).await;
        struck.expect("the key is pressed");
    }

    /// Clicks into the middle of the first element that a CSS selector finds.
    pub(crate) async fn click(&self, selector: &str) {
        let element = self.client.find(Locator::Css(selector)).await;
        let element = element.unwrap_or_else(|e| panic!("{selector}: {e}"));
        element.click().await.expect("it can be clicked");
    }

    /// Loses what servers have set to know this browser again.
    pub(crate) async fn lose_cookies(&self) {
        let lost = self.client.delete_all_cookies().await;
        lost.expect("cookies can be deleted");
    }

    /// Value of a JavaScript expression.
    pub(crate) async fn value(&self, expression: &str) -> Value {
        let script = format!("return ({expression});");
        self.client
            .execute(&script, vec![])
            .await
            .expect("the expression has a value")
    }

    /// Runs statements of an async function and gives what they return.
    pub(crate) async fn run(&self, statements: &str, arguments: Vec<Value>) -> Value {
        let script = format!(
            "const done = arguments[arguments.length - 1]; const given = [...arguments].slice(0, -1);
             (async (...given) => {{ {statements} }})(...given).then((value) => done({{ value }}), (reason) => done({{ reason: String(reason) }}));"
        );
        let outcome = self
            .client
            .execute_async(&script, arguments)
            .await
            .expect("the script runs");
        assert!(
            outcome.get("reason").is_none(),
            "in the page: {}",
            outcome["reason"]
        );
        outcome["value"].clone()
    }

    /// Text of the first element that a CSS selector finds.
    pub(crate) async fn text(&self, selector: &str) -> String {
        let element = self.client.find(Locator::Css(selector)).await;
        element
            .unwrap_or_else(|e| panic!("{selector}: {e}"))
            .text()
            .await
            .expect("it has text")
    }

    /// Waits until an expression is true, on this page or on one that it leads to; fails with the
    /// page's words when it never becomes so.
    pub(crate) async fn until(&self, expression: &str) {
        // Asked again and again from here: a script that waits in the page ends with the page.
        let script = format!("return Boolean({expression});");
        let end = Instant::now() + Duration::from_secs(110);
        let mut outcome = Ok(Value::Null);
        while Instant::now() < end {
            outcome = self.client.execute(&script, vec![]).await;
            if matches!(outcome, Ok(Value::Bool(true))) {
                return;
            }
            tokio::time::sleep(Duration::from_millis(20)).await;
        }
        let page = "return document.body.innerText.slice(0, 600);";
        let page = self.client.execute(page, vec![]).await;
        panic!("never came true: {expression}, at last {outcome:?}; the page says: {page:?}");
    }
}

/// ChromeDriver's process; its Chromium ends with it.
struct Driver {
    process: Child,
    port: u16,
}

impl Drop for Driver {
    fn drop(&mut self) {
        // Asked to shut down it ends its Chromium; killed, by whatever signal, it leaves it behind.
        let config = ureq::Agent::config_builder().proxy(None);
        let config = config.timeout_global(Some(Duration::from_secs(10)));
        let agent: ureq::Agent = config.build().into();
        let shut_down = format!("http://127.0.0.1:{}/shutdown", self.port);
        if agent.get(&shut_down).call().is_err() {
            let _ = self.process.kill(); // it may be gone already
        }
        let _ = self.process.wait();
    }
}

fn found(program: &str) -> Option<PathBuf> {
    let folders = std::env::var_os("PATH")?;
    std::env::split_paths(&folders)
        .map(|folder| folder.join(program))
        .find(|path| path.is_file())
}

fn port_of(driver: &mut Child) -> u16 {
    let output = driver.stdout.take().expect("its output is a pipe");
    let mut lines = BufReader::new(output).lines().map_while(Result::ok);
    let port = lines
        .find_map(|line| {
            line.split("successfully on port ")
                .nth(1)?
                .trim_end_matches('.')
                .parse()
                .ok()
        })
        .expect("chromedriver names its port");
    // Nobody reads on; a full pipe would block it.
    std::thread::spawn(move || lines.for_each(drop));
    port
}

fn capabilities(
    chromium: &std::path::Path,
    profile: &std::path::Path,
    scheme: Scheme,
    size: (u32, u32),
) -> Capabilities {
    let preferred = i32::from(scheme != Scheme::Dark);
    let arguments = [
        "--headless",
        "--no-sandbox",
        "--disable-gpu",
        "--disable-quic",
        "--no-first-run",
        "--disable-background-networking",
        "--disable-component-update",
        "--disable-sync",
        &format!("--blink-settings=preferredColorScheme={preferred}"),
        &format!("--window-size={},{}", size.0, size.1),
        &format!("--user-data-dir={}", profile.display()),
    ]
    .map(str::to_owned);
    let options = json!({ "binary": chromium, "args": arguments });
    let timeouts = json!({ "script": Duration::from_mins(2).as_millis() as u64 });
    [
        ("goog:chromeOptions".to_owned(), options),
        ("timeouts".to_owned(), timeouts),
    ]
    .into_iter()
    .collect()
}
