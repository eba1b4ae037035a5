//! Data folders that somebody else holds, that are newer, or that were there before.

use domain::teacher::Answered;
use store::{BY_THE_PAGE, LabelsOf, NewAnswer, PassedOver, RunId, Store, StoreError, now_ms};

use crate::stories::server_process::stair;
use crate::support::{TestApp, clip, collection, query};

#[test]
fn a_data_folder_that_another_server_holds_is_refused_with_its_number() {
    let app = TestApp::start(1);
    let output = stair()
        .args(["serve", "--bind", "127.0.0.1:0", "--data"])
        .arg(app.data())
        .stderr(std::process::Stdio::piped())
        .output()
        .expect("stair serve");
    let told = String::from_utf8_lossy(&output.stderr).into_owned();
    assert_eq!(output.status.code(), Some(2), "{told}");
    assert!(
        told.contains("another server holds the data folder") && told.contains("process"),
        "{told}"
    );
}

#[test]
fn an_address_that_others_can_reach_needs_a_token() {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let output = stair()
        .args(["serve", "--bind", "0.0.0.0:0", "--data"])
        .arg(folder.path())
        .stderr(std::process::Stdio::piped())
        .output()
        .expect("stair serve");
    let told = String::from_utf8_lossy(&output.stderr).into_owned();
    assert_eq!(output.status.code(), Some(2), "{told}");
    assert!(told.contains("token"), "{told}");
}

#[tokio::test]
async fn a_data_folder_that_is_a_file_is_refused_in_words() {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let file = folder.path().join("file");
    std::fs::write(&file, "no folder").expect("a file");
    let Err(error) = Store::open(&file).await else {
        panic!("it was opened")
    };
    assert!(matches!(error, StoreError::Folder { .. }), "{error}");
}

#[tokio::test]
async fn what_is_stored_is_there_after_the_migrations_ran_again() {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let run = answered_once(folder.path()).await;
    let store = Store::open(folder.path()).await.expect("the store again");
    let answers: Vec<Answered> = store.answers_after(run, 0).await.expect("answers");
    assert_eq!(answers.len(), 1);
    store
        .offer(run, &[query(0), query(1)], true)
        .await
        .expect("asked again");
    assert_eq!(store.progress(run).await.expect("progress").session_size, 2);
}

/// An agent that fell back to an earlier checkpoint and went another way from there.
#[tokio::test]
async fn other_segments_under_the_number_of_a_stored_query_are_refused() {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let (store, run) = with_one_query(folder.path()).await;
    let (mut elsewhere, mut other_poses) = (query(1), query(1));
    elsewhere.second.segment.start += 1;
    other_poses.first.poses[0][0] += 0.5;
    for other in [elsewhere, other_poses] {
        let told = store.offer(run, &[query(2), other], true).await;
        assert!(matches!(told, Err(StoreError::OtherSegments(key)) if key.index == 1));
        let size = store.progress(run).await.expect("progress").session_size;
        assert_eq!(size, 1, "nothing of it is stored");
    }
}

#[tokio::test]
async fn a_lease_that_ran_out_goes_to_the_next_labeler_and_the_late_answer_is_kept_aside() {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let (store, run) = with_one_query(folder.path()).await;
    let (ada, _) = store.sign_in("Ada").await.expect("Ada");
    let (bo, _) = store.sign_in("Bo").await.expect("Bo");
    let now = now_ms();
    let first = store
        .lease(run, ada.id, 1, true, now)
        .await
        .expect("a lease");
    assert!(
        store
            .lease(run, bo.id, 1, true, now)
            .await
            .expect("none")
            .is_empty()
    );
    assert_eq!(store.queue(run, bo.id).await.expect("a queue").n_held, 1);
    let later = now + 11 * 60 * 1000;
    let second = store
        .lease(run, bo.id, 1, true, later)
        .await
        .expect("taken over");
    assert_eq!(second[0].query, first[0].query);
    let late = store.answer(&first[0].id, ada.id, left()).await;
    assert!(matches!(late, Err(StoreError::Taken)), "{late:?}");
    // Each of them is kept, and none twice.
    let changed = NewAnswer {
        pressed: "right".into(),
        ..left()
    };
    for answer in [left(), changed] {
        let late = store.answer(&first[0].id, ada.id, answer).await;
        assert!(matches!(late, Err(StoreError::Taken)), "{late:?}");
    }
    assert_eq!(store.n_late_answers(run).await.expect("a number"), 2);
    store
        .answer(&second[0].id, bo.id, left())
        .await
        .expect("Bo's answer");
    assert_eq!(store.answers_after(run, 0).await.expect("answers").len(), 1);
}

