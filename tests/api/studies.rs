//! Studies over HTTP: from a file to exported answers, and every link that does not work.

use std::path::Path;
use std::process::Stdio;

use domain::query::Question;
use serde_json::{Value, json};
use store::{ItemRole, NewItem, NewStudy, Store};

use crate::stories::server_process::{ServerProcess, TOKEN, stair, wait_for};
use crate::support::{Client, query};

/// A small study of the small task: six pairs, one practice, one check, one repeat.
pub(crate) const SMALL: &str = r#"
title = "Which is better?"
tasks = ["go-fetch-return"]
question = "QUESTION"
labels_per_task = 6
segment_len = 10
labelers_per_item = 2
repeats_per_task = 1
consent = "You may stop at any time."

[source]
kind = "expert"
start_before = 60
episodes = 4

[[practice]]
task = "go-fetch-return"
first = { policy = "random", start = 0 }
second = { policy = "expert", start = 20 }
expects = "RIGHT"
because = "One of them goes about it."

[[check]]
task = "go-fetch-return"
first = { policy = "expert", seed = 3, start = 20 }
second = { policy = "random", seed = 3, start = 0 }
expects = "WRONG"
"#;

/// The small study with one of both questions.
pub(crate) fn small(question: &str) -> String {
    let [right, wrong] = match question {
        "preference" => ["second", "first"],
        _ => ["different", "different"],
    };
    let text = SMALL.replace("QUESTION", question);
    text.replace("RIGHT", right).replace("WRONG", wrong)
}

/// A server with a study that is open.
pub(crate) struct Open {
    /// Held so that it runs.
    pub(crate) server: ServerProcess,
    pub(crate) researcher: Client,
    pub(crate) path: String,
    _folder: tempfile::TempDir,
}

impl Open {
    pub(crate) fn start(question: &str) -> Self {
        Self::of(&json!({"text": small(question)}))
    }

    /// A study that comes with the program.
    pub(crate) fn ready(name: &str) -> Self {
        Self::of(&json!({"name": name}))
    }

    fn of(request: &Value) -> Self {
        let folder = tempfile::tempdir().expect("a temporary folder");
        let server = ServerProcess::start(folder.path());
        let researcher = Client::stranger_of(&server);
        Self::made(server, researcher, folder, request)
    }

    /// The small study at a server that wants a token, which its researcher has.
    pub(crate) fn guarded(question: &str) -> Self {
        let folder = tempfile::tempdir().expect("a temporary folder");
        let server = ServerProcess::start_guarded(folder.path());
        let researcher = Client::stranger_of(&server).with_token(TOKEN);
        let request = json!({"text": small(question)});
        Self::made(server, researcher, folder, &request)
    }

    fn made(
        server: ServerProcess,
        researcher: Client,
        folder: tempfile::TempDir,
        request: &Value,
    ) -> Self {
        let made = researcher.send("POST", "/api/v1/studies", Some(request));
        let path = format!("/api/v1/studies/{}", made.expect(201).json()["id"]);
        Self::opened(server, researcher, path, folder)
    }

    /// The first study of a data folder.
    pub(crate) fn over(folder: tempfile::TempDir) -> Self {
        let server = ServerProcess::start(folder.path());
        let researcher = Client::stranger_of(&server);
        Self::opened(server, researcher, "/api/v1/studies/1".to_owned(), folder)
    }

    fn opened(
        server: ServerProcess,
        researcher: Client,
        path: String,
        folder: tempfile::TempDir,
    ) -> Self {
        wait_for("the study to be ready", || {
            let study = researcher.send("GET", &path, None).expect(200).json();
            assert_ne!(study["state"], "failed", "{study}");
            study["state"] == "ready"
        });
        researcher
            .send("POST", &format!("{path}/open"), Some(&json!({})))
            .expect(200);
        Self {
            server,
            researcher,
            path,
            _folder: folder,
        }
    }

    /// The code in a new link.
    pub(crate) fn code(&self) -> String {
        let path = format!("{}/invitations", self.path);
        let links = self
            .researcher
            .send("POST", &path, Some(&json!({"count": 1})));
        let links = links.expect(201).json();
        let link = links[0]["link"].as_str().expect("a link");
        link.split_once("code=").expect("a code").1.to_owned()
    }

