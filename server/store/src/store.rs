//! Opening a data folder: lock, database, settings, writer and readers.

use std::fs::{File, TryLockError};
use std::io::{Read as _, Write as _};
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::time::Duration;

use sqlx::migrate::MigrateError;
use sqlx::sqlite::{SqliteConnectOptions, SqliteJournalMode, SqlitePoolOptions, SqliteSynchronous};
use sqlx::{ConnectOptions as _, Row as _, SqliteConnection, SqlitePool};
use tokio::sync::watch;

use crate::error::StoreError;
use crate::notice::Board;
use crate::run::RunId;
use crate::writer::{Transaction, Working, Writer};

/// Connections for reading; SQLite readers never wait for the writer.
const READERS: u32 = 4;
const BUSY_TIMEOUT: Duration = Duration::from_secs(5);

/// The data folder of one server. Cheap to clone.
#[derive(Debug, Clone)]
pub struct Store {
    inner: Arc<Inner>,
}

#[derive(Debug)]
struct Inner {
    writer: Writer,
    readers: SqlitePool,
    board: Arc<Board>,
    folder: PathBuf,
    /// Held until the last clone is gone.
    _lock: File,
}

impl Store {
    /// Opens a folder, makes it if it is not there, and brings its database up to date.
    ///
    /// # Errors
    /// [`StoreError::Folder`], [`StoreError::Held`], [`StoreError::Newer`],
    /// [`StoreError::Migration`], [`StoreError::Setting`]; nothing is changed.
    pub async fn open(folder: &Path) -> Result<Self, StoreError> {
        let refuse = |error: std::io::Error| StoreError::Folder {
            path: folder.to_owned(),
            reason: error.to_string(),
        };
        std::fs::create_dir_all(folder.join("clips")).map_err(refuse)?;
        std::fs::create_dir_all(folder.join("runs")).map_err(refuse)?;
        let lock = lock(folder)?;
        let path = folder.join("stair.sqlite");
        let options = SqliteConnectOptions::new()
            .filename(&path)
            .create_if_missing(true)
            .journal_mode(SqliteJournalMode::Wal)
            .synchronous(SqliteSynchronous::Full)
            .foreign_keys(true)
            .busy_timeout(BUSY_TIMEOUT)
            .optimize_on_close(true, None);
        let mut connection = options
            .connect()
            .await
            .map_err(|error| at_opening(&path, error.into()))?;
        migrate(&mut connection, &path).await?;
        check_settings(&mut connection).await?;
        let readers = SqlitePoolOptions::new()
            .max_connections(READERS)
            .connect_lazy_with(options.read_only(true));
        let board = Arc::new(Board::default());
        let writer = Writer::start(connection, Arc::clone(&board));
        let inner = Inner {
            writer,
            readers,
            board,
            folder: folder.to_owned(),
            _lock: lock,
        };
        Ok(Self {
            inner: Arc::new(inner),
        })
    }

    /// The folder.
    pub fn folder(&self) -> &Path {
        &self.inner.folder
    }

    /// Where a run keeps its checkpoints and transitions.
    pub fn run_folder(&self, run: RunId) -> PathBuf {
        self.inner.folder.join("runs").join(run.to_string())
    }

    /// Sequence number of a run's newest preference; raised after its commit.
    pub fn newest_answer(&self, run: RunId) -> watch::Receiver<u64> {
        self.inner.board.answers(run)
    }

    /// Id of a run's newest event; raised after its commit.
    pub fn newest_event(&self, run: RunId) -> watch::Receiver<u64> {
        self.inner.board.events(run)
    }

    /// Whether the database can be read and written now.
    ///
    /// # Errors
    /// What stands in the way.
    pub async fn check(&self) -> Result<(), StoreError> {
        sqlx::query("select 1").execute(self.readers()).await?;
        self.write(|t| {
            Box::pin(async move {
                sqlx::query("update run set id = id where 0")
                    .execute(&mut *t.connection)
                    .await?;
                Ok(())
            })
        })
        .await
    }

    pub(crate) fn readers(&self) -> &SqlitePool {
        &self.inner.readers
    }

    pub(crate) async fn write<T, W>(&self, work: W) -> Result<T, StoreError>
    where
        T: Send + 'static,
        W: for<'t> FnOnce(&'t mut Transaction<'_>) -> Working<'t, T> + Send + 'static,
    {
        self.inner.writer.write(work).await
    }
}

fn lock(folder: &Path) -> Result<File, StoreError> {
    let path = folder.join("lock");
    let refuse = |error: std::io::Error| StoreError::Folder {
        path: folder.to_owned(),
        reason: error.to_string(),
    };
    let mut file = File::options()
        .read(true)
        .write(true)
        .create(true)
        .truncate(false)
        .open(&path)
        .map_err(refuse)?;
    match file.try_lock() {
        Ok(()) => {
            file.set_len(0).map_err(refuse)?;
            write!(file, "{}", std::process::id()).map_err(refuse)?;
            Ok(file)
        }
        Err(TryLockError::WouldBlock) => {
            let mut holder = String::new();
            let is_told = file.read_to_string(&mut holder).is_ok_and(|n| n > 0);
            let holder = if is_told {
                format!(" (process {})", holder.trim())
            } else {
                String::new()
            };
            Err(StoreError::Held {
                path: folder.to_owned(),
                holder,
            })
        }
        Err(TryLockError::Error(error)) => Err(refuse(error)),
    }
}

async fn migrate(connection: &mut SqliteConnection, path: &Path) -> Result<(), StoreError> {
    match sqlx::migrate!("../../migrations").run(connection).await {
        Ok(()) => Ok(()),
        Err(MigrateError::VersionMissing(version)) => Err(StoreError::Newer {
            path: path.to_owned(),
            version,
        }),
        Err(MigrateError::Execute(error)) => Err(at_opening(path, error.into())),
        Err(error) => Err(StoreError::Migration {
            path: path.to_owned(),
            reason: error.to_string(),
        }),
    }
}

/// A read-only or full disk keeps its own words; the rest says which file it is about.
fn at_opening(path: &Path, error: StoreError) -> StoreError {
    match error {
        StoreError::Database(reason) => StoreError::Migration {
            path: path.to_owned(),
            reason: reason.to_string(),
        },
        other => other,
    }
}

/// Reads back what durability and integrity rest on: SQLite ignores a setting that it cannot take.
async fn check_settings(connection: &mut SqliteConnection) -> Result<(), StoreError> {
    const NEEDED: [(&str, &str, &str); 3] = [
        ("journal_mode", "pragma journal_mode", "wal"),
        ("synchronous", "pragma synchronous", "2"),
        ("foreign_keys", "pragma foreign_keys", "1"),
    ];
    for (name, pragma, wanted) in NEEDED {
        let row = sqlx::query(pragma).fetch_one(&mut *connection).await?;
        let got = row
            .try_get::<String, _>(0)
            .or_else(|_| row.try_get::<i64, _>(0).map(|n| n.to_string()))?;
        if got != wanted {
            return Err(StoreError::Setting { name, wanted, got });
        }
    }
    Ok(())
}
