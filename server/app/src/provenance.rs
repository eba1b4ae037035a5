//! Which program, on which machine.

use std::num::NonZeroUsize;

use lab::history::Provenance;

/// The program's commit.
pub const REVISION: &str = env!("STAIR_REVISION");

/// Of a run that begins or goes on here.
pub fn here(device: &str) -> Provenance {
    Provenance {
        revision: REVISION.into(),
        machine: machine(device != "cpu"),
    }
}

/// Of this machine, as many as this process may use.
pub fn processors() -> NonZeroUsize {
    std::thread::available_parallelism().unwrap_or(NonZeroUsize::MIN)
}

/// `AMD EPYC 9R45, 2 cores`, with the graphics cards where runs use them.
fn machine(uses_card: bool) -> String {
    let cpus = std::fs::read_to_string("/proc/cpuinfo").unwrap_or_default();
    let model = cpus.lines().find(|line| line.starts_with("model name"));
    let model = model
        .and_then(|line| line.split_once(": "))
        .map(|(_, name)| name.trim());
    let cores = processors();
    let mut machine = format!("{}, {cores} cores", model.unwrap_or("unknown processor"));
    if uses_card {
        for card in cards() {
            machine.push_str(", ");
            machine.push_str(&card);
        }
    }
    machine
}

/// `NVIDIA H100 80GB HBM3`, as the driver tells; none where it does not.
fn cards() -> Vec<String> {
    let Ok(folders) = std::fs::read_dir("/proc/driver/nvidia/gpus") else {
        return Vec::new();
    };
    let told = folders.flatten().filter_map(|card| {
        let told = std::fs::read_to_string(card.path().join("information")).ok()?;
        let model = told.lines().find_map(|line| line.strip_prefix("Model:"))?;
        Some(model.trim().to_owned())
    });
    told.collect()
}
