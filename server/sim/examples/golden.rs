//! Replays recordings and prints what `stair golden` prints, without the rest of the program:
//! `cargo run -p sim --example golden PATH…`.

use std::path::PathBuf;

use sim::golden::{Replay, find_recordings};

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let paths: Vec<_> = std::env::args().skip(1).map(PathBuf::from).collect();
    let mut replay = Replay::new();
    for file in find_recordings(&paths)? {
        replay.file(&file)?;
    }
    let report = replay.finish();
    for field in &report.fields {
        if !field.is_within_tolerance() {
            println!("PAST {field:?}");
        }
    }
    for line in &report.malformed {
        println!("{line}");
    }
    println!(
        "{} lines compared, {} fields, skipped {:?}",
        report.n_checked,
        report.fields.len(),
        report.skipped
    );
    for d in &report.dynamics {
        println!(
            "{:<40} free {:>3}, hand {:>5.1} mm, object {:>7.4} ({:>7.4}), off {:>5.1} %",
            d.recording,
            d.n_free,
            1e3 * d.hand_rms_m,
            d.object[0],
            d.object[1],
            100.0 * d.object_error()
        );
    }
    Ok(())
}
