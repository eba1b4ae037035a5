//! Studies: fixed pairs that invited people answer, each labeler in an order of their own.
//!
//! A study's pairs (items) belong to one run for each task, which asks nobody. A labeler's
//! questions (turns) belong to one run for each seat and task, with queries that show an item's
//! clips; so leases, answers and exports work as they do everywhere.

use domain::query::Question;
use serde_json::json;
use sqlx::Row as _;
use sqlx::sqlite::SqliteRow;

use crate::audit::{self, Deed};
use crate::error::StoreError;
use crate::lease::question;
use crate::store::Store;
use crate::time::now_ms;
use crate::writer::Transaction;

mod clips;
mod item;
mod part;
mod seat;

pub use clips::SealedClips;
pub use item::{ItemLine, ItemRole, NewItem};
pub use part::Part;
pub use seat::{Entered, Entrance, Seat, StudyPlan};

pub(crate) use part::{check_open, practice, turn_role};

/// Number of a study.
#[derive(
    Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash, serde::Serialize, serde::Deserialize,
)]
#[serde(transparent)]
pub struct StudyId(pub i64);

impl std::fmt::Display for StudyId {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        self.0.fmt(f)
    }
}

/// A study before it has a number.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct NewStudy {
    /// For people.
    pub title: String,
    /// What is asked about every pair.
    pub question: Question,
    /// The text of its file.
    pub file: String,
    /// The folder of the file, from which query sets are named.
    pub folder: String,
}

/// A study as it is now.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct StudyRow {
    /// Number.
    pub id: StudyId,
    /// For people.
    pub title: String,
    /// What is asked about every pair.
    pub question: Question,
    /// The text of its file.
    pub file: String,
    /// The folder of the file, from which query sets are named.
    pub folder: String,
    /// `preparing`, `ready`, `open`, `closed` or `failed`.
    pub state: String,
    /// In words.
    pub message: String,
    /// Since when, milliseconds since 1970.
    pub since_ms: i64,
    /// When it was made, milliseconds since 1970.
    pub created_at_ms: i64,
    /// Pairs, practice and checks among them.
    pub n_items: u32,
    /// Pairs whose clips are drawn.
    pub n_drawn: u32,
    /// Pairs whose clips cannot be drawn.
    pub n_bad: u32,
}

/// The columns of a [`StudyRow`].
const ROW: &str = "select study.*,
    (select count(*) from study_item where study_id = study.id) as n_items,
    (select count(*) from study_item join query on query.id = study_item.query_id
     where study_item.study_id = study.id and query.clip_state = 'ready') as n_drawn,
    (select count(*) from study_item join query on query.id = study_item.query_id
     where study_item.study_id = study.id and query.clip_state = 'bad') as n_bad
    from study";

impl Store {
    /// Keeps a new study, in state `preparing`.
    ///
    /// # Errors
    /// When it cannot be stored.
    pub async fn add_study(&self, study: NewStudy) -> Result<StudyId, StoreError> {
        self.write(move |t| {
            Box::pin(async move {
                let now = now_ms();
                let row = sqlx::query(
                    "insert into study (title, question, file, folder, state, state_message, state_since_ms, created_at_ms)
                     values (?, ?, ?, ?, 'preparing', 'choosing segments', ?, ?) returning id",
                )
                .bind(&study.title)
                .bind(kind_of(study.question))
                .bind(&study.file)
                .bind(&study.folder)
                .bind(now)
                .bind(now)
                .fetch_one(&mut *t.connection)
                .await?;
                let id = StudyId(row.try_get(0)?);
                note(t, id, "began to prepare", json!({"title": study.title})).await?;
                Ok(id)
            })
        })
        .await
    }

    /// One study.
    ///
    /// # Errors
    /// [`StoreError::Missing`].
    pub async fn study(&self, id: StudyId) -> Result<StudyRow, StoreError> {
        let row = sqlx::query(sqlx::AssertSqlSafe(format!("{ROW} where study.id = ?")))
            .bind(id.0)
            .fetch_optional(self.readers())
            .await?;
        let row = row.ok_or_else(|| StoreError::missing("study", &id))?;
        read(&row)
    }

    /// All studies, newest first.
    ///
    /// # Errors
    /// When the database cannot be read.
    pub async fn studies(&self) -> Result<Vec<StudyRow>, StoreError> {
        let rows = sqlx::query(sqlx::AssertSqlSafe(format!("{ROW} order by study.id desc")))
            .fetch_all(self.readers())
            .await?;
        rows.iter().map(read).collect()
    }

    /// Preparing goes no further, and why.
    ///
    /// # Errors
    /// When it cannot be stored.
    pub async fn fail_study(&self, id: StudyId, reason: &str) -> Result<(), StoreError> {
        let reason = reason.to_owned();
        self.write(move |t| {
            Box::pin(async move {
                set_state(t, id, "failed", &reason).await?;
                note(t, id, "failed", json!({"reason": reason})).await
            })
        })
        .await
    }

