//! What every handler can reach.

use std::sync::Arc;

use store::Store;

use crate::live::Live;

/// Cheap to clone; one per server.
#[derive(Clone)]
pub struct AppState(Arc<Inner>);

/// What the server holds.
pub struct Inner {
    /// Runs, queries, clips, answers.
    pub store: Store,
    /// The runs that are up.
    pub live: Live,
    /// Whether requests must bring a token: the server listens on more than its own machine.
    pub needs_token: bool,
}

impl AppState {
    /// The state of a server.
    pub fn new(store: Store, live: Live, needs_token: bool) -> Self {
        Self(Arc::new(Inner {
            store,
            live,
            needs_token,
        }))
    }
}

impl std::ops::Deref for AppState {
    type Target = Inner;

    fn deref(&self) -> &Inner {
        &self.0
    }
}
