//! The presets of `assets/presets`, inside the program.

use toml::Table;

use super::layers::parse_layer;
use super::{ConfigError, unknown};

/// `(name, task or "", text)` of every preset. A method's and `paper_table` hold for any task;
/// `task` and `quick` have a text for each.
///
/// The list is made at build time: a preset is a file in `assets/presets`, or in the folder
/// there of its kind, and nothing else.
pub const PRESETS: &[(&str, &str, &str)] = include!(concat!(env!("OUT_DIR"), "/presets.rs"));

/// A preset's own keys.
///
/// # Errors
/// When there is none of that name for the task.
pub(super) fn preset(name: &str, task: &str) -> Result<Table, ConfigError> {
    let found = PRESETS
        .iter()
        .find(|(n, t, _)| *n == name && (t.is_empty() || *t == task));
    let Some((_, _, text)) = found else {
        let mut known: Vec<&str> = PRESETS
            .iter()
            .map(|(n, _, _)| *n)
            .filter(|n| *n != "task")
            .collect();
        known.dedup();
        return Err(unknown("preset", name, known.into_iter()));
    };
    parse_layer(&format!("preset {name}"), text)
}