#[tokio::test]
async fn what_a_page_passed_over_is_told_until_somebody_answers_it() {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let (store, run) = with_one_query(folder.path()).await;
    let (ada, _) = store.sign_in("Ada").await.expect("Ada");
    let lease = store
        .lease(run, ada.id, 1, true, now_ms())
        .await
        .expect("a lease");
    let skip = NewAnswer {
        pressed: "skip".into(),
        reason: Some(format!("{BY_THE_PAGE}no decoder")),
        ..NewAnswer::default()
    };
    let skipped = store.answer(&lease[0].id, ada.id, skip).await;
    let told = async || {
        store
            .passed_over(LabelsOf::Run(run), 5)
            .await
            .expect("read")
    };
    assert_eq!(
        told().await,
        [PassedOver {
            query_id: lease[0].query.0,
            session: 0,
            labeler: "Ada".into(),
            reason: "no decoder".into(),
        }]
    );
    let answered = NewAnswer {
        supersedes: Some(skipped.expect("stored").id),
        ..left()
    };
    let answered = store.answer(&lease[0].id, ada.id, answered).await;
    answered.expect("stored");
    assert_eq!(told().await, []);
}

#[tokio::test]
async fn an_overdue_answer_counts_when_nobody_else_has_the_question() {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let (store, run) = with_one_query(folder.path()).await;
    let (ada, _) = store.sign_in("Ada").await.expect("Ada");
    let long_ago = now_ms() - 60 * 60 * 1000;
    let lease = store
        .lease(run, ada.id, 1, true, long_ago)
        .await
        .expect("a lease");
    assert!(
        store
            .answer(&lease[0].id, ada.id, left())
            .await
            .expect("stored")
            .is_new
    );
}

#[tokio::test]
async fn a_query_that_cannot_be_drawn_is_skipped_by_the_server_and_shown_to_the_researcher() {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let store = Store::open(folder.path()).await.expect("a store");
    let run = store.add_run(collection()).await.expect("a run");
    store.offer(run, &[query(0)], true).await.expect("stored");
    let job = store.next_clip_job().await.expect("a job").expect("one");
    assert_eq!(job.first, vec![vec![0.5, 1.5]; 4]);
    store
        .clip_failed(job.query, "no such pose")
        .await
        .expect("noted");
    let answers = store.answers_after(run, 0).await.expect("answers");
    assert_eq!(
        answers.iter().map(|a| a.preference).collect::<Vec<_>>(),
        [None]
    );
    assert_eq!(
        store.bad_queries(run).await.expect("bad")[0].trouble,
        "no such pose"
    );
    assert!(store.next_clip_job().await.expect("none").is_none());
}

async fn with_one_query(folder: &std::path::Path) -> (Store, RunId) {
    let store = Store::open(folder).await.expect("a store");
    let run = store.add_run(collection()).await.expect("a run");
    store.offer(run, &[query(1)], true).await.expect("stored");
    let job = store.next_clip_job().await.expect("a job").expect("one");
    store
        .attach_clips(job.query, &clip(1), &clip(2))
        .await
        .expect("clips");
    (store, run)
}

async fn answered_once(folder: &std::path::Path) -> RunId {
    let (store, run) = with_one_query(folder).await;
    let (ada, _) = store.sign_in("Ada").await.expect("Ada");
    let lease = store
        .lease(run, ada.id, 1, true, now_ms())
        .await
        .expect("a lease");
    store
        .answer(&lease[0].id, ada.id, left())
        .await
        .expect("stored");
    run
}

fn left() -> NewAnswer {
    NewAnswer {
        pressed: "left".into(),
        ..NewAnswer::default()
    }
}
