//! The one task that writes: everything that waits goes into one transaction (group commit).
//!
//! A commit waits for the disk; with many writers at once that wait is shared. Replies are sent
//! after the commit. Each piece of work runs inside a savepoint, so that one that fails takes
//! nothing else with it.

use std::future::Future;
use std::pin::Pin;
use std::sync::Arc;

use sqlx::{Connection as _, Executor as _, SqliteConnection};
use tokio::sync::{mpsc, oneshot};

use crate::error::StoreError;
use crate::notice::{Board, Notice};

/// Pieces of work that may share a transaction.
const GROUP: usize = 256;

/// A future that borrows the transaction it works in.
pub(crate) type Working<'t, T> = Pin<Box<dyn Future<Output = Result<T, StoreError>> + Send + 't>>;

/// What a piece of work is given.
pub(crate) struct Transaction<'t> {
    /// The only connection that may write.
    pub(crate) connection: &'t mut SqliteConnection,
    notices: &'t mut Vec<Notice>,
}

impl Transaction<'_> {
    /// Tells this after the commit.
    pub(crate) fn tell(&mut self, notice: Notice) {
        self.notices.push(notice);
    }
}

/// Hands work to the writer. Cheap to clone.
#[derive(Debug, Clone)]
pub(crate) struct Writer {
    sender: mpsc::Sender<Box<dyn Job>>,
}

impl Writer {
    /// Starts the task over its connection.
    pub(crate) fn start(connection: SqliteConnection, board: Arc<Board>) -> Self {
        let (sender, jobs) = mpsc::channel(4 * GROUP);
        tokio::spawn(write_all(connection, jobs, board));
        Self { sender }
    }

    /// Runs `work` in a transaction; returns after its commit. Once handed over the work is
    /// done even if the caller goes away.
    pub(crate) async fn write<T, W>(&self, work: W) -> Result<T, StoreError>
    where
        T: Send + 'static,
        W: for<'t> FnOnce(&'t mut Transaction<'_>) -> Working<'t, T> + Send + 'static,
    {
        let (reply, answer) = oneshot::channel();
        let job = Box::new(Pending {
            work: Some(work),
            result: None,
            reply,
        });
        self.sender
            .send(job)
            .await
            .map_err(|_| StoreError::Closed)?;
        answer.await.map_err(|_| StoreError::Closed)?
    }
}

/// Work whose result type is forgotten, so that different work fits one channel.
trait Job: Send {
    /// Does the work; whether it may be committed.
    fn run<'t>(
        &'t mut self,
        transaction: &'t mut Transaction<'_>,
    ) -> Pin<Box<dyn Future<Output = bool> + Send + 't>>;
    /// Sends the reply.
    fn finish(self: Box<Self>, committed: Result<(), StoreError>);
}

struct Pending<T, W> {
    work: Option<W>,
    result: Option<Result<T, StoreError>>,
    reply: oneshot::Sender<Result<T, StoreError>>,
}

impl<T, W> Job for Pending<T, W>
where
    T: Send + 'static,
    W: for<'t> FnOnce(&'t mut Transaction<'_>) -> Working<'t, T> + Send + 'static,
{
    fn run<'t>(
        &'t mut self,
        transaction: &'t mut Transaction<'_>,
    ) -> Pin<Box<dyn Future<Output = bool> + Send + 't>> {
        Box::pin(async move {
            let Some(work) = self.work.take() else {
                return false;
            };
            let result = work(transaction).await;
            let is_ok = result.is_ok();
            self.result = Some(result);
            is_ok
        })
    }

    fn finish(self: Box<Self>, committed: Result<(), StoreError>) {
        let result = match (self.result, committed) {
            (Some(Ok(value)), Ok(())) => Ok(value),
            (Some(Err(error)), _) | (_, Err(error)) => Err(error),
            (None, Ok(())) => Err(StoreError::Closed),
        };
        let _ = self.reply.send(result); // a caller that went away needs no reply
    }
}

async fn write_all(
    mut connection: SqliteConnection,
    mut jobs: mpsc::Receiver<Box<dyn Job>>,
    board: Arc<Board>,
) {
    let mut group = Vec::with_capacity(GROUP);
    while jobs.recv_many(&mut group, GROUP).await > 0 {
        let mut notices = Vec::new();
        let committed = commit(&mut connection, &mut group, &mut notices).await;
        if let Err(error) = &committed {
            tracing::error!("a transaction was not committed: {error}");
            let _ = connection.execute("rollback").await; // there may be none to roll back
        } else {
            for notice in notices {
                board.tell(notice);
            }
        }
        for job in group.drain(..) {
            job.finish(committed.clone());
        }
    }
    if let Err(error) = connection.close().await {
        tracing::error!("the database did not close cleanly: {error}");
    }
}

async fn commit(
    connection: &mut SqliteConnection,
    group: &mut [Box<dyn Job>],
    notices: &mut Vec<Notice>,
) -> Result<(), StoreError> {
    connection.execute("begin immediate").await?;
    for job in group.iter_mut() {
        connection.execute("savepoint work").await?;
        let n_notices = notices.len();
        let is_ok = job
            .run(&mut Transaction {
                connection: &mut *connection,
                notices: &mut *notices,
            })
            .await;
        if !is_ok {
            notices.truncate(n_notices);
            connection.execute("rollback to work").await?;
        }
        connection.execute("release work").await?;
    }
    connection.execute("commit").await?;
    Ok(())
}
