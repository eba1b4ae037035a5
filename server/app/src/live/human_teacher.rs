//! People, or programs over HTTP, as a run's teacher: queries go into the store, answers come
//! out of it by sequence number.

use domain::query::OfferedQuery;
use domain::teacher::{Answered, Teacher, TeacherError};
use store::{RunId, Store};
use tokio::runtime::Handle;
use tokio::sync::watch;

use super::clip_worker::ClipQueue;

/// A mailbox in SQLite. While nobody answers, [`Teacher::collect`] looks at one number in memory
/// and not at the database.
pub struct HumanTeacher {
    store: Store,
    runtime: Handle,
    run: RunId,
    /// Where clips are queued; `None` where a program answers.
    clips: Option<ClipQueue>,
    /// Sequence number of the run's newest answer, raised after its commit.
    newest: watch::Receiver<u64>,
    /// Its value when the store was last read.
    read_at: Option<u64>,
}

impl HumanTeacher {
    /// The teacher of one run; queries get clips when there is a queue for them.
    pub fn new(store: Store, runtime: Handle, run: RunId, clips: Option<ClipQueue>) -> Self {
        let newest = store.newest_answer(run);
        Self {
            store,
            runtime,
            run,
            clips,
            newest,
            read_at: None,
        }
    }
}

impl Teacher for HumanTeacher {
    fn ask(&mut self, queries: &[OfferedQuery]) -> Result<(), TeacherError> {
        let needs_clips = self.clips.is_some();
        let stored = self
            .runtime
            .block_on(self.store.offer(self.run, queries, needs_clips));
        stored
            .map_err(|error| TeacherError(format!("the queries could not be stored: {error}")))?;
        if let Some(clips) = &self.clips {
            clips.wake();
        }
        Ok(())
    }

    fn collect(&mut self, after: u64) -> Result<Vec<Answered>, TeacherError> {
        let newest = *self.newest.borrow();
        if self.read_at == Some(newest) {
            return Ok(Vec::new());
        }
        let answers = self
            .runtime
            .block_on(self.store.answers_after(self.run, after));
        let answers = answers
            .map_err(|error| TeacherError(format!("the answers could not be read: {error}")))?;
        self.read_at = Some(newest);
        Ok(answers)
    }
}
