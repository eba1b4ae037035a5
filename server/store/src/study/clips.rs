//! One length for all clips of a study, so that none can be told by its size.

use serde_json::json;
use sqlx::Row as _;

use super::{StudyId, note, set_state, state_of};
use crate::clip::{self, ClipRow, NewClip};
use crate::error::StoreError;
use crate::query::QueryId;
use crate::store::Store;

/// The clips of one pair as labelers will see them.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct SealedClips {
    /// The pair's query.
    pub query: QueryId,
    /// Of σ₀.
    pub first: NewClip,
    /// Of σ₁.
    pub second: NewClip,
}

impl Store {
    /// Puts the clips that labelers will see in the place of those that were drawn; the study is
    /// ready then. Bytes that nothing shows any more are removed.
    ///
    /// # Errors
    /// When they cannot be stored; the study is as it was then.
    pub async fn seal_study(
        &self,
        study: StudyId,
        sealed: Vec<SealedClips>,
    ) -> Result<(), StoreError> {
        for pair in &sealed {
            self.keep_bytes(&pair.first).await?;
            self.keep_bytes(&pair.second).await?;
        }
        let rows: Vec<_> = sealed
            .iter()
            .map(|pair| {
                (
                    pair.query,
                    ClipRow::from(&pair.first),
                    ClipRow::from(&pair.second),
                )
            })
            .collect();
        let unused = self.write(move |t| {
            Box::pin(async move {
                if state_of(t, study).await? != "preparing" {
                    return Ok(Vec::new());
                }
                let mut unused: Vec<String> = Vec::new();
                for (query, first, second) in rows {
                    clip::add_row(t, &first).await?;
                    clip::add_row(t, &second).await?;
                    let row = sqlx::query("select first_clip, second_clip from query where id = ?")
                        .bind(query.0)
                        .fetch_one(&mut *t.connection)
                        .await?;
                    unused.extend([row.try_get(0)?, row.try_get(1)?]);
                    sqlx::query("update query set first_clip = ?, second_clip = ? where id = ?")
                        .bind(&first.sha256)
                        .bind(&second.sha256)
                        .bind(query.0)
                        .execute(&mut *t.connection)
                        .await?;
                }
                let unused = clip::forget_unused(t, &unused).await?;
                set_state(t, study, "ready", "nobody can answer before it is opened").await?;
                note(t, study, "is ready", json!({})).await?;
                Ok(unused)
            })
        });
        for sha256 in unused.await? {
            self.remove_bytes(&sha256).await;
        }
        Ok(())
    }
}
