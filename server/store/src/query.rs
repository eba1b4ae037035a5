//! Queries: what was chosen to be asked, with all that drawing and judging it takes.

use domain::answer::Which;
use domain::episode::SegmentRecord;
use domain::query::{OfferedQuery, QueryKey, is_same_stage};
use serde_json::json;
use sqlx::Row as _;

use crate::answer;
use crate::clip::{self, ClipRow, NewClip};
use crate::error::StoreError;
use crate::event;
use crate::run::RunId;
use crate::store::Store;
use crate::time::now_ms;
use crate::writer::Transaction;

/// Number of a query.
#[derive(
    Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash, serde::Serialize, serde::Deserialize,
)]
#[serde(transparent)]
pub struct QueryId(pub i64);

/// A query whose clips are to be drawn.
#[derive(Debug, Clone, PartialEq)]
pub struct ClipJob {
    /// Which query.
    pub query: QueryId,
    /// Its run.
    pub run: RunId,
    /// The run's task.
    pub task: String,
    /// Poses of the first segment, `[H][pose_size]`.
    pub first: Vec<Vec<f32>>,
    /// Poses of the second.
    pub second: Vec<Vec<f32>>,
}

/// Ground truth about a query, for teachers' programs.
#[derive(Debug, Clone, PartialEq)]
pub struct TaskRewards {
    /// Its run.
    pub run: RunId,
    /// Its name in the run.
    pub key: QueryKey,
    /// Of each step of the first segment.
    pub first: Vec<f64>,
    /// Of each step of the second.
    pub second: Vec<f64>,
    /// Whether all four ends are in one true stage, where the task knows.
    pub same_stage: Option<bool>,
    /// Mean task reward a step of the run's newest episodes when it was asked.
    pub typical_reward: Option<f64>,
}

/// A query that cannot be shown.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct BadQuery {
    /// Which.
    pub query: QueryId,
    /// Its session.
    pub session: u32,
    /// What went wrong, for the researcher.
    pub trouble: String,
}

impl Store {
    /// Keeps queries that a run asks. Those that are kept already stay as they are.
    ///
    /// # Errors
    /// When they cannot be stored, or other segments are kept for one; none of them is.
    pub async fn offer(
        &self,
        run: RunId,
        queries: &[OfferedQuery],
        needs_clips: bool,
    ) -> Result<(), StoreError> {
        let queries = queries.to_vec();
        self.write(move |t| {
            Box::pin(async move {
                let clip_state = if needs_clips { "waiting" } else { "unwanted" };
                for query in &queries {
                    add(t, run, query, clip_state).await?;
                }
                Ok(())
            })
        })
        .await
    }

    /// The next query to draw, in the order of asking; runs that people wait for come before
    /// studies that are being prepared.
    ///
    /// # Errors
    /// When the database cannot be read.
    pub async fn next_clip_job(&self) -> Result<Option<ClipJob>, StoreError> {
        let row = sqlx::query(
            "select query.id, query.run_id, run.task from query join run on run.id = query.run_id
             where clip_state = 'waiting' order by run.study_id is not null, query.id limit 1",
        )
        .fetch_optional(self.readers())
        .await?;
        let Some(row) = row else { return Ok(None) };
        let query = QueryId(row.try_get(0)?);
        Ok(Some(ClipJob {
            query,
            run: RunId(row.try_get(1)?),
            task: row.try_get(2)?,
            first: self.poses(query, Which::First).await?,
            second: self.poses(query, Which::Second).await?,
        }))
    }

    async fn poses(&self, query: QueryId, which: Which) -> Result<Vec<Vec<f32>>, StoreError> {
        let row =
            sqlx::query("select len, poses from query_segment where query_id = ? and which = ?")
                .bind(query.0)
                .bind(word(which))
                .fetch_one(self.readers())
                .await?;
        let n_rows: u32 = row.try_get(0)?;
        let numbers: Vec<f32> = row
            .try_get::<Vec<u8>, _>(1)?
            .chunks_exact(4)
            .map(|b| f32::from_le_bytes([b[0], b[1], b[2], b[3]]))
            .collect();
        let size = numbers.len() / (n_rows.max(1) as usize);
        Ok(numbers
            .chunks_exact(size.max(1))
            .map(<[f32]>::to_vec)
            .collect())
    }

