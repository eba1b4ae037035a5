//! Methods as recipes of parts. The table of baselines is this folder.

use domain::sampler::QuerySampler;
use learn::replay::RewardSource;

use crate::config::{ConfigError, RunConfig, unknown};

mod pebble;
mod sac;
mod stair;
mod uniform;

/// What makes one method differ from another.
pub struct Method {
    /// Chooses queries after the first session; `None` never asks.
    pub sampler: Option<Box<dyn QuerySampler>>,
    /// What the critics learn from once exploration is over.
    pub reward: RewardSource,
    /// Whether a temporal distance is learned.
    pub learns_temporal_distance: bool,
}

/// A line of the registry.
pub struct MethodEntry {
    /// As users type it.
    pub name: &'static str,
    /// One sentence.
    pub summary: &'static str,
    /// The recipe.
    pub build: fn(&RunConfig) -> Method,
}

/// All methods.
pub const METHODS: &[MethodEntry] = &[
    MethodEntry {
        name: "stair",
        summary: "asks within a stage, where the ensemble disagrees",
        build: stair::stair,
    },
    MethodEntry {
        name: "pebble",
        summary: "asks where the ensemble disagrees",
        build: pebble::pebble,
    },
    MethodEntry {
        name: "uniform",
        summary: "asks about random pairs",
        build: uniform::uniform,
    },
    MethodEntry {
        name: "sac",
        summary: "learns from the task reward: the upper bound",
        build: sac::sac,
    },
];

/// The method of that name.
///
/// # Errors
/// Names the nearest right one.
pub fn find(name: &str) -> Result<&'static MethodEntry, ConfigError> {
    METHODS
        .iter()
        .find(|m| m.name == name)
        .ok_or_else(|| unknown("method", name, METHODS.iter().map(|m| m.name)))
}
