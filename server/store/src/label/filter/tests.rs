use domain::answer::{Answer, StageJudgement};
use domain::environment::TaskReward;
use domain::episode::{EpisodeId, Segment, SegmentRecord};
use domain::query::{OfferedQuery, QueryKey};
use tempfile::TempDir;

use super::*;
use crate::answer::{NewAnswer, StoredAnswer, Timing};
use crate::clip::NewClip;
use crate::labeler::LabelerId;
use crate::run::NewRun;
use crate::study::{ItemRole, NewItem, NewStudy, SealedClips, StudyPlan};
use crate::time::now_ms;

const LATER: i64 = i64::MAX / 2;

async fn opened() -> (TempDir, Store) {
    let folder = tempfile::tempdir().unwrap();
    let store = Store::open(folder.path()).await.unwrap();
    (folder, store)
}

fn record(episode: u32) -> SegmentRecord {
    SegmentRecord {
        segment: Segment {
            episode: EpisodeId(episode),
            start: 3,
            len: 2,
        },
        poses: vec![vec![episode as f32]; 2],
        task_rewards: vec![TaskReward(0.5); 2],
        stages: vec![0, 1],
    }
}

/// A run with a query in each of `n` rounds; the stage question is asked about the first.
async fn run_of(store: &Store, task: &str, method: &str, n: u32) -> RunId {
    let run = NewRun {
        task: task.into(),
        method: method.into(),
        preset: String::new(),
        seed: 1,
        teacher: "http".into(),
        draws_clips: false,
        config: String::new(),
        budget: 100,
        total_steps: 1,
        is_trained: false,
    };
    let run = store.add_run(run).await.unwrap();
    let queries = (0..n).map(|session| OfferedQuery {
        key: QueryKey { session, index: 0 },
        first: record(2 * session),
        second: record(2 * session + 1),
        asks_same_stage: session == 0,
        disagreement: None,
        stage_gap: None,
        typical_reward: None,
    });
    let queries: Vec<OfferedQuery> = queries.collect();
    store.offer(run, &queries, false).await.unwrap();
    run
}

/// A word as a person presses it.
fn pressed(word: &str) -> NewAnswer {
    NewAnswer {
        pressed: word.into(),
        reason: (word == "skip").then(|| "too dark".into()),
        timing: Timing {
            input: Some("key".into()),
            ..Timing::default()
        },
        ..NewAnswer::default()
    }
}

/// Answers the next questions of a run; returns the leases with what was stored.
async fn answer(
    store: &Store,
    run: RunId,
    who: LabelerId,
    answers: Vec<NewAnswer>,
) -> Vec<(String, StoredAnswer)> {
    let mut stored = Vec::new();
    for answer in answers {
        let leases = store.lease(run, who, 1, false, now_ms()).await.unwrap();
        let lease = leases[0].id.clone();
        let kept = store.answer(&lease, who, answer).await.unwrap();
        stored.push((lease, kept));
    }
    stored
}

/// Two runs with four answers each. Ada pressed left, same and right and then changed the last to
/// equal; of Bo's two skips nobody pressed the second.
async fn two_runs(store: &Store) -> ([RunId; 2], Vec<StoredAnswer>) {
    let push = run_of(store, "push", "stair", 2).await;
    let pull = run_of(store, "pull", "pebble", 3).await;
    let ada = store.sign_in("Ada").await.unwrap().0.id;
    let bo = store.sign_in("Bo").await.unwrap().0.id;
    let words = ["left", "same", "right"].map(pressed).to_vec();
    let mut stored = answer(store, push, ada, words).await;
    let (lease, last) = stored[2].clone();
    let changed = NewAnswer {
        supersedes: Some(last.id),
        ..pressed("equal")
    };
    let changed = store.answer(&lease, ada, changed).await.unwrap();
    stored.push((lease, changed));
    let by_nobody = NewAnswer {
        timing: Timing::default(),
        ..pressed("skip")
    };
    let words = ["equal", "different", "skip"].map(pressed);
    let words = words.into_iter().chain([by_nobody]).collect();
    stored.extend(answer(store, pull, bo, words).await);
    let stored = stored.into_iter().map(|(_, stored)| stored).collect();
    ([push, pull], stored)
}

/// How many answers fit.
async fn n_of(store: &Store, filter: &LabelFilter) -> u64 {
    let found = store
        .filtered_labels(filter, LabelsFrom::Newest, 100)
        .await
        .unwrap();
    assert_eq!(found.n_in_all, found.labels.len() as u64);
    found.n_in_all
}

/// Filters with one thing set, and how many of the answers of [`two_runs`] fit.
async fn assert_counts<const N: usize>(cases: [(LabelFilter, u64); N]) {
    let (_folder, store) = opened().await;
    two_runs(&store).await;
    for (filter, n) in cases {
        assert_eq!(n_of(&store, &filter).await, n, "{filter:?}");
    }
}

