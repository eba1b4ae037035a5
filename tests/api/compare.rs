//! Runs side by side: ticked in the list or named in the address, in one table and one figure each.

use domain::query::Question;
use serde_json::json;
use store::{ItemRole, NewItem, NewRun, NewStudy, RunId, Store};

use crate::support::{TestApp, collection, draw_all, query};

/// A server with runs 1 and 2, which differ in their seed and were tried so often.
pub(crate) fn two_runs(n_trials: [u32; 2]) -> TestApp {
    let second = NewRun {
        seed: 2,
        ..collection()
    };
    beside(second, n_trials)
}

/// A server with the harness's run and this one, tried so often.
fn beside(second: NewRun, n_trials: [u32; 2]) -> TestApp {
    TestApp::start_with(1, |folder| {
        let runtime = tokio::runtime::Runtime::new().expect("threads");
        runtime.block_on(async {
            let store = Store::open(folder).await.expect("a store");
            let first = store.runs().await.expect("runs")[0].id;
            let second = store.add_run(second).await.expect("a run");
            assert_eq!([first, second], [RunId(1), RunId(2)]);
            for (run, n) in [first, second].into_iter().zip(n_trials) {
                for trial in 0..n {
                    try_out(&store, run, trial).await;
                }
            }
        });
    })
}

/// What a run says of its n-th trial.
async fn try_out(store: &Store, run: RunId, n: u32) {
    let trial = json!({
        "kind": "evaluation", "step": 1_000 * n, "labels": 10 * n, "episodes": 4,
        "success_rate": 0.25 * f64::from(n), "return_mean": 1.5, "return_std": 0.5,
        "reward_correlation": null,
    });
    let name = format!("evaluation/{n}");
    let kept = store.append_event(run, &name, &trial);
    kept.await.expect("an event");
}

/// The words of the page or figure at an address.
fn text(app: &TestApp, path: &str) -> String {
    let reply = app.stranger().send("GET", path, None);
    reply.expect(200).text
}

/// Why an address is refused.
fn why_not(app: &TestApp, path: &str, status: u16) -> String {
    let reply = app.stranger().send("GET", path, None);
    let told = reply.expect(status).json();
    told["detail"].as_str().expect("words").to_owned()
}

#[test]
fn runs_that_cannot_be_compared_are_refused_in_words() {
    let app = two_runs([1, 1]);
    for (asked, status, told) in [
        ("", 422, "2 to 8 runs can be compared, and 0 were chosen"),
        ("run=1", 422, "and 1 were chosen"),
        ("runs=1,2,3,4,5,6,7,8,9", 422, "and 9 were chosen"),
        ("run=1&run=1", 422, "Run 1 is chosen twice."),
        ("runs=1,two", 422, "'two' is none"),
        ("runs=1,2&colour=red", 422, "`colour` is not known here"),
        ("runs=1,99", 404, "There is no run 99."),
    ] {
        for page in ["/compare", "/compare/success-by-steps.svg"] {
            let detail = why_not(&app, &format!("{page}?{asked}"), status);
            assert!(detail.contains(told), "{asked}: {detail}");
        }
    }
    for file in ["loss.svg", "success-by-steps.png"] {
        let path = format!("/compare/{file}?runs=1,2");
        assert!(why_not(&app, &path, 404).contains(file));
    }
}

