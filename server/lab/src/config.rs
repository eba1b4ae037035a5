//! One typed tree of settings: defaults, then presets, then a file, then the command line.
//!
//! Resolved once and saved with the run, so that any figure can be made again from it.

use serde::{Deserialize, Serialize};

use domain::nearest::nearest;
use domain::sampler::{SamplerSettings, StageCoefficients};
use domain::schedule::FeedbackSchedule;
use domain::teacher::{Judge, SCRIPTED, TeacherSettings, judge};
use learn::exploration::{BonusConfig, ExplorationConfig};
use learn::reward::{DenoisingConfig, RewardConfig, SemiSupervisedConfig, SteeringConfig};
use learn::sac::SacConfig;
use learn::temporal::TemporalConfig;

mod check;
mod command;
mod layers;
mod presets;

pub(crate) use layers::invalid;
use layers::parse_layer;
pub use layers::{Layers, identity, plainly};
pub use presets::PRESETS;
pub(crate) use presets::preset_names;

/// Everything that decides what a run does, but who answers.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct RunConfig {
    /// A name that `stair tasks` lists.
    pub task: String,
    /// A name that `stair tasks` lists.
    pub method: String,
    /// Of every random stream of the run.
    pub seed: u64,
    /// `cpu` or `cuda`.
    pub device: String,
    /// The simulations that feed the replay.
    pub environment: EnvironmentConfig,
    /// How long and how hard to train.
    pub training: TrainingConfig,
    /// SAC.
    pub agent: SacConfig,
    /// Unsupervised pre-training.
    pub exploration: ExplorationConfig,
    /// The reward ensemble.
    pub reward: RewardConfig,
    /// RUNE's bonus.
    pub bonus: BonusConfig,
    /// MRN's outer steps.
    pub steering: SteeringConfig,
    /// RIME's way of fitting.
    pub denoising: DenoisingConfig,
    /// SURF's way of fitting.
    pub semi_supervised: SemiSupervisedConfig,
    /// The temporal distance.
    pub temporal: TemporalConfig,
    /// What is asked.
    pub queries: QueriesConfig,
    /// When it is asked.
    pub feedback: FeedbackSchedule,
    /// How irregular scripted teachers are.
    pub teacher: TeacherSettings,
    /// How the policy is tried.
    pub evaluation: EvaluationConfig,
}

impl Default for RunConfig {
    fn default() -> Self {
        Self {
            task: "go-fetch-return".into(),
            method: "stair".into(),
            seed: 1,
            device: "cpu".into(),
            environment: EnvironmentConfig::default(),
            training: TrainingConfig::default(),
            agent: SacConfig::default(),
            exploration: ExplorationConfig::default(),
            reward: RewardConfig::default(),
            bonus: BonusConfig::default(),
            steering: SteeringConfig::default(),
            denoising: DenoisingConfig::default(),
            semi_supervised: SemiSupervisedConfig::default(),
            temporal: TemporalConfig::default(),
            queries: QueriesConfig::default(),
            feedback: FeedbackSchedule::default(),
            teacher: TeacherSettings::default(),
            evaluation: EvaluationConfig::default(),
        }
    }
}

/// The simulations that feed the replay.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct EnvironmentConfig {
    /// Environments stepped side by side; 1 is the paper's.
    pub n_envs: usize,
    /// Steps after which an episode of training ends, as at a time limit; 0 leaves it to the task,
    /// as the paper does. Trials are always as long as the task's.
    ///
    /// An agent that has solved a task early spends the rest of an episode where it is done.
    /// Shorter episodes show it more beginnings.
    pub episode_len: u32,
}

impl Default for EnvironmentConfig {
    fn default() -> Self {
        Self {
            n_envs: 1,
            episode_len: 0,
        }
    }
}

/// How long and how hard to train.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct TrainingConfig {
    /// Environment steps in all.
    pub total_steps: u64,
    /// Environment steps with uniformly random actions and no updates at the start; 1,000 in
    /// B-Pref's scripts.
    pub seed_steps: u64,
    /// SAC updates per environment step; 1 is the paper's.
    pub updates_per_step: f64,
    /// SAC updates right after the first session's relabelling and critic reset; 100 in the
    /// released code.
    pub updates_after_reset: u32,
    /// Whether the critic starts anew after the first session (PEBBLE does).
    pub reset_critic: bool,
    /// What the task reward is multiplied by where an agent learns from it (SAC as the upper
    /// bound alone); 1 in the released code. 0.1 brings MetaWorld's [0, 10] to the scale of
    /// learned rewards, for which the quick presets' rates were found.
    pub task_reward_scale: f32,
    /// Environment steps between rows of metrics.
    pub metrics_every: u64,
    /// Environment steps between checkpoints; sessions always have their own.
    pub checkpoint_every: u64,
    /// What happens while a session waits for answers.
    pub while_waiting: WhileWaiting,
}

