//! People who answer.

use sqlx::Row as _;

use crate::error::StoreError;
use crate::secret::Secret;
use crate::store::Store;
use crate::time::now_ms;
use crate::writer::Transaction;

/// Number of a labeler.
#[derive(
    Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash, serde::Serialize, serde::Deserialize,
)]
#[serde(transparent)]
pub struct LabelerId(pub i64);

/// The server itself, which skips queries that cannot be drawn.
pub(crate) const SERVER: LabelerId = LabelerId(1);

/// Who answers.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Labeler {
    /// Number.
    pub id: LabelerId,
    /// As they typed it.
    pub name: String,
}

impl Store {
    /// The labeler of that name, new or old, and a secret for the browser that asked.
    ///
    /// # Errors
    /// [`StoreError::Rule`] with `labeler_name_not_empty` for a name of no or more than 80
    /// letters.
    pub async fn sign_in(&self, name: &str) -> Result<(Labeler, Secret), StoreError> {
        let name = name.trim().to_owned();
        let secret = Secret::random()?;
        let browser = secret.clone();
        let labeler = self
            .write(move |t| {
                Box::pin(async move {
                    let id = find_or_add(t, &name).await?;
                    admit(t, id, &browser).await?;
                    Ok(Labeler { id, name })
                })
            })
            .await?;
        Ok((labeler, secret))
    }
}

/// Makes a secret that of one browser of a labeler.
pub(crate) async fn admit(
    t: &mut Transaction<'_>,
    labeler: LabelerId,
    browser: &Secret,
) -> Result<(), StoreError> {
    sqlx::query(
        "insert into token (hash, kind, labeler_id, created_at_ms) values (?, 'labeler', ?, ?)",
    )
    .bind(browser.hash())
    .bind(labeler.0)
    .bind(now_ms())
    .execute(&mut *t.connection)
    .await?;
    Ok(())
}

pub(crate) async fn find_or_add(
    t: &mut Transaction<'_>,
    name: &str,
) -> Result<LabelerId, StoreError> {
    sqlx::query(
        "insert into labeler (name, created_at_ms) values (?, ?) on conflict (name) do nothing",
    )
    .bind(name)
    .bind(now_ms())
    .execute(&mut *t.connection)
    .await?;
    let row = sqlx::query("select id from labeler where name = ?")
        .bind(name)
        .fetch_one(&mut *t.connection)
        .await?;
    Ok(LabelerId(row.get(0)))
}
