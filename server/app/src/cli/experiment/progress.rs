//! How far an experiment is, in the terminal.

use std::collections::BTreeMap;
use std::time::{Duration, Instant};

use indicatif::{MultiProgress, ProgressBar, ProgressStyle};
use lab::grid::{self, PlannedRun};

use super::check::shown;

/// A bar for the whole and one for each run that is under way.
pub(super) struct Progress {
    bars: MultiProgress,
    whole: ProgressBar,
    running: BTreeMap<usize, ProgressBar>,
    /// What each run costs, in seconds on one core, and how much of it is done, [0, 1].
    work: Vec<(f64, f64)>,
    started: Instant,
    done_before: f64,
}

impl Progress {
    /// * `done` – the share of each run that is done already
    pub(super) fn new(plan: &[PlannedRun], done: Vec<f64>) -> Self {
        let costs = plan
            .iter()
            .map(|run| grid::time_here(std::slice::from_ref(run), 1).as_secs_f64());
        let bars = MultiProgress::new();
        let whole = bars.add(ProgressBar::new(plan.len() as u64));
        whole.set_style(style("{bar:30} {pos}/{len} runs  {msg}"));
        let mut progress = Self {
            bars,
            whole,
            running: BTreeMap::new(),
            work: costs.zip(done).collect(),
            started: Instant::now(),
            done_before: 0.0,
        };
        progress.done_before = progress.done();
        progress.show();
        progress
    }

    pub(super) fn begin(&mut self, index: usize, run: &PlannedRun) {
        let bar = ProgressBar::new(run.config.training.total_steps);
        bar.set_style(style("{bar:30} {pos}/{len} steps  {msg}"));
        bar.set_message(run.name.clone());
        self.running.insert(index, self.bars.add(bar));
    }

    pub(super) fn advance(&mut self, index: usize, step: u64) {
        if let Some(bar) = self.running.get(&index) {
            bar.set_position(step);
            let total = bar.length().unwrap_or(1).max(1);
            self.work[index].1 = step as f64 / total as f64;
        }
        self.show();
    }

    pub(super) fn end(&mut self, index: usize, words: &str) {
        if let Some(bar) = self.running.remove(&index) {
            bar.finish_and_clear();
        }
        self.work[index].1 = 1.0;
        self.say(words);
        self.show();
    }

    /// A line above the bars, or on its own where there is no terminal.
    pub(super) fn say(&self, words: &str) {
        if self.whole.is_hidden() {
            println!("{words}");
        } else {
            let _ = self.bars.println(words); // a terminal that is gone needs no words
        }
    }

    pub(super) fn clear(&self) {
        for bar in self.running.values() {
            bar.finish_and_clear();
        }
        self.whole.finish_and_clear();
    }

    fn show(&self) {
        let ended = self.work.iter().filter(|(_, done)| *done >= 1.0).count();
        self.whole.set_position(ended as u64);
        if let Some(left) = self.left() {
            self.whole
                .set_message(format!("about {} left", shown(left)));
        }
    }

    /// From how fast the work that was done since the start was done.
    fn left(&self) -> Option<Duration> {
        let (done, elapsed) = (self.done(), self.started.elapsed());
        let since = done - self.done_before;
        let left = (1.0 - done) / since * elapsed.as_secs_f64();
        (since > 0.0).then(|| Duration::from_secs_f64(left.clamp(0.0, 1e9)))
    }

    fn done(&self) -> f64 {
        let whole: f64 = self.work.iter().map(|(cost, _)| cost).sum();
        let done: f64 = self.work.iter().map(|(cost, share)| cost * share).sum();
        done / whole
    }
}

fn style(template: &str) -> ProgressStyle {
    ProgressStyle::with_template(template).unwrap_or_else(|_| ProgressStyle::default_bar())
}
