use std::collections::BTreeMap;

use domain::answer::Which;
use domain::environment::TaskReward;
use domain::episode::{EpisodeId, Segment, SegmentRecord};
use tempfile::TempDir;

use super::*;
use crate::answer::NewAnswer;
use crate::clip::NewClip;
use crate::error::LinkTrouble;
use crate::label::LabelsOf;
use crate::labeler::LabelerId;
use crate::query::QueryId;
use crate::secret::Secret;

const LATER: i64 = i64::MAX / 2;

fn record(episode: u32) -> SegmentRecord {
    let segment = Segment {
        episode: EpisodeId(episode),
        start: 3,
        len: 2,
    };
    SegmentRecord {
        segment,
        poses: vec![vec![episode as f32]; 2],
        task_rewards: vec![TaskReward(0.5); 2],
        stages: vec![0, 1],
    }
}

fn clip(n: i64) -> NewClip {
    NewClip {
        bytes: n.to_le_bytes().to_vec(),
        sha256: format!("{n:064x}"),
        n_frames: 2,
        fps: 20,
        width: 8,
        height: 8,
    }
}

/// Two tasks; in each a practice pair, four pairs of either method and a check.
fn items() -> Vec<NewItem> {
    let mut items = Vec::new();
    for task in 0..2 {
        let mut put = |role, method: Option<u32>, expects| {
            let n = items.len() as u32;
            items.push(NewItem {
                task,
                method: method.map(|m| (m, ["stair", "pebble"][m as usize].to_owned())),
                role,
                expects,
                because: "look".into(),
                first: record(2 * n),
                second: record(2 * n + 1),
            });
        };
        put(ItemRole::Practice, None, Some("first"));
        for method in [0, 1, 0, 1, 0, 1, 0, 1] {
            put(ItemRole::Counted, Some(method), None);
        }
        put(ItemRole::Check, None, Some("second"));
    }
    items
}

fn plan() -> StudyPlan {
    StudyPlan {
        tasks: vec!["push".into(), "pull".into()],
        repeats_per_task: 2,
        seed: 1,
    }
}

async fn prepared(question: Question) -> (TempDir, Store, StudyId) {
    let folder = tempfile::tempdir().unwrap();
    let store = Store::open(folder.path()).await.unwrap();
    let study = NewStudy {
        title: "Which?".into(),
        question,
        file: String::new(),
        folder: String::new(),
    };
    let id = store.add_study(study).await.unwrap();
    for _ in 0..2 {
        // a preparation that was interrupted begins again
        store.add_items(id, &plan().tasks, items()).await.unwrap();
    }
    while let Some(job) = store.next_clip_job().await.unwrap() {
        let (a, b) = (clip(2 * job.query.0), clip(2 * job.query.0 + 1));
        store.attach_clips(job.query, &a, &b).await.unwrap();
    }
    (folder, store, id)
}

/// As drawn, with other bytes.
async fn seal(store: &Store, study: StudyId) {
    let pairs = store.items(study).await.unwrap().into_iter();
    let sealed = pairs.map(|item| SealedClips {
        query: item.query,
        first: clip(1_000 + 2 * item.query.0),
        second: clip(1_001 + 2 * item.query.0),
    });
    store.seal_study(study, sealed.collect()).await.unwrap();
}

async fn seated(store: &Store, study: StudyId) -> LabelerId {
    let [(_, secret)] = &store.invite(study, 1, 9, LATER).await.unwrap()[..] else {
        panic!("one place");
    };
    store.enter(secret, plan(), 5).await.unwrap().labeler.id
}

fn word(pressed: &str) -> NewAnswer {
    NewAnswer {
        pressed: pressed.into(),
        ..NewAnswer::default()
    }
}