    /// The browser of a labeler who has agreed, and their run.
    pub(crate) fn labeler(&self) -> Client {
        let body = json!({"code": self.code(), "agrees": true});
        let reply = self
            .researcher
            .send("POST", "/api/v1/join", Some(&body))
            .expect(201);
        let labeler = self.researcher.with_cookie_of(&reply);
        let seat = labeler.send("GET", "/api/v1/seat", None).expect(200).json();
        labeler.on_run(&seat["parts"][0]["run_id"].to_string())
    }

    pub(crate) fn close(&self) {
        let path = format!("{}/close", self.path);
        self.researcher
            .send("POST", &path, Some(&json!({})))
            .expect(200);
    }

    /// The rows of all answers.
    pub(crate) fn labels(&self) -> Vec<Value> {
        let path = format!("{}/labels?format=jsonl", self.path);
        let text = self.researcher.send("GET", &path, None).expect(200).text;
        let rows = text.lines().map(serde_json::from_str);
        rows.collect::<Result<_, _>>().expect("JSON lines")
    }
}

/// Answers everything with one word; returns what was asked.
fn answer_all(labeler: &Client, word: &str) -> Vec<Value> {
    let mut asked = Vec::new();
    while let Some(lease) = labeler.leases(1).first() {
        let reply = labeler.answers(lease, &json!({"answer": word}));
        reply.expect(201);
        asked.push(lease.clone());
    }
    asked
}

#[test]
fn a_study_is_answered_closed_and_exported_with_what_belongs_to_each_answer() {
    let study = Open::start("preference");
    let labeler = study.labeler();
    let asked = answer_all(&labeler, "left");
    assert_eq!(asked.len(), 9, "practice, six pairs, a check, a repeat");
    assert_eq!(
        asked[0]["practice"]["because"],
        "One of them goes about it."
    );
    assert!(asked[1..].iter().all(|lease| lease["practice"].is_null()));
    let seat = labeler.send("GET", "/api/v1/seat", None).expect(200).json();
    assert_eq!(seat["parts"][0]["is_done"], true);
    study.close();

    let labels = study.labels();
    let n_of = |role: &str| labels.iter().filter(|row| row["role"] == role).count();
    assert_eq!(
        ["practice", "counted", "check", "repeat"].map(n_of),
        [1, 6, 1, 1]
    );
    let lefts = |which: &str| {
        let counted = labels.iter().filter(|row| row["role"] == "counted");
        counted.filter(|row| row["left_is"] == which).count()
    };
    assert!(lefts("first").abs_diff(lefts("second")) <= 1);
    let figure = format!("{}/figures/preference-scatter.svg", study.path);
    let svg = study.researcher.send("GET", &figure, None).expect(200);
    assert!(svg.text.starts_with("<svg"), "{}", &svg.text[..80]);
    let late = labeler.send("POST", &labeler.leases_path(), Some(&json!({"count": 1})));
    assert!(late.expect(409).text.contains("takes no answers"));
}

#[test]
fn a_link_that_does_not_work_says_why() {
    let study = Open::start("same_stage");
    let join = |code: &str, agrees: bool| {
        let body = json!({"code": code, "agrees": agrees});
        study.researcher.send("POST", "/api/v1/join", Some(&body))
    };
    let code = study.code();
    join(&"0".repeat(64), true).expect(404);
    join(&code, false).expect(422);
    let entered = join(&code, true).expect(201).json();
    assert!(join(&code, true).expect(410).text.contains("already"));

    let back = join(entered["return_code"].as_str().expect("a code"), false).expect(201);
    let elsewhere = study.researcher.with_cookie_of(&back);
    let seat = elsewhere
        .send("GET", "/api/v1/seat", None)
        .expect(200)
        .json();
    assert_eq!(seat["seat"], 1, "the same place from another machine");
    let full = format!("{}/invitations", study.path);
    let full = study
        .researcher
        .send("POST", &full, Some(&json!({"count": 2})));
    assert!(full.expect(409).text.contains("1 more can be invited"));
    let second = study.code();
    study.close();
    assert!(join(&second, true).expect(410).text.contains("closed"));
    let page = study
        .researcher
        .send("GET", &format!("/join?code={second}"), None);
    assert!(page.expect(200).text.contains("This study is over"));
}

#[test]
fn each_mistake_of_a_file_comes_back_with_its_line() {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let server = ServerProcess::start(folder.path());
    let researcher = Client::stranger_of(&server);
    let text = small("preference").replace("consent", "concent");
    let refused = researcher
        .send("POST", "/api/v1/studies", Some(&json!({"text": text})))
        .expect(422);
    let detail = refused.json()["detail"].as_str().expect("words").to_owned();
    assert!(
        detail.contains("line 9: there is no key `concent`; did you mean 'consent'?"),
        "{detail}"
    );
    researcher
        .send("GET", "/api/v1/studies/7", None)
        .expect(404);
    researcher.send("GET", "/studies/none", None).expect(404);
    let way_back = researcher.send("GET", "/seat", None).expect(404).text;
    assert!(way_back.contains("Return code"), "{way_back}");
}

