//! The presets of `assets/presets`, inside the program.

use toml::{Table, Value};

use super::layers::{invalid, merge};
use super::{ConfigError, RunConfig, unknown};

/// `(name, task or "", text)` of every preset. A method has one for any task and may have more for
/// single ones, `task` and `quick` have one for each; where there are both, the task's own comes on
/// top.
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

/// A preset's own keys: those for any task, and on top of them the task's own.
///
/// # Errors
/// When there is none of that name for the task.
pub(super) fn preset(name: &str, task: &str) -> Result<Table, ConfigError> {
    let (general, own) = (layer(name, "")?, layer(name, task)?);
    if general.is_none() && own.is_none() {
        return Err(unknown("preset", name, preset_names().into_iter()));
    }
    let mut all = general.unwrap_or_default();
    merge(&mut all, &own.unwrap_or_default());
    Ok(all)
}

/// The keys of one file, on top of those of the file that it is `like`: another task's of the
/// same preset. `None` where there is no such file.
fn layer(name: &str, task: &str) -> Result<Option<Table>, ConfigError> {
    let found = PRESETS.iter().find(|(n, t, _)| (*n, *t) == (name, task));
    let Some((_, _, text)) = found else {
        return Ok(None);
    };
    let origin = format!("preset {name}");
    let own: Table = toml::from_str(text).map_err(|error| invalid(&origin, text, &error))?;
    let (like, own): (Table, Table) = own.into_iter().partition(|(key, _)| key == "like");
    let own = checked(&origin, own)?;
    let mut all = match like.get("like") {
        Some(other) => below(name, other)?,
        None => Table::new(),
    };
    merge(&mut all, &own);
    Ok(Some(all))
}

/// The keys of the file that another is `like`.
///
/// # Errors
/// When it is no name of a task, or that of a task for which the preset has no file.
fn below(name: &str, like: &Value) -> Result<Table, ConfigError> {
    let found = match like.as_str() {
        Some(task) if !task.is_empty() => layer(name, task)?,
        _ => None,
    };
    found.ok_or_else(|| {
        let known = PRESETS.iter().filter(|(n, ..)| *n == name);
        unknown(
            "task to be like",
            &like.to_string(),
            known.map(|(_, t, _)| *t),
        )
    })
}

/// Keys that settings have; a shipped preset has no line worth naming.
fn checked(origin: &str, own: Table) -> Result<Table, ConfigError> {
    match own.clone().try_into::<RunConfig>() {
        Ok(_) => Ok(own),
        Err(error) => Err(invalid(origin, "", &error)),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_preset_that_is_like_another_changes_only_what_it_says() {
        let (door, window) = ("door-open", "window-open");
        let own = preset("quick", door).unwrap();
        let mut like = preset("quick", window).unwrap();
        assert_ne!(own, like);
        like["feedback"]["queries_per_session"] = Value::Integer(60);
        like["feedback"]["budget"] = Value::Integer(3000);
        assert_eq!(own, like);
    }

    #[test]
    fn a_tasks_own_preset_comes_on_top_of_the_one_for_all() {
        let (all, walker) = ("window-open", "quadruped-run");
        let rate =
            |task| preset("paper_table", task).unwrap()["reward"]["learning_rate"].as_float();
        assert_eq!((rate(all), rate(walker)), (Some(1e-4), Some(5e-4)));
        let own = preset("paper_table", walker).unwrap();
        assert_eq!(own["agent"]["critic_ema"].as_float(), Some(0.01));
    }

    #[test]
    fn a_preset_that_is_like_none_is_refused() {
        for like in [Value::String("window-opne".into()), Value::Integer(3)] {
            let told = below("quick", &like).unwrap_err().to_string();
            assert!(told.contains(&like.to_string()), "{told}");
        }
    }

    #[test]
    fn a_key_that_no_setting_has_is_refused() {
        let own = toml::from_str("[agent]\nhiden = [1]").unwrap();
        let told = checked("preset x", own).unwrap_err().to_string();
        assert!(
            told.contains("hiden") && told.contains("`hidden`"),
            "{told}"
        );
    }
}
