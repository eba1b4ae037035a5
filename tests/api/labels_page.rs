//! The page of stored answers: what was answered over HTTP is on it, filters narrow it, and what a
//! study keeps to itself while it is open is kept there too.

use std::collections::BTreeSet;
use std::path::Path;

use domain::query::Question;
use serde_json::json;
use store::{ItemRole, NewItem, NewStudy, Store};

use super::studies::Open;
use crate::stories::server_process::TOKEN;
use crate::support::{Client, TestApp, draw_all, query};

/// The words of a page with this behind its question mark.
fn page(who: &Client, filters: &str) -> String {
    let reply = who.send("GET", &format!("/labels?{filters}"), None);
    reply.expect(200).text
}

/// How many answers fit, as the page's heading says.
fn count(page: &str) -> &str {
    between(page, "id=\"found-title\">", "</h2>")
}

fn between<'p>(page: &'p str, before: &str, after: &str) -> &'p str {
    let (_, rest) = page.split_once(before).expect(before);
    let (found, _) = rest.split_once(after).expect(after);
    found
}

/// The pairs of clips on a page.
fn pairs(page: &str) -> Vec<&str> {
    let parts = page.split("<stair-pair still ").skip(1);
    parts
        .map(|part| part.split('>').next().expect("a tag"))
        .collect()
}

/// The address of the page to which a link with these words leads.
fn linked(page: &str, words: &str) -> Option<String> {
    let (before, _) = page.split_once(&format!("\">{words}</a>"))?;
    let (_, address) = before.rsplit_once("href=\"/labels?")?;
    Some(address.replace("&amp;", "&"))
}

#[test]
fn an_answer_is_shown_with_the_very_clips_and_what_it_means() {
    let app = TestApp::start(2);
    let ada = app.labeler("Ada <3");
    let lease = &ada.leases(1)[0];
    let timing = json!({"visible_ms": 3_249, "input": "key"});
    ada.answers(lease, &json!({"answer": "right", "timing": timing}))
        .expect(201);
    let label = &ada.labels()[0];

    let page = page(&ada, "");
    assert_eq!(count(&page), "1 answer");
    let sides = ["left", "right"].map(|side| lease[side]["clip"].as_str().expect("a clip"));
    let shown = format!("left=\"{}\" right=\"{}\"", sides[0], sides[1]);
    assert_eq!(pairs(&page), [shown]);
    let meaning = label["meaning"].as_str().expect("a segment");
    for words in [
        "<strong>right is better</strong>",
        &format!("<span>the {meaning} segment</span>"),
        "<dd>which is better?</dd>",
        "<dd>STAIR</dd>",
        "<dd>3.2 s</dd>",
        &format!("<a href=\"/runs/{0}\">Run {0}</a>, round 1", app.run),
        &format!(
            "datetime=\"{}\"",
            label["stored_at"].as_str().expect("a time")
        ),
    ] {
        assert!(page.contains(words), "{words} is not in {page}");
    }
    assert!(page.contains("Ada ") && !page.contains("Ada <3"), "{page}");

    let run = format!("/runs/{}", app.run);
    let run = ada.send("GET", &run, None).expect(200).text;
    for link in [
        format!("/labels?run={}", app.run),
        format!("/api/v1/runs/{}/labels?format=parquet", app.run),
    ] {
        assert!(run.contains(&format!("href=\"{link}\"")), "{link}");
    }
}

/// Ada prefers the left clips of a pair, calls their stages the same, passes over a pair and takes
/// the first answer back; nobody presses what a program passes over.
fn answered(app: &TestApp) {
    let (ada, program) = (app.labeler("Ada"), app.program());
    let first = &ada.leases(1)[0];
    let stored = ada.answers(first, &json!({"answer": "left"}));
    let stored = stored.expect(201).json();
    let key = json!({"input": "key"});
    for answer in [
        json!({"answer": "same"}),
        json!({"answer": "skip", "reason": "too dark", "timing": key}),
    ] {
        ada.answers(&ada.leases(1)[0], &answer).expect(201);
    }
    let changed = json!({"answer": "equal", "supersedes": stored["answer_id"]});
    ada.answers(first, &changed).expect(201);
    let skip = json!({"answer": "skip", "reason": "no pixels"});
    program.answers(&program.leases(1)[0], &skip).expect(201);
}

