//! From layers of TOML to one checked tree.

use domain::nearest::nearest;
use toml::de::DeTable;
use toml::{Table, Value};

use super::presets::preset;
use super::{ConfigError, RunConfig, find_task};
use crate::method;

/// Where settings come from, least important first.
#[derive(Debug, Clone, Default)]
pub struct Layers {
    /// A task's name; `None` leaves it to the file.
    pub task: Option<String>,
    /// A method's name.
    pub method: Option<String>,
    /// Presets on top of the task's and the method's own: `quick`.
    pub presets: Vec<String>,
    /// A file's name and text.
    pub file: Option<(String, String)>,
    /// `key.path=value`, values in TOML's notation (bare words are strings).
    pub overrides: Vec<String>,
}

impl RunConfig {
    /// Resolves layers into one checked tree.
    ///
    /// # Errors
    /// [`ConfigError`] names the layer, the key or line, and the nearest right name.
    pub fn resolve(layers: &Layers) -> Result<Self, ConfigError> {
        Self::resolve_from("--set", layers)
    }

    /// The same, where single settings were not typed as `--set`.
    ///
    /// * `origin` – what errors call the place where they were: `settings`
    ///
    /// # Errors
    /// As [`RunConfig::resolve`].
    pub fn resolve_from(origin: &str, layers: &Layers) -> Result<Self, ConfigError> {
        let file = layers
            .file
            .as_ref()
            .map(|(name, text)| parse_layer(name, text))
            .transpose()?;
        let overrides = layers
            .overrides
            .iter()
            .map(|o| parse_override(origin, o))
            .collect::<Result<Vec<_>, _>>()?;
        for (setting, layer) in layers.overrides.iter().zip(&overrides) {
            refuse_another(origin, setting, layer, layers)?;
        }
        let mut chosen = Table::new();
        for layer in file.iter().chain(&overrides) {
            merge(&mut chosen, layer);
        }
        let named = |key: &str, option: &Option<String>| {
            option
                .clone()
                .or_else(|| chosen.get(key).and_then(Value::as_str).map(str::to_owned))
        };
        let task = named("task", &layers.task).ok_or_else(|| no_task(layers))?;
        let method = named("method", &layers.method).unwrap_or_else(|| Self::default().method);
        find_task(&task)?;
        method::find(&method)?;

        let mut tree = Table::new();
        let preset_names = ["task", method.as_str()]
            .into_iter()
            .chain(layers.presets.iter().map(String::as_str));
        for name in preset_names {
            merge(&mut tree, &preset(name, &task)?);
        }
        merge(&mut tree, &chosen);
        tree.insert("task".into(), Value::String(task));
        tree.insert("method".into(), Value::String(method));
        let config: Self = tree
            .try_into()
            .map_err(|e: toml::de::Error| ConfigError::Invalid {
                origin: "settings".into(),
                message: plainly(e.message()),
            })?;
        config.check()?;
        config.check_asks()?;
        Ok(config)
    }
}

/// Which of `task`, `method` and `seed` a setting names. Each has a place of its own, and named
/// twice it would count once.
pub fn identity(setting: &str) -> Option<&'static str> {
    let layer = parse_override("--set", setting).ok()?; // what is none is told when it is resolved
    let names = ["task", "method", "seed"];
    names.into_iter().find(|name| layer.contains_key(*name))
}

/// Refuses a setting that names another task or method than the run has: it would be passed over.
fn refuse_another(
    origin: &str,
    setting: &str,
    layer: &Table,
    layers: &Layers,
) -> Result<(), ConfigError> {
    for (key, named) in [("task", &layers.task), ("method", &layers.method)] {
        let (Some(named), Some(other)) = (named, layer.get(key).and_then(Value::as_str)) else {
            continue;
        };
        if named != other {
            return Err(ConfigError::Invalid {
                origin: format!("{origin} {setting}"),
                message: format!("the {key} is {named} already; name {other} in its place"),
            });
        }
    }
    Ok(())
}

/// There is no task by default: hours of another one than was meant would go unnoticed.
fn no_task(layers: &Layers) -> ConfigError {
    let file = layers.file.as_ref();
    ConfigError::Invalid {
        origin: file
            .map_or("settings", |(name, _)| name.as_str())
            .to_owned(),
        message: "no task is named; write task = \"window-open\" at the top of the file, or name \
                  one on the command line"
            .into(),
    }
}

