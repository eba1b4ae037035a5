//! The harness: a server over a data folder that holds a collection of ready queries.

use std::path::{Path, PathBuf};

use domain::environment::TaskReward;
use domain::episode::{EpisodeId, Segment, SegmentRecord};
use domain::query::{OfferedQuery, QueryKey};
use serde_json::{Value, json};
use store::{NewClip, NewRun, RunId, Store};
use ureq::http::{Request, Response};
use ureq::{Agent, Body};

use crate::stories::server_process::{PATIENCE, ServerProcess};

/// A server with one run: a collection of queries that no agent learns from.
pub(crate) struct TestApp {
    pub(crate) server: ServerProcess,
    /// The run's number.
    pub(crate) run: String,
    folder: tempfile::TempDir,
}

/// What the server answered.
pub(crate) struct Reply {
    pub(crate) status: u16,
    pub(crate) headers: ureq::http::HeaderMap,
    pub(crate) text: String,
    /// As they came.
    bytes: Vec<u8>,
}

impl Reply {
    /// The first eight bytes of the body.
    pub(crate) fn first_bytes(&self) -> u64 {
        let first = self.bytes.first_chunk().expect("a body of eight bytes");
        u64::from_be_bytes(*first)
    }

    /// Bytes of the body.
    pub(crate) fn len(&self) -> usize {
        self.bytes.len()
    }

    /// The body as JSON; null where it is none.
    pub(crate) fn json(&self) -> Value {
        serde_json::from_str(&self.text).unwrap_or_default()
    }

    /// The reply, which must have this status.
    #[track_caller]
    pub(crate) fn expect(self, status: u16) -> Self {
        assert_eq!(self.status, status, "{}", self.text);
        self
    }
}

/// Whoever sends requests: a browser with a cookie, or a program with a token.
#[derive(Clone)]
pub(crate) struct Client {
    address: String,
    header: Option<(&'static str, String)>,
    run: String,
}

impl TestApp {
    /// A server over `n_queries` ready queries; every fourth also asks the stage question.
    pub(crate) fn start(n_queries: u32) -> Self {
        Self::start_with(n_queries, |_| {})
    }

    /// The same, with more done to the data folder before the server opens it.
    pub(crate) fn start_with(n_queries: u32, prepare: impl FnOnce(&Path)) -> Self {
        let folder = tempfile::tempdir().expect("a temporary folder");
        let run = seed(folder.path(), n_queries).to_string();
        prepare(folder.path());
        Self {
            server: ServerProcess::start(folder.path()),
            run,
            folder,
        }
    }

    /// A server over ready queries for those alone who bring its token, which strangers lack.
    pub(crate) fn start_guarded(n_queries: u32) -> Self {
        let folder = tempfile::tempdir().expect("a temporary folder");
        Self {
            run: seed(folder.path(), n_queries).to_string(),
            server: ServerProcess::start_guarded(folder.path()),
            folder,
        }
    }

    /// The data folder.
    pub(crate) fn data(&self) -> PathBuf {
        self.folder.path().to_owned()
    }

    /// Somebody without a name.
    pub(crate) fn stranger(&self) -> Client {
        Client {
            address: self.server.address.clone(),
            header: None,
            run: self.run.clone(),
        }
    }

    /// A labeler's browser.
    pub(crate) fn labeler(&self, name: &str) -> Client {
        let reply = self
            .stranger()
            .send("POST", "/api/v1/labelers", Some(&json!({"name": name})))
            .expect(201);
        self.stranger().with_cookie_of(&reply)
    }

    /// A program with a teacher token.
    pub(crate) fn program(&self) -> Client {
        let token = self.server.teacher_token(&self.run);
        self.stranger().with_token(&token)
    }
}

impl Client {
    /// Somebody without a name, at a server without a run.
    pub(crate) fn stranger_of(server: &ServerProcess) -> Self {
        Self {
            address: server.address.clone(),
            header: None,
            run: String::new(),
        }
    }

    /// The same at another run.
    pub(crate) fn on_run(&self, run: &str) -> Self {
        Self {
            run: run.to_owned(),
            ..self.clone()
        }
    }

    /// Who brings this token.
    pub(crate) fn with_token(self, token: &str) -> Self {
        Self {
            header: Some(("authorization", format!("Bearer {token}"))),
            ..self
        }
    }

    /// Whose browser has the cookie that a reply sets.
    pub(crate) fn with_cookie_of(&self, reply: &Reply) -> Self {
        let cookie = reply.headers["set-cookie"].to_str().expect("text");
        let cookie = cookie.split(';').next().expect("a pair").to_owned();
        Self {
            header: Some(("cookie", cookie)),
            ..self.clone()
        }
    }

    /// The run's number.
    pub(crate) fn run(&self) -> String {
        self.run.clone()
    }

    /// Where leases are had.
    pub(crate) fn leases_path(&self) -> String {
        format!("/api/v1/runs/{}/leases", self.run)
    }

