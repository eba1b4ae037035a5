//! A grid of runs: one file says which, in every combination, and this is the list that it
//! stands for.
//!
//! Task × method × teacher × setting × seed, first all runs of the first seed, so that a grid
//! that is cut short can be compared all the same. Pure: the same file gives the same list.

use std::collections::BTreeSet;

use toml::Spanned;

use crate::config::{
    ConfigError, Layers, RunConfig, find_task, find_teacher, identity, preset_names, unknown,
};
use crate::method;

mod file;
mod shipped;

use file::{Axes, GridFile, SettingEntry};
pub use shipped::{SHIPPED, shipped};

/// Runs that a grid may have.
const MOST_RUNS: usize = 100_000;

/// A file of a grid: its name for errors, and its text.
#[derive(Debug, Clone, Copy)]
pub struct GridText<'a> {
    /// What to call it when something is wrong with it.
    pub name: &'a str,
    /// TOML.
    pub text: &'a str,
}

/// An experiment, resolved.
#[derive(Debug, Clone, PartialEq)]
pub struct Grid {
    /// What it shows, in a few words.
    pub title: String,
    /// What it shows and where in the paper, in sentences.
    pub about: String,
    /// In the order in which they are started.
    pub runs: Vec<GridRun>,
}

/// What tells one run of a grid from all others.
#[derive(
    Debug, Clone, PartialEq, Eq, PartialOrd, Ord, Hash, serde::Serialize, serde::Deserialize,
)]
pub struct RunKey {
    /// The task's name.
    pub task: String,
    /// The method's name.
    pub method: String,
    /// The scripted teacher's name.
    pub teacher: String,
    /// The setting's name; empty for a grid without any.
    pub setting: String,
    /// Of every random stream of the run.
    pub seed: u64,
}

impl RunKey {
    /// A name for its folder and for people: `go-fetch-return.stair.oracle.80-labels.3`.
    pub fn name(&self) -> String {
        let setting = folder_part(&self.setting);
        let parts = [&self.task, &self.method, &self.teacher, &setting];
        let parts: Vec<&str> = parts.into_iter().map(String::as_str).collect();
        let named = parts.into_iter().filter(|part| !part.is_empty());
        format!("{}.{}", named.collect::<Vec<_>>().join("."), self.seed)
    }

    /// Setting and teacher as figures and tables show them; empty for the plain setting under
    /// the oracle.
    pub fn shown_setting(&self) -> String {
        shown_setting(&self.setting, &self.teacher)
    }

    /// The teacher; empty for the oracle, who goes without saying.
    pub fn shown_teacher(&self) -> &str {
        shown_teacher(&self.teacher)
    }
}

/// Settings as a file of a grid names them, in its order; none where it cannot be read.
pub fn setting_names(source: GridText) -> Vec<String> {
    let file = GridFile::parse(source);
    let settings = file.map(|file| file.setting).unwrap_or_default();
    let names = settings
        .into_iter()
        .map(|setting| setting.name.into_inner());
    names.collect()
}

/// Setting and teacher in words, as [`RunKey::shown_setting`] says.
pub(crate) fn shown_setting(setting: &str, teacher: &str) -> String {
    let parts = [setting, shown_teacher(teacher)];
    let parts: Vec<&str> = parts.into_iter().filter(|part| !part.is_empty()).collect();
    parts.join(", ")
}

fn shown_teacher(teacher: &str) -> &str {
    if teacher == "oracle" { "" } else { teacher }
}

/// A setting's name as folders have it.
fn folder_part(setting: &str) -> String {
    setting.chars().map(in_a_name).collect()
}

fn in_a_name(c: char) -> char {
    if c.is_ascii_alphanumeric() || "=_-".contains(c) {
        c
    } else {
        '-'
    }
}

/// A run of a grid with all its settings.
#[derive(Debug, Clone, PartialEq)]
pub struct GridRun {
    /// Which.
    pub key: RunKey,
    /// The resolved settings.
    pub config: RunConfig,
}

