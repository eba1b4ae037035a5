//! Several runs at once, each a process of its own.
//!
//! Processes and not threads: what takes a process down (memory, a fault inside libtorch) then
//! takes one run, its memory goes back to the system when it ends, and a run is stopped and taken
//! up again exactly as `stair train` is. Each has its share of the processors, which changes
//! nothing of what it computes.
//!
//! A run's process has its stdin open to this one and stops with a checkpoint when that ends,
//! however this one ends.

use std::collections::VecDeque;
use std::fs::File;
use std::io::{IsTerminal as _, Read as _, Seek as _, SeekFrom};
use std::os::unix::process::{CommandExt as _, ExitStatusExt as _};
use std::path::Path;
use std::process::{Child, Command, ExitStatus, Stdio};
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, Instant};

use anyhow::Context as _;
use indicatif::{ProgressBar, ProgressStyle};
use lab::cost::on_cores;
use lab::experiment::grid::GridRun;
use lab::experiment::results::{GridFolder, Results, Row, rows_of_run};
use lab::history::RunHistory;
use lab::run::Run;
use serde_json::json;

use super::{check, in_words};
use crate::provenance::{self, processors};

/// How many threads a process computes on; whoever sets it knows better.
const N_THREADS: &str = "RAYON_NUM_THREADS";
/// Between looks at the processes.
const LOOK: Duration = Duration::from_millis(100);
/// Between looks at how far they are.
const LOOK_CLOSELY: Duration = Duration::from_secs(3);
/// After which what is done tells how fast this goes.
const SETTLED: Duration = Duration::from_secs(10);

/// What became of the runs.
#[derive(Debug, Default)]
pub(super) struct Tally {
    /// In the grid.
    pub n_runs: usize,
    /// Finished before.
    pub n_before: usize,
    /// Finished now.
    pub n_finished: usize,
    /// Which could not go on, and why.
    pub failed: Vec<(String, String)>,
}

/// Works through the runs of a grid.
pub(super) struct Pool<'a> {
    folder: &'a GridFolder,
    log: File,
    jobs: usize,
}

/// A run whose process is up.
struct Worker<'a> {
    run: &'a GridRun,
    child: Child,
}

/// How the process of a run ended.
enum End {
    Finished,
    Stopped,
    Failed(String),
}

impl<'a> Pool<'a> {
    /// * `log` – locked; runs write to it and hold the lock with it
    pub(super) fn new(folder: &'a GridFolder, log: File, jobs: usize) -> Self {
        Self { folder, log, jobs }
    }

    /// Runs whatever is not finished, until all is or somebody says stop.
    pub(super) fn work(
        &self,
        runs: &[GridRun],
        results: &Results,
        is_told_to_stop: &AtomicBool,
    ) -> anyhow::Result<Tally> {
        let mut waiting: VecDeque<&GridRun> = runs
            .iter()
            .filter(|run| results.run(&run.key).is_none())
            .collect();
        let mut tally = Tally {
            n_runs: runs.len(),
            n_before: runs.len() - waiting.len(),
            ..Tally::default()
        };
        let mut progress = Progress::new(self.folder, runs.len(), self.jobs, &waiting);
        let mut up: Vec<Worker> = Vec::new();
        loop {
            if is_told_to_stop.load(Ordering::SeqCst) {
                waiting.clear();
                for worker in &mut up {
                    worker.child.stdin = None; // it leaves a checkpoint
                }
            }
            while up.len() < self.jobs
                && let Some(run) = waiting.pop_front()
            {
                match self.start(run) {
                    Ok(worker) => up.push(worker),
                    Err(error) => {
                        self.fail(run, format!("{error:#}"), &mut tally, &mut progress)?;
                    }
                }
            }
            for mut worker in std::mem::take(&mut up) {
                match worker.child.try_wait().context("cannot watch a run")? {
                    None => up.push(worker),
                    Some(status) => self.close(&worker, status, &mut tally, &mut progress)?,
                }
            }
            progress.show(&tally, &waiting, &up)?;
            if up.is_empty() && waiting.is_empty() {
                progress.bar.finish_and_clear();
                return Ok(tally);
            }
            std::thread::sleep(LOOK); // a process ends without a word
        }
    }