#[tokio::test]
async fn a_preparation_that_begins_again_keeps_its_pairs_and_sealing_replaces_their_clips() {
    let (folder, store, study) = prepared(Question::Preference).await;
    let row = store.study(study).await.unwrap();
    assert_eq!((row.n_items, row.n_drawn, row.n_bad), (20, 20, 0));
    let drawn = store.items(study).await.unwrap()[0].clips.clone().unwrap();
    seal(&store, study).await;
    let sealed = store.items(study).await.unwrap()[0].clips.clone().unwrap();
    assert_ne!(drawn, sealed);
    assert!(store.clip(&drawn[0]).await.is_err(), "its row is gone");
    let bytes = |sha: &str| {
        folder
            .path()
            .join("clips")
            .join(&sha[..2])
            .join(format!("{sha}.mp4"))
    };
    assert!(!bytes(&drawn[0]).exists() && bytes(&sealed[0]).exists());
    assert_eq!(store.study(study).await.unwrap().state, "ready");
    assert!(store.runs().await.unwrap().is_empty(), "no run of its own");
}

#[tokio::test]
async fn a_labeler_practises_first_and_meets_the_planned_pairs_with_the_planned_sides() {
    let (_folder, store, study) = prepared(Question::SameStage).await;
    seal(&store, study).await;
    store.open_study(study).await.unwrap();
    let labeler = seated(&store, study).await;
    let (_, number, parts) = store.seat_of(labeler).await.unwrap().unwrap();
    let told: Vec<_> = parts.iter().map(|p| (p.task.as_str(), p.budget)).collect();
    assert_eq!((number, told), (1, vec![("push", 11), ("pull", 11)]));

    let run = parts[0].run;
    let mut n_practice = 0;
    for n in 0..12 {
        let leases = store.lease(run, labeler, 3, true, 10).await.unwrap();
        assert_eq!(leases.len(), 3.min(12 - n));
        assert_eq!(leases[0].question, Question::SameStage);
        assert_eq!(leases[0].practice.is_some(), n == 0, "practice comes first");
        n_practice += u32::from(leases[0].practice.is_some());
        store
            .answer(&leases[0].id, labeler, word("same"))
            .await
            .unwrap();
        let answered = store.progress(run).await.unwrap().answered;
        assert_eq!(
            answered,
            n as u32 + 1 - n_practice,
            "practice is not counted"
        );
    }
    let (_, _, parts) = store.seat_of(labeler).await.unwrap().unwrap();
    assert_eq!([parts[0].is_done, parts[1].is_done], [true, false]);

    let labels = store
        .labels(LabelsOf::Study(study), 0, 100)
        .await
        .unwrap()
        .labels;
    let mut sides: BTreeMap<Option<i64>, Vec<Which>> = BTreeMap::new();
    for label in labels
        .iter()
        .filter(|l| l.role.as_deref() != Some("practice"))
    {
        let left_is = crate::query::which(&label.left_is);
        sides.entry(label.item_id).or_default().push(left_is);
    }
    let twice: Vec<_> = sides.values().filter(|s| s.len() == 2).collect();
    assert_eq!((sides.len(), twice.len()), (9, 2));
    assert!(
        twice.iter().all(|s| s[0] == s[1].other()),
        "repeats are swapped"
    );
}

#[tokio::test]
async fn right_answers_of_practice_are_told_as_sides() {
    let (_folder, store, study) = prepared(Question::Preference).await;
    seal(&store, study).await;
    store.open_study(study).await.unwrap();
    let mut seen = BTreeMap::new();
    for _ in 0..8 {
        let labeler = seated(&store, study).await;
        let parts = store.seat_of(labeler).await.unwrap().unwrap().2;
        let lease = &store
            .lease(parts[0].run, labeler, 1, true, 10)
            .await
            .unwrap()[0];
        let practice = lease.practice.clone().unwrap();
        seen.insert(lease.left_is == Which::First, practice.expects);
    }
    let told: Vec<_> = seen.iter().map(|(k, v)| (*k, v.as_str())).collect();
    assert_eq!(told, [(false, "right"), (true, "left")]);
}

