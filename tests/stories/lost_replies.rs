//! Five hundred answers, a fifth of the replies lost, the server killed five times: every
//! acknowledged answer is there, none is there twice.

use std::collections::BTreeMap;
use std::io::Write as _;
use std::net::TcpStream;
use std::sync::Mutex;
use std::sync::atomic::{AtomicBool, AtomicUsize, Ordering};
use std::time::Duration;

use domain::random::{Rng, Stream};
use serde_json::{Value, json};

use super::server_process::{ServerProcess, ask, id_text, wait_for};

const N_ANSWERS: usize = 500;
const N_KILLS: usize = 5;
const N_PROGRAMS: u64 = 4;
const DROPPED: f64 = 0.2;

fn settings() -> Value {
    json!({
        "environment": {"n_envs": 2},
        "training": {"total_steps": 2000, "seed_steps": 200, "updates_per_step": 0.02},
        "agent": {"hidden": [16, 16], "batch": 32},
        "feedback": {"first_step": 400, "every": 200, "queries_per_session": 100, "budget": N_ANSWERS},
        "queries": {"same_stage_fraction": 0.0},
        "evaluation": {"every": 100_000, "episodes": 1},
    })
}

/// What the programs know: which answer to which query was acknowledged.
#[derive(Default)]
struct Acknowledged {
    by_query: Mutex<BTreeMap<String, String>>,
    count: AtomicUsize,
    is_over: AtomicBool,
}

struct Program<'a> {
    address: &'a str,
    run: &'a str,
    token: String,
    rng: Rng,
    known: &'a Acknowledged,
}

impl Program<'_> {
    fn answer_until_done(&mut self) {
        let path = format!("/api/v1/runs/{}/leases", self.run);
        while !self.known.is_over.load(Ordering::SeqCst) {
            let offered = ask(
                self.address,
                "POST",
                &path,
                Some(&self.token),
                Some(&json!({"count": 8})),
            );
            let Some((200, told)) = offered else { continue }; // the server is away
            let leases = told["leases"].as_array().expect("a list of leases").clone();
            for lease in &leases {
                self.answer(lease);
            }
            if leases.is_empty() {
                std::thread::sleep(Duration::from_millis(20)); // the agent trains until the next session
            }
        }
    }

    /// Sends until it is acknowledged; a fifth of the time nobody listens to the reply. All
    /// programs of a run hold the same leases, so most answers are also sent by several at once.
    fn answer(&mut self, lease: &Value) {
        let path = format!("/api/v1/leases/{}/answer", id_text(&lease["lease_id"]));
        let query = id_text(&lease["query_id"]);
        let pressed = if query.bytes().map(u32::from).sum::<u32>() % 3 == 0 {
            "left"
        } else {
            "right"
        };
        let body = json!({"answer": pressed});
        loop {
            if self.rng.chance(DROPPED) {
                self.send_and_hang_up(&path, &body);
                continue;
            }
            match ask(self.address, "PUT", &path, Some(&self.token), Some(&body)) {
                Some((200 | 201, _)) => break,
                Some((503, _)) | None => {}
                Some((status, told)) => panic!("PUT {path}: {status} {told}"),
            }
        }
        let mut by_query = self.known.by_query.lock().expect("no panic");
        by_query.insert(query, pressed.to_owned());
        self.known.count.store(by_query.len(), Ordering::SeqCst);
    }

    fn send_and_hang_up(&self, path: &str, body: &Value) {
        let Ok(mut stream) = TcpStream::connect(self.address) else {
            return;
        };
        let (body, token) = (body.to_string(), &self.token);
        let request = format!(
            "PUT {path} HTTP/1.1\r\nhost: {}\r\nauthorization: Bearer {token}\r\n\
             content-type: application/json\r\ncontent-length: {}\r\n\r\n{body}",
            self.address,
            body.len()
        );
        let _ = stream.write_all(request.as_bytes()); // nobody listens to what comes of it
    }
}

#[test]
fn five_hundred_answers_survive_five_kills_and_lost_replies_each_exactly_once() {
    let data = tempfile::tempdir().expect("a temporary folder");
    let mut server = ServerProcess::start(data.path());
    let run = server.create_run("uniform", 1, "", &settings());
    let address = server.address.clone();
    let known = Acknowledged::default();
    let tokens: Vec<String> = (0..N_PROGRAMS)
        .map(|_| server.teacher_token(&run))
        .collect();

    std::thread::scope(|scope| {
        let _over = OverAtEnd(&known); // also when this story fails, so that they end
        for (number, token) in tokens.into_iter().enumerate() {
            let rng = Rng::new(7, Stream::Test, number as u64);
            let mut program = Program {
                address: &address,
                run: &run,
                token,
                rng,
                known: &known,
            };
            scope.spawn(move || program.answer_until_done());
        }
        for kill in 1..=N_KILLS {
            let due = kill * N_ANSWERS / (N_KILLS + 1);
            wait_for("answers to be acknowledged", || {
                known.count.load(Ordering::SeqCst) >= due
            });
            server.kill_and_restart();
        }
        wait_for("the last answers", || {
            known.count.load(Ordering::SeqCst) >= N_ANSWERS
        });
    });

    let (_, exported) = ask(
        &address,
        "GET",
        &format!("/api/v1/runs/{run}/labels?format=jsonl"),
        None,
        None,
    )
    .expect("the labels");
    let stored = stored_answers(exported.as_str().expect("JSON Lines"));
    let known = known.by_query.into_inner().expect("no panic");
    assert_eq!(known.len(), N_ANSWERS);
    assert_eq!(stored, known, "what was acknowledged is what is stored");
}

/// Query → answer pressed; a query that is there twice fails the story.
fn stored_answers(lines: &str) -> BTreeMap<String, String> {
    let mut stored = BTreeMap::new();
    for line in lines.lines() {
        let row: Value = serde_json::from_str(line).expect("a JSON line");
        let pressed = row["pressed"]
            .as_str()
            .expect("the answer pressed")
            .to_owned();
        let before = stored.insert(id_text(&row["query_id"]), pressed);
        assert!(before.is_none(), "stored twice: {row}");
    }
    stored
}

/// Lets the programs end however the story ends.
struct OverAtEnd<'a>(&'a Acknowledged);

impl Drop for OverAtEnd<'_> {
    fn drop(&mut self) {
        self.0.is_over.store(true, Ordering::SeqCst);
    }
}
