//! What a result was computed on.

/// Processor and number of cores, such as `AMD EPYC 9B45, 2 cores`.
pub(super) fn describe() -> String {
    let info = std::fs::read_to_string("/proc/cpuinfo").unwrap_or_default();
    let model = info
        .lines()
        .find(|line| line.starts_with("model name"))
        .and_then(|line| line.split(':').nth(1))
        .map_or("an unknown processor", str::trim);
    let n_cores = std::thread::available_parallelism().map_or(1, usize::from);
    let cores = if n_cores == 1 { "core" } else { "cores" };
    format!("{model}, {n_cores} {cores}")
}