    /// Both clips of a query are there: it may be shown from now on.
    ///
    /// # Errors
    /// When they cannot be stored.
    pub async fn attach_clips(
        &self,
        query: QueryId,
        first: &NewClip,
        second: &NewClip,
    ) -> Result<(), StoreError> {
        self.keep_bytes(first).await?;
        self.keep_bytes(second).await?;
        let (first, second) = (ClipRow::from(first), ClipRow::from(second));
        self.write(move |t| {
            Box::pin(async move {
                clip::add_row(t, &first).await?;
                clip::add_row(t, &second).await?;
                let row = sqlx::query(
                    "update query set clip_state = 'ready', clip_trouble = null, first_clip = ?, second_clip = ?
                     where id = ? and clip_state = 'waiting' returning run_id, session",
                )
                .bind(&first.sha256)
                .bind(&second.sha256)
                .bind(query.0)
                .fetch_optional(&mut *t.connection)
                .await?;
                let Some(row) = row else { return Ok(()) }; // drawn twice: the first drawing stays
                let (run, session) = (RunId(row.try_get(0)?), row.try_get::<u32, _>(1)?);
                let data = json!({"kind": "clips_ready", "session": session, "query": query});
                event::add(t, run, &data).await?;
                Ok(())
            })
        })
        .await
    }

    /// A query cannot be drawn. It is never shown; the server skips it, as a labeler would.
    ///
    /// # Errors
    /// When that cannot be stored.
    pub async fn clip_failed(&self, query: QueryId, trouble: &str) -> Result<(), StoreError> {
        let trouble = trouble.to_owned();
        self.write(move |t| {
            Box::pin(async move {
                let row = sqlx::query(
                    "update query set clip_state = 'bad', clip_trouble = ? where id = ? and clip_state = 'waiting'
                     returning run_id, session",
                )
                .bind(&trouble)
                .bind(query.0)
                .fetch_optional(&mut *t.connection)
                .await?;
                let Some(row) = row else { return Ok(()) };
                let (run, session) = (RunId(row.try_get(0)?), row.try_get::<u32, _>(1)?);
                let data = json!({"kind": "clip_failed", "session": session, "query": query, "reason": trouble});
                event::add(t, run, &data).await?;
                answer::skip_by_server(t, query, &trouble).await
            })
        })
        .await
    }

    /// Queries of a run that cannot be shown, newest first.
    ///
    /// # Errors
    /// When the database cannot be read.
    pub async fn bad_queries(&self, run: RunId) -> Result<Vec<BadQuery>, StoreError> {
        let rows = sqlx::query(
            "select id, session, clip_trouble from query where run_id = ? and clip_state = 'bad' order by id desc",
        )
        .bind(run.0)
        .fetch_all(self.readers())
        .await?;
        rows.iter()
            .map(|row| {
                Ok(BadQuery {
                    query: QueryId(row.try_get(0)?),
                    session: row.try_get(1)?,
                    trouble: row.try_get(2)?,
                })
            })
            .collect()
    }

    /// Ground truth about a query. For teachers' programs: no labeler's request may come here.
    ///
    /// # Errors
    /// [`StoreError::Missing`].
    pub async fn task_rewards(&self, query: QueryId) -> Result<TaskRewards, StoreError> {
        let rows = sqlx::query(
            "select run_id, session, position, task_rewards, stages, typical_reward from query
             join query_segment on query_segment.query_id = query.id where query.id = ? order by which",
        )
        .bind(query.0)
        .fetch_all(self.readers())
        .await?;
        let [first, second] = rows.as_slice() else {
            return Err(StoreError::missing("query", &query.0));
        };
        let rewards = |row: &sqlx::sqlite::SqliteRow| -> Result<Vec<f64>, StoreError> {
            let bytes: Vec<u8> = row.try_get(3)?;
            Ok(bytes
                .as_chunks::<8>()
                .0
                .iter()
                .copied()
                .map(f64::from_le_bytes)
                .collect())
        };
        let (a, b): (Vec<u8>, Vec<u8>) = (first.try_get(4)?, second.try_get(4)?);
        Ok(TaskRewards {
            run: RunId(first.try_get(0)?),
            key: QueryKey {
                session: first.try_get(1)?,
                index: first.try_get(2)?,
            },
            first: rewards(first)?,
            second: rewards(second)?,
            same_stage: is_same_stage(&a, &b),
            typical_reward: first.try_get(5)?,
        })
    }
}