    fn start(&self, run: &'a GridRun) -> anyhow::Result<Worker<'a>> {
        let path = self.folder.run_path(&run.key);
        let settings = self.folder.keep_settings(&run.config)?;
        std::fs::create_dir_all(&path).context("cannot make the run's folder")?;
        let program = std::env::current_exe().context("cannot find this program")?;
        let mut command = Command::new(program);
        if std::env::var_os(N_THREADS).is_none() {
            let share = (processors().get() / self.jobs).max(1);
            command.env(N_THREADS, share.to_string());
        }
        command.args([
            "train",
            "--json",
            "--until-eof",
            "--teacher",
            &run.key.teacher,
        ]);
        if Run::exists(&path) {
            command.arg("--resume").arg(&path);
        } else {
            command.args(["--seed", &run.key.seed.to_string()]);
            command
                .arg("--config")
                .arg(settings)
                .arg("--out")
                .arg(&path);
        }
        let says = File::create(path.join("log.txt")).context("cannot keep what the run says")?;
        let child = command
            .stdin(Stdio::piped())
            .stdout(self.log.try_clone().context("cannot share the log")?)
            .stderr(says)
            .process_group(0) // Ctrl-C reaches this process alone, which tells the others
            .spawn();
        Ok(Worker {
            run,
            child: child.context("cannot start a run")?,
        })
    }

    /// Keeps what a run came to.
    fn close(
        &self,
        worker: &Worker,
        status: ExitStatus,
        tally: &mut Tally,
        progress: &mut Progress<'_>,
    ) -> anyhow::Result<()> {
        let (run, key) = (worker.run, &worker.run.key);
        let path = self.folder.run_path(key);
        match end(&path, status) {
            End::Finished => match finished_rows(run, &path) {
                Ok(rows) => {
                    self.folder.add(&rows)?;
                    tally.n_finished += 1;
                    progress.say(&format!("finished {}", key.name()));
                    if let Err(error) = self.folder.slim(key) {
                        progress.say(&error.to_string());
                    }
                }
                Err(error) => self.fail(run, format!("{error:#}"), tally, progress)?,
            },
            End::Stopped => progress.say(&format!("stopped {}", key.name())),
            End::Failed(reason) => self.fail(run, reason, tally, progress)?,
        }
        Ok(())
    }

    fn fail(
        &self,
        run: &GridRun,
        reason: String,
        tally: &mut Tally,
        progress: &mut Progress<'_>,
    ) -> anyhow::Result<()> {
        progress.say(&format!("failed {}: {reason}", run.key.name()));
        progress.gives_up(run);
        let here = provenance::here(&run.config.device);
        self.folder.add_failure(run, &reason, here)?;
        tally.failed.push((run.key.name(), reason));
        Ok(())
    }
}

/// The rows of a run that ended well, from its folder.
fn finished_rows(run: &GridRun, path: &Path) -> anyhow::Result<Vec<Row>> {
    let metrics = path.join("metrics.jsonl");
    let metrics = std::fs::read_to_string(metrics).context("cannot read its metrics")?;
    let rows = rows_of_run(&run.key, &run.config, &metrics, &RunHistory::of(path)?)?;
    rows.context("it ended without a last line in its metrics")
}

/// Whether a run finished, was stopped, or failed, and why.
fn end(path: &Path, status: ExitStatus) -> End {
    if status.success() {
        let is_over = last_event(path).is_some_and(|event| event["kind"] == "finished");
        return if is_over { End::Finished } else { End::Stopped };
    }
    if let Some(signal) = status.signal() {
        let hint = if signal == 9 {
            ", often for want of memory"
        } else {
            ""
        };
        return End::Failed(format!("its process was ended by signal {signal}{hint}"));
    }
    let said = std::fs::read_to_string(path.join("log.txt")).unwrap_or_default();
    // A panic's own words stand before a hint on how to see more of it.
    let says = |line: &&str| !line.trim().is_empty() && !line.starts_with("note: run with");
    let last = said.lines().rev().find(says);
    let last = last.map(|line| line.trim_start_matches("stair: "));
    End::Failed(last.map_or_else(|| format!("it ended with {status}"), str::to_owned))
}

/// The newest event of a run; `None` before the first.
fn last_event(path: &Path) -> Option<serde_json::Value> {
    const TAIL: u64 = 4_096;
    let mut file = File::open(path.join("metrics.jsonl")).ok()?;
    let len = file.metadata().ok()?.len();
    file.seek(SeekFrom::Start(len.saturating_sub(TAIL))).ok()?;
    let mut tail = Vec::new();
    file.read_to_end(&mut tail).ok()?;
    let tail = String::from_utf8_lossy(&tail).into_owned();
    let mut lines = tail.lines().rev();
    lines.find_map(|line| serde_json::from_str(line).ok())
}

/// How far the grid is, in the terminal and in a file for pages.
struct Progress<'a> {
    folder: &'a GridFolder,
    bar: ProgressBar,
    n_runs: usize,
    jobs: usize,
    began: Instant,
    looked: Option<Instant>,
    /// Seconds on one core that were left at first, as estimated.
    at_first: f64,
    /// Seconds that runs have been up, added up until the last look at the processes.
    busy_s: f64,
    counted: Instant,
}

