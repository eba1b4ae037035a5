//! Encoded clips: rows in the database, bytes beside it.

use std::io::Write as _;
use std::path::{Path, PathBuf};

use sqlx::Row as _;

use crate::error::StoreError;
use crate::store::Store;
use crate::time::now_ms;
use crate::writer::Transaction;

/// A clip to be kept.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct NewClip {
    /// The file's bytes.
    pub bytes: Vec<u8>,
    /// SHA-256 of the bytes, 64 hexadecimal digits.
    pub sha256: String,
    /// Pictures.
    pub n_frames: u32,
    /// Pictures a second.
    pub fps: u32,
    /// Pixels.
    pub width: u32,
    /// Pixels.
    pub height: u32,
}

/// A clip that is kept.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct ClipInfo {
    /// Its name.
    pub sha256: String,
    /// Pictures.
    pub n_frames: u32,
    /// Pictures a second.
    pub fps: u32,
    /// Pixels.
    pub width: u32,
    /// Pixels.
    pub height: u32,
    /// Bytes.
    pub n_bytes: u64,
}

impl Store {
    /// What is known of a clip, and where its bytes are.
    ///
    /// # Errors
    /// [`StoreError::Missing`].
    pub async fn clip(&self, sha256: &str) -> Result<(ClipInfo, PathBuf), StoreError> {
        let row = sqlx::query("select * from clip where sha256 = ?")
            .bind(sha256)
            .fetch_optional(self.readers())
            .await?;
        let row = row.ok_or_else(|| StoreError::missing("clip", &sha256))?;
        let info = ClipInfo {
            sha256: row.try_get("sha256")?,
            n_frames: row.try_get("n_frames")?,
            fps: row.try_get("fps")?,
            width: row.try_get("width")?,
            height: row.try_get("height")?,
            n_bytes: row.try_get::<i64, _>("n_bytes")?.unsigned_abs(),
        };
        let path = path_of(self.folder(), &info.sha256);
        Ok((info, path))
    }

    /// Puts the bytes on disk, whole or not at all; done before the row that names them.
    pub(crate) async fn keep_bytes(&self, clip: &NewClip) -> Result<(), StoreError> {
        let path = path_of(self.folder(), &clip.sha256);
        let bytes = clip.bytes.clone();
        let written = tokio::task::spawn_blocking(move || write_whole(&path, &bytes)).await;
        match written {
            Ok(Ok(())) => Ok(()),
            Ok(Err(error)) if error.kind() == std::io::ErrorKind::StorageFull => {
                Err(StoreError::Full)
            }
            Ok(Err(error)) if error.kind() == std::io::ErrorKind::ReadOnlyFilesystem => {
                Err(StoreError::ReadOnly)
            }
            Ok(Err(error)) => Err(StoreError::Folder {
                path: self.folder().join("clips"),
                reason: error.to_string(),
            }),
            Err(_) => Err(StoreError::Closed),
        }
    }

    /// Removes bytes that no row names any more. What cannot be removed stays and does no harm.
    pub(crate) async fn remove_bytes(&self, sha256: &str) {
        let path = path_of(self.folder(), sha256);
        let removed = tokio::task::spawn_blocking(move || std::fs::remove_file(path)).await;
        if let Ok(Err(error)) = removed {
            tracing::warn!("the bytes of clip {sha256} are unused and cannot be removed: {error}");
        }
    }
}

/// Removes the rows of those clips that nothing shows; returns which they were.
pub(crate) async fn forget_unused(
    t: &mut Transaction<'_>,
    clips: &[String],
) -> Result<Vec<String>, StoreError> {
    let mut forgotten = Vec::new();
    for sha256 in clips {
        let removed = sqlx::query(
            "delete from clip where sha256 = ?1
                and not exists (select 1 from query where first_clip = ?1 or second_clip = ?1)
                and not exists (select 1 from demonstration where clip = ?1)",
        )
        .bind(sha256)
        .execute(&mut *t.connection)
        .await?;
        if removed.rows_affected() > 0 {
            forgotten.push(sha256.clone());
        }
    }
    Ok(forgotten)
}

pub(crate) async fn add_row(t: &mut Transaction<'_>, clip: &ClipRow) -> Result<(), StoreError> {
    sqlx::query(
        "insert into clip (sha256, n_frames, fps, width, height, n_bytes, created_at_ms)
         values (?, ?, ?, ?, ?, ?, ?) on conflict do nothing",
    )
    .bind(&clip.sha256)
    .bind(clip.n_frames)
    .bind(clip.fps)
    .bind(clip.width)
    .bind(clip.height)
    .bind(clip.n_bytes)
    .bind(now_ms())
    .execute(&mut *t.connection)
    .await?;
    Ok(())
}

/// A clip without its bytes.
pub(crate) struct ClipRow {
    pub(crate) sha256: String,
    n_frames: u32,
    fps: u32,
    width: u32,
    height: u32,
    n_bytes: i64,
}

impl From<&NewClip> for ClipRow {
    fn from(clip: &NewClip) -> Self {
        Self {
            sha256: clip.sha256.clone(),
            n_frames: clip.n_frames,
            fps: clip.fps,
            width: clip.width,
            height: clip.height,
            n_bytes: clip.bytes.len().cast_signed() as i64,
        }
    }
}

fn path_of(folder: &Path, sha256: &str) -> PathBuf {
    folder
        .join("clips")
        .join(sha256.get(..2).unwrap_or("00"))
        .join(format!("{sha256}.mp4"))
}

fn write_whole(path: &Path, bytes: &[u8]) -> std::io::Result<()> {
    if path.exists() {
        return Ok(());
    }
    let folder = path.parent().unwrap_or(Path::new("."));
    std::fs::create_dir_all(folder)?;
    let beside = path.with_extension("part");
    let mut file = std::fs::File::create(&beside)?;
    file.write_all(bytes)?;
    file.sync_all()?;
    std::fs::rename(&beside, path)?;
    std::fs::File::open(folder)?.sync_all()
}
