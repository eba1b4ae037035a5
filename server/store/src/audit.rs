//! Who did what: rows that are only ever added, in the transaction of the thing itself.

use serde_json::Value;

use crate::error::StoreError;
use crate::labeler::LabelerId;
use crate::run::RunId;
use crate::time::now_ms;
use crate::writer::Transaction;

/// One thing that was done.
pub(crate) struct Deed<'a> {
    /// Who, where it was a labeler.
    pub(crate) labeler: Option<LabelerId>,
    /// In which run.
    pub(crate) run: Option<RunId>,
    /// What: `answered`, `superseded`, `paused`.
    pub(crate) action: &'a str,
    /// To what.
    pub(crate) subject: &'a str,
    /// Everything else.
    pub(crate) detail: Value,
}

pub(crate) async fn record(t: &mut Transaction<'_>, deed: Deed<'_>) -> Result<(), StoreError> {
    sqlx::query("insert into audit (at_ms, labeler_id, run_id, action, subject, detail) values (?, ?, ?, ?, ?, ?)")
        .bind(now_ms())
        .bind(deed.labeler.map(|l| l.0))
        .bind(deed.run.map(|r| r.0))
        .bind(deed.action)
        .bind(deed.subject)
        .bind(deed.detail.to_string())
        .execute(&mut *t.connection)
        .await?;
    Ok(())
}
