//! One typed tree of settings: defaults, then presets, then a file, then the command line.
//!
//! Resolved once and saved with the run, so that any figure can be made again from it.

use serde::{Deserialize, Serialize};
use toml::{Table, Value};

use domain::sampler::{SAMPLERS, SamplerSettings, StageCoefficients, sampler};
use domain::schedule::FeedbackSchedule;
use domain::teacher::TeacherSettings;
use learn::exploration::{BonusConfig, ExplorationConfig};
use learn::reward::{DenoisingConfig, RewardConfig, SemiSupervisedConfig, SteeringConfig};
use learn::sac::SacConfig;
use learn::temporal::TemporalConfig;

use crate::method;
use crate::nearest::nearest;

/// Everything that decides what a run does.
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
}

impl Default for EnvironmentConfig {
    fn default() -> Self {
        Self { n_envs: 1 }
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
pub struct QueriesConfig {
    /// Steps in a segment, H; 0 takes the task's own.
    pub segment_len: u32,
    /// Candidates drawn for each query asked; 10 in the released code.
    pub candidates_per_query: u32,
    /// Only the newest so many complete episodes are asked about; 100 in the released code.
    pub newest_episodes: usize,
    /// A name of [`SAMPLERS`]; empty takes the method's own.
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
    /// Share of queries that also ask whether both segments show the same stage, [0, 1].
    pub same_stage_fraction: f64,
    /// Whether indistinguishable answers train towards (½, ½) or are dropped.
    pub train_on_equal: bool,
    /// Share of a session's answers after which the run goes on, (0, 1]; later answers are
    /// trained on with the next session.
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
        /// `task`, `method`, `preset`.
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

/// Where settings come from, least important first.
#[derive(Debug, Clone, Default)]
pub struct Layers {
    /// A task's name.
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

/// `(name, task or "", text)` of every preset in the program.
pub const PRESETS: &[(&str, &str, &str)] = &[
    (
        "sac",
        "",
        include_str!("../../../assets/presets/method/sac.toml"),
    ),
    (
        "uniform",
        "",
        include_str!("../../../assets/presets/method/uniform.toml"),
    ),
    (
        "pebble",
        "",
        include_str!("../../../assets/presets/method/pebble.toml"),
    ),
    (
        "stair",
        "",
        include_str!("../../../assets/presets/method/stair.toml"),
    ),
    (
        "stair_isr",
        "",
        include_str!("../../../assets/presets/method/stair_isr.toml"),
    ),
    (
        "timestep",
        "",
        include_str!("../../../assets/presets/method/timestep.toml"),
    ),
    (
        "rune",
        "",
        include_str!("../../../assets/presets/method/rune.toml"),
    ),
    (
        "mrn",
        "",
        include_str!("../../../assets/presets/method/mrn.toml"),
    ),
    (
        "rime",
        "",
        include_str!("../../../assets/presets/method/rime.toml"),
    ),
    (
        "qpa",
        "",
        include_str!("../../../assets/presets/method/qpa.toml"),
    ),
    (
        "surf",
        "",
        include_str!("../../../assets/presets/method/surf.toml"),
    ),
    (
        "surf_whole",
        "",
        include_str!("../../../assets/presets/method/surf_whole.toml"),
    ),
    (
        "task",
        "door-open",
        include_str!("../../../assets/presets/task/door-open.toml"),
    ),
    (
        "task",
        "door-unlock",
        include_str!("../../../assets/presets/task/door-unlock.toml"),
    ),
    (
        "task",
        "drawer-open",
        include_str!("../../../assets/presets/task/drawer-open.toml"),
    ),
    (
        "task",
        "faucet-open",
        include_str!("../../../assets/presets/task/faucet-open.toml"),
    ),
    (
        "task",
        "go-fetch-return",
        include_str!("../../../assets/presets/task/go-fetch-return.toml"),
    ),
    (
        "task",
        "sweep-into",
        include_str!("../../../assets/presets/task/sweep-into.toml"),
    ),
    (
        "task",
        "window-close",
        include_str!("../../../assets/presets/task/window-close.toml"),
    ),
    (
        "task",
        "window-open",
        include_str!("../../../assets/presets/task/window-open.toml"),
    ),
    (
        "task",
        "push-green",
        include_str!("../../../assets/presets/task/push-green.toml"),
    ),
    (
        "task",
        "walker-run",
        include_str!("../../../assets/presets/task/walker-run.toml"),
    ),
    (
        "task",
        "quadruped-walk",
        include_str!("../../../assets/presets/task/quadruped-walk.toml"),
    ),
    (
        "task",
        "quadruped-run",
        include_str!("../../../assets/presets/task/quadruped-run.toml"),
    ),
    (
        "task",
        "cheetah-run",
        include_str!("../../../assets/presets/task/cheetah-run.toml"),
    ),
    (
        "quick",
        "door-open",
        include_str!("../../../assets/presets/quick/door-open.toml"),
    ),
    (
        "quick",
        "door-unlock",
        include_str!("../../../assets/presets/quick/door-unlock.toml"),
    ),
    (
        "quick",
        "drawer-open",
        include_str!("../../../assets/presets/quick/drawer-open.toml"),
    ),
    (
        "quick",
        "faucet-open",
        include_str!("../../../assets/presets/quick/faucet-open.toml"),
    ),
    (
        "paper_table",
        "",
        include_str!("../../../assets/presets/paper_table.toml"),
    ),
    (
        "quick",
        "go-fetch-return",
        include_str!("../../../assets/presets/quick/go-fetch-return.toml"),
    ),
    (
        "quick",
        "sweep-into",
        include_str!("../../../assets/presets/quick/sweep-into.toml"),
    ),
    (
        "quick",
        "window-close",
        include_str!("../../../assets/presets/quick/window-close.toml"),
    ),
    (
        "quick",
        "window-open",
        include_str!("../../../assets/presets/quick/window-open.toml"),
    ),
    (
        "quick",
        "push-green",
        include_str!("../../../assets/presets/quick/push-green.toml"),
    ),
    (
        "quick",
        "walker-run",
        include_str!("../../../assets/presets/quick/walker-run.toml"),
    ),
    (
        "quick",
        "quadruped-walk",
        include_str!("../../../assets/presets/quick/quadruped-walk.toml"),
    ),
    (
        "quick",
        "quadruped-run",
        include_str!("../../../assets/presets/quick/quadruped-run.toml"),
    ),
    (
        "quick",
        "cheetah-run",
        include_str!("../../../assets/presets/quick/cheetah-run.toml"),
    ),
];

impl RunConfig {
    /// Resolves layers into one checked tree.
    ///
    /// # Errors
    /// [`ConfigError`] names the layer, the key or line, and the nearest right name.
    pub fn resolve(layers: &Layers) -> Result<Self, ConfigError> {
        let file = layers
            .file
            .as_ref()
            .map(|(name, text)| parse_layer(name, text))
            .transpose()?;
        let overrides = layers
            .overrides
            .iter()
            .map(|o| parse_override(o))
            .collect::<Result<Vec<_>, _>>()?;
        let mut chosen = Table::new();
        for layer in file.iter().chain(&overrides) {
            merge(&mut chosen, layer);
        }
        let named = |key: &str, option: &Option<String>| {
            option
                .clone()
                .or_else(|| chosen.get(key).and_then(Value::as_str).map(str::to_owned))
        };
        let task = named("task", &layers.task).unwrap_or_else(|| Self::default().task);
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
                message: e.message().to_owned(),
            })?;
        config.check()?;
        Ok(config)
    }

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

    /// The first setting in which two trees differ that decides what a checkpoint holds, with
    /// its value here and there.
    pub(crate) fn first_misfit(&self, other: &Self) -> Option<(&'static str, String, String)> {
        type Describe = fn(&RunConfig) -> String;
        let deciding: [(&str, Describe); 8] = [
            ("task", |c| c.task.clone()),
            ("environment.n_envs", |c| c.environment.n_envs.to_string()),
            ("agent.hidden", |c| format!("{:?}", c.agent.hidden)),
            ("agent.layer_norm", |c| c.agent.layer_norm.to_string()),
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

    fn check(&self) -> Result<(), ConfigError> {
        let task = find_task(&self.task)?;
        method::find(&self.method)?;
        let out = |key, value: String, must_be| {
            Err(ConfigError::OutOfRange {
                key,
                value,
                must_be,
            })
        };
        let (t, q, f) = (&self.training, &self.queries, &self.feedback);
        if !(1..=256).contains(&self.environment.n_envs) {
            return out(
                "environment.n_envs",
                self.environment.n_envs.to_string(),
                "from 1 to 256",
            );
        }
        if !(t.updates_per_step >= 0.0 && t.updates_per_step <= 64.0) {
            return out(
                "training.updates_per_step",
                t.updates_per_step.to_string(),
                "from 0 to 64",
            );
        }
        if !(t.task_reward_scale > 0.0 && t.task_reward_scale.is_finite()) {
            return out(
                "training.task_reward_scale",
                t.task_reward_scale.to_string(),
                "above 0",
            );
        }
        if t.total_steps == 0 {
            return out("training.total_steps", "0".into(), "at least 1");
        }
        if f.first_step <= t.seed_steps {
            return out(
                "feedback.first_step",
                f.first_step.to_string(),
                "above training.seed_steps",
            );
        }
        if f.queries_per_session == 0 {
            return out("feedback.queries_per_session", "0".into(), "at least 1");
        }
        if f.every == 0 {
            return out("feedback.every", "0".into(), "at least 1 step");
        }
        if !(0.0..=1.0).contains(&q.same_stage_fraction) {
            return out(
                "queries.same_stage_fraction",
                q.same_stage_fraction.to_string(),
                "from 0 to 1",
            );
        }
        if !(q.sufficient_fraction > 0.0 && q.sufficient_fraction <= 1.0) {
            return out(
                "queries.sufficient_fraction",
                q.sufficient_fraction.to_string(),
                "above 0, at most 1",
            );
        }
        if q.candidates_per_query == 0 {
            return out("queries.candidates_per_query", "0".into(), "at least 1");
        }
        if q.near_policy_episodes == 0 {
            return out("queries.near_policy_episodes", "0".into(), "at least 1");
        }
        if !q.sampler.is_empty() && sampler(&q.sampler, &q.sampler_settings()).is_none() {
            let known = SAMPLERS.iter().map(|(name, _)| *name);
            return Err(unknown("sampler", &q.sampler, known));
        }
        self.check_teacher()?;
        self.check_methods()?;
        if q.newest_episodes == 0 {
            return out("queries.newest_episodes", "0".into(), "at least 1");
        }
        if self.evaluation.episodes == 0 {
            return out("evaluation.episodes", "0".into(), "at least 1");
        }
        if q.segment_len > (task.spec)().episode_len {
            return out(
                "queries.segment_len",
                q.segment_len.to_string(),
                "at most an episode's length",
            );
        }
        self.check_sizes()
    }

    /// Of networks and of what they are given at once.
    fn check_sizes(&self) -> Result<(), ConfigError> {
        let out = |key, value: String, must_be| {
            Err(ConfigError::OutOfRange {
                key,
                value,
                must_be,
            })
        };
        let sizes = [
            ("agent.hidden", &self.agent.hidden),
            ("reward.hidden", &self.reward.hidden),
            ("temporal.hidden", &self.temporal.hidden),
        ];
        for (key, sizes) in sizes {
            if sizes.len() > 16 || sizes.iter().any(|n| !(1..=65_536).contains(n)) {
                let must_be = "at most 16 layers of 1 to 65536";
                return out(key, format!("{sizes:?}"), must_be);
            }
        }
        let batches = [
            ("agent.batch", self.agent.batch),
            ("reward.batch", self.reward.batch),
            ("temporal.batch", self.temporal.batch),
        ];
        for (key, batch) in batches {
            if !(1..=1_000_000).contains(&batch) {
                return out(key, batch.to_string(), "from 1 to 1000000");
            }
        }
        if !(1..=64).contains(&self.reward.members) {
            return out(
                "reward.members",
                self.reward.members.to_string(),
                "from 1 to 64",
            );
        }
        if !(1..=65_536).contains(&self.temporal.latent) {
            return out(
                "temporal.latent",
                self.temporal.latent.to_string(),
                "from 1 to 65536",
            );
        }
        Ok(())
    }
}

impl RunConfig {
    /// What single methods read.
    fn check_methods(&self) -> Result<(), ConfigError> {
        let (b, d, s) = (&self.bonus, &self.denoising, &self.semi_supervised);
        let shares = [
            ("bonus.decay", b.decay, 0.0..1.0),
            ("denoising.flip_below", d.flip_below, 1e-12..0.5),
            ("semi_supervised.certainty", s.certainty, 0.5..1.0),
        ];
        for (key, value, range) in shares {
            if !range.contains(&value) {
                return Err(ConfigError::OutOfRange {
                    key,
                    value: value.to_string(),
                    must_be: "a share: bonus.decay in [0, 1), flip_below in (0, 0.5), \
                              certainty in [0.5, 1)",
                });
            }
        }
        let weights = [
            ("bonus.initial", b.initial),
            ("steering.weight", self.steering.weight),
            ("denoising.slack", d.slack),
            ("denoising.doubt", d.doubt),
            ("denoising.least_doubt", d.least_doubt),
            ("semi_supervised.weight", s.weight),
        ];
        for (key, value) in weights {
            if !(value >= 0.0 && value.is_finite()) {
                return Err(ConfigError::OutOfRange {
                    key,
                    value: value.to_string(),
                    must_be: "a number from 0 on",
                });
            }
        }
        if s.passes == 0 {
            return Err(ConfigError::OutOfRange {
                key: "semi_supervised.passes",
                value: "0".into(),
                must_be: "at least 1",
            });
        }
        Ok(())
    }

    fn check_teacher(&self) -> Result<(), ConfigError> {
        let t = &self.teacher;
        let shares = [
            ("teacher.mistake", t.mistake),
            ("teacher.inconsistent_mistake", t.inconsistent_mistake),
            ("teacher.equal", t.equal),
            ("teacher.skip", t.skip),
        ];
        let out = |key, value: f64, must_be| {
            Err(ConfigError::OutOfRange {
                key,
                value: value.to_string(),
                must_be,
            })
        };
        for (key, value) in shares {
            if !(0.0..=1.0).contains(&value) {
                return out(key, value, "from 0 to 1");
            }
        }
        if !(t.discount > 0.0 && t.discount <= 1.0) {
            return out("teacher.discount", t.discount, "above 0, at most 1");
        }
        if !(t.rationality > 0.0 && t.rationality.is_finite()) {
            return out("teacher.rationality", t.rationality, "a number above 0");
        }
        Ok(())
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

/// Names of presets, each once; tasks bring their own without being asked.
pub(crate) fn preset_names() -> Vec<&'static str> {
    let names = PRESETS.iter().map(|(name, _, _)| *name);
    let mut known: Vec<&str> = names.filter(|name| *name != "task").collect();
    known.sort_unstable();
    known.dedup();
    known
}

fn preset(name: &str, task: &str) -> Result<Table, ConfigError> {
    let found = PRESETS
        .iter()
        .find(|(n, t, _)| *n == name && (t.is_empty() || *t == task));
    let Some((_, _, text)) = found else {
        return Err(unknown("preset", name, preset_names().into_iter()));
    };
    parse_layer(&format!("preset {name}"), text)
}

/// Parses one layer alone, so that an error can point into its own text.
fn parse_layer(origin: &str, text: &str) -> Result<Table, ConfigError> {
    toml::from_str::<RunConfig>(text).map_err(|e| invalid(origin, text, &e))?;
    toml::from_str(text).map_err(|e| invalid(origin, text, &e))
}

fn parse_override(text: &str) -> Result<Table, ConfigError> {
    let origin = format!("--set {text}");
    let Some((key, value)) = text.split_once('=') else {
        return Err(ConfigError::Invalid {
            origin,
            message: "write it as key=value".into(),
        });
    };
    let is_bare = toml::from_str::<Table>(&format!("x = {value}")).is_err();
    let value = if is_bare {
        format!("{value:?}")
    } else {
        value.to_owned()
    };
    parse_layer(&origin, &format!("{key} = {value}"))
}

/// An error of TOML with its line, and the nearest right key where one is unknown.
pub(crate) fn invalid(origin: &str, text: &str, error: &toml::de::Error) -> ConfigError {
    let line = error
        .span()
        .map(|span| 1 + text[..span.start.min(text.len())].matches('\n').count());
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
        message: format!("{place}{message}{suggestion}"),
    }
}

fn merge(base: &mut Table, layer: &Table) {
    for (key, value) in layer {
        match (base.get_mut(key), value) {
            (Some(Value::Table(below)), Value::Table(above)) => merge(below, above),
            _ => {
                base.insert(key.clone(), value.clone());
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn layers(presets: &[&str], overrides: &[&str]) -> Layers {
        Layers {
            presets: presets.iter().map(ToString::to_string).collect(),
            overrides: overrides.iter().map(ToString::to_string).collect(),
            ..Layers::default()
        }
    }

    #[test]
    fn every_preset_resolves_for_every_task_and_method() {
        for task in sim::tasks::tasks() {
            for method in method::METHODS {
                for presets in [vec![], vec!["quick".to_owned()]] {
                    let layers = Layers {
                        task: Some(task.name.into()),
                        method: Some(method.name.into()),
                        presets,
                        ..Layers::default()
                    };
                    RunConfig::resolve(&layers).unwrap();
                }
            }
        }
    }

    #[test]
    fn a_later_layer_wins_and_the_saved_tree_reads_back() {
        let config =
            RunConfig::resolve(&layers(&["quick"], &["training.total_steps=123456"])).unwrap();
        assert_eq!(config.training.total_steps, 123_456);
        assert_eq!(
            RunConfig::parse("saved", &config.to_toml()).unwrap(),
            config
        );
    }

    #[test]
    fn a_wrong_key_is_named_with_its_line_and_the_nearest_right_one() {
        let file = (
            "my.toml".to_owned(),
            "seed = 3\n\n[feedback]\nbugdet = 10\n".to_owned(),
        );
        let error = RunConfig::resolve(&Layers {
            file: Some(file),
            ..Layers::default()
        })
        .unwrap_err();
        let text = error.to_string();
        assert!(
            text.contains("my.toml: line 4") && text.contains("did you mean `budget`"),
            "{text}"
        );
    }

    #[test]
    fn a_wrong_name_is_answered_with_the_nearest_right_one() {
        let wrong = Layers {
            task: Some("windowopen".into()),
            ..Layers::default()
        };
        assert!(
            RunConfig::resolve(&wrong)
                .unwrap_err()
                .to_string()
                .contains("did you mean 'window-open'")
        );
        let error = RunConfig::resolve(&layers(&["quik"], &[])).unwrap_err();
        assert!(
            error.to_string().contains("did you mean 'quick'"),
            "{error}"
        );
    }

    #[test]
    fn a_value_out_of_range_or_of_the_wrong_kind_is_refused() {
        for bad in [
            "environment.n_envs=0",
            "queries.same_stage_fraction=1.5",
            "queries.sampler=disagrement",
            "queries.near_policy_episodes=0",
            "teacher.mistake=1.5",
            "teacher.discount=0.0",
            "bonus.decay=1.0",
            "denoising.flip_below=0.0",
            "semi_supervised.certainty=0.2",
            "semi_supervised.passes=0",
            "seed=many",
            "seed",
            "feedback.every=0",
            "agent.hidden=[256, 0]",
            "agent.hidden=[1000000000]",
            "agent.batch=0",
            "agent.precision=f16",
            "reward.members=0",
        ] {
            RunConfig::resolve(&layers(&[], &[bad])).unwrap_err();
        }
    }
}
