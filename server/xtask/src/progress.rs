//! Says what takes long, how long it took and how large it is.

use std::io::{IsTerminal, Write};
use std::path::Path;
use std::time::{Duration, Instant};

/// How often a line is renewed on a terminal, and how often one is added to a log.
const EVERY_ON_A_TERMINAL: Duration = Duration::from_secs(1);
const EVERY_IN_A_LOG: Duration = Duration::from_secs(10);

/// A line that tells how far something is: rewritten in place on a terminal, added now and then
/// to a log.
pub(crate) struct Progress {
    label: String,
    started: Instant,
    last: Instant,
    is_terminal: bool,
}

impl Progress {
    /// Announces what begins.
    pub(crate) fn start(label: &str) -> Self {
        let is_terminal = std::io::stdout().is_terminal();
        println!("{label}");
        Self {
            label: label.to_owned(),
            started: Instant::now(),
            last: Instant::now(),
            is_terminal,
        }
    }

    /// Tells how many of how many bytes are there, if it is time to.
    pub(crate) fn bytes(&mut self, done: u64, total: u64) {
        let every = if self.is_terminal {
            EVERY_ON_A_TERMINAL
        } else {
            EVERY_IN_A_LOG
        };
        if self.last.elapsed() < every {
            return;
        }
        self.last = Instant::now();
        let line = format!(
            "  {} of {}, {}",
            megabytes(done.min(total)),
            megabytes(total),
            seconds(self.started.elapsed())
        );
        if self.is_terminal {
            print!("\r{line}   ");
        } else {
            println!("{line}");
        }
        // A terminal that went away must not stop a download.
        let _ = std::io::stdout().flush();
    }

    /// Tells that it is done and how long it took.
    pub(crate) fn finish(self) {
        let start = if self.is_terminal { "\r" } else { "" };
        println!(
            "{start}  done in {}: {}",
            seconds(self.started.elapsed()),
            self.label
        );
    }
}

/// `531 MB`: decimal, as download pages count.
pub(crate) fn megabytes(bytes: u64) -> String {
    format!("{} MB", bytes.div_ceil(1_000_000))
}

/// `0.4 s`, `12 s`, `3 min 05 s`
pub(crate) fn seconds(duration: Duration) -> String {
    let whole = duration.as_secs();
    match whole {
        0..10 => format!("{:.1} s", duration.as_secs_f64()),
        10..60 => format!("{whole} s"),
        _ => format!("{} min {:02} s", whole / 60, whole % 60),
    }
}

/// Bytes of all files below a folder; what vanishes while it is being counted counts nothing.
pub(crate) fn folder_size(folder: &Path) -> u64 {
    let Ok(entries) = std::fs::read_dir(folder) else {
        return 0;
    };
    entries
        .flatten()
        .map(|entry| match entry.metadata() {
            Ok(metadata) if metadata.is_dir() => folder_size(&entry.path()),
            Ok(metadata) => metadata.len(),
            Err(_) => 0,
        })
        .sum()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn durations_read_like_a_person_would_say_them() {
        assert_eq!(seconds(Duration::from_millis(420)), "0.4 s");
        assert_eq!(seconds(Duration::from_secs(59)), "59 s");
        assert_eq!(seconds(Duration::from_secs(185)), "3 min 05 s");
    }

    #[test]
    fn sizes_are_rounded_up_to_whole_megabytes() {
        assert_eq!(megabytes(0), "0 MB");
        assert_eq!(megabytes(530_600_001), "531 MB");
    }
}
