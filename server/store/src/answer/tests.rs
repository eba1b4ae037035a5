use std::path::Path;

use domain::environment::TaskReward;
use domain::episode::{EpisodeId, Segment, SegmentRecord};
use domain::query::OfferedQuery;

use super::*;
use crate::run::NewRun;

fn record(episode: u32) -> SegmentRecord {
    SegmentRecord {
        segment: Segment {
            episode: EpisodeId(episode),
            start: 3,
            len: 2,
        },
        poses: vec![vec![0.5]; 2],
        task_rewards: vec![TaskReward(0.5); 2],
        stages: vec![0, 1],
    }
}

/// A run with one query, which is asked about in both ways.
async fn asked(folder: &Path) -> (Store, RunId) {
    let store = Store::open(folder).await.unwrap();
    let run = NewRun {
        task: "any".into(),
        method: "any".into(),
        preset: String::new(),
        seed: 1,
        teacher: "http".into(),
        draws_clips: false,
        config: String::new(),
        budget: 1,
        total_steps: 1,
        is_trained: false,
    };
    let run = store.add_run(run).await.unwrap();
    let query = OfferedQuery {
        key: QueryKey {
            session: 0,
            index: 0,
        },
        first: record(0),
        second: record(1),
        asks_same_stage: true,
        disagreement: None,
        stage_gap: None,
        typical_reward: None,
    };
    store.offer(run, &[query], false).await.unwrap();
    (store, run)
}

fn word(pressed: &str) -> NewAnswer {
    NewAnswer {
        pressed: pressed.into(),
        ..NewAnswer::default()
    }
}

#[tokio::test]
async fn an_answer_about_the_stages_of_a_skipped_pair_is_kept_aside_until_the_skip_is_taken_back() {
    let folder = tempfile::tempdir().unwrap();
    let (store, run) = asked(folder.path()).await;
    let (ada, _) = store.sign_in("Ada").await.unwrap();
    let leases = store.lease(run, ada.id, 2, false, now_ms()).await.unwrap();
    let [preference, stage] = &leases[..] else {
        panic!("both questions: {leases:?}");
    };
    let skip = NewAnswer {
        reason: Some("too dark".into()),
        ..word("skip")
    };
    let skipped = store.answer(&preference.id, ada.id, skip).await.unwrap();

    let late = store.answer(&stage.id, ada.id, word("same")).await;
    assert!(matches!(late, Err(StoreError::Withdrawn)), "{late:?}");
    let kept = sqlx::query("select pressed from late_answer where lease_id = ?")
        .bind(&stage.id)
        .fetch_one(store.readers())
        .await
        .unwrap();
    assert_eq!(kept.get::<String, _>(0), "same");
    let open = store.lease(run, ada.id, 2, false, now_ms()).await.unwrap();
    assert!(open.is_empty(), "it is not asked any more");

    let taken_back = NewAnswer {
        supersedes: Some(skipped.id),
        ..word("left")
    };
    let preferred = store.answer(&preference.id, ada.id, taken_back).await;
    preferred.unwrap();
    let open = store.lease(run, ada.id, 2, false, now_ms()).await.unwrap();
    assert_eq!(open.len(), 1, "the stages are asked about again");
    assert_eq!(open[0].id, stage.id);
    let judged = store.answer(&stage.id, ada.id, word("different")).await;
    assert_eq!(judged.unwrap().sequence, 1);
}