async fn add(
    t: &mut Transaction<'_>,
    run: RunId,
    query: &OfferedQuery,
    clip_state: &str,
) -> Result<(), StoreError> {
    let Some(id) = add_query(t, run, query, clip_state).await? else {
        return check_alike(t, run, query).await;
    };
    let kinds: &[&str] = if query.asks_same_stage {
        &["preference", "same_stage"]
    } else {
        &["preference"]
    };
    for kind in kinds {
        ask(t, run, id, kind).await?;
    }
    Ok(())
}

/// Keeps a query and its segments, and asks nothing about it; `None` where it is kept already.
pub(crate) async fn add_query(
    t: &mut Transaction<'_>,
    run: RunId,
    query: &OfferedQuery,
    clip_state: &str,
) -> Result<Option<QueryId>, StoreError> {
    let row = sqlx::query(
        "insert into query (run_id, session, position, asks_same_stage, disagreement, stage_gap, typical_reward,
                            clip_state, created_at_ms)
         values (?, ?, ?, ?, ?, ?, ?, ?, ?) on conflict (run_id, session, position) do nothing returning id",
    )
    .bind(run.0)
    .bind(query.key.session)
    .bind(query.key.index)
    .bind(query.asks_same_stage)
    .bind(query.disagreement)
    .bind(query.stage_gap)
    .bind(query.typical_reward.map(|reward| reward.0))
    .bind(clip_state)
    .bind(now_ms())
    .fetch_optional(&mut *t.connection)
    .await?;
    let Some(row) = row else { return Ok(None) };
    let id = QueryId(row.try_get(0)?);
    add_segment(t, id, Which::First, &query.first).await?;
    add_segment(t, id, Which::Second, &query.second).await?;
    Ok(Some(id))
}

/// Whether what is kept under a query's key is that query.
async fn check_alike(
    t: &mut Transaction<'_>,
    run: RunId,
    query: &OfferedQuery,
) -> Result<(), StoreError> {
    let rows = sqlx::query(
        "select which, episode, start, len, poses from query_segment
         where query_id = (select id from query where run_id = ? and session = ? and position = ?)",
    )
    .bind(run.0)
    .bind(query.key.session)
    .bind(query.key.index)
    .fetch_all(&mut *t.connection)
    .await?;
    for row in rows {
        let record = match which(row.try_get(0)?) {
            Which::First => &query.first,
            Which::Second => &query.second,
        };
        let (kept, segment) = (
            (row.try_get(1)?, row.try_get(2)?, row.try_get(3)?),
            record.segment,
        );
        let poses: Vec<u8> = row.try_get(4)?;
        if kept != (segment.episode.0, segment.start, segment.len) || poses != pose_bytes(record) {
            return Err(StoreError::OtherSegments(query.key));
        }
    }
    Ok(())
}

pub(crate) async fn ask(
    t: &mut Transaction<'_>,
    run: RunId,
    query: QueryId,
    kind: &str,
) -> Result<(), StoreError> {
    sqlx::query("insert into question (run_id, query_id, kind) values (?, ?, ?)")
        .bind(run.0)
        .bind(query.0)
        .bind(kind)
        .execute(&mut *t.connection)
        .await?;
    Ok(())
}

async fn add_segment(
    t: &mut Transaction<'_>,
    query: QueryId,
    which: Which,
    record: &SegmentRecord,
) -> Result<(), StoreError> {
    let task_rewards: Vec<u8> = record
        .task_rewards
        .iter()
        .flat_map(|r| r.0.to_le_bytes())
        .collect();
    sqlx::query(
        "insert into query_segment (query_id, which, episode, start, len, poses, task_rewards, stages)
         values (?, ?, ?, ?, ?, ?, ?, ?)",
    )
    .bind(query.0)
    .bind(word(which))
    .bind(record.segment.episode.0)
    .bind(record.segment.start)
    .bind(record.segment.len)
    .bind(pose_bytes(record))
    .bind(task_rewards)
    .bind(&record.stages)
    .execute(&mut *t.connection)
    .await?;
    Ok(())
}

fn pose_bytes(record: &SegmentRecord) -> Vec<u8> {
    let numbers = record.poses.iter().flatten();
    numbers.flat_map(|x| x.to_le_bytes()).collect()
}

pub(crate) fn word(which: Which) -> &'static str {
    match which {
        Which::First => "first",
        Which::Second => "second",
    }
}

pub(crate) fn which(word: &str) -> Which {
    if word == "first" {
        Which::First
    } else {
        Which::Second
    }
}
