//! Batches for SAC: what is drawn, and with which reward.

use domain::environment::EpisodeEnd;
use domain::random::Rng;

use super::{Lane, Replay, row};

/// Which reward a batch carries.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum RewardSource {
    /// The ensemble's estimate: what preference-based methods learn from.
    Learned,
    /// Ground truth: the upper bound's alone.
    Task,
}

/// How a batch is drawn and what it carries.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct BatchRule {
    /// What its rewards are.
    pub reward: RewardSource,
    /// Of the disagreement of the learned reward, added to it; 0 leaves it out.
    pub disagreement_weight: f32,
    /// Newest transitions, of all lanes together, from which half of the rows are drawn; the
    /// other half from everything. `None` draws all from everything.
    pub recent: Option<usize>,
    /// Whether nothing follows a time limit either: values do not bootstrap there.
    pub ends_at_time_limit: bool,
}

impl Default for BatchRule {
    fn default() -> Self {
        Self {
            reward: RewardSource::Learned,
            disagreement_weight: 0.0,
            recent: None,
            ends_at_time_limit: false,
        }
    }
}

/// Transitions drawn for one SAC update, row-major.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Batch {
    /// `[B × S]`.
    pub observation: Vec<f32>,
    /// `[B × A]`.
    pub action: Vec<f32>,
    /// `[B]`.
    pub reward: Vec<f32>,
    /// `[B × S]`.
    pub next_observation: Vec<f32>,
    /// `[B]`: 0 where nothing follows the step, 1 elsewhere, time limits included.
    pub not_terminal: Vec<f32>,
}

impl Batch {
    /// `B`.
    pub fn len(&self) -> usize {
        self.reward.len()
    }

    /// Whether there is no row.
    pub fn is_empty(&self) -> bool {
        self.reward.is_empty()
    }
}

impl Replay {
    /// `n` transitions drawn uniformly with replacement, with their learned reward.
    ///
    /// # Panics
    /// When there is no transition yet.
    pub fn sample(&self, n: usize, rng: &mut Rng) -> Batch {
        self.sample_with(n, rng, RewardSource::Learned)
    }

    /// `n` transitions drawn uniformly with replacement, with the reward of `source`.
    ///
    /// # Panics
    /// When there is no transition yet.
    pub fn sample_with(&self, n: usize, rng: &mut Rng, reward: RewardSource) -> Batch {
        let rule = BatchRule {
            reward,
            ..BatchRule::default()
        };
        self.draw(n, rng, &rule)
    }

    /// `n` transitions drawn with replacement as `rule` says; where half of them are recent,
    /// those come last.
    ///
    /// # Panics
    /// When there is no transition yet.
    pub fn draw(&self, n: usize, rng: &mut Rng, rule: &BatchRule) -> Batch {
        let (s, a, len) = (self.shape.observation, self.shape.action, self.len());
        let mut batch = Batch {
            observation: Vec::with_capacity(n * s),
            action: Vec::with_capacity(n * a),
            reward: Vec::with_capacity(n),
            next_observation: Vec::with_capacity(n * s),
            not_terminal: Vec::with_capacity(n),
        };
        let n_recent = rule.recent.map_or(0, |_| n / 2);
        let recent = self.recent(rule.recent.unwrap_or(0));
        let len_recent = recent.iter().map(|(_, steps)| steps.len()).sum();
        for index in 0..n {
            let (lane, step) = if index < n - n_recent {
                self.locate(rng.below(len))
            } else {
                locate_recent(&recent, rng.below(len_recent))
            };
            let state = self.state_of(lane, step);
            batch
                .observation
                .extend_from_slice(row(&lane.observations, state, s));
            batch
                .next_observation
                .extend_from_slice(row(&lane.observations, state + 1, s));
            batch.action.extend_from_slice(row(&lane.actions, step, a));
            batch.reward.push(lane.reward(step, rule));
            let is_over = match lane.marks[step].end() {
                Some(EpisodeEnd::Terminal) => true,
                Some(EpisodeEnd::TimeLimit) => rule.ends_at_time_limit,
                None => false,
            };
            batch.not_terminal.push(if is_over { 0.0 } else { 1.0 });
        }
        batch
    }

    /// The newest steps of each lane that make up `n` in all: lanes step side by side.
    fn recent(&self, n: usize) -> Vec<(&Lane, std::ops::Range<usize>)> {
        let own = n.div_ceil(self.lanes.len());
        let lanes = self.lanes.iter();
        lanes
            .map(|lane| {
                let n_steps = lane.marks.len();
                (lane, n_steps - own.min(n_steps)..n_steps)
            })
            .collect()
    }
}

impl Lane {
    fn reward(&self, step: usize, rule: &BatchRule) -> f32 {
        let reward = match rule.reward {
            RewardSource::Learned => self.learned_rewards[step],
            RewardSource::Task => self.task_rewards[step] as f32,
        };
        let disagreement = self.disagreements.get(step).copied().unwrap_or(0.0);
        reward + rule.disagreement_weight * disagreement
    }
}

/// Lane and step of the recent transition with number `index`, lane after lane.
fn locate_recent<'a>(
    recent: &[(&'a Lane, std::ops::Range<usize>)],
    mut index: usize,
) -> (&'a Lane, usize) {
    for (lane, steps) in recent {
        if index < steps.len() {
            return (lane, steps.start + index);
        }
        index -= steps.len();
    }
    unreachable!("an index below the number of recent transitions")
}