/// It would be forgotten at once, and its link be used up.
#[test]
fn a_browser_that_keeps_no_cookies_does_not_use_its_link_up() {
    let study = Open::start("preference");
    let code = study.code();
    let form = [("content-type", "application/x-www-form-urlencoded")];
    let agree = |who: &Client| {
        let typed = Some(format!("code={code}&agrees=yes"));
        who.send_with("POST", "/join", typed, &form).expect(200)
    };
    let browser = Client::stranger_of(&study.server);
    let door = browser.send("GET", &format!("/join?code={code}"), None);
    let kept = browser.with_cookie_of(&door.expect(200));
    let told = agree(&browser).text;
    assert!(
        told.contains("keeps no cookies") && told.contains("still works"),
        "{told}"
    );
    let labeler = agree(&kept);
    assert!(
        labeler.text.contains("id=\"return-code\""),
        "{}",
        labeler.text
    );
    let labeler = browser.with_cookie_of(&labeler);
    labeler.send("GET", "/seat", None).expect(200);
}

#[test]
fn nobody_else_reaches_a_labelers_questions() {
    let study = Open::start("same_stage");
    let (one, other) = (study.labeler(), study.labeler());
    let other = other.on_run(&one.run());
    let refused = other.send("POST", &other.leases_path(), Some(&json!({"count": 1})));
    refused.expect(403);
    let page = format!("/runs/{}/label", one.run());
    other.send("GET", &page, None).expect(404);
    one.send("GET", &page, None).expect(200);
}

#[test]
fn at_a_server_with_a_token_a_labeler_needs_nothing_but_their_link() {
    let study = Open::guarded("preference");
    let stranger = Client::stranger_of(&study.server);
    let get = |who: &Client, path: &str, status| who.send("GET", path, None).expect(status);
    let code = study.code();
    get(&stranger, &format!("/join?code={code}"), 200);
    for page in ["/seat", "/runs/1/label"] {
        let way_back = get(&stranger, page, 401).text;
        assert!(way_back.contains("Return code"), "{way_back}");
    }
    assert_eq!(
        get(&stranger, "/api/v1/seat", 401).json()["type"],
        "/problems/token-needed"
    );
    let agreed = json!({"code": code, "agrees": true});
    let joined = stranger.send("POST", "/api/v1/join", Some(&agreed));
    let labeler = stranger.with_cookie_of(&joined.expect(201));
    get(&labeler, "/seat", 200);
    let seat = get(&labeler, "/api/v1/seat", 200).json();
    let labeler = labeler.on_run(&seat["parts"][0]["run_id"].to_string());
    let run = labeler.run();
    let page = format!("/runs/{run}/label");
    get(&labeler, &page, 200);
    get(&labeler, "/runs/1/label", 401); // the run of the study's pairs is nobody's to answer
    let form = [("content-type", "application/x-www-form-urlencoded")];
    let typed = Some("name=Ada".to_owned());
    labeler.send_with("POST", &page, typed, &form).expect(401);
    let first = &labeler.leases(1)[0];
    let clip = first["left"]["clip"].as_str().expect("where the clip is");
    assert!(get(&labeler, clip, 200).len() > 1_000);
    get(&stranger, clip, 401);
    assert_eq!(answer_all(&labeler, "left").len(), 9);
    for researchers in [
        "/".to_owned(),
        "/studies/1".to_owned(),
        format!("/runs/{run}"),
        format!("/api/v1/runs/{run}/labels"),
        study.path.clone(),
        format!("{}/labels", study.path),
    ] {
        get(&labeler, &researchers, 401);
    }
    assert_eq!(study.labels().len(), 9);
    let export = |token: &str| {
        let server = format!("http://{}", study.server.address);
        let mut stair = stair();
        stair.args([
            "study", "export", "1", "--format", "jsonl", "--server", &server,
        ]);
        stair.args(["--token", token]).output().expect("stair")
    };
    let told = export(TOKEN);
    assert_eq!(String::from_utf8_lossy(&told.stdout).lines().count(), 9);
    assert_eq!(export("wrong").status.code(), Some(2));
}

