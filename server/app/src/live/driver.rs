//! One run on its thread: opened, driven, and its end written down.

use std::panic::{AssertUnwindSafe, catch_unwind};
use std::sync::atomic::Ordering;
use std::sync::mpsc::Receiver;
use std::sync::{Arc, Mutex};
use std::time::Instant;

use anyhow::Context as _;
use domain::teacher::{Scripted, Teacher};
use lab::config::{RunConfig, scripted_teacher};
use lab::history::Sitting;
use lab::message::{Command, Event, Phase};
use lab::run::{Outcome, Run};
use serde_json::{Value, json};
use store::{RunId, RunRow};

use super::human_teacher::HumanTeacher;
use super::state_line::{StateKind, StateLine};
use super::{Inner, LiveEvent, Now, lock, panic_text};
use crate::provenance;

/// Who answers a run, as `POST /api/v1/runs` names it: people at their pages.
pub const HUMAN: &str = "human";
/// A program over HTTP; clips are not drawn for it.
pub const HTTP: &str = "http";

/// Kind of the event of a checkpoint that was passed over; its `complaint` says why.
pub const DAMAGED_CHECKPOINT: &str = "damaged_checkpoint";
/// Kind of the event of a history that was set aside; its `complaint` says why.
pub const DAMAGED_HISTORY: &str = "damaged_history";

fn is_over_http(teacher: &str) -> bool {
    matches!(teacher, HUMAN | HTTP)
}

/// All that a run's thread needs.
pub(super) struct Driver {
    inner: Arc<Inner>,
    run: RunId,
    now: Arc<Mutex<Now>>,
}

impl Driver {
    pub(super) fn new(inner: Arc<Inner>, run: RunId, now: Arc<Mutex<Now>>) -> Self {
        Self { inner, run, now }
    }

    /// The thread's whole life.
    pub(super) fn run(self, commands: &Receiver<Command>) {
        let driven = catch_unwind(AssertUnwindSafe(|| self.drive(commands)));
        let line = match driven {
            Ok(Ok(line)) => line,
            Ok(Err(error)) => StateLine::failed(&format!("{error:#}")),
            Err(panic) => StateLine::failed(&panic_text(panic.as_ref())),
        };
        if line.kind == StateKind::Failed {
            tracing::error!(run.id = %self.run, "run {} {}", self.run, line.message);
        }
        // A run that was stopped because the server closes is still training: it goes on by itself.
        let is_to_go_on =
            line.kind == StateKind::Stopped && self.inner.is_closing.load(Ordering::SeqCst);
        if !is_to_go_on {
            self.show(&line);
        }
        lock(&self.now).has_ended = true;
    }

    fn drive(&self, commands: &Receiver<Command>) -> anyhow::Result<StateLine> {
        let began = Instant::now();
        self.show(&StateLine::opening());
        let row = self
            .wait(self.inner.store.run(self.run))?
            .context("the store does not know this run")?;
        let mut run = self.open(&row)?;
        let config = run.config().clone();
        let folder = self.inner.store.run_folder(self.run);
        let here = provenance::here(&config.device);
        let (sitting, complaint) = Sitting::begin(&folder, &here, began)?;
        if let Some(complaint) = complaint {
            tracing::warn!(run.id = %self.run, "{complaint}");
            self.log(&json!({"kind": DAMAGED_HISTORY, "complaint": complaint}));
        }
        let mut teacher = self.teacher(&row, &run)?;
        let outcome = sitting.drive(&mut run, teacher.as_mut(), commands, &mut |event| {
            self.hear(event, &row, &config);
        })?;
        match outcome {
            Outcome::Finished(finished) => Ok(StateLine::finished(&finished)),
            Outcome::Stopped => {
                self.note_step(run.step(), None);
                Ok(StateLine::stopped(run.step()))
            }
        }
    }

    fn open(&self, row: &RunRow) -> anyhow::Result<Run> {
        let folder = self.inner.store.run_folder(self.run);
        if !Run::exists(&folder) {
            let config = RunConfig::parse("the run's settings", &row.config)?;
            let script = Some(row.teacher.as_str()).filter(|name| !is_over_http(name));
            return Ok(Run::start_with(config, &folder, script)?);
        }
        let (run, complaints) = Run::resume(&folder)?;
        for complaint in complaints {
            tracing::warn!(run.id = %self.run, "passed over a damaged checkpoint: {complaint}");
            self.log(&json!({"kind": DAMAGED_CHECKPOINT, "complaint": complaint}));
        }
        Ok(run)
    }

