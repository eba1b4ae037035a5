//! Episodes of the policy to look at: "how it does now".

use sqlx::Row as _;

use crate::clip::{self, ClipRow, NewClip};
use crate::error::StoreError;
use crate::run::RunId;
use crate::store::Store;
use crate::time::now_ms;

/// An episode whose clip is to be kept.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct NewDemonstration {
    /// The session that was about to be asked; `None` at the end of the run.
    pub session: Option<u32>,
    /// Environment steps taken.
    pub step: u64,
    /// Whether it succeeded.
    pub success: bool,
    /// Its task return.
    pub task_return: f64,
}

/// An episode with its clip.
#[derive(Debug, Clone, PartialEq)]
pub struct DemonstrationRow {
    /// What it shows.
    pub shows: NewDemonstration,
    /// Name of its clip.
    pub clip: String,
    /// Pictures in it.
    pub n_frames: u32,
    /// Pictures a second.
    pub fps: u32,
}

impl Store {
    /// Keeps an episode's clip.
    ///
    /// # Errors
    /// When it cannot be stored.
    pub async fn add_demonstration(
        &self,
        run: RunId,
        shows: NewDemonstration,
        clip: &NewClip,
    ) -> Result<(), StoreError> {
        self.keep_bytes(clip).await?;
        let clip = ClipRow::from(clip);
        self.write(move |t| {
            Box::pin(async move {
                clip::add_row(t, &clip).await?;
                sqlx::query(
                    "insert into demonstration (run_id, session, step, success, task_return, clip, created_at_ms)
                     values (?, ?, ?, ?, ?, ?, ?)",
                )
                .bind(run.0)
                .bind(shows.session)
                .bind(shows.step.cast_signed())
                .bind(shows.success)
                .bind(shows.task_return)
                .bind(&clip.sha256)
                .bind(now_ms())
                .execute(&mut *t.connection)
                .await?;
                Ok(())
            })
        })
        .await
    }

    /// A run's episodes, oldest first.
    ///
    /// # Errors
    /// When the database cannot be read.
    pub async fn demonstrations(&self, run: RunId) -> Result<Vec<DemonstrationRow>, StoreError> {
        let rows = sqlx::query(
            "select session, step, success, task_return, clip, n_frames, fps
             from demonstration join clip on clip.sha256 = demonstration.clip
             where run_id = ? order by step, demonstration.id",
        )
        .bind(run.0)
        .fetch_all(self.readers())
        .await?;
        rows.iter()
            .map(|row| {
                Ok(DemonstrationRow {
                    shows: NewDemonstration {
                        session: row.try_get(0)?,
                        step: row.try_get::<i64, _>(1)?.unsigned_abs(),
                        success: row.try_get(2)?,
                        task_return: row.try_get(3)?,
                    },
                    clip: row.try_get(4)?,
                    n_frames: row.try_get(5)?,
                    fps: row.try_get(6)?,
                })
            })
            .collect()
    }
}
