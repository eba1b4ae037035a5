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

/// All of them; the list is made of `assets/experiments` at build time.
pub const SHIPPED: &[ShippedGrid] = include!(concat!(env!("OUT_DIR"), "/experiments.rs"));

/// The grid of that name.
///
/// # Errors
/// Names the nearest right one.
pub fn shipped(name: &str) -> Result<&'static ShippedGrid, ConfigError> {
    let known = SHIPPED.iter().map(|grid| grid.name);
    let found = SHIPPED.iter().find(|grid| grid.name == name);
    found.ok_or_else(|| unknown("experiment", name, known))
}