#[test]
fn filters_narrow_what_is_shown_and_stay_in_the_form() {
    let app = TestApp::start(3);
    answered(&app);
    let all = app.stranger();
    let own = format!("run={}", app.run);
    let today = "from=2000-01-01&to=2999-01-01T00:00";
    let empty = "run=&study=&labeler=&task=&method=&question=&answer=&flag=&round=&from=&to=";
    for (filters, told) in [
        ("", "5 answers"),
        (empty, "5 answers"),
        (own.as_str(), "5 answers"),
        ("labeler=ada", "4 answers"),
        ("task=go-fetch-return", "5 answers"),
        ("task=door-open", "No answers"),
        ("method=stair", "5 answers"),
        ("method=pebble", "No answers"),
        ("question=same_stage", "1 answer"),
        ("answer=equal", "1 answer"),
        ("flag=changed", "2 answers"),
        ("flag=skipped", "2 answers"),
        ("flag=passed_over", "1 answer"),
        ("flag=check", "No answers"),
        ("labeler=Ada&flag=skipped&round=1", "1 answer"),
        ("round=2", "No answers"),
        ("study=1", "No answers"),
        (today, "5 answers"),
        ("to=2000-01-01", "No answers"),
    ] {
        assert_eq!(count(&page(&all, filters)), told, "{filters}");
    }
    let narrowed = page(&all, "labeler=Ada&flag=skipped&from=2000-01-01");
    for kept in [
        "<option value=\"Ada\" selected>",
        "<option value=\"skipped\" selected>",
        "name=\"from\" step=\"any\" value=\"2000-01-01T00:00\"",
        "<dt>Reason</dt><dd>too dark</dd>",
    ] {
        assert!(narrowed.contains(kept), "{kept} is not in {narrowed}");
    }
    let of_run = page(&all, &own);
    for format in ["csv", "jsonl", "parquet"] {
        let export = format!("/api/v1/runs/{}/labels?format={format}", app.run);
        assert!(of_run.contains(&format!("href=\"{export}\"")), "{export}");
    }
    assert!(page(&all, "run=99").contains("There is no run 99."));
    assert!(page(&all, "study=99").contains("There is no study 99."));
    assert!(page(&all, "round=2").contains("No answer fits all of these filters."));
}

#[test]
fn a_filter_that_cannot_be_is_refused_with_what_belongs_there_and_a_way_back() {
    let app = TestApp::start(1);
    let all = app.stranger();
    assert!(page(&all, "").contains("No answers yet."));
    for filter in [
        "run=three",
        "run=0",
        "study=-1",
        "round=0",
        "from=yesterday",
        "to=2026-02-30",
        "flag=skiped",
        "answer=up",
        "question=any",
        "before=first",
    ] {
        let told = all.send("GET", &format!("/labels?{filter}"), None);
        let told = told.expect(422).json();
        assert_eq!(told["type"], "/problems/bad-request", "{told}");
        let (field, value) = filter.split_once('=').expect("both");
        let detail = told["detail"].as_str().expect("words");
        assert!(
            detail.starts_with(&format!("`{field}` must be")),
            "{detail}"
        );
        assert!(detail.ends_with(&format!("it is '{value}'.")), "{detail}");
    }
    let told = all.send("GET", "/labels?labeller=Ada", None).expect(400);
    assert!(told.text.contains("labeller"), "{}", told.text);
    let html = [("accept", "text/html")];
    let told = all.send_with("GET", "/labels?run=three", None, &html);
    let told = told.expect(422).text;
    let way_back = "class=\"button primary\" href=\"/labels\"";
    assert!(told.contains(way_back), "{told}");
}

