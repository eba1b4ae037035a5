//! One round of asking: what was chosen, what replaces a skipped query, when it is complete.

use domain::agreement::probability_of_superiority;
use domain::answer::Preference;
use domain::environment::TaskReward;
use domain::query::{OfferedQuery, Query, QueryKey, is_same_stage};
use domain::random::{Rng, Stream};
use domain::sampler::{Beliefs, QuerySampler};
use domain::teacher::{Judge as _, Oracle, task_return};
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
            let offered = planned.offer(replay);
            let difference = task_return(&offered.second) - task_return(&offered.first);
            let right = Oracle.judge(&offered)?;
            (difference.abs() > 0.0).then_some(own == right)
        };
        share(&self.planned.iter().filter_map(agrees).collect::<Vec<_>>())
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
        let gaps = beliefs.stage_gap(candidates);
        let symmetric_gaps = symmetric_gap(&gaps, candidates, beliefs);
        let chosen_gaps = beliefs.stage_gap(&chosen);
        let of_chosen = are_same_stage(&chosen, replay);
        let of_pool = are_same_stage(candidates, replay);
        SessionOffered {
            session: self.index,
            step,
            n_queries: self.size,
            disagreement_chosen: mean(&beliefs.disagreement(&chosen)),
            disagreement_pool: mean(&beliefs.disagreement(candidates)),
            stage_gap_chosen: mean(&chosen_gaps),
            stage_gap_pool: mean(&gaps),
            same_stage_chosen: of_chosen.and_then(|are| share(&are)),
            same_stage_pool: of_pool.as_deref().and_then(share),
            stage_gap_auc: of_pool
                .as_deref()
                .and_then(|are| area_under_curve(&gaps, are)),
            symmetric_gap_chosen: mean(&symmetric_gap(&chosen_gaps, &chosen, beliefs)),
            symmetric_gap_pool: mean(&symmetric_gaps),
            symmetric_gap_auc: of_pool.and_then(|are| area_under_curve(&symmetric_gaps, &are)),
        }
    }
}

/// Mean stage gap of both directions, `[N]`; empty for methods without a notion of stages.
///
/// * `there` – gap of each query as it is, `[N]`
fn symmetric_gap(there: &[f32], queries: &[Query], beliefs: &mut dyn Beliefs) -> Vec<f32> {
    let swapped: Vec<Query> = queries.iter().map(|q| q.swapped()).collect();
    let back = beliefs.stage_gap(&swapped);
    let both = there.iter().zip(&back);
    both.map(|(a, b)| f32::midpoint(*a, *b)).collect()
}

/// Whether each query lies within one true stage; `None` where the task does not know its stages.
fn are_same_stage(queries: &[Query], replay: &Replay) -> Option<Vec<bool>> {
    let is = |q: &Query| is_same_stage(replay.stages(q.first), replay.stages(q.second));
    queries.iter().map(is).collect()
}

/// How well gaps tell queries within a stage from the others; `None` without gaps, and where all
/// queries are of one kind.
fn area_under_curve(gaps: &[f32], are_same_stage: &[bool]) -> Option<f64> {
    let pairs = || gaps.iter().copied().zip(are_same_stage);
    let of = |is_same| {
        pairs()
            .filter(move |(_, is)| **is == is_same)
            .map(|(gap, _)| gap)
    };
    let (within, across): (Vec<f32>, Vec<f32>) = (of(true).collect(), of(false).collect());
    probability_of_superiority(&across, &within)
}

fn share(are: &[bool]) -> Option<f64> {
    mean(&are.iter().copied().map(f32::from).collect::<Vec<_>>())
}

fn mean(values: &[f32]) -> Option<f64> {
    let sum: f64 = values.iter().copied().map(f64::from).sum();
    (!values.is_empty()).then(|| sum / values.len() as f64)
}

#[cfg(test)]
mod tests {
    use domain::answer::Which;
    use domain::environment::EpisodeEnd;
    use domain::episode::{EpisodeId, Segment};
    use learn::replay::{NewStep, ReplayShape};

    use super::*;
    use crate::preferences::Asked;

    /// An episode of 12 steps; the state after step t is in stage t / 4, or in none that is known.
    fn replay(knows_stages: bool) -> Replay {
        let shape = ReplayShape {
            observation: 1,
            action: 1,
            pose: 0,
        };
        let mut replay = Replay::new(shape, 1);
        let stage = |t: u8| knows_stages.then_some(t / 4);
        replay.begin_episode(0, 1, &[0.0], &[], stage(0));
        for t in 0..12 {
            let step = NewStep {
                action: &[0.0],
                learned_reward: 0.0,
                task_reward: TaskReward(0.0),
                success: false,
                stage: stage(t),
                end: (t == 11).then_some(EpisodeEnd::TimeLimit),
                next_observation: &[0.0],
                next_pose: &[],
            };
            replay.push(0, step);
        }
        replay
    }

