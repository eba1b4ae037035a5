//! Secrets that stand for rights, stored as hashes.

use serde_json::json;
use sqlx::Row as _;

use crate::audit::{self, Deed};
use crate::error::StoreError;
use crate::labeler::{self, Labeler, LabelerId, name_of_program};
use crate::run::RunId;
use crate::secret::Secret;
use crate::store::Store;
use crate::time::now_ms;

/// What a token is for.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum TokenKind {
    /// Using a server that listens on more than its own machine.
    Access,
    /// A labeler's browser.
    Labeler,
    /// A program that answers one run's queries and may read their task rewards.
    Teacher(RunId),
}

/// Who brought a token.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Bearer {
    /// What it is for.
    pub kind: TokenKind,
    /// Whose it is; an access token is nobody's.
    pub labeler: Option<Labeler>,
}

impl Store {
    /// Whose secret this is; `None` for one that was never given out.
    ///
    /// # Errors
    /// When the database cannot be read.
    pub async fn bearer(&self, secret: &Secret) -> Result<Option<Bearer>, StoreError> {
        let row = sqlx::query(
            "select token.kind, token.run_id, labeler.id, labeler.name
             from token left join labeler on labeler.id = token.labeler_id where token.hash = ?",
        )
        .bind(secret.hash())
        .fetch_optional(self.readers())
        .await?;
        let Some(row) = row else { return Ok(None) };
        let kind: String = row.try_get(0)?;
        let kind = match (kind.as_str(), row.try_get::<Option<i64>, _>(1)?) {
            ("access", _) => TokenKind::Access,
            ("labeler", _) => TokenKind::Labeler,
            ("teacher", Some(run)) => TokenKind::Teacher(RunId(run)),
            (other, _) => return Err(StoreError::Impossible(format!("a token of kind {other}"))),
        };
        let id: Option<i64> = row.try_get(2)?;
        let labeler = match id {
            Some(id) => Some(Labeler {
                id: LabelerId(id),
                name: row.try_get(3)?,
            }),
            None => None,
        };
        Ok(Some(Bearer { kind, labeler }))
    }

    /// A new access token, or the given one made valid.
    ///
    /// # Errors
    /// When it cannot be stored.
    pub async fn add_access_token(&self, secret: &Secret) -> Result<(), StoreError> {
        let hash = secret.hash();
        self.write(move |t| {
            Box::pin(async move {
                sqlx::query(
                    "insert into token (hash, kind, created_at_ms) values (?, 'access', ?) on conflict do nothing",
                )
                .bind(hash)
                .bind(now_ms())
                .execute(&mut *t.connection)
                .await?;
                Ok(())
            })
        })
        .await
    }

    /// A new token for a program that teaches `run`.
    ///
    /// # Errors
    /// [`StoreError::Missing`] for an unknown run.
    pub async fn add_teacher_token(&self, run: RunId) -> Result<Secret, StoreError> {
        self.run(run)
            .await?
            .ok_or_else(|| StoreError::missing("run", &run))?;
        let secret = Secret::random()?;
        let hash = secret.hash();
        self.write(move |t| {
            Box::pin(async move {
                let id = labeler::find_or_add_kept(t, &name_of_program(run)).await?;
                sqlx::query("insert into token (hash, kind, labeler_id, run_id, created_at_ms) values (?, 'teacher', ?, ?, ?)")
                    .bind(hash)
                    .bind(id.0)
                    .bind(run.0)
                    .bind(now_ms())
                    .execute(&mut *t.connection)
                    .await?;
                let deed = Deed { labeler: None, run: Some(run), action: "gave a teacher token", subject: "token", detail: json!({}) };
                audit::record(t, deed).await
            })
        })
        .await?;
        Ok(secret)
    }
}
