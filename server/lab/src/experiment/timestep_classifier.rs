//! How well a classifier tells from an expert's states at which step they were seen: the paper's
//! evidence that tasks have stages.
//!
//! A task's scripted expert plays episodes; the classifier is fitted to the states of one half of
//! them and judged on the other.
//!
//! Source: STAIR, section 3.2 and its appendix, "Details on the classification experiment".
//! Differs from the paper: the expert is scripted, not trained, and whole episodes are held out,
//! where the paper draws the held-out states from all episodes, so that most of their neighbours
//! in time are trained on.

use std::num::NonZeroUsize;

use domain::environment::EnvError;
use domain::random::{Rng, Stream};
use domain::stage::{StageProbabilities, TimestepReport, TimestepTally};
use learn::device::Device;
use learn::timestep::{TimedStates, TimestepClassifier, TimestepConfig, TimestepFit};
use serde::{Deserialize, Serialize};
use sim::expert::rollout;
use sim::tasks::{Expert, Task, tasks};

use super::{Artifact, json_lines, on_threads};
use crate::config::{ConfigError, find_task};
use crate::evaluate::held_out_seed;
use crate::figure::{self, FigureError, Request, Source};

mod report;

/// As users type it.
pub const NAME: &str = "timestep-classifier";
/// The paper's tasks.
pub const TASKS: [&str; 3] = ["door-open", "drawer-open", "window-open"];
/// The paper's million states, of episodes of 500 steps.
pub const N_EPISODES: u32 = 2_000;

/// Stages of the episode that is shown step by step: the steps themselves would be too many.
const N_SHOWN_STAGES: usize = 20;

/// How the experiment is run.
#[derive(Debug, Clone)]
pub struct Settings {
    /// Whose experts are watched, in this order.
    pub tasks: Vec<Played>,
    /// Of the episodes, the initial weights and the order of states.
    pub seed: u64,
    /// Episodes of each task, half of them held out; at least two.
    pub n_episodes: u32,
    /// Threads; changes no number.
    pub n_threads: NonZeroUsize,
    /// Of the classifier.
    pub classifier: TimestepConfig,
}

/// A task that somebody wrote an expert for.
#[derive(Debug, Clone, Copy)]
pub struct Played {
    task: &'static Task,
    expert: Expert,
}

/// Why the experiment cannot be run.
#[derive(Debug, thiserror::Error)]
pub enum TimestepError {
    /// No such task.
    #[error(transparent)]
    Unknown(#[from] ConfigError),
    /// Nobody to watch.
    #[error("{task} has no scripted expert; tasks that have one: {known}")]
    NoExpert {
        /// The task.
        task: &'static str,
        /// All that have one.
        known: String,
    },
    /// The physics refused.
    #[error(transparent)]
    Physics(#[from] EnvError),
    /// Its rows cannot be drawn.
    #[error(transparent)]
    Figure(#[from] FigureError),
}

/// What came of one task.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Outcome {
    /// Its name.
    pub task: String,
    /// Of everything random.
    pub seed: u64,
    /// Episodes that the classifier was fitted to.
    pub n_fitted_episodes: u32,
    /// Episodes that it was judged on.
    pub n_held_out_episodes: u32,
    /// Share of all these episodes in which the expert succeeded; `null` where a task only goes
    /// better or worse.
    pub expert_success_rate: Option<f64>,
    /// The last pass over the states that it was fitted to.
    pub last_pass: TimestepFit,
    /// On the states of the held-out episodes.
    pub held_out: TimestepReport,
}

/// A pass over a task's states is done.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Progress {
    /// The task.
    pub task: &'static str,
    /// Passes so far.
    pub n_epochs: u32,
    /// How this one went.
    pub fit: TimestepFit,
}

impl Played {
    /// The task of that name.
    ///
    /// # Errors
    /// [`TimestepError::Unknown`] and [`TimestepError::NoExpert`], with what there is.
    pub fn find(name: &str) -> Result<Self, TimestepError> {
        let task = find_task(name)?;
        let expert = task.expert.ok_or_else(|| {
            let with_expert = tasks().iter().filter(|task| task.expert.is_some());
            let names: Vec<&str> = with_expert.map(|task| task.name).collect();
            TimestepError::NoExpert {
                task: task.name,
                known: names.join(", "),
            }
        })?;
        Ok(Self { task, expert })
    }

