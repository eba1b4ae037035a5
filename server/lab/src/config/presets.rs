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

/// Names of presets, each once; tasks bring their own without being asked.
pub(crate) fn preset_names() -> Vec<&'static str> {
    let names = PRESETS.iter().map(|(name, _, _)| *name);
    let mut known: Vec<&str> = names.filter(|name| *name != "task").collect();
    known.sort_unstable();
    known.dedup();
    known
}

/// A preset's own keys.
///
/// # Errors
/// When there is none of that name for the task.
pub(super) fn preset(name: &str, task: &str) -> Result<Table, ConfigError> {
    let found = PRESETS
        .iter()
        .find(|(n, t, _)| *n == name && (t.is_empty() || *t == task));
    let Some((_, _, text)) = found else {
        return Err(unknown("preset", name, preset_names().into_iter()));
    };
    parse_layer(&format!("preset {name}"), text)
}
