//! Methods as recipes of parts. The table of baselines is this folder.

use domain::sampler::{QuerySampler, SAMPLERS, sampler};
use learn::exploration::BonusConfig;
use learn::replay::RewardSource;
use learn::reward::{RewardLearner, SteeringConfig};
use learn::stage::StageApproximator;

use crate::config::{ConfigError, RunConfig, unknown};

mod mrn;
mod pebble;
mod qpa;
mod rime;
mod rune;
mod sac;
mod stair;
mod stair_isr;
mod surf;
mod timestep;
mod true_stage;
mod uniform;

/// What makes one method differ from another.
pub struct Method {
    /// Chooses queries after the first session; `None` never asks.
    pub sampler: Option<Box<dyn QuerySampler>>,
    /// What the critics learn from once exploration is over.
    pub reward: RewardSource,
    /// What the stage gap is, for methods that have one.
    pub stage: Option<StageApproximator>,
    /// How the reward ensemble is fitted.
    pub reward_learner: fn(&RunConfig) -> Box<dyn RewardLearner>,
    /// What is added to the learned reward where the ensemble disagrees about it.
    pub bonus: Option<BonusConfig>,
    /// Newest episodes' worth of steps from which half of each batch comes while answers are
    /// still to be had.
    pub recent_episodes: Option<usize>,
    /// Whether and how the rewards are moved by what the critics make of them.
    pub steering: Option<SteeringConfig>,
}

impl Method {
    /// Whether a temporal distance is learned.
    pub fn learns_temporal_distance(&self) -> bool {
        self.stage
            .is_some_and(StageApproximator::needs_temporal_distance)
    }

    /// Whether only tasks that know their stages can have it.
    pub fn needs_true_stages(&self) -> bool {
        self.stage.is_some_and(StageApproximator::needs_true_stages)
    }

    /// The same method with another way of choosing; one that asks for a stage gap brings the
    /// paper's along where the method has none.
    #[must_use]
    fn choosing_with(self, sampler: Box<dyn QuerySampler>, config: &RunConfig) -> Self {
        let gap = sampler.needs_stage_gap().then(|| stair::gap(config));
        Self {
            stage: self.stage.or(gap),
            sampler: Some(sampler),
            ..self
        }
    }
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
        name: "rune",
        summary: "PEBBLE, drawn to where the rewards are in doubt",
        build: rune::rune,
    },
    MethodEntry {
        name: "mrn",
        summary: "PEBBLE, its rewards steered by the critics",
        build: mrn::mrn,
    },
    MethodEntry {
        name: "rime",
        summary: "PEBBLE that leaves doubtful answers out",
        build: rime::rime,
    },
    MethodEntry {
        name: "qpa",
        summary: "asks about and learns from what the policy does now",
        build: qpa::qpa,
    },
    MethodEntry {
        name: "surf",
        summary: "PEBBLE that also learns from unanswered pairs and crops",
        build: surf::surf,
    },
    MethodEntry {
        name: "surf_whole",
        summary: "SURF without crops",
        build: surf::surf_whole,
    },
    MethodEntry {
        name: "stair_isr",
        summary: "STAIR with stages as intervals of learned distances",
        build: stair_isr::stair_isr,
    },
    MethodEntry {
        name: "timestep",
        summary: "STAIR with the step of the episode for a stage",
        build: timestep::timestep,
    },
    MethodEntry {
        name: "true_stage",
        summary: "STAIR told the true stages, where the task knows them",
        build: true_stage::true_stage,
    },
    MethodEntry {
        name: "sac",
        summary: "learns from the task reward: the upper bound",
        build: sac::sac,
    },
];

/// The recipe that the settings ask for.
///
/// # Errors
/// Names the nearest right method or sampler.
pub fn build(config: &RunConfig) -> Result<Method, ConfigError> {
    let method = (find(&config.method)?.build)(config);
    let (name, settings) = (&config.queries.sampler, config.queries.sampler_settings());
    if name.is_empty() || method.sampler.is_none() {
        return Ok(method);
    }
    let known = SAMPLERS.iter().map(|(name, _)| *name);
    let sampler = sampler(name, &settings).ok_or_else(|| unknown("sampler", name, known))?;
    Ok(method.choosing_with(sampler, config))
}

/// Place of a method in the program's list; those that are not in it come last.
pub fn rank(name: &str) -> usize {
    let known = METHODS.iter().position(|method| method.name == name);
    known.unwrap_or(METHODS.len())
}

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