    fn teacher(&self, row: &RunRow, run: &Run) -> anyhow::Result<Box<dyn Teacher>> {
        let name = row.teacher.as_str();
        if is_over_http(name) {
            let clips = row.draws_clips.then(|| self.inner.clips.clone());
            let (store, runtime) = (self.inner.store.clone(), self.inner.runtime.clone());
            return Ok(Box::new(HumanTeacher::new(store, runtime, self.run, clips)));
        }
        let judge = scripted_teacher(name, run.config().seed, &run.config().teacher)?;
        Ok(Box::new(Scripted::new(judge, run.consumed_sequence())))
    }

    /// Everything a run says passes here.
    fn hear(&self, event: Event, row: &RunRow, config: &RunConfig) {
        match event {
            Event::Phase(phase) => self.say(phase, config),
            Event::Demonstration(demonstration) => {
                if row.draws_clips || row.teacher != HTTP {
                    self.inner
                        .clips
                        .demonstrate(self.run, row.task.clone(), demonstration);
                }
            }
            lasting => self.keep(&lasting, row),
        }
    }

    /// Shows what is only of the moment.
    fn say(&self, phase: Phase, config: &RunConfig) {
        // How far it is need not be stored at every moment, but where it comes to wait.
        if self.show(&StateLine::of_phase(&phase, config)) {
            self.note_step(phase.step, None);
        }
        lock(&self.now).phase = Some(phase.clone());
        let data = serde_json::to_value(Event::Phase(phase)).unwrap_or_default();
        let _ = self.inner.events.send(LiveEvent {
            run: self.run,
            data,
        }); // nobody may be watching
    }

    fn keep(&self, event: &Event, row: &RunRow) {
        self.log(&serde_json::to_value(event).unwrap_or_default());
        let (step, n_labels) = match event {
            Event::Metrics(row) => (row.step, row.labels),
            Event::SessionClosed(row) => (row.step, row.labels),
            Event::Refitted(row) => (row.step, row.labels),
            Event::Evaluation(row) => (row.step, row.labels),
            Event::Finished(row) => (row.step, row.labels),
            _ => return,
        };
        // Answers over HTTP are counted where they are stored.
        let n_labels = (!is_over_http(&row.teacher)).then_some(n_labels);
        self.note_step(step, n_labels);
    }

    fn note_step(&self, step: u64, n_labels: Option<u32>) {
        if let Err(error) = self.wait(self.inner.store.set_step(self.run, step, n_labels)) {
            tracing::error!(run.id = %self.run, "a run's progress could not be stored: {error}");
        }
    }

    /// Appends to the store's log, where pages follow it. A run that was killed says some things
    /// again; what has a name there already is not kept twice.
    fn log(&self, event: &Value) {
        if let Err(error) = self.wait(self.inner.store.append_event(self.run, &name(event), event))
        {
            tracing::error!(run.id = %self.run, "an event could not be stored: {error}");
        }
    }

    /// Keeps the line of the moment in memory; the store hears of it when its kind changes, which
    /// is what it returns.
    fn show(&self, line: &StateLine) -> bool {
        let is_new = {
            let mut now = lock(&self.now);
            now.line = Some(line.clone());
            now.stored.replace(line.kind) != Some(line.kind)
        };
        if !is_new {
            return false;
        }
        let stored =
            self.inner
                .store
                .set_run_state(self.run, line.kind.word(), &line.message, &line.next);
        if let Err(error) = self.wait(stored) {
            tracing::error!(run.id = %self.run, "a run's state could not be stored: {error}");
        }
        true
    }

    fn wait<T>(&self, work: impl Future<Output = T>) -> T {
        self.inner.runtime.block_on(work)
    }
}

/// What tells one event of a run from another: its kind and where in the run it belongs. The
/// same place is reached again after a kill, with the same numbers or with newer answers.
fn name(event: &Value) -> String {
    let part = |key: &str| event.get(key).map(Value::to_string).unwrap_or_default();
    let place = [
        part("kind"),
        part("step"),
        part("session"),
        part("fit"),
        part("consumed_sequence"),
        part("complaint"),
    ];
    place.join("/")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_row_of_metrics_is_known_by_its_step_whatever_its_numbers() {
        let row = |step: u64, speed: f64| {
            name(&json!({"kind": "metrics", "step": step, "steps_per_s": speed}))
        };
        assert_eq!(row(1_000, 50.0), row(1_000, 60.0));
        assert_ne!(row(1_000, 50.0), row(2_000, 50.0));
        assert_ne!(
            row(1_000, 50.0),
            name(&json!({"kind": "evaluation", "step": 1_000}))
        );
    }
}
