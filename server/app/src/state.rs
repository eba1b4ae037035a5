//! What every handler can reach.

use std::path::PathBuf;
use std::sync::Arc;

/// Cheap to clone; one per server.
#[derive(Clone)]
pub struct AppState(Arc<Inner>);

/// What the server holds.
pub struct Inner {
    /// Folder with the database, the clips and the runs.
    pub data: PathBuf,
}

impl AppState {
    /// The state of a server over `data`.
    pub fn new(data: PathBuf) -> Self {
        Self(Arc::new(Inner { data }))
    }
}

impl std::ops::Deref for AppState {
    type Target = Inner;

    fn deref(&self) -> &Inner {
        &self.0
    }
}
