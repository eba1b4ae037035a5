//! Runs: what they are and in which state.

use serde_json::json;
use sqlx::Row as _;
use sqlx::sqlite::SqliteRow;

use crate::audit::{self, Deed};
use crate::error::StoreError;
use crate::event;
use crate::store::Store;
use crate::study::StudyId;
use crate::time::now_ms;
use crate::writer::Transaction;

/// Number of a run.
#[derive(
    Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash, serde::Serialize, serde::Deserialize,
)]
#[serde(transparent)]
pub struct RunId(pub i64);

impl std::fmt::Display for RunId {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        self.0.fmt(f)
    }
}

/// A run before it has a number.
#[derive(Debug, Clone, PartialEq)]
pub struct NewRun {
    /// The task's name.
    pub task: String,
    /// The method's name.
    pub method: String,
    /// Presets on top of the task's and the method's own, comma-separated; may be empty.
    pub preset: String,
    /// Of every random stream.
    pub seed: u64,
    /// `human`, `http`, or a scripted teacher's name.
    pub teacher: String,
    /// Whether clips of its queries are drawn.
    pub draws_clips: bool,
    /// The resolved settings as TOML.
    pub config: String,
    /// Answers in all.
    pub budget: u32,
    /// Environment steps in all.
    pub total_steps: u64,
    /// Whether an agent learns from the answers; false for a fixed collection of queries.
    pub is_trained: bool,
}

/// A run as it is now.
#[derive(Debug, Clone, PartialEq)]
pub struct RunRow {
    /// Number.
    pub id: RunId,
    /// The task's name.
    pub task: String,
    /// The method's name.
    pub method: String,
    /// Presets on top of the task's and the method's own, comma-separated; may be empty.
    pub preset: String,
    /// Of every random stream.
    pub seed: u64,
    /// `human`, `http`, or a scripted teacher's name.
    pub teacher: String,
    /// Whether clips of its queries are drawn.
    pub draws_clips: bool,
    /// The resolved settings as TOML.
    pub config: String,
    /// Answers in all.
    pub budget: u32,
    /// Environment steps in all.
    pub total_steps: u64,
    /// Whether an agent learns from the answers.
    pub is_trained: bool,
    /// Environment steps taken.
    pub step: u64,
    /// Preferences received, skips not counted.
    pub n_labels: u32,
    /// What it is doing.
    pub state: RunState,
    /// The study that it is a part of.
    pub study: Option<StudyId>,
    /// When it was made, milliseconds since 1970.
    pub created_at_ms: i64,
}

/// A run's state in one line.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct RunState {
    /// `training`, `waiting_for_labels`, `paused`, `finished`, `stopped`, `failed`.
    pub kind: String,
    /// What it is doing.
    pub message: String,
    /// What comes next.
    pub next: String,
    /// Since when, milliseconds since 1970.
    pub since_ms: i64,
}

/// How far the asking is.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct Progress {
    /// Preferences received, skips not counted.
    pub answered: u32,
    /// Answers in all.
    pub budget: u32,
    /// The newest session, from 0; `None` before the first.
    pub session: Option<u32>,
    /// Preferences received in it.
    pub session_answered: u32,
    /// Preferences it needs.
    pub session_size: u32,
}

impl Store {
    /// Keeps a new run, in state `training`.
    ///
    /// # Errors
    /// When it cannot be stored.
    pub async fn add_run(&self, run: NewRun) -> Result<RunId, StoreError> {
        self.write(move |t| Box::pin(async move { insert(t, &run, None).await }))
            .await
    }

    /// One run; `None` for a number that no run has.
    ///
    /// # Errors
    /// When the database cannot be read.
    pub async fn run(&self, id: RunId) -> Result<Option<RunRow>, StoreError> {
        let row = sqlx::query("select * from run where id = ?")
            .bind(id.0)
            .fetch_optional(self.readers())
            .await?;
        row.as_ref().map(read).transpose()
    }

    /// All runs, newest first; those of studies are told by their study.
    ///
    /// # Errors
    /// When the database cannot be read.
    pub async fn runs(&self) -> Result<Vec<RunRow>, StoreError> {
        let rows = sqlx::query("select * from run where study_id is null order by id desc")
            .fetch_all(self.readers())
            .await?;
        rows.iter().map(read).collect()
    }

    /// Changes a run's state line. `since` moves, and followers are told, when the kind changes;
    /// a repeated kind only changes the words.
    ///
    /// # Errors
    /// [`StoreError::Missing`]; [`StoreError::Rule`] for a state that is none.
    pub async fn set_run_state(
        &self,
        run: RunId,
        state: &str,
        message: &str,
        next: &str,
    ) -> Result<(), StoreError> {
        let (state, message, next) = (state.to_owned(), message.to_owned(), next.to_owned());
        self.write(move |t| {
            Box::pin(async move {
                let row = sqlx::query("select state from run where id = ?").bind(run.0);
                let row = row.fetch_optional(&mut *t.connection).await?;
                let before: String = row
                    .ok_or_else(|| StoreError::missing("run", &run))?
                    .try_get(0)?;
                let now = now_ms();
                sqlx::query(
                    "update run set state_message = ?, state_next = ?,
                        state_since_ms = iif(state = ?, state_since_ms, ?), state = ? where id = ?",
                )
                .bind(&message)
                .bind(&next)
                .bind(&state)
                .bind(now)
                .bind(&state)
                .bind(run.0)
                .execute(&mut *t.connection)
                .await?;
                if before != state {
                    let data =
                        json!({"kind": "state", "state": state, "message": message, "next": next});
                    event::add(t, run, &data).await?;
                    let deed = Deed {
                        labeler: None,
                        run: Some(run),
                        action: "changed state",
                        subject: "run",
                        detail: data,
                    };
                    audit::record(t, deed).await?;
                }
                Ok(())
            })
        })
        .await
    }