impl<'a> Progress<'a> {
    fn new(
        folder: &'a GridFolder,
        n_runs: usize,
        jobs: usize,
        waiting: &VecDeque<&GridRun>,
    ) -> Self {
        let bar = ProgressBar::new(n_runs as u64);
        let style = ProgressStyle::with_template("{bar:30} {pos}/{len} runs  {msg}");
        bar.set_style(style.unwrap_or_else(|_| ProgressStyle::default_bar()));
        let left = waiting.iter().map(|run| left_s(folder, run)).sum();
        let now = Instant::now();
        Self {
            folder,
            bar,
            n_runs,
            jobs,
            began: now,
            looked: None,
            at_first: left,
            busy_s: 0.0,
            counted: now,
        }
    }

    /// A line that stays: above the bar, or alone where there is no terminal.
    fn say(&self, line: &str) {
        if std::io::stderr().is_terminal() {
            self.bar.suspend(|| eprintln!("{line}"));
        } else {
            eprintln!("{line}");
        }
    }

    /// What a failed run had left is not done, and not to be done either.
    fn gives_up(&mut self, run: &GridRun) {
        self.at_first -= left_s(self.folder, run);
    }

    fn show(
        &mut self,
        tally: &Tally,
        waiting: &VecDeque<&GridRun>,
        up: &[Worker],
    ) -> anyhow::Result<()> {
        self.count(up.len());
        let n_over = tally.n_before + tally.n_finished + tally.failed.len();
        let is_end = up.is_empty() && waiting.is_empty();
        let is_soon = self.looked.is_some_and(|at| at.elapsed() < LOOK_CLOSELY);
        if is_soon && !is_end {
            return Ok(());
        }
        self.looked = Some(Instant::now());
        let runs = up.iter().map(|worker| worker.run);
        let runs = runs.chain(waiting.iter().copied());
        let lefts: Vec<f64> = runs.map(|run| left_s(self.folder, run)).collect();
        let left = time_left(&lefts, self.jobs, self.pace(lefts.iter().sum()));
        self.bar.set_position(n_over as u64);
        let words = in_words(Duration::from_secs_f64(left.clamp(0.0, 1e9)));
        self.bar.set_message(format!(
            "{} up, {} failed, {words} left",
            up.len(),
            tally.failed.len()
        ));
        let running: Vec<_> = up
            .iter()
            .map(|worker| {
                let (name, config) = (worker.run.key.name(), &worker.run.config);
                json!({"name": name, "step": step(self.folder, worker.run), "total_steps": config.training.total_steps})
            })
            .collect();
        let text = json!({
            "n_runs": self.n_runs, "n_over": n_over, "n_failed": tally.failed.len(),
            "running": running, "left_s": left,
        });
        Ok(self.folder.replace("progress.json", &text.to_string())?)
    }

    /// Adds what the runs that are up have taken since the last time.
    fn count(&mut self, n_up: usize) {
        let now = Instant::now();
        self.busy_s += now.duration_since(self.counted).as_secs_f64() * n_up as f64;
        self.counted = now;
    }