impl Default for TrainingConfig {
    /// STAIR's released script, cut at 300,000 steps as the paper's window-open curves are.
    fn default() -> Self {
        Self {
            total_steps: 300_000,
            seed_steps: 1_000,
            updates_per_step: 1.0,
            updates_after_reset: 100,
            reset_critic: true,
            task_reward_scale: 1.0,
            metrics_every: 1_000,
            checkpoint_every: 10_000,
            while_waiting: WhileWaiting::Pause,
        }
    }
}

/// What happens while a session waits for answers.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum WhileWaiting {
    /// The agent stands still: the same answers always give the same run.
    Pause,
    /// The agent goes on training under the present reward.
    Train,
}

/// What is asked.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
#[expect(
    clippy::struct_excessive_bools,
    reason = "each is a setting of its own that is on or off"
)]
pub struct QueriesConfig {
    /// Steps in a segment, H; 0 takes the task's own.
    pub segment_len: u32,
    /// Candidates drawn for each query asked; 10 in the released code.
    pub candidates_per_query: u32,
    /// Only the newest so many complete episodes are asked about; 100 in the released code.
    pub newest_episodes: usize,
    /// A name of [`SAMPLERS`](domain::sampler::SAMPLERS); empty takes the method's own.
    pub sampler: String,
    /// c_stage and c_state of STAIR's score.
    pub coefficients: StageCoefficients,
    /// Whether the stage gap is the mean of both directions; the paper's is one way.
    pub symmetric_gap: bool,
    /// Newest complete episodes that count as near the policy, QPA's N: 10 in its released
    /// settings, 60 for door-open, 30 for door-unlock and drawer-open.
    pub near_policy_episodes: usize,
    /// Whether segments never take an episode's last possible start, a slip of the released
    /// code.
    pub bpref_starts: bool,
    /// Whether a segment may be paired with itself, a slip of the released code.
    pub bpref_pairs: bool,
    /// Whether a skipped query counts as an answer to the budget and is not replaced, a slip of
    /// the released code: a teacher who skips half of what is asked teaches with half the answers.
    pub bpref_skips: bool,
    /// Share of queries that also ask whether both segments show the same stage, [0, 1].
    pub same_stage_fraction: f64,
    /// Whether indistinguishable answers train towards (½, ½) or are dropped.
    pub train_on_equal: bool,
    /// Share of a session's answers after which the run goes on, (0, 1]. Later answers are
    /// trained on with the next session; where none is to come, by themselves, as soon as the same
    /// share of those that are still missing is there.
    pub sufficient_fraction: f64,
}

impl Default for QueriesConfig {
    fn default() -> Self {
        Self {
            segment_len: 0,
            candidates_per_query: 10,
            newest_episodes: 100,
            sampler: String::new(),
            coefficients: StageCoefficients::default(),
            symmetric_gap: false,
            near_policy_episodes: 10,
            bpref_starts: false,
            bpref_pairs: false,
            bpref_skips: false,
            same_stage_fraction: 0.0,
            train_on_equal: true,
            sufficient_fraction: 1.0,
        }
    }
}

impl QueriesConfig {
    /// What a sampler is made with.
    pub fn sampler_settings(&self) -> SamplerSettings {
        SamplerSettings {
            coefficients: self.coefficients,
            near_policy_episodes: self.near_policy_episodes,
        }
    }
}

/// How the policy is tried.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct EvaluationConfig {
    /// Environment steps between evaluations.
    pub every: u64,
    /// Episodes in each, with the same held-out seeds every time.
    pub episodes: u32,
}

impl Default for EvaluationConfig {
    /// The released code tries 10 episodes; 50 are steadier.
    fn default() -> Self {
        Self {
            every: 5_000,
            episodes: 50,
        }
    }
}

/// Why settings cannot be used.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum ConfigError {
    /// A name that no registry holds.
    #[error("there is no {what} '{name}'{}; known: {known}", hint(.nearest.as_ref()))]
    UnknownName {
        /// `task`, `method`, `preset`, `teacher`.
        what: &'static str,
        /// What was asked for.
        name: String,
        /// The most similar known name, if one is similar.
        nearest: Option<String>,
        /// All of them.
        known: String,
    },
    /// A file or `--set` that does not fit the tree.
    #[error("{origin}: {message}")]
    Invalid {
        /// Which layer.
        origin: String,
        /// What is wrong, with line and key where there is one.
        message: String,
    },
    /// A value outside its range.
    #[error("{key} is {value}, but must be {must_be}")]
    OutOfRange {
        /// Dotted path.
        key: &'static str,
        /// What it is.
        value: String,
        /// What it may be.
        must_be: &'static str,
    },
}

