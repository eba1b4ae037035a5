//! Opening a data folder: lock, database, settings, writer and readers.

use std::fs::{File, TryLockError};
use std::io::{Read as _, Write as _};
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::time::Duration;

use sqlx::migrate::{MigrateError, Migrator};
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
/// What makes a database, and an older one this version's.
static MIGRATIONS: Migrator = sqlx::migrate!("../../migrations");

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
    match MIGRATIONS.run(connection).await {
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
    const NEEDED: [(&str, &str, &str); 4] = [
        ("journal_mode", "pragma journal_mode", "wal"),
        ("synchronous", "pragma synchronous", "2"),
        ("foreign_keys", "pragma foreign_keys", "1"),
        ("busy_timeout", "pragma busy_timeout", "5000"),
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

#[cfg(test)]
mod tests {
    use sqlx::{Connection as _, Executor as _, SqliteConnection};

    use super::*;
    use crate::secret::Secret;
    use crate::token::TokenKind;

    /// SQL from outside the program, as somebody with a database shell would send it.
    async fn execute(folder: &Path, sql: &'static str) -> Result<(), sqlx::Error> {
        let options = SqliteConnectOptions::new().filename(folder.join("stair.sqlite"));
        let mut shell = SqliteConnection::connect_with(&options).await?;
        shell.execute(sql).await?;
        shell.close().await
    }

    #[tokio::test]
    async fn a_database_from_a_newer_version_is_refused_and_left_alone() {
        let folder = tempfile::tempdir().expect("a temporary folder");
        drop(Store::open(folder.path()).await.expect("a store"));
        let later =
            "insert into _sqlx_migrations (version, description, success, checksum, execution_time)
                     values (9999, 'later', 1, x'00', 0)";
        execute(folder.path(), later)
            .await
            .expect("a newer program was here");
        let refused = Store::open(folder.path())
            .await
            .expect_err("must be refused");
        assert!(
            matches!(refused, StoreError::Newer { version: 9999, .. }),
            "{refused}"
        );
    }

    /// A labeler and a run in a database of the version with migration 6, and two tokens: of that
    /// run, and of one that is not there.
    async fn filled_by_the_version_before(folder: &Path, run: &Secret, no_run: &Secret) {
        let options = SqliteConnectOptions::new()
            .filename(folder.join("stair.sqlite"))
            .create_if_missing(true)
            .foreign_keys(true);
        let mut old = SqliteConnection::connect_with(&options)
            .await
            .expect("a database");
        MIGRATIONS.run_to(6, &mut old).await.expect("that version");
        let rows =
            "insert into labeler (id, name, created_at_ms) values (2, 'program of run 1', 0);
             insert into run (id, task, method, preset, seed, teacher, draws_clips, config, budget,
                total_steps, state, state_message, state_next, state_since_ms, created_at_ms)
             values (1, 'any', 'any', '', 1, 'http', 0, '', 1, 1, 'stopped', '', '', 0, 0);";
        old.execute(rows).await.expect("rows");
        for (secret, number) in [(run, 1), (no_run, 9)] {
            sqlx::query("insert into token (hash, kind, labeler_id, run_id, created_at_ms) values (?, 'teacher', 2, ?, 0)")
                .bind(secret.hash())
                .bind(number)
                .execute(&mut old)
                .await
                .expect("a token");
        }
        old.close().await.expect("closed");
    }

    #[tokio::test]
    async fn a_token_of_the_version_before_is_kept_where_there_is_its_run() {
        let folder = tempfile::tempdir().expect("a temporary folder");
        let [run, no_run] = ["of a run", "of none"].map(Secret::brought);
        filled_by_the_version_before(folder.path(), &run, &no_run).await;
        let store = Store::open(folder.path())
            .await
            .expect("brought up to date");
        let bearer = store.bearer(&run).await.expect("read");
        assert_eq!(
            bearer.map(|bearer| bearer.kind),
            Some(TokenKind::Teacher(RunId(1)))
        );
        assert_eq!(store.bearer(&no_run).await.expect("read"), None);
        let of_no_run = "insert into token (hash, kind, labeler_id, run_id, created_at_ms)
                         values (zeroblob(32), 'teacher', 2, 9, 0)";
        let refused = execute(folder.path(), of_no_run)
            .await
            .expect_err("no such run");
        assert!(refused.to_string().contains("FOREIGN KEY"), "{refused}");
    }

    #[tokio::test]
    async fn what_still_refers_to_a_row_is_found_without_reading_a_whole_table() {
        let folder = tempfile::tempdir().expect("a temporary folder");
        let store = Store::open(folder.path()).await.expect("a store");
        for sql in [
            "explain query plan delete from clip where sha256 = ''",
            "explain query plan delete from question where id = 0",
            "explain query plan delete from study_item where id = 0",
        ] {
            let rows = sqlx::query(sql).fetch_all(store.readers()).await;
            let rows = rows.expect(sql);
            let steps: Vec<String> = rows.iter().map(|row| row.get("detail")).collect();
            assert!(
                steps.iter().all(|step| step.starts_with("SEARCH")),
                "{steps:?}"
            );
        }
    }

    #[tokio::test]
    async fn a_second_store_is_told_who_holds_the_folder() {
        let folder = tempfile::tempdir().expect("a temporary folder");
        let first = Store::open(folder.path()).await.expect("a store");
        let refused = Store::open(folder.path())
            .await
            .expect_err("must be refused");
        assert!(
            refused
                .to_string()
                .contains(&format!("process {}", std::process::id())),
            "{refused}"
        );
        drop(first);
    }

    #[tokio::test]
    async fn audit_rows_cannot_be_changed_or_removed() {
        let folder = tempfile::tempdir().expect("a temporary folder");
        let store = Store::open(folder.path()).await.expect("a store");
        let run = crate::run::NewRun {
            task: "any".into(),
            method: "any".into(),
            preset: String::new(),
            seed: 1,
            teacher: "human".into(),
            draws_clips: true,
            config: String::new(),
            budget: 1,
            total_steps: 1,
            is_trained: false,
        };
        let id = store.add_run(run).await.expect("a run");
        let refused = store
            .set_run_state(id, "asleep", "", "")
            .await
            .expect_err("no such state");
        assert!(
            matches!(&refused, StoreError::Rule(rule) if rule.contains("run_state_known")),
            "{refused}"
        );
        for sql in ["delete from audit", "update audit set action = 'nothing'"] {
            let refused = execute(folder.path(), sql).await.expect_err(sql);
            assert!(refused.to_string().contains("append-only"), "{refused}");
        }
    }

    #[tokio::test]
    async fn one_that_fails_takes_nothing_else_with_it() {
        let folder = tempfile::tempdir().expect("a temporary folder");
        let store = Store::open(folder.path()).await.expect("a store");
        let (good, bad) = tokio::join!(store.sign_in("Ada"), store.sign_in(" "));
        assert_eq!(good.expect("Ada").0.name, "Ada");
        assert!(
            matches!(bad, Err(StoreError::Rule(rule)) if rule.contains("labeler_name_not_empty"))
        );
    }
}
