//! Averages for the rows of metrics, and how often a run speaks. The only clock of a run:
//! nothing that it says flows back into training.

use std::time::{Duration, Instant};

use learn::replay::Replay;

use crate::learner::Updates;
use crate::message::Metrics;

/// Sums since the last row.
#[derive(Debug, Default)]
pub(crate) struct Meter {
    critic_loss: Mean,
    actor_loss: Mean,
    q_mean: Mean,
    alpha: Mean,
    entropy: Mean,
    temporal_loss: Mean,
    last_row: Option<(u64, Instant)>,
    /// Spent at rest since the last row.
    rested: Duration,
    last_said: Option<Instant>,
}

#[derive(Debug, Default)]
struct Mean {
    sum: f64,
    n: u32,
}

impl Mean {
    fn add(&mut self, value: f32) {
        self.sum += f64::from(value);
        self.n += 1;
    }

    fn take(&mut self) -> Option<f64> {
        let Self { sum, n } = std::mem::take(self);
        (n > 0).then(|| sum / f64::from(n))
    }
}

/// Episodes that the running return and success rate look back on.
const N_RECENT: usize = 10;

impl Meter {
    /// Takes in what the updates of one round said.
    pub(crate) fn record(&mut self, updates: &Updates) {
        for m in &updates.agent {
            self.critic_loss.add(m.critic_loss);
            self.actor_loss.add(m.actor_loss);
            self.q_mean.add(m.q_mean);
            self.alpha.add(m.alpha);
            self.entropy.add(m.entropy);
        }
        for m in &updates.temporal {
            self.temporal_loss.add(m.loss);
        }
    }

    /// Sleeps for about `time`, which counts as no time of practice.
    pub(crate) fn rest(&mut self, time: Duration) {
        let from = Instant::now();
        std::thread::sleep(time);
        self.rested += from.elapsed();
    }

    /// The row for the interval that ends now; starts the next interval.
    pub(crate) fn row(&mut self, step: u64, labels: u32, replay: &Replay) -> Metrics {
        let now = Instant::now();
        let rested = std::mem::take(&mut self.rested);
        let rate = |(from, since): (u64, Instant)| {
            let worked = (now - since).saturating_sub(rested);
            (step - from) as f64 / worked.as_secs_f64().max(1e-9)
        };
        let steps_per_s = self.last_row.replace((step, now)).map(rate);
        let complete = replay.complete_episodes();
        let recent = &complete[complete.len().saturating_sub(N_RECENT)..];
        let mean = |value: &dyn Fn(&learn::replay::EpisodeInfo) -> f64| {
            let sum: f64 = recent.iter().map(|id| value(&replay.episode(*id))).sum();
            (!recent.is_empty()).then(|| sum / recent.len() as f64)
        };
        Metrics {
            step,
            labels,
            episodes: complete.len() as u32,
            return_mean: mean(&|episode| episode.task_return),
            success_rate: mean(&|episode| f64::from(u8::from(episode.is_success))),
            critic_loss: self.critic_loss.take(),
            actor_loss: self.actor_loss.take(),
            q_mean: self.q_mean.take(),
            alpha: self.alpha.take(),
            entropy: self.entropy.take(),
            temporal_loss: self.temporal_loss.take(),
            steps_per_s,
        }
    }

    /// Whether to say again what the run is doing: at a change, else about once a second.
    pub(crate) fn is_time_to_say(&mut self, is_change: bool) -> bool {
        let is_due = is_change
            || self
                .last_said
                .is_none_or(|said| said.elapsed() >= Duration::from_secs(1));
        if is_due {
            self.last_said = Some(Instant::now());
        }
        is_due
    }
}