fn flag(flag: LabelFlag) -> LabelFilter {
    LabelFilter {
        flag: Some(flag),
        ..LabelFilter::default()
    }
}

#[tokio::test]
async fn a_filter_lets_through_what_is_of_its_run_study_labeler_task_method_and_question() {
    let none = LabelFilter::default;
    let of_run = |run| LabelFilter {
        run: Some(RunId(run)),
        ..none()
    };
    let by = |name: &str| LabelFilter {
        labeler: Some(name.to_owned()),
        ..none()
    };
    let of_study = LabelFilter {
        study: Some(StudyId(1)),
        ..none()
    };
    let of_task = LabelFilter {
        task: Some("pull".to_owned()),
        ..none()
    };
    let of_method = LabelFilter {
        method: Some("stair".to_owned()),
        ..none()
    };
    let about_stages = LabelFilter {
        question: Some(Question::SameStage),
        ..none()
    };
    assert_counts([
        (none(), 8),
        (of_run(1), 4),
        (of_run(99), 0),
        (of_study, 0),
        (by("ADA"), 4),
        (by("' or 1 = 1 --"), 0),
        (of_task, 4),
        (of_method, 4),
        (about_stages, 2),
    ])
    .await;
}

#[tokio::test]
async fn a_filter_lets_through_what_has_its_word_flag_or_round_and_several_what_fits_all() {
    let word = |pressed| LabelFilter {
        pressed: Some(pressed),
        ..LabelFilter::default()
    };
    let round = |session| LabelFilter {
        session: Some(session),
        ..LabelFilter::default()
    };
    let skipped = |task: &str, labeler, session| LabelFilter {
        task: Some(task.to_owned()),
        labeler,
        session,
        ..flag(LabelFlag::Skipped)
    };
    assert_counts([
        (word(Pressed::Preference(Answer::Equal)), 2),
        (word(Pressed::SameStage(StageJudgement::Different)), 1),
        (word(Pressed::SameStage(StageJudgement::Skip)), 2),
        (flag(LabelFlag::Changed), 2),
        (flag(LabelFlag::Skipped), 2),
        (flag(LabelFlag::PassedOver), 1),
        (flag(LabelFlag::Practice), 0),
        (round(0), 4),
        (round(2), 1),
        (skipped("pull", Some("Bo".to_owned()), Some(1)), 1),
        (skipped("push", None, None), 0),
    ])
    .await;
}

#[tokio::test]
async fn a_span_of_time_holds_its_beginning_and_not_its_end() {
    let (_folder, store) = opened().await;
    let (_, stored) = two_runs(&store).await;
    for at in stored.iter().map(|answer| answer.stored_at_ms) {
        let n_from = stored.iter().filter(|a| a.stored_at_ms >= at).count() as u64;
        let from = LabelFilter {
            from_ms: Some(at),
            ..LabelFilter::default()
        };
        let before = LabelFilter {
            before_ms: Some(at),
            ..LabelFilter::default()
        };
        assert_eq!(n_of(&store, &from).await, n_from);
        assert_eq!(n_of(&store, &before).await, 8 - n_from);
    }
}

#[tokio::test]
async fn what_there_is_to_filter_by_is_what_answers_have() {
    let (_folder, store) = opened().await;
    two_runs(&store).await;
    run_of(&store, "lift", "rune", 1).await;
    store.sign_in("Cy").await.unwrap();
    let choices = store.label_choices().await.unwrap();
    assert_eq!(choices.labelers, ["Ada", "Bo"]);
    assert_eq!(choices.tasks, ["pull", "push"]);
    assert_eq!(choices.methods, ["pebble", "stair"]);
}

/// Numbers of the answers on a page, as stored.
fn sequences(found: &FoundLabels) -> Vec<i64> {
    found.labels.iter().map(|f| f.label.sequence).collect()
}

