//! A `stair serve` of its own: started, killed and started again on the same port.

use std::io::{BufRead as _, BufReader};
use std::path::{Path, PathBuf};
use std::process::{Child, Command, ExitStatus, Stdio};
use std::time::{Duration, Instant};

use serde_json::{Value, json};

/// How long anything may take before a story gives up on it.
pub(crate) const PATIENCE: Duration = Duration::from_mins(3);

/// The token of a server that wants one.
pub(crate) const TOKEN: &str = "not-to-be-guessed-0";

/// A server process over a data folder.
pub(crate) struct ServerProcess {
    child: Child,
    /// `127.0.0.1:port`
    pub(crate) address: String,
    data: PathBuf,
    /// What others must bring.
    token: Option<&'static str>,
}

impl ServerProcess {
    /// On a free port.
    pub(crate) fn start(data: &Path) -> Self {
        Self::start_at(data, "127.0.0.1:0", None)
    }

    /// The same, for those alone who bring [`TOKEN`].
    pub(crate) fn start_guarded(data: &Path) -> Self {
        Self::start_at(data, "127.0.0.1:0", Some(TOKEN))
    }

    fn start_at(data: &Path, address: &str, token: Option<&'static str>) -> Self {
        let mut child = stair()
            .args(["serve", "--bind", address, "--data"])
            .arg(data)
            .args(token.iter().flat_map(|token| ["--token", token]))
            .stdout(Stdio::piped())
            .spawn()
            .expect("stair serve");
        let stdout = child.stdout.take().expect("a pipe was asked for");
        let mut lines = BufReader::new(stdout).lines();
        let address = loop {
            let line = lines
                .next()
                .expect("a line that says where to go")
                .expect("text");
            if let Some((_, rest)) = line.split_once("http://") {
                let end = rest
                    .find(|c: char| c.is_whitespace() || c == '/')
                    .unwrap_or(rest.len());
                break rest[..end].to_owned();
            }
        };
        std::thread::spawn(move || for _ in lines {}); // so that the server can go on printing
        let server = Self {
            child,
            address,
            data: data.to_owned(),
            token,
        };
        wait_for("the server to be ready", || {
            ask(&server.address, "GET", "/readyz", None, None).is_some()
        });
        server
    }

    /// SIGKILL, then a new process on the same port and folder.
    pub(crate) fn kill_and_restart(&mut self) {
        self.child.kill().expect("SIGKILL");
        self.child.wait().expect("an ended process");
        *self = Self::start_at(&self.data, &self.address, self.token);
    }

    /// SIGTERM, and how the process ended.
    pub(crate) fn terminate(&mut self) -> ExitStatus {
        let told = Command::new("kill")
            .args(["-TERM", &self.child.id().to_string()])
            .status();
        assert!(told.expect("kill").success());
        self.child.wait().expect("an ended process")
    }

    /// A new process on the same port and folder after the old one ended.
    pub(crate) fn restart(&mut self) {
        *self = Self::start_at(&self.data, &self.address, self.token);
    }

    /// The JSON body of a request that must succeed, with the token where the server wants one.
    pub(crate) fn ask(&self, method: &str, path: &str, body: Option<&Value>) -> Value {
        let (status, told) = ask(&self.address, method, path, self.token, body).expect("an answer");
        assert!(
            (200..300).contains(&status),
            "{method} {path}: {status} {told}"
        );
        told
    }

    /// Waits until a run is at its end, as long as it goes on; what there is to know of it then.
    pub(crate) fn finished(&self, run: &str) -> Value {
        let path = format!("/api/v1/runs/{run}");
        wait_while_it_moves("the run to finish", || {
            let run = self.ask("GET", &path, None);
            if run["state"]["kind"] == "finished" {
                Seen::There
            } else {
                Seen::At(run["step"].as_u64().expect("a number of steps"))
            }
        });
        self.ask("GET", &path, None)
    }

    /// Starts a run that programs answer; its id.
    pub(crate) fn create_run(
        &self,
        method: &str,
        seed: u64,
        preset: &str,
        settings: &Value,
    ) -> String {
        let body = json!({
            "task": "go-fetch-return", "method": method, "preset": preset, "seed": seed, "teacher": "http",
            "settings": settings,
        });
        id_text(&self.ask("POST", "/api/v1/runs", Some(&body))["id"])
    }

    /// A token with which a program may answer.
    pub(crate) fn teacher_token(&self, run: &str) -> String {
        let told = self.ask(
            "POST",
            &format!("/api/v1/runs/{run}/teacher-tokens"),
            Some(&json!({})),
        );
        told["token"].as_str().expect("a token").to_owned()
    }
}

impl Drop for ServerProcess {
    fn drop(&mut self) {
        let _ = self.child.kill(); // it may have ended by itself
        let _ = self.child.wait();
    }
}

/// The program under test.
pub(crate) fn stair() -> Command {
    let mut command = Command::new(env!("CARGO_BIN_EXE_stair"));
    command
        .stdin(Stdio::null())
        .stderr(Stdio::null())
        .env_remove("STAIR_TEACHER_TOKEN");
    command
}

/// An id as a part of an address.
pub(crate) fn id_text(id: &Value) -> String {
    id.as_str().map_or_else(|| id.to_string(), str::to_owned)
}

/// One request on a connection of its own; `None` when no whole answer came.
pub(crate) fn ask(
    address: &str,
    method: &str,
    path: &str,
    token: Option<&str>,
    body: Option<&Value>,
) -> Option<(u16, Value)> {
    let config = ureq::Agent::config_builder()
        .http_status_as_error(false)
        .proxy(None);
    let agent: ureq::Agent = config.timeout_global(Some(PATIENCE)).build().into();
    let mut request = ureq::http::Request::builder()
        .method(method)
        .uri(format!("http://{address}{path}"));
    if let Some(token) = token {
        request = request.header("authorization", format!("Bearer {token}"));
    }
    let body = body.map(Value::to_string).unwrap_or_default();
    let request = request
        .header("content-type", "application/json")
        .body(body)
        .expect("a request");
    let mut response = agent.run(request).ok()?;
    let text = response.body_mut().read_to_string().ok()?;
    Some((
        response.status().as_u16(),
        serde_json::from_str(&text).unwrap_or(Value::String(text)),
    ))
}

/// Looks again and again; a story that waits in vain fails with what it waited for.
pub(crate) fn wait_for(what: &str, mut is_there: impl FnMut() -> bool) {
    wait_while_it_moves(what, || if is_there() { Seen::There } else { Seen::At(0) });
}

/// What a look at something awaited shows.
pub(crate) enum Seen {
    /// It is there.
    There,
    /// It is on its way, so far.
    At(u64),
}

/// As [`wait_for`], but patience begins anew with every step on the way: a slow machine may take
/// long for much.
pub(crate) fn wait_while_it_moves(what: &str, mut look: impl FnMut() -> Seen) {
    let (mut since, mut last) = (Instant::now(), None);
    while let Seen::At(place) = look() {
        if last.replace(place) != Some(place) {
            since = Instant::now();
        }
        let waited = since.elapsed();
        assert!(waited < PATIENCE, "waited in vain for {what}, at {place}");
        std::thread::sleep(Duration::from_millis(20)); // another process has to get there
    }
}
