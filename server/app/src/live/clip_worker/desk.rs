//! What the clip thread does without its device: takes messages, and keeps what was drawn.

use std::collections::VecDeque;
use std::sync::mpsc::{Receiver, RecvTimeoutError};
use std::sync::{Arc, Mutex};
use std::time::{Duration, Instant};

use lab::message::Demonstration;
use serde_json::json;
use store::{ClipJob, NewClip, NewDemonstration, QueryId, RunId, Store, StoreError};
use tokio::runtime::Handle;

use super::{Message, Trouble, lock};
use crate::api::clips;

/// From one try to store clips to the next.
const PAUSE: Duration = Duration::from_secs(1);

/// What waits to be drawn, and where it goes.
pub(super) struct Desk {
    store: Store,
    runtime: Handle,
    messages: Receiver<Message>,
    demonstrations: VecDeque<(RunId, String, Demonstration)>,
    trouble: Arc<Mutex<Option<Trouble>>>,
}

impl Desk {
    pub(super) fn new(
        store: Store,
        runtime: Handle,
        messages: Receiver<Message>,
        trouble: Arc<Mutex<Option<Trouble>>>,
    ) -> Self {
        Self {
            store,
            runtime,
            messages,
            demonstrations: VecDeque::new(),
            trouble,
        }
    }

    /// Takes the messages that are there. Whether to go on.
    pub(super) fn take_all(&mut self) -> bool {
        while let Ok(message) = self.messages.try_recv() {
            if !self.take(message) {
                return false;
            }
        }
        true
    }

    /// Waits for a message and takes it. Whether to go on.
    pub(super) fn wait(&mut self) -> bool {
        match self.messages.recv() {
            Ok(message) => self.take(message),
            Err(_) => false,
        }
    }

    /// Whether to go on.
    fn take(&mut self, message: Message) -> bool {
        match message {
            Message::Wake => {}
            Message::Demonstration {
                run,
                task,
                demonstration,
            } => {
                self.demonstrations.push_back((run, task, demonstration));
            }
            Message::Close => return false,
        }
        true
    }

    /// The next query to draw.
    pub(super) fn next_job(&self) -> Option<ClipJob> {
        let job = self.runtime.block_on(self.store.next_clip_job());
        job.unwrap_or_else(|error| {
            tracing::error!("cannot read which clips to draw: {error}");
            None
        })
    }

    /// The next episode to draw.
    pub(super) fn next_demonstration(&mut self) -> Option<(RunId, String, Demonstration)> {
        self.demonstrations.pop_front()
    }

    /// Keeps a query's clips, or why it has none, as soon as the store can: a full disk holds
    /// everything up until there is room, and the pages say so. Whether to go on.
    pub(super) fn keep(&mut self, job: &ClipJob, drawn: &Result<[NewClip; 2], String>) -> bool {
        while let Err(error) = self.store_drawn(job.query, drawn) {
            self.tell(job.run, &error);
            if !self.pause() {
                return false;
            }
        }
        if lock(&self.trouble).take().is_some() {
            tracing::info!("clips can be stored again");
        }
        true
    }

    fn store_drawn(
        &self,
        query: QueryId,
        drawn: &Result<[NewClip; 2], String>,
    ) -> Result<(), StoreError> {
        self.runtime.block_on(async {
            match drawn {
                Ok([first, second]) => self.store.attach_clips(query, first, second).await,
                Err(reason) => self.store.clip_failed(query, reason).await,
            }
        })
    }

    /// Lets the pages say why no clips come; the log has each reason once.
    fn tell(&self, run: RunId, error: &StoreError) {
        let told = format!("clips cannot be stored: {error}");
        let mut trouble = lock(&self.trouble);
        if trouble.as_ref().is_none_or(|before| before.told != told) {
            tracing::error!(run.id = %run, "{told}");
        }
        *trouble = Some(Trouble {
            told,
            is_passing: true,
        });
    }

    /// Lets a moment pass, and takes the messages that come in it. Whether to go on.
    fn pause(&mut self) -> bool {
        let over = Instant::now() + PAUSE;
        loop {
            let left = over.saturating_duration_since(Instant::now());
            match self.messages.recv_timeout(left) {
                Ok(message) => {
                    if !self.take(message) {
                        return false;
                    }
                }
                Err(RecvTimeoutError::Timeout) => return true,
                Err(RecvTimeoutError::Disconnected) => return false,
            }
        }
    }

