//! The runs that are up: each on its own thread, driven by `lab`, watched by pages; and the
//! studies that are being prepared.
//!
//! Invariants: a run that fails or panics ends alone, with its reason shown; a run never touches
//! HTTP; whatever is up when the process ends goes on by itself at the next start.

use std::any::Any;
use std::collections::BTreeMap;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc::{Sender, channel};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::thread::JoinHandle;

use anyhow::Context as _;
use lab::message::{Command, Phase};
use serde_json::Value;
use store::{RunId, Store, StudyId};
use tokio::runtime::Handle;
use tokio::sync::{broadcast, watch};

mod clip_worker;
mod driver;
mod human_teacher;
mod state_line;
mod study;

use clip_worker::ClipQueue;
pub use driver::{DAMAGED_CHECKPOINT, DAMAGED_HISTORY, HTTP, HUMAN};
pub use state_line::{StateKind, StateLine};
pub use study::parse as parse_study;

/// Events of the moment that a slow reader may fall behind; only the newest matters.
const BACKLOG: usize = 64;

/// The registry. Cheap to clone; one per server.
#[derive(Clone)]
pub struct Live(Arc<Inner>);

struct Inner {
    store: Store,
    runtime: Handle,
    clips: ClipQueue,
    clip_thread: Mutex<Option<JoinHandle<()>>>,
    study_threads: Mutex<Vec<JoinHandle<()>>>,
    events: broadcast::Sender<LiveEvent>,
    runs: Mutex<BTreeMap<RunId, LiveRun>>,
    is_closing: AtomicBool,
    /// Whether every thread has ended.
    closed: watch::Sender<bool>,
}

/// A run whose thread is up, or was.
struct LiveRun {
    commands: Sender<Command>,
    thread: Option<JoinHandle<()>>,
    /// What it said last.
    now: Arc<Mutex<Now>>,
}

/// What a run's thread says about the moment; never written to disk.
#[derive(Debug, Clone, Default)]
struct Now {
    phase: Option<Phase>,
    line: Option<StateLine>,
    /// The kind that the store was told last.
    stored: Option<StateKind>,
    /// A stop was asked for and the thread is writing its checkpoint.
    is_stopping: bool,
    /// The run is closed and its end written down; the thread has nothing left to do.
    has_ended: bool,
}

/// Something of the moment, for pages that follow a run.
#[derive(Debug, Clone)]
pub struct LiveEvent {
    /// Whose.
    pub run: RunId,
    /// `lab`'s event as JSON, with its `kind`.
    pub data: Value,
}