fn hint(nearest: Option<&String>) -> String {
    nearest
        .map(|n| format!(" (did you mean '{n}'?)"))
        .unwrap_or_default()
}

impl RunConfig {
    /// Reads the tree that a run saved.
    ///
    /// # Errors
    /// As [`RunConfig::resolve`].
    pub fn parse(origin: &str, text: &str) -> Result<Self, ConfigError> {
        parse_layer(origin, text)?;
        let config: Self = toml::from_str(text).map_err(|e| invalid(origin, text, &e))?;
        config.check()?;
        Ok(config)
    }

    /// The whole tree as TOML.
    ///
    /// # Panics
    /// Never: a tree of plain values can always be written as TOML.
    pub fn to_toml(&self) -> String {
        toml::to_string(self).expect("a tree of plain values is always TOML")
    }

    /// Steps in a segment: the setting, or the task's own.
    pub fn segment_len(&self, spec: &domain::environment::EnvSpec) -> u32 {
        if self.queries.segment_len == 0 {
            spec.segment_len
        } else {
            self.queries.segment_len
        }
    }

    /// Steps in an episode of training: the setting, or the task's own.
    pub fn episode_len(&self, spec: &domain::environment::EnvSpec) -> u32 {
        if self.environment.episode_len == 0 {
            spec.episode_len
        } else {
            self.environment.episode_len
        }
    }

    /// The first setting in which two trees differ that decides what a checkpoint holds, with
    /// its value here and there.
    pub(crate) fn first_misfit(&self, other: &Self) -> Option<(&'static str, String, String)> {
        type Describe = fn(&RunConfig) -> String;
        let deciding: [(&str, Describe); 9] = [
            ("task", |c| c.task.clone()),
            ("environment.n_envs", |c| c.environment.n_envs.to_string()),
            ("agent.hidden", |c| format!("{:?}", c.agent.hidden)),
            ("agent.layer_norm", |c| c.agent.layer_norm.to_string()),
            ("agent.actor_ema", |c| {
                let is_averaged = c.agent.actor_ema > 0.0;
                if is_averaged { "above 0" } else { "0" }.into()
            }),
            ("reward.members", |c| c.reward.members.to_string()),
            ("reward.hidden", |c| format!("{:?}", c.reward.hidden)),
            ("temporal.hidden", |c| format!("{:?}", c.temporal.hidden)),
            ("temporal.latent", |c| c.temporal.latent.to_string()),
        ];
        deciding.into_iter().find_map(|(key, of)| {
            let (own, others) = (of(self), of(other));
            (own != others).then_some((key, own, others))
        })
    }
}

/// The task of that name.
///
/// # Errors
/// Names the nearest right one.
pub fn find_task(name: &str) -> Result<&'static sim::tasks::Task, ConfigError> {
    sim::tasks::task(name)
        .map_err(|_| unknown("task", name, sim::tasks::tasks().iter().map(|t| t.name)))
}

/// Whether a scripted teacher has this name, or one of `others` who answer from outside a run.
///
/// # Errors
/// Names the nearest right one.
pub fn find_teacher(name: &str, others: &[&str]) -> Result<(), ConfigError> {
    let is_scripted = SCRIPTED.iter().any(|(known, _)| *known == name);
    if is_scripted || others.contains(&name) {
        return Ok(());
    }
    Err(unknown_teacher(name, others))
}

/// The scripted teacher of that name, with its part of the settings.
///
/// # Errors
/// Names the nearest right one.
pub fn scripted_teacher(
    name: &str,
    seed: u64,
    settings: &TeacherSettings,
) -> Result<Box<dyn Judge>, ConfigError> {
    judge(name, seed, settings).ok_or_else(|| unknown_teacher(name, &[]))
}

fn unknown_teacher(name: &str, others: &[&str]) -> ConfigError {
    let scripted = SCRIPTED.iter().map(|(name, _)| *name);
    unknown("teacher", name, others.iter().copied().chain(scripted))
}

/// An error that names the nearest known name.
pub(crate) fn unknown<'a>(
    what: &'static str,
    name: &str,
    known: impl Iterator<Item = &'a str>,
) -> ConfigError {
    let known: Vec<&str> = known.collect();
    ConfigError::UnknownName {
        what,
        name: name.into(),
        nearest: nearest(name, &known).map(str::to_owned),
        known: known.join(", "),
    }
}

#[cfg(test)]
mod tests;
