//! From a checked tree back to the command line that asks for it.

use toml::{Table, Value};

use super::{Layers, RunConfig, preset_names};

impl RunConfig {
    /// The shortest `stair train` that resolves to this tree. Who answers is no setting, so that
    /// `--teacher` is left to whoever knows.
    pub fn command(&self) -> String {
        let (preset, settings) = self.preset_and_settings();
        let preset = preset.map(|name| format!(" --preset {name}"));
        let settings = settings.iter().map(|s| format!(" --set {}", quoted(s)));
        format!(
            "stair train {} --method {}{} --seed {}{}",
            self.task,
            self.method,
            preset.unwrap_or_default(),
            self.seed,
            settings.collect::<String>()
        )
    }

    /// The preset on top of the task's and the method's own that leaves the fewest settings to be
    /// changed, `None` where none does better, and the changed ones as `key.path=value`. The seed
    /// is not among them.
    pub fn preset_and_settings(&self) -> (Option<&'static str>, Vec<String>) {
        let own = table(self);
        let presets = std::iter::once(None).chain(preset_names().into_iter().map(Some));
        let candidates = presets.filter_map(|preset| {
            let layers = Layers {
                task: Some(self.task.clone()),
                method: Some(self.method.clone()),
                presets: preset.into_iter().map(str::to_owned).collect(),
                overrides: vec![format!("seed={}", self.seed)],
                file: None,
            };
            let base = Self::resolve(&layers).ok()?;
            let mut settings = Vec::new();
            note_differences(&table(&base), &own, "", &mut settings);
            Some((preset, settings))
        });
        candidates
            .min_by_key(|(_, settings)| settings.len())
            .unwrap_or_default() // a tree that was checked has a known task and method
    }
}

fn table(config: &RunConfig) -> Table {
    Table::try_from(config).expect("a tree of plain values is always TOML")
}

fn note_differences(base: &Table, own: &Table, prefix: &str, settings: &mut Vec<String>) {
    for (key, value) in own {
        match (base.get(key), value) {
            (Some(Value::Table(base)), Value::Table(own)) => {
                note_differences(base, own, &format!("{prefix}{key}."), settings);
            }
            (there, here) if there == Some(here) => {}
            _ => settings.push(format!("{prefix}{key}={value}")),
        }
    }
}

/// As a shell takes it for one word.
fn quoted(setting: &str) -> String {
    let is_plain = |c: char| c.is_ascii_alphanumeric() || "._=-".contains(c);
    if setting.chars().all(is_plain) {
        setting.to_owned()
    } else {
        format!("'{setting}'")
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn resolve(method: &str, presets: &[&str], overrides: &[&str]) -> RunConfig {
        let owned = |words: &[&str]| words.iter().map(ToString::to_string).collect();
        RunConfig::resolve(&Layers {
            task: Some("window-open".into()),
            method: Some(method.into()),
            presets: owned(presets),
            overrides: owned(overrides),
            file: None,
        })
        .unwrap()
    }

    #[test]
    fn the_command_names_the_preset_and_what_differs_from_it() {
        let changed = ["seed=3", "agent.hidden=[64, 64]", "feedback.budget=120"];
        assert_eq!(
            resolve("pebble", &["quick"], &changed).command(),
            "stair train window-open --method pebble --preset quick --seed 3 \
             --set 'agent.hidden=[64, 64]' --set feedback.budget=120"
        );
        assert_eq!(
            resolve("stair", &[], &[]).command(),
            "stair train window-open --method stair --seed 1"
        );
    }

    #[test]
    fn what_the_command_names_resolves_to_the_same_tree() {
        let changed = ["training.while_waiting=train", "reward.learning_rate=2e-5"];
        for presets in [&[][..], &["quick"], &["quick", "paper_table"]] {
            let config = resolve("qpa", presets, &changed);
            let (preset, settings) = config.preset_and_settings();
            let settings: Vec<&str> = settings.iter().map(String::as_str).collect();
            let presets: Vec<&str> = preset.into_iter().collect();
            assert_eq!(resolve("qpa", &presets, &settings), config, "{settings:?}");
        }
    }
}
