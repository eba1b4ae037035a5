//! What a file of an experiment may say, with the places at which it says it.

use serde::Deserialize;
use toml::Spanned;

use super::GridText;
use crate::config::{ConfigError, invalid};

/// The whole file.
#[derive(Debug, Clone, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct GridFile {
    /// What it shows, in a few words.
    pub title: String,
    /// What it shows and where in the paper, in sentences.
    #[serde(default)]
    pub about: String,
    /// Presets of every run, on top of its task's and method's own.
    #[serde(default)]
    pub presets: Vec<Spanned<String>>,
    /// Settings of every run, as `--set` takes them.
    #[serde(default)]
    pub set: Vec<Spanned<String>>,
    /// The grid.
    pub axes: Axes,
    /// More grids; what one does not name is as in [`GridFile::axes`].
    #[serde(default)]
    pub also: Vec<Axes>,
    /// Settings by name; an axis of the grid.
    #[serde(default)]
    pub setting: Vec<SettingEntry>,
    /// Few runs that make the same figure.
    pub small: Option<Axes>,
}

/// What is combined with what.
#[derive(Debug, Clone, Default, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct Axes {
    /// Names that `stair tasks` lists.
    pub tasks: Option<Spanned<Vec<Spanned<String>>>>,
    /// Names that `stair tasks` lists.
    pub methods: Option<Spanned<Vec<Spanned<String>>>>,
    /// Scripted teachers; the oracle where none is named.
    pub teachers: Option<Spanned<Vec<Spanned<String>>>>,
    /// Names of settings; all of the file where none is named.
    pub settings: Option<Spanned<Vec<Spanned<String>>>>,
    /// How many, from 1 on, or which; 1 where none is named.
    pub seeds: Option<Spanned<Seeds>>,
    /// Further presets, of the small variant alone.
    #[serde(default)]
    pub presets: Vec<Spanned<String>>,
    /// Further settings, of the small variant alone.
    #[serde(default)]
    pub set: Vec<Spanned<String>>,
}

impl Axes {
    /// The same, with what it does not name from others.
    pub(super) fn or(&self, others: &Self) -> Self {
        let mut axes = self.clone();
        axes.tasks = axes.tasks.or_else(|| others.tasks.clone());
        axes.methods = axes.methods.or_else(|| others.methods.clone());
        axes.teachers = axes.teachers.or_else(|| others.teachers.clone());
        axes.settings = axes.settings.or_else(|| others.settings.clone());
        axes.seeds = axes.seeds.or_else(|| others.seeds.clone());
        axes
    }
}

/// How many seeds, from 1 on, or which.
#[derive(Debug, Clone, Deserialize)]
#[serde(untagged, expecting = "expected a number of seeds or a list of them")]
pub(super) enum Seeds {
    /// 1 to n.
    Count(u32),
    /// These.
    List(Vec<u64>),
}

impl Seeds {
    pub(super) fn n(&self) -> usize {
        match self {
            Self::Count(n) => *n as usize,
            Self::List(seeds) => seeds.len(),
        }
    }

    pub(super) fn list(&self) -> Vec<u64> {
        match self {
            Self::Count(n) => (1..=u64::from(*n)).collect(),
            Self::List(seeds) => seeds.clone(),
        }
    }
}

/// Settings under a name.
#[derive(Debug, Clone, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct SettingEntry {
    /// As figures and tables show it.
    pub name: Spanned<String>,
    /// Its presets.
    #[serde(default)]
    pub presets: Vec<Spanned<String>>,
    /// Its settings, as `--set` takes them.
    #[serde(default)]
    pub set: Vec<Spanned<String>>,
}

impl GridFile {
    /// Reads it; what is wrong is told with its line and the nearest right key.
    pub(super) fn parse(source: GridText) -> Result<Self, ConfigError> {
        let file: Self =
            toml::from_str(source.text).map_err(|e| invalid(source.name, source.text, &e))?;
        let misplaced = std::iter::once(&file.axes)
            .chain(&file.also)
            .find(|axes| !axes.presets.is_empty() || !axes.set.is_empty());
        if misplaced.is_some() {
            return Err(ConfigError::Invalid {
                origin: source.name.into(),
                message: "presets and set stand above [axes], in a [[setting]] or in [small]"
                    .into(),
            });
        }
        Ok(file)
    }
}