#[test]
fn pages_follow_each_other_and_keep_the_filters() {
    let app = TestApp::start(30);
    let ada = app.labeler("Ada");
    while let Some(lease) = ada.leases(1).first() {
        let word = match lease["question"].as_str() {
            Some("preference") => "left",
            _ => "different",
        };
        ada.answers(lease, &json!({"answer": word})).expect(201);
    }
    let newest = page(&ada, "question=preference");
    assert_eq!((count(&newest), pairs(&newest).len()), ("30 answers", 24));
    assert_eq!(linked(&newest, "Newer"), None);
    let older = linked(&newest, "Older").expect("a link");
    assert!(older.starts_with("question=preference&before="), "{older}");

    let oldest = page(&ada, &older);
    assert_eq!((count(&oldest), pairs(&oldest).len()), ("30 answers", 6));
    assert_eq!(linked(&oldest, "Older"), None);
    let both = pairs(&newest).into_iter().chain(pairs(&oldest));
    assert_eq!(both.collect::<BTreeSet<_>>().len(), 30, "none is left out");
    let back = linked(&oldest, "Newer").expect("a link");
    assert_eq!(pairs(&page(&ada, &back)), pairs(&newest));
}

/// Pairs that two methods chose.
const FILE: &str = r#"
title = "Same stage?"
tasks = ["go-fetch-return"]
question = "same_stage"
labels_per_task = 2
segment_len = 10
consent = "Yes."
[source]
kind = "expert"
"#;

/// A study whose clips are drawn.
async fn fill(folder: &Path) {
    let store = Store::open(folder).await.expect("a store");
    let study = NewStudy {
        title: "Same stage?".into(),
        question: Question::SameStage,
        file: FILE.into(),
        folder: String::new(),
    };
    let id = store.add_study(study).await.expect("a study");
    let items = [(0, "stair"), (1, "pebble")].map(|(number, method)| {
        let pair = query(number);
        NewItem {
            task: 0,
            method: Some((number, method.to_owned())),
            role: ItemRole::Counted,
            expects: None,
            because: String::new(),
            first: pair.first,
            second: pair.second,
        }
    });
    let tasks = ["go-fetch-return".to_owned()];
    let added = store.add_items(id, &tasks, items.to_vec()).await;
    added.expect("pairs");
    draw_all(&store).await;
}

#[test]
fn methods_of_a_study_are_on_the_page_once_it_is_closed() {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let runtime = tokio::runtime::Runtime::new().expect("threads");
    runtime.block_on(fill(folder.path()));
    let study = Open::over(folder);
    let labeler = study.labeler();
    while let Some(lease) = labeler.leases(1).first() {
        let answer = json!({"answer": "same"});
        labeler.answers(lease, &answer).expect(201);
    }
    let open = page(&study.researcher, "study=1");
    assert_eq!(count(&open), "2 answers");
    assert!(!open.to_lowercase().contains("pebble"), "{open}");
    assert!(open.contains("told once the study is closed"), "{open}");
    assert!(open.contains("/api/v1/studies/1/labels?format=csv"));
    let chosen = page(&study.researcher, "method=pebble");
    assert_eq!(count(&chosen), "No answers");

    study.close();
    let closed = page(&study.researcher, "study=1&method=pebble");
    assert_eq!(count(&closed), "1 answer");
    assert!(closed.contains("<dd>PEBBLE</dd>"), "{closed}");
    let study = study.researcher.send("GET", "/studies/1", None);
    assert!(study.expect(200).text.contains("href=\"/labels?study=1\""));
}

#[test]
fn the_page_is_for_researchers() {
    let app = TestApp::start_guarded(1);
    app.stranger().send("GET", "/labels", None).expect(401);
    let researcher = app.stranger().with_token(TOKEN);
    researcher.send("GET", "/labels", None).expect(200);
}
