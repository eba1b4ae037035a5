//! Resolved settings of runs, held against each other.

use crate::config::RunConfig;

/// Of resolved settings without their seed, so that the seeds of a group share it: 16
/// hexadecimal digits, FNV-1a.
pub fn fingerprint(config: &RunConfig) -> String {
    let text = without_seed(config).to_toml();
    let mix = |hash: u64, byte: u8| (hash ^ u64::from(byte)).wrapping_mul(0x0100_0000_01b3);
    format!("{:016x}", text.bytes().fold(0xcbf2_9ce4_8422_2325, mix))
}

pub(super) fn without_seed(config: &RunConfig) -> RunConfig {
    RunConfig {
        seed: 0,
        ..config.clone()
    }
}

/// As a row holds them.
pub(super) fn table(config: &RunConfig) -> toml::Table {
    toml::from_str(&config.to_toml()).unwrap_or_default()
}

/// The first setting in which two trees differ, seeds aside: dotted path, and both values.
pub(crate) fn first_difference(
    there: &RunConfig,
    here: &RunConfig,
) -> Option<(String, String, String)> {
    let flat = |config: &RunConfig| {
        let tree = table(&without_seed(config));
        let mut leaves = Vec::new();
        flatten("", &toml::Value::Table(tree), &mut leaves);
        leaves
    };
    let (there, here) = (flat(there), flat(here));
    let value = |leaves: &[(String, String)], key: &str| {
        let found = leaves.iter().find(|(k, _)| k == key);
        found.map_or_else(|| "nothing".to_owned(), |(_, value)| value.clone())
    };
    let mut keys = there.iter().chain(&here).map(|(key, _)| key);
    keys.find_map(|key| {
        let (there, here) = (value(&there, key), value(&here, key));
        (there != here).then(|| (key.clone(), there, here))
    })
}

fn flatten(path: &str, value: &toml::Value, leaves: &mut Vec<(String, String)>) {
    let toml::Value::Table(table) = value else {
        leaves.push((path.to_owned(), value.to_string()));
        return;
    };
    for (key, value) in table {
        let path = if path.is_empty() {
            key.clone()
        } else {
            format!("{path}.{key}")
        };
        flatten(&path, value, leaves);
    }
}