    /// Notes how far the run is. `n_labels` where a script inside the run answers; the answers of
    /// people and programs are counted when they are stored.
    ///
    /// # Errors
    /// When it cannot be stored.
    pub async fn set_step(
        &self,
        run: RunId,
        step: u64,
        n_labels: Option<u32>,
    ) -> Result<(), StoreError> {
        self.write(move |t| {
            Box::pin(async move {
                sqlx::query(
                    "update run set step = ?, n_labels = coalesce(?, n_labels) where id = ?",
                )
                .bind(step.cast_signed())
                .bind(n_labels)
                .bind(run.0)
                .execute(&mut *t.connection)
                .await?;
                Ok(())
            })
        })
        .await
    }

    /// How far the asking is.
    ///
    /// # Errors
    /// [`StoreError::Missing`].
    pub async fn progress(&self, run: RunId) -> Result<Progress, StoreError> {
        let row = sqlx::query(
            "with newest as (select max(session) as session from query where run_id = ?1),
                  state as (
                    select question.state as state,
                        (select pressed from answer where answer.question_id = question.id
                         order by sequence desc limit 1) as pressed
                    from newest join query on query.run_id = ?1 and query.session = newest.session
                    join question on question.query_id = query.id and question.kind = 'preference')
             select run.n_labels, run.budget,
                iif(run.study_id is null, (select session from newest), null),
                (select count(*) from state where pressed is not null and pressed != 'skip'),
                (select count(*) from state where pressed is null or pressed != 'skip')
             from run where run.id = ?1",
        )
        .bind(run.0)
        .fetch_optional(self.readers())
        .await?;
        let row = row.ok_or_else(|| StoreError::missing("run", &run))?;
        Ok(Progress {
            answered: row.try_get(0)?,
            budget: row.try_get(1)?,
            session: row.try_get(2)?,
            session_answered: row.try_get(3)?,
            session_size: row.try_get(4)?,
        })
    }
}

/// Keeps a new run, in state `training`.
pub(crate) async fn insert(
    t: &mut Transaction<'_>,
    run: &NewRun,
    study: Option<StudyId>,
) -> Result<RunId, StoreError> {
    let now = now_ms();
    let row = sqlx::query(
        "insert into run (task, method, preset, seed, teacher, draws_clips, config, budget, total_steps, is_trained,
            study_id, state, state_message, state_next, state_since_ms, created_at_ms)
         values (?, ?, ?, ?, ?, ?, ?, ?, ?, ?, ?, 'training', 'getting ready', '', ?, ?) returning id",
    )
    .bind(&run.task)
    .bind(&run.method)
    .bind(&run.preset)
    .bind(run.seed.cast_signed())
    .bind(&run.teacher)
    .bind(run.draws_clips)
    .bind(&run.config)
    .bind(run.budget)
    .bind(run.total_steps.cast_signed())
    .bind(run.is_trained)
    .bind(study.map(|study| study.0))
    .bind(now)
    .bind(now)
    .fetch_one(&mut *t.connection)
    .await?;
    let id = RunId(row.get(0));
    let detail =
        json!({"task": run.task, "method": run.method, "seed": run.seed, "teacher": run.teacher});
    let deed = Deed {
        labeler: None,
        run: Some(id),
        action: "started",
        subject: "run",
        detail,
    };
    audit::record(t, deed).await?;
    Ok(id)
}

fn read(row: &SqliteRow) -> Result<RunRow, StoreError> {
    Ok(RunRow {
        id: RunId(row.try_get("id")?),
        task: row.try_get("task")?,
        method: row.try_get("method")?,
        preset: row.try_get("preset")?,
        seed: row.try_get::<i64, _>("seed")?.cast_unsigned(),
        teacher: row.try_get("teacher")?,
        draws_clips: row.try_get("draws_clips")?,
        config: row.try_get("config")?,
        budget: row.try_get("budget")?,
        total_steps: row.try_get::<i64, _>("total_steps")?.cast_unsigned(),
        is_trained: row.try_get("is_trained")?,
        step: row.try_get::<i64, _>("step")?.cast_unsigned(),
        n_labels: row.try_get("n_labels")?,
        state: RunState {
            kind: row.try_get("state")?,
            message: row.try_get("state_message")?,
            next: row.try_get("state_next")?,
            since_ms: row.try_get("state_since_ms")?,
        },
        study: row.try_get::<Option<i64>, _>("study_id")?.map(StudyId),
        created_at_ms: row.try_get("created_at_ms")?,
    })
}