    /// The clip first, then the event that shows it; an episode that a killed run shows again
    /// makes no second event.
    ///
    /// # Errors
    /// When they cannot be stored.
    pub(super) fn keep_demonstration(
        &self,
        run: RunId,
        shows: NewDemonstration,
        clip: &NewClip,
    ) -> Result<(), StoreError> {
        let NewDemonstration {
            session,
            step,
            success,
            task_return,
        } = shows;
        let event = json!({
            "kind": "clips", "what": "demonstration", "session": session, "step": step, "success": success,
            "task_return": task_return, "clip": clips::address(&clip.sha256),
        });
        let name = session.map_or_else(
            || "demonstration/end".to_owned(),
            |s| format!("demonstration/{s}"),
        );
        let kept = self.store.add_demonstration(run, shows, clip);
        self.runtime.block_on(kept)?;
        let told = self.store.append_event(run, &name, &event);
        self.runtime.block_on(told)?;
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use std::path::Path;
    use std::sync::mpsc::{Sender, channel};

    use domain::environment::TaskReward;
    use domain::episode::{EpisodeId, Segment, SegmentRecord};
    use domain::query::{OfferedQuery, QueryKey};
    use store::NewRun;
    use tokio::runtime::Runtime;

    use super::*;

    fn record(episode: u32) -> SegmentRecord {
        SegmentRecord {
            segment: Segment {
                episode: EpisodeId(episode),
                start: 0,
                len: 2,
            },
            poses: vec![vec![0.5]; 2],
            task_rewards: vec![TaskReward(0.5); 2],
            stages: vec![0; 2],
        }
    }

    fn clip(n: u8) -> NewClip {
        NewClip {
            bytes: vec![n; 8],
            sha256: format!("{n:064x}"),
            n_frames: 2,
            fps: 20,
            width: 8,
            height: 8,
        }
    }

    /// A store in which one query waits to be drawn.
    async fn store_with_a_query(folder: &Path) -> Store {
        let store = Store::open(folder).await.unwrap();
        let run = NewRun {
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
        let run = store.add_run(run).await.unwrap();
        let query = OfferedQuery {
            key: QueryKey {
                session: 0,
                index: 0,
            },
            first: record(0),
            second: record(1),
            asks_same_stage: false,
            disagreement: None,
            stage_gap: None,
            typical_reward: None,
        };
        store.offer(run, &[query], true).await.unwrap();
        store
    }

    /// A desk over such a store, and where its messages are put.
    fn desk(runtime: &Runtime, folder: &Path) -> (Desk, Sender<Message>) {
        let store = runtime.block_on(store_with_a_query(folder));
        let (sender, messages) = channel();
        let handle = runtime.handle().clone();
        (Desk::new(store, handle, messages, Arc::default()), sender)
    }

    /// Lets every clip of a data folder be refused, as a full disk does.
    fn obstruct(folder: &Path) -> std::path::PathBuf {
        let clips = folder.join("clips");
        std::fs::remove_dir(&clips).unwrap();
        std::fs::write(&clips, "in the way").unwrap();
        clips
    }

    #[test]
    fn clips_that_cannot_be_stored_are_kept_once_they_can_and_the_pages_know_meanwhile() {
        let (runtime, folder) = (Runtime::new().unwrap(), tempfile::tempdir().unwrap());
        let (mut desk, _sender) = desk(&runtime, folder.path());
        let obstacle = obstruct(folder.path());
        let (trouble, store) = (Arc::clone(&desk.trouble), desk.store.clone());
        let job = desk.next_job().expect("a query to draw");
        let worker = std::thread::spawn(move || desk.keep(&job, &Ok([clip(1), clip(2)])));

        while lock(&trouble).is_none() {
            assert!(!worker.is_finished(), "it gave up");
            std::thread::yield_now(); // another thread has to get there
        }
        let told = lock(&trouble).as_ref().map(|trouble| trouble.told.clone());
        assert!(
            told.is_some_and(|told| told.starts_with("clips cannot be stored: ")),
            "what is wrong"
        );
        assert!(lock(&trouble).as_ref().is_some_and(|t| t.is_passing));

        std::fs::remove_file(obstacle).unwrap();
        assert!(worker.join().unwrap(), "it goes on");
        assert!(lock(&trouble).is_none(), "nothing is wrong any more");
        let job = runtime.block_on(store.next_clip_job()).unwrap();
        assert_eq!(job, None, "the query has its clips");
    }

    #[test]
    fn a_pause_is_as_long_whatever_else_is_asked() {
        let (runtime, folder) = (Runtime::new().unwrap(), tempfile::tempdir().unwrap());
        let (mut desk, sender) = desk(&runtime, folder.path());
        for _ in 0..3 {
            sender.send(Message::Wake).unwrap();
        }
        let began = Instant::now();
        assert!(desk.pause());
        assert!(began.elapsed() >= PAUSE);
    }

    #[test]
    fn a_server_that_closes_does_not_wait_for_clips_that_cannot_be_stored() {
        let (runtime, folder) = (Runtime::new().unwrap(), tempfile::tempdir().unwrap());
        let (mut desk, sender) = desk(&runtime, folder.path());
        obstruct(folder.path());
        let job = desk.next_job().expect("a query to draw");
        sender.send(Message::Close).unwrap();
        assert!(!desk.keep(&job, &Ok([clip(1), clip(2)])));
    }
}
