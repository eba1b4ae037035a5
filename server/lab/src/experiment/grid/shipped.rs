//! The grids that come with the program: one for every table and figure of the paper.

use super::GridText;
use crate::config::{ConfigError, unknown};

/// A line of the registry: a file below `assets/experiments`.
pub struct ShippedGrid {
    /// As users type it.
    pub name: &'static str,
    /// TOML.
    pub text: &'static str,
}

impl ShippedGrid {
    /// The file, as [`super::resolve`] takes it.
    pub fn source(&self) -> GridText<'static> {
        GridText {
            name: self.name,
            text: self.text,
        }
    }
}

macro_rules! shipped {
    ($($name:literal),* $(,)?) => {
        &[$(ShippedGrid {
            name: $name,
            text: include_str!(concat!("../../../../../assets/experiments/", $name, ".toml")),
        }),*]
    };
}

/// All of them.
pub const SHIPPED: &[ShippedGrid] = shipped![
    "metaworld",
    "dmcontrol",
    "robodesk",
    "stage-approximators",
    "update-frequency",
    "query-rules",
    "coefficients",
    "feedback-efficiency",
    "noisy-teachers",
    "go-fetch-return",
    "go-fetch-return-labels",
    "go-fetch-return-noise",
];

/// The grid of that name.
///
/// # Errors
/// Names the nearest right one.
pub fn shipped(name: &str) -> Result<&'static ShippedGrid, ConfigError> {
    let known = SHIPPED.iter().map(|grid| grid.name);
    let found = SHIPPED.iter().find(|grid| grid.name == name);
    found.ok_or_else(|| unknown("experiment", name, known))
}