#[test]
fn labelers_by_script_answer_at_a_server_with_a_token() {
    let study = Open::guarded("preference");
    let server = format!("http://{}", study.server.address);
    let told = stair()
        .args(["study", "answer", "1", "--labelers", "2"])
        .args(["--server", &server, "--token", TOKEN])
        .stderr(Stdio::piped())
        .output()
        .expect("stair");
    let complaint = String::from_utf8_lossy(&told.stderr);
    assert!(told.status.success(), "{complaint}");
    assert_eq!(study.labels().len(), 2 * 9);
}

#[test]
fn nobody_takes_a_labelers_place_by_typing_its_name() {
    let study = Open::start("same_stage");
    let labeler = study.labeler();
    let name = json!({"name": "labeler 1 of study 1"});
    let typed = study
        .researcher
        .send("POST", "/api/v1/labelers", Some(&name));
    assert_eq!(typed.expect(422).json()["type"], "/problems/name-kept");
    answer_all(&labeler, "same");
    let labels = study.labels();
    let is_named = |row: &&Value| row["labeler"] == name["name"];
    assert_eq!(
        labels.iter().filter(is_named).count(),
        9,
        "that is the name of the place"
    );
}

#[test]
fn a_preparation_that_failed_is_taken_up_when_somebody_tries_again() {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let runtime = tokio::runtime::Runtime::new().expect("threads");
    runtime.block_on(prepare_a_pair_that_cannot_be_drawn(folder.path()));
    let server = ServerProcess::start(folder.path());
    let researcher = Client::stranger_of(&server);
    let wait_until_it_has_failed = || {
        wait_for("the preparation to fail", || {
            let study = researcher.send("GET", "/api/v1/studies/1", None);
            study.expect(200).json()["state"] == "failed"
        });
    };
    wait_until_it_has_failed();
    // Its clips are drawn again, and fail again; it does not wait for them for ever.
    researcher
        .send("POST", "/api/v1/studies/1/retry", None)
        .expect(200);
    wait_until_it_has_failed();
}

/// A study that is half prepared: its one pair has poses that the task does not have.
async fn prepare_a_pair_that_cannot_be_drawn(folder: &Path) {
    let store = Store::open(folder).await.expect("a store");
    let study = NewStudy {
        title: "Same stage?".into(),
        question: Question::SameStage,
        file: small("same_stage"),
        folder: String::new(),
    };
    let id = store.add_study(study).await.expect("a study");
    let pair = query(1);
    let item = NewItem {
        task: 0,
        method: None,
        role: ItemRole::Counted,
        expects: None,
        because: String::new(),
        first: pair.first,
        second: pair.second,
    };
    let tasks = ["go-fetch-return".to_owned()];
    store
        .add_items(id, &tasks, vec![item])
        .await
        .expect("a pair");
}

#[test]
fn a_form_that_cannot_be_read_is_answered_with_a_page_that_says_why() {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let server = ServerProcess::start(folder.path());
    let researcher = Client::stranger_of(&server);
    let study = json!({"text": small("preference")});
    let made = researcher.send("POST", "/api/v1/studies", Some(&study));
    let study = format!("/studies/{}", made.expect(201).json()["id"]);
    let invite = |accept: &str| {
        let path = format!("{study}/invitations");
        let headers = [
            ("content-type", "application/x-www-form-urlencoded"),
            ("accept", accept),
        ];
        let form = Some("count=".to_owned());
        researcher
            .send_with("POST", &path, form, &headers)
            .expect(422)
    };
    let why = "`count` must be a whole number, 0 or more; it is empty.";
    assert_eq!(invite("application/json").json()["detail"], why);
    let page = invite("text/html").text;
    assert!(page.contains("<h1>") && page.contains(why), "{page}");
    assert!(page.contains(&format!("href=\"{study}\"")), "{page}");
}

#[test]
fn a_study_that_was_opened_stays_as_its_file_was() {
    let study = Open::start("preference");
    let put = |text: &str, status| {
        let body = json!({"text": text});
        let reply = study.researcher.send("PUT", &study.path, Some(&body));
        reply.expect(status)
    };
    let text = small("preference");
    assert_eq!(put(&text, 200).json()["state"], "open");
    let refused = put(
        &text.replace("labels_per_task = 6", "labels_per_task = 4"),
        409,
    );
    assert!(
        refused.text.contains("study of its own"),
        "{}",
        refused.text
    );
    let labeler = study.labeler();
    assert_eq!(answer_all(&labeler, "left").len(), 9, "nothing has changed");
}