#[tokio::test]
async fn methods_are_told_only_once_the_study_is_closed_and_that_is_logged() {
    let (folder, store, study) = prepared(Question::SameStage).await;
    seal(&store, study).await;
    store.open_study(study).await.unwrap();
    let labeler = seated(&store, study).await;
    let run = store.seat_of(labeler).await.unwrap().unwrap().2[0].run;
    for _ in 0..12 {
        let lease = store
            .lease(run, labeler, 1, true, 10)
            .await
            .unwrap()
            .remove(0);
        store
            .answer(&lease.id, labeler, word("different"))
            .await
            .unwrap();
    }
    let open = store.lease(run, labeler, 1, true, 10).await.unwrap();
    assert!(open.is_empty());
    let methods = || async {
        let labels = store
            .labels(LabelsOf::Study(study), 0, 100)
            .await
            .unwrap()
            .labels;
        let counted = labels
            .into_iter()
            .filter(|l| l.role.as_deref() == Some("counted"));
        counted.filter_map(|l| l.method).collect::<Vec<_>>()
    };
    assert!(methods().await.is_empty());
    store.close_study(study).await.unwrap();
    assert_eq!(methods().await.len(), 8);
    drop(store);
    let store = Store::open(folder.path()).await.unwrap();
    let n = sqlx::query("select count(*) from audit where action = 'closed and unblinded'")
        .fetch_one(store.readers())
        .await
        .unwrap();
    assert_eq!(n.get::<i64, _>(0), 1);
}

#[tokio::test]
async fn questions_of_a_study_are_for_one_labeler_and_while_it_is_open() {
    let (_folder, store, study) = prepared(Question::Preference).await;
    seal(&store, study).await;
    store.open_study(study).await.unwrap();
    let (labeler, other) = (seated(&store, study).await, seated(&store, study).await);
    let run = store.seat_of(labeler).await.unwrap().unwrap().2[0].run;
    let ordinary = super::item::collection("push", 1);
    let ordinary = store.add_run(ordinary).await.unwrap();
    for run in [run, ordinary] {
        let refused = store.lease(run, other, 1, true, 10).await.unwrap_err();
        assert!(matches!(refused, StoreError::NotYours), "{refused}");
    }
    let lease = store
        .lease(run, labeler, 1, true, 10)
        .await
        .unwrap()
        .remove(0);
    store.close_study(study).await.unwrap();
    for refused in [
        store.lease(run, labeler, 1, true, 10).await.unwrap_err(),
        store
            .answer(&lease.id, labeler, word("left"))
            .await
            .unwrap_err(),
    ] {
        assert!(
            matches!(refused, StoreError::StudyState { .. }),
            "{refused}"
        );
    }
    let kept = sqlx::query("select count(*) from late_answer")
        .fetch_one(store.readers())
        .await
        .unwrap();
    assert_eq!(kept.get::<i64, _>(0), 1, "the late answer is kept aside");
}

