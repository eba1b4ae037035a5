//! What a run is going to hold in memory, and whether this machine has it.

use domain::environment::EnvSpec;
use learn::replay::ReplayShape;

use crate::config::RunConfig;
use crate::method::Method;

const MIB: u64 = 1 << 20;

/// Program, libraries and what the allocator keeps of freed memory: libtorch alone holds 117 MB,
/// runs of window-open some 200 MB soon after their start.
const PROGRAM: u64 = 256 * MIB;
/// Bytes of a label: its key, its two segments, the answer.
const LABEL: u64 = 128;

/// Bytes that a run will hold when it ends, by what holds them.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct MemoryNeed {
    /// Transitions and poses of all steps.
    pub replay: u64,
    /// The agent with its updates.
    pub agent: u64,
    /// The reward ensemble with its fitting.
    pub reward: u64,
    /// The temporal distance with its steps; 0 where none is learned.
    pub temporal: u64,
    /// All labels.
    pub labels: u64,
    /// The program itself.
    pub program: u64,
}

/// A run that this machine cannot hold.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[error(
    "the run needs {} of memory, {} of it for {what}, and this machine has {} free; lower {setting}{}",
    gib(.need.total()), gib(*.part), gib(*.available), advice(.n_steps.as_ref())
)]
pub struct TooLittleMemory {
    /// What it needs.
    pub need: MemoryNeed,
    /// What the machine has, bytes.
    pub available: u64,
    /// What needs most.
    pub what: &'static str,
    /// How much of it, bytes.
    pub part: u64,
    /// The setting that decides about it.
    pub setting: &'static str,
    /// The environment steps that would fit, where fewer steps help.
    pub n_steps: Option<u64>,
}

impl MemoryNeed {
    /// From the settings alone.
    pub fn of(config: &RunConfig, spec: &EnvSpec, method: &Method) -> Self {
        let (s, a) = (spec.observation_size, spec.action_size);
        Self {
            replay: step_bytes(spec).saturating_mul(config.training.total_steps),
            agent: config.agent.bytes(s, a),
            reward: config.reward.bytes(s, a),
            temporal: if method.learns_temporal_distance() {
                config.temporal.bytes(s)
            } else {
                0
            },
            labels: LABEL * u64::from(config.feedback.budget),
            program: PROGRAM,
        }
    }

    /// All of it, bytes.
    pub fn total(&self) -> u64 {
        self.replay.saturating_add(self.beside_replay())
    }

    /// Whether it fits into so many free bytes.
    ///
    /// # Errors
    /// [`TooLittleMemory`], with the setting that decides about the largest part.
    pub fn check(&self, spec: &EnvSpec, available: u64) -> Result<(), TooLittleMemory> {
        if self.total() <= available {
            return Ok(());
        }
        let parts = [
            (self.replay, "the replay", "training.total_steps"),
            (self.agent, "the agent", "agent.hidden or agent.batch"),
            (
                self.reward,
                "the reward ensemble",
                "reward.hidden or reward.members",
            ),
            (
                self.temporal,
                "the temporal distance",
                "temporal.hidden or temporal.batch",
            ),
            (self.labels, "labels", "feedback.budget"),
        ];
        let (part, what, setting) = parts.into_iter().max_by_key(|p| p.0).unwrap_or(parts[0]);
        let rest = available.checked_sub(self.beside_replay());
        let n_steps = rest.map(|bytes| bytes / step_bytes(spec));
        Err(TooLittleMemory {
            need: *self,
            available,
            what,
            part,
            setting,
            n_steps: n_steps.filter(|n| *n > 0 && part == self.replay),
        })
    }

    fn beside_replay(&self) -> u64 {
        self.agent + self.reward + self.temporal + self.labels + self.program
    }
}

/// Bytes that can still be had without swapping: the kernel's own estimate, where there is one.
pub fn available() -> Option<u64> {
    parse_available(&std::fs::read_to_string("/proc/meminfo").ok()?)
}

fn parse_available(meminfo: &str) -> Option<u64> {
    let line = meminfo
        .lines()
        .find_map(|l| l.strip_prefix("MemAvailable:"))?;
    let kib: u64 = line.trim().strip_suffix("kB")?.trim().parse().ok()?;
    kib.checked_mul(1024)
}

fn step_bytes(spec: &EnvSpec) -> u64 {
    shape(spec).step_bytes() as u64
}

/// Rows of a task's replay.
pub(crate) fn shape(spec: &EnvSpec) -> ReplayShape {
    ReplayShape {
        observation: spec.observation_size,
        action: spec.action_size,
        pose: spec.pose_size,
    }
}

fn gib(bytes: u64) -> String {
    format!("{:.1} GiB", bytes as f64 / f64::from(1 << 30))
}

fn advice(n_steps: Option<&u64>) -> String {
    n_steps.map_or_else(String::new, |n| format!(" to {n} or fewer"))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::config::{Layers, find_task};
    use crate::method;

    const GIB: u64 = 1 << 30;

    fn need(task: &str, overrides: &[&str]) -> (MemoryNeed, EnvSpec) {
        let config = RunConfig::resolve(&Layers {
            task: Some(task.into()),
            overrides: overrides.iter().map(ToString::to_string).collect(),
            ..Layers::default()
        })
        .unwrap();
        let spec = (find_task(task).unwrap().spec)();
        let method = (method::find(&config.method).unwrap().build)(&config);
        (MemoryNeed::of(&config, &spec, &method), spec)
    }

    #[test]
    fn a_million_steps_with_their_poses_hold_less_than_one_and_a_half_gigabytes() {
        for labels in ["feedback.budget=0", "feedback.budget=10000"] {
            let (need, _) = need("window-open", &["training.total_steps=1000000", labels]);
            assert!(need.total() < 1_500_000_000, "{need:?}");
        }
    }

    #[test]
    fn a_run_too_long_is_refused_with_the_steps_that_fit() {
        let (need, spec) = need("window-open", &["training.total_steps=1000000000"]);
        let error = need.check(&spec, 8 * GIB).unwrap_err();
        let text = error.to_string();
        assert!(
            text.contains("training.total_steps") && text.contains("8.0 GiB"),
            "{text}"
        );
        let n_steps = error.n_steps.unwrap();
        let fitting = format!("training.total_steps={n_steps}");
        let (need, spec) = self::need("window-open", &[&fitting]);
        assert_eq!(need.check(&spec, 8 * GIB), Ok(()));
        need.check(&spec, 4 * GIB).unwrap_err();
    }

    #[test]
    fn a_network_too_large_is_refused_with_its_own_setting() {
        let (need, spec) = need("window-open", &["agent.hidden=[65536, 65536]"]);
        let text = need.check(&spec, 8 * GIB).unwrap_err().to_string();
        assert!(
            text.contains("agent.hidden") && !text.contains("or fewer"),
            "{text}"
        );
    }

    #[test]
    fn the_kernels_estimate_is_read_in_its_unit() {
        let meminfo = "MemTotal:       24683008 kB\nMemAvailable:   23281664 kB\nBuffers: 1 kB\n";
        assert_eq!(parse_available(meminfo), Some(23_281_664 * 1024));
        assert_eq!(parse_available("MemTotal: 5 kB\n"), None);
    }
}