    /// One request.
    pub(crate) fn send(&self, method: &str, path: &str, body: Option<&Value>) -> Reply {
        self.send_with(method, path, body.map(Value::to_string), &[])
    }

    /// One request with a body of any kind, JSON unless the headers say otherwise, and more
    /// headers.
    pub(crate) fn send_with(
        &self,
        method: &str,
        path: &str,
        body: Option<String>,
        headers: &[(&str, &str)],
    ) -> Reply {
        let mut request = Request::builder()
            .method(method)
            .uri(format!("http://{}{path}", self.address));
        for (name, value) in self
            .header
            .iter()
            .map(|(n, v)| (*n, v.as_str()))
            .chain(headers.iter().copied())
        {
            request = request.header(name, value);
        }
        let says_what = headers.iter().any(|(name, _)| *name == "content-type");
        if body.is_some() && !says_what {
            request = request.header("content-type", "application/json");
        }
        let request = request.body(body.unwrap_or_default()).expect("a request");
        let config = Agent::config_builder()
            .http_status_as_error(false)
            .proxy(None)
            .timeout_global(Some(PATIENCE));
        let agent: Agent = config.build().into();
        let mut response: Response<Body> = agent.run(request).expect("a reply");
        let bytes = response.body_mut().read_to_vec().unwrap_or_default();
        Reply {
            status: response.status().as_u16(),
            headers: response.headers().clone(),
            text: String::from_utf8_lossy(&bytes).into_owned(),
            bytes,
        }
    }

    /// Open leases, topped up to `count`.
    pub(crate) fn leases(&self, count: u32) -> Vec<Value> {
        let path = format!("/api/v1/runs/{}/leases", self.run);
        let reply = self
            .send("POST", &path, Some(&json!({"count": count})))
            .expect(200)
            .json();
        reply["leases"].as_array().expect("a list").clone()
    }

    /// Answers a lease.
    pub(crate) fn answers(&self, lease: &Value, body: &Value) -> Reply {
        let path = format!(
            "/api/v1/leases/{}/answer",
            lease["lease_id"].as_str().expect("an id")
        );
        self.send("PUT", &path, Some(body))
    }

    /// All answers of the run.
    pub(crate) fn labels(&self) -> Vec<Value> {
        let path = format!("/api/v1/runs/{}/labels?format=jsonl", self.run);
        let text = self.send("GET", &path, None).expect(200).text;
        text.lines()
            .map(|line| serde_json::from_str(line).expect("JSON"))
            .collect()
    }
}

/// A query of which nothing but its number matters.
pub(crate) fn query(index: u32) -> OfferedQuery {
    let record = |episode: u32, reward: f64| SegmentRecord {
        segment: Segment {
            episode: EpisodeId(episode),
            start: 5,
            len: 4,
        },
        poses: vec![vec![0.5, 1.5]; 4],
        task_rewards: vec![TaskReward(reward); 4],
        stages: vec![0; 4],
    };
    OfferedQuery {
        key: QueryKey { session: 0, index },
        first: record(2 * index, 1.0),
        second: record(2 * index + 1, 2.0),
        asks_same_stage: index.is_multiple_of(4),
        disagreement: Some(0.25),
        stage_gap: Some(1.5),
        typical_reward: Some(TaskReward(3.0)),
    }
}

/// A run without an agent.
pub(crate) fn collection() -> NewRun {
    NewRun {
        task: "go-fetch-return".into(),
        method: "stair".into(),
        preset: String::new(),
        seed: 1,
        teacher: "human".into(),
        draws_clips: true,
        config: String::new(),
        budget: 10_000,
        total_steps: 0,
        is_trained: false,
    }
}

/// Bytes that are told apart by `n`.
pub(crate) fn clip(n: u64) -> NewClip {
    NewClip {
        bytes: format!("clip number {n:06}").into_bytes(),
        sha256: format!("{n:064x}"),
        n_frames: 4,
        fps: 20,
        width: 8,
        height: 8,
    }
}

/// Puts a collection with clips into a folder that no server holds.
pub(crate) fn seed(folder: &Path, n_queries: u32) -> RunId {
    let runtime = tokio::runtime::Runtime::new().expect("threads");
    runtime.block_on(async {
        let store = Store::open(folder).await.expect("a store");
        let run = store.add_run(collection()).await.expect("a run");
        let queries: Vec<OfferedQuery> = (0..n_queries).map(query).collect();
        store
            .offer(run, &queries, true)
            .await
            .expect("stored queries");
        draw_all(&store).await;
        run
    })
}

/// Gives every query that waits for clips two of its own.
pub(crate) async fn draw_all(store: &Store) {
    while let Some(job) = store.next_clip_job().await.expect("a job") {
        let n = 2 * job.query.0.unsigned_abs();
        let attached = store.attach_clips(job.query, &clip(n), &clip(n + 1)).await;
        attached.expect("stored clips");
    }
}