    /// Segments of three steps that start at these.
    fn query(first: u32, second: u32) -> Query {
        let [first, second] = [first, second].map(|start| Segment {
            episode: EpisodeId(0),
            start,
            len: 3,
        });
        Query { first, second }
    }

    /// The replay's task rewards are all 0, and scripted teachers have to name one all the same.
    #[test]
    fn answers_about_pairs_of_equal_task_reward_are_neither_right_nor_wrong() {
        let session = session([query(0, 4), query(0, 4)]);
        let answers = [Which::First, Which::Second];
        let asked = session.planned.iter().zip(answers).map(|(p, which)| Asked {
            key: p.key,
            query: p.query,
            state: AnswerState::Preferred(Preference::Prefer(which)),
        });
        let preferences = Preferences::from(asked.collect::<Vec<_>>());
        assert_eq!(session.oracle_agreement(&preferences, &replay(true)), None);
    }

    fn session(queries: impl IntoIterator<Item = Query>) -> Session {
        let planned = (0..).zip(queries).map(|(index, query)| Planned {
            key: QueryKey { session: 0, index },
            query,
            asks_same_stage: false,
            disagreement: None,
            stage_gap: None,
            typical_reward: None,
        });
        let planned: Vec<Planned> = planned.collect();
        Session {
            index: 0,
            size: planned.len() as u32,
            planned,
            reserve: Vec::new(),
        }
    }

    #[test]
    fn a_pair_is_of_one_stage_where_all_its_ends_are() {
        let queries = [
            query(0, 1), // both in the first stage
            query(0, 2), // the second one leaves it
            query(2, 3), // both go from the first to the second
            query(0, 4), // each in one, but in two
            query(8, 9),
        ];
        let are = are_same_stage(&queries, &replay(true));
        assert_eq!(are, Some(vec![true, false, false, false, true]));
        assert_eq!(are_same_stage(&queries, &replay(false)), None);
    }

    /// Sees how far back it is from the first segment to the second, and no way ahead.
    struct OneWay;

    impl Beliefs for OneWay {
        fn disagreement(&mut self, candidates: &[Query]) -> Vec<f32> {
            vec![0.0; candidates.len()]
        }
        fn entropy(&mut self, candidates: &[Query]) -> Vec<f32> {
            vec![0.0; candidates.len()]
        }
        fn states(&mut self, candidates: &[Query]) -> Vec<Vec<f32>> {
            vec![Vec::new(); candidates.len()]
        }
        fn asked_states(&mut self) -> Vec<Vec<f32>> {
            Vec::new()
        }
        fn stage_gap(&mut self, candidates: &[Query]) -> Vec<f32> {
            let back = |q: &Query| q.first.start.saturating_sub(q.second.start) as f32;
            candidates.iter().map(back).collect()
        }
    }

    #[test]
    fn a_session_tells_the_gap_there_and_that_of_both_directions() {
        // there 0, 4, 0 and 1; both ways ½, 2, 4 and ½; the first and the last in one stage
        let candidates = [query(0, 1), query(4, 0), query(0, 8), query(9, 8)];
        let session = session([candidates[2]]);
        let told = session.report(0, &candidates, &mut OneWay, &replay(true));
        let there = (told.stage_gap_chosen, told.stage_gap_pool);
        assert_eq!(there, (Some(0.0), Some(1.25)));
        let both = (told.symmetric_gap_chosen, told.symmetric_gap_pool);
        assert_eq!(both, (Some(4.0), Some(1.75)));
        let auc = (told.stage_gap_auc, told.symmetric_gap_auc);
        assert_eq!(auc, (Some(0.625), Some(1.0)));
    }

    #[test]
    fn gaps_tell_pairs_of_one_stage_from_others_or_they_do_not() {
        let are = [true, false, true, false];
        let told = |gaps: &[f32]| area_under_curve(gaps, &are);
        assert_eq!(told(&[0.1, 0.4, 0.2, 0.3]), Some(1.0));
        assert_eq!(told(&[0.1, 0.2, 0.4, 0.3]), Some(0.5));
        assert_eq!(told(&[]), None); // a method without a gap
    }
}