    /// An episode of the expert: the states before each step, `[T × S]`, and whether it
    /// succeeded.
    fn play(self, seed: u64) -> Result<(Vec<f32>, bool), EnvError> {
        let mut observations = Vec::new();
        let mut act = |observation: &[f32]| {
            observations.extend_from_slice(observation);
            (self.expert)(observation)
        };
        let success = rollout((self.task.make)().as_mut(), seed, &mut act)?.success;
        Ok((observations, success))
    }
}

/// Rows, a table, a figure, and of each task a held-out episode as `stage-map` draws it.
///
/// * `tell` – hears of each pass as it is done, from several threads
///
/// # Errors
/// When the physics refuses.
pub fn run(
    settings: &Settings,
    tell: &(dyn Fn(Progress) + Sync),
) -> Result<Vec<Artifact>, TimestepError> {
    let work = |played: &Played| watch(settings, *played, tell);
    let watched = on_threads(&settings.tasks, settings.n_threads, work);
    let (mut outcomes, mut episodes) = (Vec::new(), Vec::new());
    for watched in watched {
        let (outcome, episode) = watched?;
        episodes.push(Source {
            name: format!("{}.jsonl", outcome.task),
            text: json_lines(&shown(&episode)),
        });
        outcomes.push(outcome);
    }
    let rows = Source {
        name: format!("{NAME}.jsonl"),
        text: json_lines(&outcomes),
    };
    let figure = drawn(NAME, std::slice::from_ref(&rows))?;
    let map = drawn("stage-map", &episodes)?;
    let mut files = vec![
        Artifact::of(rows),
        Artifact::new(format!("{NAME}.md"), report::table(&outcomes)),
        Artifact::new(format!("{NAME}.svg"), figure),
    ];
    files.extend(episodes.into_iter().map(Artifact::of));
    files.push(Artifact::new("stage-map.svg", map));
    Ok(files)
}

/// Fits and judges the classifier of one task; also its probabilities along the first held-out
/// episode.
fn watch(
    settings: &Settings,
    played: Played,
    tell: &(dyn Fn(Progress) + Sync),
) -> Result<(Outcome, StageProbabilities), EnvError> {
    let (spec, seed) = ((played.task.spec)(), settings.seed);
    let n_fitted = settings.n_episodes / 2;
    let n_held_out = settings.n_episodes - n_fitted;
    let mut states = TimedStates::new(spec.observation_size);
    let mut n_successes = 0;
    for index in 0..n_fitted {
        let seed = Rng::new(seed, Stream::EpisodeSeed, u64::from(index)).next_u64();
        let (observations, success) = played.play(seed)?;
        states.push_episode(&observations);
        n_successes += u32::from(success);
    }

    let n_steps = spec.episode_len as usize;
    let (size, config) = (spec.observation_size, &settings.classifier);
    let mut classifier = TimestepClassifier::new(config, size, n_steps, seed, Device::CPU);
    let mut n_epochs = 0;
    let last_pass = classifier.fit(&states, |fit| {
        n_epochs += 1;
        tell(Progress {
            task: played.task.name,
            n_epochs,
            fit,
        });
    });

    let (mut tally, mut first) = (TimestepTally::new(n_steps), None);
    for index in 0..n_held_out {
        let (observations, success) = played.play(held_out_seed(seed, index))?;
        n_successes += u32::from(success);
        let table = StageProbabilities::new(classifier.probabilities(&observations), n_steps);
        let table = table.expect("a softmax gives probabilities");
        tally.add(&table);
        first.get_or_insert(table);
    }
    let success_rate = f64::from(n_successes) / f64::from(settings.n_episodes);
    let outcome = Outcome {
        task: played.task.name.into(),
        seed,
        n_fitted_episodes: n_fitted,
        n_held_out_episodes: n_held_out,
        expert_success_rate: spec.has_success.then_some(success_rate),
        last_pass,
        held_out: tally.report().expect("at least one episode is held out"),
    };
    Ok((outcome, first.expect("at least one episode is held out")))
}

/// The rows of an episode's stage map, to four decimals.
fn shown(episode: &StageProbabilities) -> Vec<Vec<f32>> {
    let merged = episode.merged(N_SHOWN_STAGES.min(episode.n_stages()));
    let rounded = |p: &f32| (p * 1e4).round() / 1e4;
    (0..merged.n_states())
        .map(|step| merged.row(step).iter().map(rounded).collect())
        .collect()
}

fn drawn(name: &str, sources: &[Source]) -> Result<String, FigureError> {
    let request = Request {
        sources,
        ..Request::default()
    };
    figure::make(figure::find(name)?, &request)
}

#[cfg(test)]
mod tests;
