//! The pairs of a study.

use domain::episode::SegmentRecord;
use domain::query::{OfferedQuery, QueryKey};
use serde_json::json;
use sqlx::Row as _;

use super::{StudyId, note, set_state, state_of};
use crate::error::StoreError;
use crate::query::{QueryId, add_query};
use crate::run::{self, NewRun};
use crate::store::Store;

/// Why a pair is in a study.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum ItemRole {
    /// For the study's result.
    Counted,
    /// To learn what is asked; its right answer is told.
    Practice,
    /// To see whether labelers look; its right answer is known.
    Check,
}

impl ItemRole {
    pub(super) fn word(self) -> &'static str {
        match self {
            Self::Counted => "counted",
            Self::Practice => "practice",
            Self::Check => "check",
        }
    }
}

/// A pair before it is kept.
#[derive(Debug, Clone, PartialEq)]
pub struct NewItem {
    /// Number of its task in the study, from 0.
    pub task: u32,
    /// Number in the study, from 0, and name of the method that chose it.
    pub method: Option<(u32, String)>,
    /// Why it is there.
    pub role: ItemRole,
    /// The right answer, whatever the sides, where it is known.
    pub expects: Option<&'static str>,
    /// Why it is right, for practice.
    pub because: String,
    /// σ₀.
    pub first: SegmentRecord,
    /// σ₁.
    pub second: SegmentRecord,
}

/// How far one pair is.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct ItemLine {
    /// Its query.
    pub query: QueryId,
    /// Number of its task in the study, from 0.
    pub task: u32,
    /// Why it is there.
    pub role: String,
    /// `waiting`, `ready` or `bad`.
    pub clip_state: String,
    /// Why its clips cannot be drawn.
    pub trouble: Option<String>,
    /// The clips, once they are drawn.
    pub clips: Option<[String; 2]>,
    /// Answers that it has, repeats not counted.
    pub n_answers: u32,
}

impl Store {
    /// Keeps a study's pairs, all or none; those that are kept already stay as they are.
    ///
    /// Their order becomes their numbers, which every export tells: it must not tell methods.
    ///
    /// * `tasks` – names, in the order of their numbers
    ///
    /// # Errors
    /// When they cannot be stored.
    pub async fn add_items(
        &self,
        study: StudyId,
        tasks: &[String],
        items: Vec<NewItem>,
    ) -> Result<(), StoreError> {
        let tasks = tasks.to_vec();
        self.write(move |t| {
            Box::pin(async move {
                let known = sqlx::query("select 1 from study_item where study_id = ? limit 1")
                    .bind(study.0)
                    .fetch_optional(&mut *t.connection)
                    .await?;
                if known.is_some() || state_of(t, study).await? != "preparing" {
                    return Ok(());
                }
                let mut runs = Vec::new();
                for task in &tasks {
                    runs.push(run::insert(t, &collection(task, 0), Some(study)).await?);
                }
                for (index, item) in (0..).zip(&items) {
                    let run = runs[item.task as usize];
                    let query = OfferedQuery {
                        key: QueryKey { session: 0, index },
                        first: item.first.clone(),
                        second: item.second.clone(),
                        asks_same_stage: false,
                        disagreement: None,
                        stage_gap: None,
                        typical_reward: None,
                    };
                    let Some(query) = add_query(t, run, &query, "waiting").await? else {
                        return Err(StoreError::Impossible(format!("pair {index} of a study twice")));
                    };
                    sqlx::query(
                        "insert into study_item (study_id, query_id, task, method, method_number, role, expects, because)
                         values (?, ?, ?, ?, ?, ?, ?, ?)",
                    )
                    .bind(study.0)
                    .bind(query.0)
                    .bind(item.task)
                    .bind(item.method.as_ref().map(|(_, name)| name))
                    .bind(item.method.as_ref().map_or(0, |(number, _)| *number))
                    .bind(item.role.word())
                    .bind(item.expects)
                    .bind(&item.because)
                    .execute(&mut *t.connection)
                    .await?;
                }
                set_state(t, study, "preparing", "drawing clips").await?;
                note(t, study, "chose pairs", json!({"n": items.len()})).await
            })
        })
        .await
    }

    /// How far each pair of a study is, in the order in which they were kept.
    ///
    /// # Errors
    /// When the database cannot be read.
    pub async fn items(&self, study: StudyId) -> Result<Vec<ItemLine>, StoreError> {
        let rows = sqlx::query(
            "select query.id, study_item.task, study_item.role, query.clip_state, query.clip_trouble,
                query.first_clip, query.second_clip,
                (select count(*) from study_turn join question on question.query_id = study_turn.query_id and question.state = 'answered'
                 where study_turn.item_id = study_item.id and study_turn.role != 'repeat')
             from study_item join query on query.id = study_item.query_id
             where study_item.study_id = ? order by study_item.id",
        )
        .bind(study.0)
        .fetch_all(self.readers())
        .await?;
        rows.iter()
            .map(|row| {
                let clips: (Option<String>, Option<String>) = (row.try_get(5)?, row.try_get(6)?);
                Ok(ItemLine {
                    query: QueryId(row.try_get(0)?),
                    task: row.try_get(1)?,
                    role: row.try_get(2)?,
                    clip_state: row.try_get(3)?,
                    trouble: row.try_get(4)?,
                    clips: clips.0.zip(clips.1).map(|(first, second)| [first, second]),
                    n_answers: row.try_get(7)?,
                })
            })
            .collect()
    }
}

/// A run that holds queries of a study and trains nothing.
pub(super) fn collection(task: &str, budget: u32) -> NewRun {
    NewRun {
        task: task.to_owned(),
        method: "study".into(),
        preset: String::new(),
        seed: 0,
        teacher: "human".into(),
        draws_clips: true,
        config: String::new(),
        budget,
        total_steps: 0,
        is_trained: false,
    }
}

/// Segments of a stored query, to be shown once more elsewhere.
pub(super) const COPY_SEGMENTS: &str =
    "insert into query_segment (query_id, which, episode, start, len, poses, task_rewards, stages)
     select ?, which, episode, start, len, poses, task_rewards, stages from query_segment where query_id = ?";
