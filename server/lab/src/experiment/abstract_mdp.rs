//! Learning a reward on a chain of abstract stages, from aligned or from any queries.
//!
//! A state is a stage, an action moves on to the next one, and the reward is the stage's own
//! bias plus the action's. A table of rewards ψ is fitted to preferences between single
//! state-action pairs, one Adam step on fresh queries an epoch; the policy takes the best action
//! by ψ in every stage.
//!
//! Source: STAIR, section 3.2 and its appendix, Algorithm "Tabular PbRL"; 100 stages and a
//! terminal one, of which only the former have actions.

use domain::agreement::{Bootstrap, Estimate, mean};
use domain::random::{Rng, Stream};
use serde::{Deserialize, Serialize};

use super::{Artifact, ExperimentEntry, Settings, json_lines, on_threads};
use crate::figure::{self, FigureError, Request, Source};

mod fit;
mod report;

pub use fit::{Errors, fit};

pub(super) const ENTRY: ExperimentEntry = ExperimentEntry {
    name: "abstract-mdp",
    summary: "aligned against any queries on a chain of abstract stages, by stage reward bias",
    run,
};

/// R_bias of the experiment: stage biases are uniform in [0, R_bias], actions' rewards in
/// [0, 10]. The paper plots its values without naming them.
pub const BIASES: [f64; 6] = [0.0, 10.0, 20.0, 50.0, 100.0, 200.0];
/// Stages with actions.
pub const N_STAGES: usize = 100;
/// Actions in each stage.
pub const N_ACTIONS: usize = 5;

/// Which pairs are asked about.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Selection {
    /// Both of the same stage.
    Aligned,
    /// Any two.
    Conventional,
}

impl Selection {
    /// As tables and figures have it.
    pub(crate) fn name(self) -> &'static str {
        match self {
            Self::Aligned => "aligned",
            Self::Conventional => "conventional",
        }
    }
}

/// One chain: the reward of each action in each stage, `[stages × actions]`, normalised so that
/// the best policy earns 1 a stage on average and the worst 0.
#[derive(Debug, Clone, PartialEq)]
pub struct Chain {
    rewards: Vec<f64>,
}

impl Chain {
    /// The chain of a seed. The actions' rewards and the order of the stages' biases are the
    /// same for every R_bias: chains of one seed are compared in pairs.
    pub fn draw(bias: f64, seed: u64) -> Self {
        let mut rng = Rng::new(seed, Stream::Reset, 0);
        let mut rewards = Vec::with_capacity(N_STAGES * N_ACTIONS);
        for _ in 0..N_STAGES {
            let stage = bias * rng.uniform();
            rewards.extend((0..N_ACTIONS).map(|_| stage + rng.uniform_in(0.0, 10.0)));
        }
        let of_stages = |best: fn(f64, f64) -> f64| {
            let stages = rewards.chunks(N_ACTIONS);
            let bests = stages.map(|stage| stage.iter().copied().reduce(best));
            mean(&bests.flatten().collect::<Vec<_>>())
        };
        let (worst, best) = (of_stages(f64::min), of_stages(f64::max));
        for reward in &mut rewards {
            *reward = (*reward - worst) / (best - worst);
        }
        Self { rewards }
    }

    /// Reward of each action in each stage, `[stages × actions]`.
    pub fn rewards(&self) -> &[f64] {
        &self.rewards
    }
}

/// One repetition: how the policy did as its reward was learned.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Outcome {
    /// R_bias.
    pub bias: f64,
    /// Which pairs were asked about.
    pub selection: Selection,
    /// Of the chain and its queries.
    pub seed: u64,
    /// Normalised episode reward before the first epoch and after each, in [0, 1].
    pub rewards: Vec<f64>,
    /// How far ψ is from the reward in the end.
    #[serde(flatten)]
    pub errors: Errors,
}

/// Both selections at every R_bias for every seed, in this order.
pub fn outcomes(settings: Settings, biases: &[f64]) -> Vec<Outcome> {
    let mut jobs = Vec::new();
    for &bias in biases {
        for selection in [Selection::Aligned, Selection::Conventional] {
            jobs.extend((0..settings.n_seeds).map(|seed| (bias, selection, seed)));
        }
    }
    on_threads(&jobs, settings.n_threads, |&(bias, selection, seed)| {
        let (rewards, errors) = fit(&Chain::draw(bias, seed), selection, seed);
        Outcome {
            bias,
            selection,
            seed,
            rewards,
            errors,
        }
    })
}

/// Mean over seeds of a number of each outcome with its 95 % bootstrap interval over seeds.
pub(crate) fn over_seeds(outcomes: &[&Outcome], of: impl Fn(&Outcome) -> f64) -> Option<Estimate> {
    let values: Vec<f64> = outcomes.iter().map(|outcome| of(outcome)).collect();
    Bootstrap::default().center(&values, mean)
}

fn run(settings: Settings) -> Result<Vec<Artifact>, FigureError> {
    let outcomes = outcomes(settings, &BIASES);
    let rows = json_lines(&outcomes);
    let sources = [Source {
        name: "abstract-mdp.jsonl".into(),
        text: rows.clone(),
    }];
    let request = Request {
        sources: &sources,
        ..Request::default()
    };
    let svg = figure::make(figure::find("abstract-mdp")?, &request)?;
    Ok(vec![
        Artifact::new("abstract-mdp.jsonl", rows),
        Artifact::new("abstract-mdp.md", report::table(&outcomes)),
        Artifact::new("abstract-mdp.svg", svg),
    ])
}

#[cfg(test)]
mod tests;