#[tokio::test]
async fn pages_leave_nothing_out_and_show_nothing_twice_while_answers_arrive() {
    let (_folder, store) = opened().await;
    let run = run_of(&store, "push", "stair", 8).await;
    let ada = store.sign_in("Ada").await.unwrap().0.id;
    let words = [
        "left", "same", "left", "left", "left", "left", "left", "left",
    ];
    answer(&store, run, ada, words.map(pressed).to_vec()).await;
    let preferences = LabelFilter {
        question: Some(Question::Preference),
        ..LabelFilter::default()
    };
    let page = async |from| {
        let found = store.filtered_labels(&preferences, from, 3).await;
        found.unwrap()
    };
    let first = page(LabelsFrom::Newest).await;
    assert_eq!((sequences(&first), first.n_in_all), (vec![7, 6, 5], 7));
    assert_eq!(first.newer, None);

    answer(&store, run, ada, vec![pressed("right")]).await;
    let second = page(first.older.unwrap()).await;
    assert_eq!((sequences(&second), second.n_in_all), (vec![4, 3, 2], 8));
    let third = page(second.older.unwrap()).await;
    assert_eq!((sequences(&third), third.older), (vec![1], None));

    let back = page(third.newer.unwrap()).await;
    assert_eq!(sequences(&back), [4, 3, 2]);
    let back = page(back.newer.unwrap()).await;
    assert_eq!(sequences(&back), [7, 6, 5]);
    assert_eq!(back.newer, Some(LabelsFrom::Newest));
    assert_eq!(sequences(&page(LabelsFrom::Newest).await), [8, 7, 6]);

    let below_all = page(LabelsFrom::Below(0)).await;
    assert!(below_all.labels.is_empty() && below_all.older.is_none());
    assert!(below_all.newer.is_some(), "there is a way back");
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

/// An open study of a practice pair and one pair of either of two methods, all answered.
async fn answered_study(store: &Store) -> StudyId {
    let study = NewStudy {
        title: "Which?".into(),
        question: Question::Preference,
        file: String::new(),
        folder: String::new(),
    };
    let study = store.add_study(study).await.unwrap();
    let item = |n: u32, role: ItemRole, method: Option<(u32, &str)>| NewItem {
        task: 0,
        method: method.map(|(number, name)| (number, name.to_owned())),
        role,
        expects: (role == ItemRole::Practice).then_some("first"),
        because: String::new(),
        first: record(2 * n),
        second: record(2 * n + 1),
    };
    let items = vec![
        item(0, ItemRole::Practice, None),
        item(1, ItemRole::Counted, Some((0, "stair"))),
        item(2, ItemRole::Counted, Some((1, "rune"))),
    ];
    let tasks = vec!["push".to_owned()];
    store.add_items(study, &tasks, items).await.unwrap();
    while let Some(job) = store.next_clip_job().await.unwrap() {
        let (first, second) = (clip(2 * job.query.0), clip(2 * job.query.0 + 1));
        store
            .attach_clips(job.query, &first, &second)
            .await
            .unwrap();
    }
    let pairs = store.items(study).await.unwrap().into_iter();
    let sealed = pairs.map(|item| SealedClips {
        query: item.query,
        first: clip(100 + 2 * item.query.0),
        second: clip(101 + 2 * item.query.0),
    });
    store.seal_study(study, sealed.collect()).await.unwrap();
    store.open_study(study).await.unwrap();
    let places = store.invite(study, 1, 1, LATER).await.unwrap();
    let plan = StudyPlan {
        tasks,
        repeats_per_task: 0,
        seed: 1,
    };
    let entered = store.enter(&places[0].1, plan, 5).await.unwrap();
    let who = entered.labeler.id;
    let run = store.seat_of(who).await.unwrap().unwrap().2[0].run;
    let words = ["left", "left", "left"].map(pressed).to_vec();
    answer(store, run, who, words).await;
    study
}

#[tokio::test]
async fn no_filter_and_no_choice_tells_a_method_of_a_study_that_is_not_closed() {
    let (_folder, store) = opened().await;
    run_of(&store, "push", "stair", 1).await;
    let study = answered_study(&store).await;
    let of_study = LabelFilter {
        study: Some(study),
        ..LabelFilter::default()
    };
    let chosen_by = |method: &str| LabelFilter {
        method: Some(method.to_owned()),
        ..LabelFilter::default()
    };
    let practice = LabelFilter {
        flag: Some(LabelFlag::Practice),
        ..of_study.clone()
    };
    assert_eq!(n_of(&store, &of_study).await, 3);
    assert_eq!(n_of(&store, &practice).await, 1);
    for method in ["stair", "rune", "study"] {
        assert_eq!(n_of(&store, &chosen_by(method)).await, 0, "{method}");
    }
    let choices = store.label_choices().await.unwrap();
    assert!(choices.methods.is_empty(), "{choices:?}");
    let found = store
        .filtered_labels(&of_study, LabelsFrom::Newest, 9)
        .await
        .unwrap();
    let hides = |found: &FoundLabel| found.is_blinded && found.label.method.is_none();
    assert!(found.labels.iter().all(hides), "{found:?}");

    store.close_study(study).await.unwrap();
    for method in ["stair", "rune"] {
        assert_eq!(n_of(&store, &chosen_by(method)).await, 1, "{method}");
    }
    let choices = store.label_choices().await.unwrap();
    assert_eq!(choices.methods, ["rune", "stair"]);
    let found = store
        .filtered_labels(&of_study, LabelsFrom::Newest, 9)
        .await
        .unwrap();
    assert!(found.labels.iter().all(|found| !found.is_blinded));
}