    /// Seconds that each estimated second took so far.
    ///
    /// * `left` – seconds on one core that are still estimated
    fn pace(&self, left: f64) -> f64 {
        let done = self.at_first - left;
        if done > 0.0 && self.began.elapsed() > SETTLED {
            self.busy_s / done
        } else {
            1.0
        }
    }
}

/// Seconds until the last run is over: a run is on one core, so the cores that the others leave do
/// not help it.
///
/// * `lefts` – estimated seconds of each run, in the order in which they are started
/// * `pace` – seconds that an estimated one takes
fn time_left(lefts: &[f64], n_jobs: usize, pace: f64) -> f64 {
    let estimated = lefts.iter().map(|left| Duration::from_secs_f64(*left));
    pace * on_cores(estimated, n_jobs).as_secs_f64()
}

fn step(folder: &GridFolder, run: &GridRun) -> u64 {
    let event = last_event(&folder.run_path(&run.key));
    event.and_then(|event| event["step"].as_u64()).unwrap_or(0)
}

/// Seconds on one core that a run has yet to take.
fn left_s(folder: &GridFolder, run: &GridRun) -> f64 {
    let share = step(folder, run) as f64 / run.config.training.total_steps as f64;
    check::time(run).as_secs_f64() * (1.0 - share.min(1.0))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn ended(status: i32, log: &str, metrics: &str) -> End {
        let folder = tempfile::tempdir().unwrap();
        std::fs::write(folder.path().join("log.txt"), log).unwrap();
        std::fs::write(folder.path().join("metrics.jsonl"), metrics).unwrap();
        end(folder.path(), ExitStatus::from_raw(status))
    }

    #[test]
    fn the_last_run_takes_its_time_however_many_cores_are_free() {
        let close = |found: f64, expected: f64| {
            assert!((found - expected).abs() < 1e-6, "{found} for {expected}");
        };
        close(time_left(&[100.0, 10.0], 2, 1.0), 100.0);
        close(time_left(&[100.0, 10.0, 5.0], 2, 1.5), 150.0);
        close(time_left(&[30.0; 4], 2, 1.0), 60.0);
        close(time_left(&[], 2, 1.0), 0.0);
    }

    #[test]
    fn the_pace_is_that_of_runs_that_were_up_and_not_of_idle_cores() {
        let folder = GridFolder::at(Path::new("nowhere"));
        let mut progress = Progress::new(&folder, 2, 4, &VecDeque::new());
        progress.at_first = 100.0;
        progress.busy_s = 60.0;
        assert_eq!(
            progress.pace(60.0).to_bits(),
            1.0_f64.to_bits(),
            "too early"
        );
        let Some(earlier) = progress.began.checked_sub(2 * SETTLED) else {
            return; // the machine has only just started
        };
        progress.began = earlier;
        // 40 estimated seconds took 60, of one run beside three idle cores.
        assert!((progress.pace(60.0) - 1.5).abs() < 1e-12);
    }

    #[test]
    fn a_run_that_ends_well_is_finished_or_was_stopped() {
        let evaluation = "{\"kind\":\"evaluation\",\"step\":5}\n";
        let finished = "{\"kind\":\"finished\",\"step\":9}\n";
        assert!(matches!(
            ended(0, "", &format!("{evaluation}{finished}")),
            End::Finished
        ));
        assert!(matches!(ended(0, "", evaluation), End::Stopped));
        assert!(matches!(ended(0, "", ""), End::Stopped));
    }

    #[test]
    fn a_run_that_fails_says_why() {
        let End::Failed(reason) = ended(0x0100, "Passed over\nstair: no card\n\n", "") else {
            panic!("code 1 is a failure")
        };
        assert_eq!(reason, "no card");
        let panic = "thread 'main' panicked at x.rs:1:\nno such tensor\nnote: run with `RUST_BACKTRACE=1`\n";
        let End::Failed(reason) = ended(0x6500, panic, "") else {
            panic!("code 101 is a failure")
        };
        assert_eq!(reason, "no such tensor");
        let End::Failed(reason) = ended(9, "", "") else {
            panic!("a signal is a failure")
        };
        assert!(
            reason.contains("signal 9") && reason.contains("memory"),
            "{reason}"
        );
    }
}
