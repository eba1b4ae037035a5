//! Policies that a command line may name: the scripted expert, chance, or a checkpoint.

use std::path::Path;

use domain::environment::EnvSpec;
use domain::random::{Rng, Stream};
use lab::policy::TrainedPolicy;

use crate::cli::BadInput;

/// A policy over several states at once.
pub struct Policy {
    spec: EnvSpec,
    kind: Kind,
    noise: f64,
    seed: u64,
}

enum Kind {
    Expert(sim::tasks::Expert),
    Random,
    Trained(Box<TrainedPolicy>),
}

impl Policy {
    /// `expert`, `random`, or the path of a checkpoint or a run's folder. Gaussian noise of
    /// standard deviation `noise` is added to each component of the clipped action, and the
    /// sum clipped again.
    ///
    /// # Errors
    /// [`BadInput`] for a path that holds no checkpoint of this task, and for the expert of a
    /// task that has none.
    pub fn open(
        task: &'static sim::tasks::Task,
        name: &str,
        noise: f64,
        seed: u64,
    ) -> anyhow::Result<Self> {
        let kind = match name {
            "expert" => Kind::Expert(task.expert.ok_or_else(|| no_expert(task))?),
            "random" => Kind::Random,
            path => Kind::Trained(Box::new(trained(task, path)?)),
        };
        Ok(Self {
            spec: (task.spec)(),
            kind,
            noise,
            seed,
        })
    }

    /// Actions `[n × A]` for states `[n × S]` at step `t` of their episodes.
    pub fn act(&self, observations: &[f32], t: u32) -> Vec<f32> {
        let n = observations.len() / self.spec.observation_size;
        let mut rng = Rng::new(self.seed, Stream::Rollout, u64::from(t));
        let mut actions = match &self.kind {
            Kind::Expert(expert) => observations
                .chunks(self.spec.observation_size)
                .flat_map(expert)
                .collect(),
            Kind::Random => (0..n * self.spec.action_size)
                .map(|_| rng.uniform_in(-1.0, 1.0) as f32)
                .collect(),
            Kind::Trained(policy) => policy.act(observations),
        };
        if self.noise > 0.0 {
            for action in &mut actions {
                *action =
                    (action.clamp(-1.0, 1.0) + (self.noise * rng.normal()) as f32).clamp(-1.0, 1.0);
            }
        }
        actions
    }
}

fn no_expert(task: &sim::tasks::Task) -> BadInput {
    BadInput(format!(
        "{} has no scripted expert; use 'random' or a checkpoint",
        task.name
    ))
}

fn trained(task: &sim::tasks::Task, path: &str) -> anyhow::Result<TrainedPolicy> {
    let policy = TrainedPolicy::open(Path::new(path)).map_err(|error| {
        BadInput(format!(
            "a policy is 'expert', 'random' or a checkpoint, and '{path}' is no checkpoint: {error}"
        ))
    })?;
    let trained_on = &policy.config().task;
    if trained_on != task.name {
        let wrong = format!(
            "the checkpoint {path} was trained on {trained_on}, not on {}",
            task.name
        );
        return Err(BadInput(wrong).into());
    }
    Ok(policy)
}