#[test]
fn ticked_runs_are_side_by_side_in_a_table_and_in_every_figure() {
    let app = two_runs([3, 2]);
    let home = text(&app, "/");
    for run in [1, 2] {
        let tick = format!("type=\"checkbox\" name=\"run\" value=\"{run}\" form=\"compare\"");
        assert!(home.contains(&tick), "{tick} is not in {home}");
    }
    assert!(home.contains("action=\"/compare\""), "{home}");

    let page = text(&app, "/compare?run=1&run=2");
    assert_eq!(page, text(&app, "/compare?runs=1,2"));
    for words in [
        "<a href=\"/runs/1\">Run 1</a>",
        "<a href=\"/runs/2\">Run 2</a>",
        "<td>0 of 10,000</td>",
        "<td>50 %</td>",
        "<td>25 %</td>",
    ] {
        assert!(page.contains(words), "{words} is not in {page}");
    }
    for figure in ["success-by-steps", "success-by-answers", "return-by-steps"] {
        let path = format!("/compare/{figure}.svg?runs=1,2");
        assert!(page.contains(&format!("src=\"{path}\"")), "{path}");
        let reply = app.stranger().send("GET", &path, None).expect(200);
        assert_eq!(reply.headers["content-type"], "image/svg+xml");
        for line in ["run 1: STAIR, seed 1", "run 2: STAIR, seed 2"] {
            assert!(reply.text.contains(line), "{line} is not in {}", reply.text);
        }
    }
}

#[test]
fn one_run_alone_has_nothing_to_be_compared_with() {
    let app = TestApp::start(1);
    let home = text(&app, "/");
    assert!(home.contains("href=\"/runs/1\""), "{home}");
    assert!(!home.contains("/compare") && !home.contains("name=\"run\""));
}

#[test]
fn runs_without_a_trial_have_words_instead_of_curves() {
    let app = two_runs([0, 0]);
    let page = text(&app, "/compare?runs=1,2");
    assert!(page.contains("None of these runs has been tried yet."));
    assert!(page.contains("<td>not tried yet</td>") && !page.contains("<img"));
    let told = why_not(&app, "/compare/success-by-steps.svg?runs=1,2", 404);
    assert!(told.contains("None of these runs has been tried yet."));

    let app = two_runs([2, 0]);
    let page = text(&app, "/compare?runs=1,2");
    assert!(page.contains("Run 2 has not been tried yet, so it has no curve."));
    let svg = text(&app, "/compare/success-by-steps.svg?runs=1,2");
    assert!(svg.contains("run 1: STAIR") && !svg.contains("run 2: "));
}

#[test]
fn runs_of_different_tasks_are_not_compared_by_their_return() {
    let second = NewRun {
        task: "window-open".into(),
        ..collection()
    };
    let app = beside(second, [2, 2]);
    let page = text(&app, "/compare?runs=1,2");
    assert!(page.contains("These runs are of different tasks."));
    assert!(page.contains("success-by-steps.svg") && !page.contains("return-by-steps"));
    let told = why_not(&app, "/compare/return-by-steps.svg?runs=1,2", 422);
    assert!(told.contains("no curve of the return"), "{told}");
    let svg = text(&app, "/compare/success-by-steps.svg?runs=1,2");
    assert!(svg.contains(">go-fetch-return<") && svg.contains(">window-open<"));
}

/// A study of one pair, whose run gets the next number.
async fn add_study(store: &Store) {
    let study = NewStudy {
        title: "Which is better?".into(),
        question: Question::Preference,
        file: String::new(),
        folder: String::new(),
    };
    let study = store.add_study(study).await.expect("a study");
    let pair = query(0);
    let item = NewItem {
        task: 0,
        method: Some((0, "stair".to_owned())),
        role: ItemRole::Counted,
        expects: None,
        because: String::new(),
        first: pair.first,
        second: pair.second,
    };
    let tasks = ["go-fetch-return".to_owned()];
    let added = store.add_items(study, &tasks, vec![item]).await;
    added.expect("a pair");
    draw_all(store).await;
}

#[test]
fn the_run_of_a_study_is_not_compared() {
    let app = TestApp::start_with(1, |folder| {
        let runtime = tokio::runtime::Runtime::new().expect("threads");
        runtime.block_on(async {
            let store = Store::open(folder).await.expect("a store");
            add_study(&store).await;
        });
    });
    let told = why_not(&app, "/compare?runs=1,2", 422);
    assert!(told.contains("Run 2 is a part of study 1"), "{told}");
}