#[tokio::test]
async fn a_link_works_once_and_says_why_it_does_not() {
    let (_folder, store, study) = prepared(Question::Preference).await;
    let early = store.invite(study, 1, 2, LATER).await.unwrap_err();
    assert!(matches!(early, StoreError::StudyState { .. }), "{early}");
    seal(&store, study).await;
    let places = store.invite(study, 2, 2, 1_000).await.unwrap();
    let full = store.invite(study, 1, 2, LATER).await.unwrap_err();
    assert!(
        full.to_string().contains("no more can be invited"),
        "{full}"
    );
    let trouble = |result: Result<Entrance, StoreError>| match result {
        Err(StoreError::Link(trouble)) => trouble,
        other => panic!("{other:?}"),
    };
    let secret = &places[0].1;
    assert_eq!(
        trouble(store.entrance(secret, 5).await),
        LinkTrouble::NotYet
    );
    store.open_study(study).await.unwrap();
    assert_eq!(
        trouble(store.entrance(secret, 1_000).await),
        LinkTrouble::Expired
    );
    let unknown = Secret::brought("abc");
    assert_eq!(
        trouble(store.entrance(&unknown, 5).await),
        LinkTrouble::Unknown
    );
    assert!(!store.entrance(secret, 5).await.unwrap().is_return);
    let entered = store.enter(secret, plan(), 5).await.unwrap();
    assert_eq!(trouble(store.entrance(secret, 5).await), LinkTrouble::Used);
    assert!(store.enter(secret, plan(), 5).await.is_err());

    let typed = Secret::typed(
        &entered
            .return_code
            .reveal()
            .to_uppercase()
            .replace('a', "a-"),
    );
    let browser = store.come_back(&typed).await.unwrap();
    let back = store.bearer(&browser).await.unwrap().unwrap();
    assert_eq!(back.labeler, Some(entered.labeler.clone()));

    let fresh = store.invite_again(study, 1, LATER).await.unwrap();
    assert!(store.entrance(&fresh, 5).await.unwrap().is_return);
    let again = store.enter(&fresh, plan(), 5).await.unwrap();
    assert_eq!(again.labeler, entered.labeler);
    let parts = store.seat_of(again.labeler.id).await.unwrap().unwrap().2;
    assert_eq!(parts.len(), 2, "nothing is laid out twice");
    store.close_study(study).await.unwrap();
    assert_eq!(
        trouble(store.entrance(&places[1].1, 5).await),
        LinkTrouble::Closed
    );
}

#[tokio::test]
async fn a_preparation_that_failed_can_be_taken_up_again() {
    let folder = tempfile::tempdir().unwrap();
    let store = Store::open(folder.path()).await.unwrap();
    let study = NewStudy {
        title: "Which?".into(),
        question: Question::Preference,
        file: String::new(),
        folder: String::new(),
    };
    let id = store.add_study(study).await.unwrap();
    store.add_items(id, &plan().tasks, items()).await.unwrap();
    store
        .clip_failed(QueryId(1), "no such device")
        .await
        .unwrap();
    assert_eq!(store.study(id).await.unwrap().n_bad, 1);
    assert!(store.retry_study(id).await.is_err(), "it has not failed");
    store
        .fail_study(id, "1 pair cannot be drawn")
        .await
        .unwrap();
    store.retry_study(id).await.unwrap();
    let row = store.study(id).await.unwrap();
    assert_eq!((row.state.as_str(), row.n_bad), ("preparing", 0));
}

#[tokio::test]
async fn nobody_comes_in_as_a_labeler_of_a_study_or_as_a_program_by_typing_a_name() {
    let (_folder, store, study) = prepared(Question::Preference).await;
    seal(&store, study).await;
    store.open_study(study).await.unwrap();
    let name = crate::labeler::name_of_seat(1, study);
    let typed_before = Secret::random().unwrap();
    let (squatted, browser) = (name.clone(), typed_before.clone());
    store
        .write(move |t| {
            Box::pin(async move {
                // as versions did that kept no names
                let id = crate::labeler::find_or_add_kept(t, &squatted).await?;
                crate::labeler::admit(t, id, &browser).await
            })
        })
        .await
        .unwrap();
    assert!(store.bearer(&typed_before).await.unwrap().is_some());
    let labeler = seated(&store, study).await;
    assert!(store.seat_of(labeler).await.unwrap().is_some());
    let bearer = store.bearer(&typed_before).await.unwrap();
    assert_eq!(bearer, None, "whoever had typed it is out");

    let ordinary = store
        .add_run(super::item::collection("push", 1))
        .await
        .unwrap();
    store.add_teacher_token(ordinary).await.unwrap();
    let program = crate::labeler::name_of_program(ordinary);
    for name in [
        name.as_str(),
        program.as_str(),
        "(server)",
        "labeler 99 of study 99",
    ] {
        let refused = store.sign_in(name).await.unwrap_err();
        assert!(matches!(&refused, StoreError::NameKept(n) if n == name));
        assert!(refused.to_string().contains("another name"), "{refused}");
    }
}
