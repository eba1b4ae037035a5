//! Work that would hold up the threads that serve.

use crate::problem::Problem;

/// Work of milliseconds to seconds, such as reading rows and making a report: not on the threads
/// that serve.
///
/// # Errors
/// A worker that ended before its work.
pub async fn in_worker<T: Send + 'static>(
    work: impl FnOnce() -> T + Send + 'static,
) -> Result<T, Problem> {
    let done = tokio::task::spawn_blocking(work).await;
    done.map_err(|error| {
        tracing::error!("a worker ended: {error}");
        Problem::internal()
    })
}
