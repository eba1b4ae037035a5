//! One round of asking: what was chosen, what replaces a skipped query, when it is complete.

use domain::answer::Preference;
use domain::environment::TaskReward;
use domain::query::{OfferedQuery, Query, QueryKey};
use domain::random::{Rng, Stream};
use domain::sampler::{Beliefs, QuerySampler};
use domain::teacher::{Judge as _, Oracle};
use learn::replay::Replay;
use serde::{Deserialize, Serialize};

use crate::message::SessionOffered;
use crate::preferences::{AnswerState, Preferences};

/// A chosen query, by reference.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub(crate) struct Planned {
    key: QueryKey,
    query: Query,
    asks_same_stage: bool,
    disagreement: Option<f32>,
    stage_gap: Option<f32>,
    typical_reward: Option<TaskReward>,
}

impl Planned {
    /// With everything that a teacher needs to answer.
    pub(crate) fn offer(&self, replay: &Replay) -> OfferedQuery {
        OfferedQuery {
            key: self.key,
            first: replay.record(self.query.first),
            second: replay.record(self.query.second),
            asks_same_stage: self.asks_same_stage,
            disagreement: self.disagreement,
            stage_gap: self.stage_gap,
            typical_reward: self.typical_reward,
        }
    }

    /// Its name.
    pub(crate) fn key(&self) -> QueryKey {
        self.key
    }

    /// The two segments.
    pub(crate) fn query(&self) -> Query {
        self.query
    }
}

/// An open round of asking.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub(crate) struct Session {
    index: u32,
    /// Preferences that it needs.
    size: u32,
    planned: Vec<Planned>,
    /// The candidates that were next in rank, best last.
    reserve: Vec<Planned>,
}

/// How a session is put together.
pub(crate) struct Selection<'a> {
    /// Round of asking, from 0.
    pub index: u32,
    /// Queries to ask.
    pub size: u32,
    /// Of the run.
    pub seed: u64,
    /// Share of queries that also ask the stage question.
    pub same_stage_fraction: f64,
    /// Where queries are chosen from.
    pub candidates: &'a [Query],
    /// How the agent does these days, for scripted teachers.
    pub typical_reward: Option<TaskReward>,
}

impl Session {
    /// Ranks the candidates and keeps the best as the session, the next ones in reserve.
    pub(crate) fn choose(
        selection: &Selection<'_>,
        sampler: &dyn QuerySampler,
        beliefs: &mut dyn Beliefs,
    ) -> Self {
        let Selection {
            index,
            size,
            seed,
            same_stage_fraction,
            candidates,
            typical_reward,
        } = *selection;
        let mut rng = Rng::new(seed, Stream::Sampler, u64::from(index));
        let order = sampler.rank(candidates, beliefs, &mut rng);
        let n_kept = order.len().min(2 * size as usize);
        let ranked: Vec<Query> = order[..n_kept].iter().map(|&i| candidates[i]).collect();
        let (disagreement, stage_gap) = (beliefs.disagreement(&ranked), beliefs.stage_gap(&ranked));
        let plan = |(place, query): (usize, &Query)| Planned {
            key: QueryKey {
                session: index,
                index: place as u32,
            },
            query: *query,
            asks_same_stage: rng.chance(same_stage_fraction),
            disagreement: disagreement.get(place).copied(),
            stage_gap: stage_gap.get(place).copied(),
            typical_reward,
        };
        let mut planned: Vec<Planned> = ranked.iter().enumerate().map(plan).collect();
        let mut reserve = planned.split_off(planned.len().min(size as usize));
        reserve.reverse();
        let size = planned.len() as u32;
        Self {
            index,
            size,
            planned,
            reserve,
        }
    }

    /// Round of asking, from 0.
    pub(crate) fn index(&self) -> u32 {
        self.index
    }

    /// Queries asked so far, replacements included.
    pub(crate) fn planned(&self) -> &[Planned] {
        &self.planned
    }

    /// The next query in rank, to be asked in place of a skipped one.
    pub(crate) fn replacement(&mut self) -> Option<Planned> {
        let next = self.reserve.pop()?;
        self.planned.push(next);
        Some(next)
    }

    /// Preferences received and needed.
    pub(crate) fn progress(&self, preferences: &Preferences) -> (u32, u32) {
        let is_preferred =
            |p: &&Planned| matches!(preferences.state(p.key), Some(AnswerState::Preferred(_)));
        let n_received = self.planned.iter().filter(is_preferred).count() as u32;
        (n_received, self.size)
    }

    /// Whether the run may go on: `sufficient` of the needed preferences are there, or nothing
    /// is left to be answered.
    pub(crate) fn is_complete(&self, preferences: &Preferences, sufficient: f64) -> bool {
        let (n_received, n_needed) = self.progress(preferences);
        let is_open = |p: &Planned| preferences.state(p.key) == Some(AnswerState::Open);
        f64::from(n_received) >= f64::from(n_needed) * sufficient
            || !self.planned.iter().any(is_open)
    }

    /// Share of its answers that an unerring teacher would have given, among those that prefer one
    /// segment of a pair that differs in task reward.
    pub(crate) fn oracle_agreement(
        &self,
        preferences: &Preferences,
        replay: &Replay,
    ) -> Option<f64> {
        let agrees = |planned: &Planned| {
            let Some(AnswerState::Preferred(own @ Preference::Prefer(_))) =
                preferences.state(planned.key)
            else {
                return None;
            };
            let right = Oracle.judge(&planned.offer(replay))?;
            (right != Preference::Equal).then_some(f32::from(u8::from(own == right)))
        };
        mean(&self.planned.iter().filter_map(agrees).collect::<Vec<_>>())
    }

    /// What choosing did: the chosen queries against all candidates.
    pub(crate) fn report(
        &self,
        step: u64,
        candidates: &[Query],
        beliefs: &mut dyn Beliefs,
        replay: &Replay,
    ) -> SessionOffered {
        let chosen: Vec<Query> = self.planned.iter().map(Planned::query).collect();
        let same_stage: Option<Vec<f32>> = self
            .planned
            .iter()
            .map(|p| {
                p.offer(replay)
                    .is_same_stage()
                    .map(|is_same| f32::from(u8::from(is_same)))
            })
            .collect();
        SessionOffered {
            session: self.index,
            step,
            n_queries: self.size,
            disagreement_chosen: mean(&beliefs.disagreement(&chosen)),
            disagreement_pool: mean(&beliefs.disagreement(candidates)),
            stage_gap_chosen: mean(&beliefs.stage_gap(&chosen)),
            stage_gap_pool: mean(&beliefs.stage_gap(candidates)),
            same_stage_chosen: same_stage.and_then(|s| mean(&s)),
        }
    }
}

fn mean(values: &[f32]) -> Option<f64> {
    let sum: f64 = values.iter().copied().map(f64::from).sum();
    (!values.is_empty()).then(|| sum / values.len() as f64)
}