    /// Takes up a preparation that failed: clips that could not be drawn are tried again.
    ///
    /// # Errors
    /// [`StoreError::Missing`]; [`StoreError::StudyState`] for a study that did not fail.
    pub async fn retry_study(&self, id: StudyId) -> Result<(), StoreError> {
        self.write(move |t| {
            Box::pin(async move {
                let state = state_of(t, id).await?;
                if state != "failed" {
                    let told = "only a preparation that failed can be taken up again";
                    return Err(StoreError::StudyState { state, told });
                }
                sqlx::query(
                    "update query set clip_state = 'waiting', clip_trouble = null
                     where clip_state = 'bad' and id in (select query_id from study_item where study_id = ?)",
                )
                .bind(id.0)
                .execute(&mut *t.connection)
                .await?;
                set_state(t, id, "preparing", "drawing clips").await?;
                note(t, id, "took up preparing", json!({})).await
            })
        })
        .await
    }

    /// Lets labelers answer.
    ///
    /// # Errors
    /// [`StoreError::Missing`]; [`StoreError::StudyState`] for a study that is not ready.
    pub async fn open_study(&self, id: StudyId) -> Result<(), StoreError> {
        self.write(move |t| {
            Box::pin(async move {
                let told = match state_of(t, id).await?.as_str() {
                    "ready" => {
                        set_state(t, id, "open", "labelers can answer").await?;
                        return note(t, id, "opened", json!({})).await;
                    }
                    "open" => return Ok(()),
                    "closed" => "a closed study stays closed; copy its file to ask again",
                    _ => "its clips are not all there",
                };
                let state = state_of(t, id).await?;
                Err(StoreError::StudyState { state, told })
            })
        })
        .await
    }

    /// Takes no more answers, and tells from now on which method chose which pair. Logged.
    ///
    /// # Errors
    /// [`StoreError::Missing`]; [`StoreError::StudyState`] for a study that was never open.
    pub async fn close_study(&self, id: StudyId) -> Result<(), StoreError> {
        self.write(move |t| {
            Box::pin(async move {
                let state = state_of(t, id).await?;
                match state.as_str() {
                    "open" => {
                        let message = "no more answers are taken; methods are told";
                        set_state(t, id, "closed", message).await?;
                        note(t, id, "closed and unblinded", json!({})).await
                    }
                    "closed" => Ok(()),
                    _ => {
                        let told = "only an open study can be closed";
                        Err(StoreError::StudyState { state, told })
                    }
                }
            })
        })
        .await
    }
}

fn read(row: &SqliteRow) -> Result<StudyRow, StoreError> {
    Ok(StudyRow {
        id: StudyId(row.try_get("id")?),
        title: row.try_get("title")?,
        question: question(row.try_get("question")?),
        file: row.try_get("file")?,
        folder: row.try_get("folder")?,
        state: row.try_get("state")?,
        message: row.try_get("state_message")?,
        since_ms: row.try_get("state_since_ms")?,
        created_at_ms: row.try_get("created_at_ms")?,
        n_items: row.try_get("n_items")?,
        n_drawn: row.try_get("n_drawn")?,
        n_bad: row.try_get("n_bad")?,
    })
}

/// As the column `kind` of questions has it.
fn kind_of(question: Question) -> &'static str {
    match question {
        Question::Preference => "preference",
        Question::SameStage => "same_stage",
    }
}

async fn state_of(t: &mut Transaction<'_>, id: StudyId) -> Result<String, StoreError> {
    let row = sqlx::query("select state from study where id = ?").bind(id.0);
    let row = row.fetch_optional(&mut *t.connection).await?;
    let row = row.ok_or_else(|| StoreError::missing("study", &id))?;
    Ok(row.try_get(0)?)
}

async fn set_state(
    t: &mut Transaction<'_>,
    id: StudyId,
    state: &str,
    message: &str,
) -> Result<(), StoreError> {
    sqlx::query(
        "update study set state_message = ?, state_since_ms = iif(state = ?, state_since_ms, ?), state = ? where id = ?",
    )
    .bind(message)
    .bind(state)
    .bind(now_ms())
    .bind(state)
    .bind(id.0)
    .execute(&mut *t.connection)
    .await?;
    Ok(())
}

async fn note(
    t: &mut Transaction<'_>,
    id: StudyId,
    action: &str,
    detail: serde_json::Value,
) -> Result<(), StoreError> {
    let deed = Deed {
        labeler: None,
        run: None,
        action,
        subject: &format!("study {id}"),
        detail,
    };
    audit::record(t, deed).await
}

#[cfg(test)]
mod tests;
