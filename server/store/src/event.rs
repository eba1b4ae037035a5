//! What happened in a run, in order, for pages that follow it.

use serde_json::Value;
use sqlx::Row as _;

use crate::error::StoreError;
use crate::notice::Notice;
use crate::run::RunId;
use crate::store::Store;
use crate::time::now_ms;
use crate::writer::Transaction;

/// One thing that happened.
#[derive(Debug, Clone, PartialEq)]
pub struct EventRow {
    /// Grows with time; unique over all runs.
    pub id: u64,
    /// `metrics`, `session_offered`, `answer`, …
    pub kind: String,
    /// JSON, an object with the same `kind`.
    pub data: String,
    /// Milliseconds since 1970.
    pub at_ms: i64,
}

impl Store {
    /// Keeps an event under a name that is unique in its run; `data` is a JSON object that
    /// carries its `kind`. Returns its id, or `None` where the name was logged before.
    ///
    /// # Errors
    /// When it cannot be stored.
    pub async fn append_event(
        &self,
        run: RunId,
        name: &str,
        data: &Value,
    ) -> Result<Option<u64>, StoreError> {
        let (name, data) = (name.to_owned(), data.clone());
        self.write(move |t| Box::pin(async move { add_named(t, run, Some(&name), &data).await }))
            .await
    }

    /// Events with ids above `after`, oldest first, at most `limit`.
    ///
    /// # Errors
    /// When the database cannot be read.
    pub async fn events_after(
        &self,
        run: RunId,
        after: u64,
        limit: u32,
    ) -> Result<Vec<EventRow>, StoreError> {
        let rows = sqlx::query("select id, kind, data, at_ms from event where run_id = ? and id > ? order by id limit ?")
            .bind(run.0)
            .bind(i64::try_from(after).unwrap_or(i64::MAX))
            .bind(limit)
            .fetch_all(self.readers())
            .await?;
        rows.iter().map(read).collect()
    }

    /// The run's events of any of these kinds, oldest first.
    ///
    /// # Errors
    /// When the database cannot be read.
    pub async fn events_of(&self, run: RunId, kinds: &[&str]) -> Result<Vec<EventRow>, StoreError> {
        let kinds =
            serde_json::to_string(kinds).map_err(|e| StoreError::Impossible(e.to_string()))?;
        let rows = sqlx::query(
            "select id, kind, data, at_ms from event
             where run_id = ? and kind in (select value from json_each(?)) order by id",
        )
        .bind(run.0)
        .bind(kinds)
        .fetch_all(self.readers())
        .await?;
        rows.iter().map(read).collect()
    }
}

/// Logs an event without a name.
pub(crate) async fn add(
    t: &mut Transaction<'_>,
    run: RunId,
    data: &Value,
) -> Result<(), StoreError> {
    add_named(t, run, None, data).await.map(|_| ())
}

async fn add_named(
    t: &mut Transaction<'_>,
    run: RunId,
    name: Option<&str>,
    data: &Value,
) -> Result<Option<u64>, StoreError> {
    let row = sqlx::query(
        "insert into event (run_id, at_ms, name, kind, data) values (?, ?, ?, ?, ?) on conflict do nothing returning id",
    )
    .bind(run.0)
    .bind(now_ms())
    .bind(name)
    .bind(data["kind"].as_str().unwrap_or("event"))
    .bind(data.to_string())
    .fetch_optional(&mut *t.connection)
    .await?;
    let Some(row) = row else { return Ok(None) };
    let id = row.try_get::<i64, _>(0)?.unsigned_abs();
    t.tell(Notice::Event(run, id));
    Ok(Some(id))
}

fn read(row: &sqlx::sqlite::SqliteRow) -> Result<EventRow, StoreError> {
    Ok(EventRow {
        id: row.try_get::<i64, _>(0)?.unsigned_abs(),
        kind: row.try_get(1)?,
        data: row.try_get(2)?,
        at_ms: row.try_get(3)?,
    })
}
