//! What a commit tells those who wait: a run's newest answer, a run's newest event.

use std::collections::HashMap;
use std::sync::{Mutex, PoisonError};

use tokio::sync::watch;

use crate::run::RunId;

/// News that a transaction carries; told after its commit and not before.
#[derive(Debug, Clone, Copy)]
pub(crate) enum Notice {
    /// The run's newest preference has this sequence number.
    Answer(RunId, u64),
    /// The run's newest event has this id.
    Event(RunId, u64),
}

/// One number for each run, which only grows.
#[derive(Debug, Default)]
pub(crate) struct Board {
    answers: Mutex<HashMap<RunId, watch::Sender<u64>>>,
    events: Mutex<HashMap<RunId, watch::Sender<u64>>>,
}

impl Board {
    pub(crate) fn tell(&self, notice: Notice) {
        let (column, run, value) = match notice {
            Notice::Answer(run, sequence) => (&self.answers, run, sequence),
            Notice::Event(run, id) => (&self.events, run, id),
        };
        let mut column = column.lock().unwrap_or_else(PoisonError::into_inner);
        let sender = column.entry(run).or_insert_with(|| watch::channel(0).0);
        sender.send_if_modified(|newest| {
            let grows = value > *newest;
            *newest = value.max(*newest);
            grows
        });
    }

    pub(crate) fn answers(&self, run: RunId) -> watch::Receiver<u64> {
        subscribe(&self.answers, run)
    }

    pub(crate) fn events(&self, run: RunId) -> watch::Receiver<u64> {
        subscribe(&self.events, run)
    }
}

fn subscribe(
    column: &Mutex<HashMap<RunId, watch::Sender<u64>>>,
    run: RunId,
) -> watch::Receiver<u64> {
    let mut column = column.lock().unwrap_or_else(PoisonError::into_inner);
    column
        .entry(run)
        .or_insert_with(|| watch::channel(0).0)
        .subscribe()
}