/// What a command to a run may meet.
#[derive(Debug, thiserror::Error)]
pub enum LiveError {
    /// The run's thread is writing its last checkpoint.
    #[error("the run is stopping; try again in a moment")]
    Stopping,
    /// The run has no thread that could be paused.
    #[error("the run is not training, so there is nothing to pause or stop")]
    NotUp,
    /// The server is closing.
    #[error("the server is closing")]
    Closing,
    /// The system gave no thread.
    #[error("the system gives no thread for the run: {0}")]
    Thread(#[from] std::io::Error),
    /// The store.
    #[error(transparent)]
    Store(#[from] store::StoreError),
}

impl Live {
    /// Starts the clip thread, and every run that was training or waiting when the last process
    /// ended.
    ///
    /// # Errors
    /// When the store cannot be read or the system gives no thread.
    pub async fn start(store: Store) -> anyhow::Result<Self> {
        let runtime = Handle::current();
        let (clips, thread) = clip_worker::start(store.clone(), runtime.clone())
            .context("cannot start the thread that draws clips")?;
        let live = Self(Arc::new(Inner {
            store,
            runtime,
            clips,
            clip_thread: Mutex::new(Some(thread)),
            study_threads: Mutex::default(),
            events: broadcast::channel(BACKLOG).0,
            runs: Mutex::default(),
            is_closing: AtomicBool::new(false),
            closed: watch::Sender::new(false),
        }));
        for run in live.0.store.runs().await.context("cannot read the runs")? {
            if run.is_trained
                && matches!(run.state.kind.as_str(), "training" | "waiting_for_labels")
            {
                tracing::info!(run.id = %run.id, "going on with run {}", run.id);
                live.spawn(run.id)?;
            }
        }
        let studies = live.0.store.studies().await;
        for study in studies.context("cannot read the studies")? {
            if study.state == "preparing" {
                tracing::info!("going on with preparing study {}", study.id);
                live.prepare(study.id)?;
            }
        }
        live.0.clips.wake();
        Ok(live)
    }

    /// Gets a study ready: chooses its segments, draws its clips, and gives all of them one
    /// length. Whatever of that is done already stays.
    ///
    /// # Errors
    /// [`LiveError::Closing`]; [`LiveError::Thread`].
    pub fn prepare(&self, study: StudyId) -> Result<(), LiveError> {
        if self.0.is_closing.load(Ordering::SeqCst) {
            return Err(LiveError::Closing);
        }
        Ok(study::start(&self.0, study)?)
    }

    /// Starts a run that the store knows, or goes on with it.
    ///
    /// # Errors
    /// [`LiveError`].
    pub fn spawn(&self, run: RunId) -> Result<(), LiveError> {
        let mut runs = lock(&self.0.runs);
        if self.0.is_closing.load(Ordering::SeqCst) {
            return Err(LiveError::Closing);
        }
        if runs.get(&run).is_some_and(LiveRun::is_up) {
            return Ok(());
        }
        let (commands, inbox) = channel();
        let now = Arc::new(Mutex::new(Now {
            line: Some(StateLine::opening()),
            ..Now::default()
        }));
        let driver = driver::Driver::new(Arc::clone(&self.0), run, Arc::clone(&now));
        let thread = std::thread::Builder::new()
            .name(format!("run {run}"))
            .spawn(move || driver.run(&inbox))?;
        runs.insert(
            run,
            LiveRun {
                commands,
                thread: Some(thread),
                now,
            },
        );
        Ok(())
    }

    /// Lets a run stand still; answers are still taken.
    ///
    /// # Errors
    /// [`LiveError::NotUp`].
    pub fn pause(&self, run: RunId) -> Result<(), LiveError> {
        self.command(run, Command::Pause)
    }

    /// Goes on with a run that is paused, stopped or failed.
    ///
    /// # Errors
    /// [`LiveError::Stopping`] while its last checkpoint is being written.
    pub fn resume(&self, run: RunId) -> Result<(), LiveError> {
        match self.command(run, Command::Resume) {
            Err(LiveError::NotUp) => self.spawn(run),
            other => other,
        }
    }

    /// Ends a run's thread after a checkpoint. The run can be taken up again.
    ///
    /// # Errors
    /// [`LiveError::NotUp`].
    pub fn stop(&self, run: RunId) -> Result<(), LiveError> {
        self.command(run, Command::Stop)
    }

    fn command(&self, run: RunId, command: Command) -> Result<(), LiveError> {
        let runs = lock(&self.0.runs);
        let live = runs
            .get(&run)
            .filter(|live| live.is_up())
            .ok_or(LiveError::NotUp)?;
        let mut now = lock(&live.now);
        if now.is_stopping {
            return if command == Command::Stop {
                Ok(())
            } else {
                Err(LiveError::Stopping)
            };
        }
        now.is_stopping = command == Command::Stop;
        live.commands.send(command).map_err(|_| LiveError::NotUp)
    }

    /// The state of a run whose thread is up, with the numbers of the moment; the store has it
    /// for every other run.
    pub fn state(&self, run: RunId) -> Option<StateLine> {
        let mut line = self.now(run)?.line?;
        if line.kind == StateKind::WaitingForLabels
            && let Some(trouble) = self.clip_trouble()
        {
            line.message = format!("{}; {trouble}", line.message);
        }
        Some(line)
    }

    /// What a run whose thread is up is doing.
    pub fn phase(&self, run: RunId) -> Option<Phase> {
        self.now(run)?.phase
    }

    fn now(&self, run: RunId) -> Option<Now> {
        let runs = lock(&self.0.runs);
        let live = runs.get(&run).filter(|live| live.is_up())?;
        Some(lock(&live.now).clone())
    }

    /// What runs are doing from now on, as it changes and about once a second. Everything that
    /// lasts is in the store's log instead.
    pub fn events(&self) -> broadcast::Receiver<LiveEvent> {
        self.0.events.subscribe()
    }

    /// Why no clips come at the moment, with what to do about it.
    pub fn clip_trouble(&self) -> Option<String> {
        self.0.clips.trouble()
    }

    /// Stops every run at a checkpoint, then the clip thread. The runs go on at the next start.
    /// Whoever calls this returns when all is done, also when an earlier caller gave up waiting.
    pub async fn close(&self) {
        if !self.0.is_closing.swap(true, Ordering::SeqCst) {
            let inner = Arc::clone(&self.0);
            tokio::task::spawn_blocking(move || inner.stop_all());
        }
        let mut closed = self.0.closed.subscribe();
        // Fails only when the sender is gone, and it lives as long as `self`.
        let _ = closed.wait_for(|is_closed| *is_closed).await;
    }
}

impl Inner {
    fn stop_all(&self) {
        let threads: Vec<_> = lock(&self.runs)
            .values_mut()
            .filter_map(|run| {
                let _ = run.commands.send(Command::Stop); // a thread that has ended needs no telling
                run.thread.take()
            })
            .collect();
        self.clips.close();
        let clips = lock(&self.clip_thread).take();
        let studies = std::mem::take(&mut *lock(&self.study_threads));
        for thread in threads.into_iter().chain(clips).chain(studies) {
            // A panic inside a run was caught there; one outside was printed by the hook.
            let _ = thread.join();
        }
        self.closed.send_replace(true);
    }
}

impl LiveRun {
    fn is_up(&self) -> bool {
        !lock(&self.now).has_ended
            && self
                .thread
                .as_ref()
                .is_some_and(|thread| !thread.is_finished())
    }
}

/// A poisoned lock guards plain values that are whole at every moment.
fn lock<T>(mutex: &Mutex<T>) -> MutexGuard<'_, T> {
    mutex.lock().unwrap_or_else(PoisonError::into_inner)
}

/// What a panic said.
fn panic_text(panic: &(dyn Any + Send)) -> String {
    let text = panic
        .downcast_ref::<String>()
        .map(String::as_str)
        .or(panic.downcast_ref::<&str>().copied());
    format!(
        "a bug in this program: {}",
        text.unwrap_or("it stopped without a word")
    )
}