/// Why a file is no grid of runs.
#[derive(Debug, thiserror::Error)]
pub enum GridError {
    /// Text that is not TOML, or not of this kind.
    #[error(transparent)]
    Text(#[from] ConfigError),
    /// A name or setting that does not fit.
    #[error("{file}: line {line}: {reason}")]
    Misfit {
        /// The file.
        file: String,
        /// From 1.
        line: usize,
        /// What is wrong, with the nearest right name where there is one.
        reason: String,
    },
    /// No combination at all.
    #[error("{file}: line {line}: {axis} is empty, so there is nothing to run; name at least one")]
    Empty {
        /// The file.
        file: String,
        /// From 1.
        line: usize,
        /// Which list.
        axis: &'static str,
    },
    /// More than anybody could want.
    #[error("{file}: {n} runs are more than {MOST_RUNS}; make the lists shorter")]
    TooMany {
        /// The file.
        file: String,
        /// How many.
        n: usize,
    },
    /// Asked for in vain.
    #[error("{file} has no [small]: leave --small out, or add one")]
    NoSmall {
        /// The file.
        file: String,
    },
}

/// Reads a file and resolves every run of it.
///
/// * `is_small` – the file's small variant: the same figure from few runs
///
/// # Errors
/// [`GridError`] names the file, the line and the nearest right name.
pub fn resolve(source: GridText, is_small: bool) -> Result<Grid, GridError> {
    let file = GridFile::parse(source)?;
    let reader = Reader {
        source,
        file: &file,
    };
    let axes: Vec<Axes> = if is_small {
        let Some(small) = &file.small else {
            return Err(GridError::NoSmall {
                file: source.name.to_owned(),
            });
        };
        vec![small.or(&file.axes)]
    } else {
        let more = file.also.iter().map(|axes| axes.or(&file.axes));
        std::iter::once(file.axes.clone()).chain(more).collect()
    };
    let mut runs = Vec::new();
    let mut seen = BTreeSet::new();
    for axes in &axes {
        for run in reader.product(axes, is_small)? {
            if seen.insert(run.key.clone()) {
                runs.push(run);
            }
        }
    }
    runs.sort_by_key(|run| run.key.seed);
    let (title, about) = (file.title.clone(), file.about.trim().to_owned());
    Ok(Grid { title, about, runs })
}

/// A file with what its lines are needed for.
struct Reader<'a> {
    source: GridText<'a>,
    file: &'a GridFile,
}