/// Parses one layer alone, so that an error can point into its own text.
pub(super) fn parse_layer(origin: &str, text: &str) -> Result<Table, ConfigError> {
    toml::from_str::<RunConfig>(text).map_err(|e| invalid(origin, text, &e))?;
    toml::from_str(text).map_err(|e| invalid(origin, text, &e))
}

fn parse_override(origin: &str, text: &str) -> Result<Table, ConfigError> {
    let origin = format!("{origin} {text}");
    let Some((key, value)) = text.split_once('=') else {
        return Err(ConfigError::Invalid {
            origin,
            message: "write it as key=value".into(),
        });
    };
    let value = if is_bare(value) {
        format!("{value:?}")
    } else {
        value.to_owned()
    };
    parse_layer(&origin, &format!("{key} = {value}"))
}

/// Whether a value is a word that lacks its quotes. Digits alone are none, not even where TOML
/// cannot read them.
fn is_bare(value: &str) -> bool {
    let is_digits = |text: &str| !text.is_empty() && text.bytes().all(|b| b.is_ascii_digit());
    !is_digits(value.trim()) && DeTable::parse(&format!("x = {value}")).is_err()
}

/// An error of TOML with its line, and the nearest right key where one is unknown.
pub(crate) fn invalid(origin: &str, text: &str, error: &toml::de::Error) -> ConfigError {
    let line = error
        .span()
        .map(|span| 1 + text[..span.start.min(text.len())].matches('\n').count())
        .filter(|_| text.contains('\n'));
    let place = line
        .map(|line| format!("line {line}: "))
        .unwrap_or_default();
    let message = error.message();
    // serde's words are: unknown field `x`, expected one of `a`, `b`
    let quoted: Vec<&str> = message.split('`').skip(1).step_by(2).collect();
    let suggestion = match quoted.split_first() {
        Some((wrong, known)) if message.starts_with("unknown") => nearest(wrong, known),
        _ => None,
    };
    let suggestion = suggestion
        .map(|s| format!(" (did you mean `{s}`?)"))
        .unwrap_or_default();
    ConfigError::Invalid {
        origin: origin.into(),
        message: format!("{place}{}{suggestion}", plainly(message)),
    }
}

/// A message of serde's or TOML's with the names of Rust's types put as what a person would write.
pub fn plainly(message: &str) -> String {
    if ["u64 value was too large", "integer number overflowed"].contains(&message) {
        return format!("a whole number is at most {}", i64::MAX);
    }
    let Some((found, expected)) = message.rsplit_once("expected ") else {
        return message.into();
    };
    let found = found.replace("floating point", "number");
    let found = found.replace("` as i128", "`").replace("` as u128", "`");
    match wanted(expected, &found) {
        Some(wanted) => format!("{found}expected {wanted}"),
        None => message.into(),
    }
}

/// What a person would write where serde expected something else than it found.
fn wanted(expected: &str, found: &str) -> Option<String> {
    let wanted = match expected {
        "f32" | "f64" => "a number",
        "a boolean" => "true or false",
        "a sequence" => "a list, as in [256, 256]",
        "a string" => "text in quotes",
        _ if expected.starts_with("struct ") => "a table of settings",
        _ => return wanted_whole(expected, found),
    };
    Some(wanted.to_owned())
}

/// The same for one of Rust's whole numbers, with the largest of its type where the number that
/// was found is larger. TOML has none above those of `i64`.
fn wanted_whole(expected: &str, found: &str) -> Option<String> {
    let largest = match expected {
        "u8" => i64::from(u8::MAX),
        "u16" => i64::from(u16::MAX),
        "u32" => i64::from(u32::MAX),
        "i8" => i64::from(i8::MAX),
        "i16" => i64::from(i16::MAX),
        "i32" => i64::from(i32::MAX),
        "u64" | "usize" | "i64" | "isize" => i64::MAX,
        _ => return None,
    };
    let number = found.split('`').nth(1).and_then(|n| n.parse::<f64>().ok());
    if number.is_some_and(|number| number >= largest as f64) {
        return Some(format!("a whole number, at most {largest}"));
    }
    let least = if expected.starts_with('u') {
        ", 0 or more"
    } else {
        ""
    };
    Some(format!("a whole number{least}"))
}

pub(super) fn merge(base: &mut Table, layer: &Table) {
    for (key, value) in layer {
        match (base.get_mut(key), value) {
            (Some(Value::Table(below)), Value::Table(above)) => merge(below, above),
            _ => {
                base.insert(key.clone(), value.clone());
            }
        }
    }
}