impl Reader<'_> {
    fn misfit(&self, at: usize, reason: &dyn ToString) -> GridError {
        GridError::Misfit {
            file: self.source.name.to_owned(),
            line: self.line(at),
            reason: reason.to_string(),
        }
    }

    fn line(&self, at: usize) -> usize {
        let before = self.source.text.get(..at).unwrap_or(self.source.text);
        1 + before.matches('\n').count()
    }

    /// Every combination of some axes, checked.
    fn product(&self, axes: &Axes, is_small: bool) -> Result<Vec<GridRun>, GridError> {
        let tasks = self.names(axes.tasks.as_ref(), "tasks", |name| {
            find_task(name).map(|_| ())
        })?;
        let methods = self.names(axes.methods.as_ref(), "methods", |name| {
            method::find(name).map(|_| ())
        })?;
        let teachers = match &axes.teachers {
            None => vec!["oracle".to_owned()],
            teachers => self.names(teachers.as_ref(), "teachers", |name| {
                find_teacher(name, &[])
            })?,
        };
        let settings = self.settings(axes)?;
        let seeds = self.seeds(axes)?;
        let sizes = [
            tasks.len(),
            methods.len(),
            teachers.len(),
            settings.len(),
            seeds.len(),
        ];
        let n = sizes.into_iter().fold(1_usize, usize::saturating_mul);
        if n > MOST_RUNS {
            let file = self.source.name.to_owned();
            return Err(GridError::TooMany { file, n });
        }
        let mut runs = Vec::with_capacity(n);
        for task in &tasks {
            for setting in &settings {
                for teacher in &teachers {
                    for method in &methods {
                        let layers = self.layers(task, method, *setting, is_small);
                        let config = self.config(&layers, *setting, is_small)?;
                        runs.extend(seeds.iter().map(|&seed| GridRun {
                            key: RunKey {
                                task: task.clone(),
                                method: method.clone(),
                                teacher: teacher.clone(),
                                setting:
                                    setting.map_or_else(String::new, |s| s.name.get_ref().clone()),
                                seed,
                            },
                            config: RunConfig {
                                seed,
                                ..config.clone()
                            },
                        }));
                    }
                }
            }
        }
        Ok(runs)
    }

    /// The names of an axis, each known.
    fn names(
        &self,
        axis: Option<&Spanned<Vec<Spanned<String>>>>,
        what: &'static str,
        check: impl Fn(&str) -> Result<(), ConfigError>,
    ) -> Result<Vec<String>, GridError> {
        let empty = |at| GridError::Empty {
            file: self.source.name.to_owned(),
            line: self.line(at),
            axis: what,
        };
        let Some(names) = axis else {
            return Err(self.misfit(0, &format!("{what} are not named under [axes]")));
        };
        if names.get_ref().is_empty() {
            return Err(empty(names.span().start));
        }
        for name in names.get_ref() {
            check(name.get_ref()).map_err(|error| self.misfit(name.span().start, &error))?;
        }
        Ok(names
            .get_ref()
            .iter()
            .map(|n| n.get_ref().clone())
            .collect())
    }

    /// The settings of some axes: those they name, else all there are, else the plain one.
    fn settings(&self, axes: &Axes) -> Result<Vec<Option<&SettingEntry>>, GridError> {
        let all = &self.file.setting;
        for (n, setting) in all.iter().enumerate() {
            let name = setting.name.get_ref();
            let is_twice = all[..n].iter().any(|other| other.name.get_ref() == name);
            let is_alike =
                |other: &&SettingEntry| folder_part(other.name.get_ref()) == folder_part(name);
            let is_wrong =
                name.is_empty() || name.chars().any(|c| c.is_control() || c == '/' || c == '|');
            let reason = if is_twice {
                format!("the setting '{name}' is there twice")
            } else if let Some(other) = all[..n].iter().find(is_alike) {
                let other = other.name.get_ref();
                format!(
                    "the settings '{other}' and '{name}' would share their runs' folders; \
                     tell them apart by more than punctuation"
                )
            } else if is_wrong {
                "a setting needs a name without '/' and '|'".to_owned()
            } else {
                continue;
            };
            return Err(self.misfit(setting.name.span().start, &reason));
        }
        let Some(named) = &axes.settings else {
            return Ok(if all.is_empty() {
                vec![None]
            } else {
                all.iter().map(Some).collect()
            });
        };
        if let Some(name) = named.get_ref().first().filter(|_| all.is_empty()) {
            let reason = format!(
                "there is no setting '{}': the file has no [[setting]]",
                name.get_ref()
            );
            return Err(self.misfit(name.span().start, &reason));
        }
        let find = |name: &str| all.iter().find(|s| s.name.get_ref() == name);
        let names = self.names(Some(named), "settings", |name| {
            let known = all.iter().map(|s| s.name.get_ref().as_str());
            find(name)
                .map(|_| ())
                .ok_or_else(|| unknown("setting", name, known))
        })?;
        Ok(names.iter().map(|name| find(name)).collect())
    }

    fn seeds(&self, axes: &Axes) -> Result<Vec<u64>, GridError> {
        let Some(seeds) = &axes.seeds else {
            return Ok(vec![1]);
        };
        let n_seeds = seeds.get_ref().n();
        if n_seeds == 0 {
            return Err(GridError::Empty {
                file: self.source.name.to_owned(),
                line: self.line(seeds.span().start),
                axis: "seeds",
            });
        }
        if n_seeds > MOST_RUNS {
            let file = self.source.name.to_owned();
            return Err(GridError::TooMany { file, n: n_seeds });
        }
        Ok(seeds.get_ref().list())
    }

    fn layers(
        &self,
        task: &str,
        method: &str,
        setting: Option<&SettingEntry>,
        is_small: bool,
    ) -> Layers {
        let text = |names: &[Spanned<String>]| -> Vec<String> {
            names.iter().map(|name| name.get_ref().clone()).collect()
        };
        let file = self.file;
        let small = file.small.as_ref().filter(|_| is_small);
        let (mut presets, mut overrides) = (text(&file.presets), text(&file.set));
        if let Some(setting) = setting {
            presets.extend(text(&setting.presets));
            overrides.extend(text(&setting.set));
        }
        if let Some(small) = small {
            presets.extend(text(&small.presets));
            overrides.extend(text(&small.set));
        }
        Layers {
            task: Some(task.to_owned()),
            method: Some(method.to_owned()),
            presets,
            file: None,
            overrides,
        }
    }

    /// The settings of a combination; what does not fit is told with the line it stands in.
    fn config(
        &self,
        layers: &Layers,
        setting: Option<&SettingEntry>,
        is_small: bool,
    ) -> Result<RunConfig, GridError> {
        let small = self.file.small.as_ref().filter(|_| is_small);
        let of_setting = setting.map(|s| (&s.presets, &s.set));
        let of_small = small.map(|s| (&s.presets, &s.set));
        let of_file = Some((&self.file.presets, &self.file.set));
        let written = || [of_file, of_setting, of_small].into_iter().flatten();
        for preset in written().flat_map(|(presets, _)| presets) {
            if !preset_names().contains(&preset.get_ref().as_str()) {
                let error = unknown("preset", preset.get_ref(), preset_names().into_iter());
                return Err(self.misfit(preset.span().start, &error));
            }
        }
        for set in written().flat_map(|(_, set)| set) {
            if let Some(name) = identity(set.get_ref()) {
                let reason = format!("{name} is no setting here; name {name}s under [axes]");
                return Err(self.misfit(set.span().start, &reason));
            }
        }
        // One line alone is wrong, or a value that only the whole tree can judge.
        let resolve = |layers: &Layers| RunConfig::resolve_from("set", layers);
        resolve(layers).map_err(|error| {
            let alone = |set: &&Spanned<String>| {
                let layers = Layers {
                    overrides: vec![set.get_ref().clone()],
                    ..layers.clone()
                };
                resolve(&layers).is_err()
            };
            let line = written().flat_map(|(_, set)| set).find(alone);
            let named = |name: &Option<String>| name.clone().unwrap_or_default();
            let whose = format!(
                "{} on {}: {error}",
                named(&layers.method),
                named(&layers.task)
            );
            line.map_or_else(
                || self.misfit(setting.map_or(0, |s| s.name.span().start), &whose),
                |set| self.misfit(set.span().start, &error),
            )
        })
    }
}

#[cfg(test)]
mod tests;
