//! What is asked and when, what comes back, and what of the budget that takes.

use domain::random::{Rng, Stream};
use domain::sampler::{QuerySampler, Uniform};
use domain::teacher::Teacher;
use learn::beliefs::LearnedBeliefs;

use super::{Run, RunError};
use crate::candidates::Pool;
use crate::config::WhileWaiting;
use crate::message::Event;
use crate::preferences::AnswerState;
use crate::session::{Selection, Session};

/// Newest episodes by which scripted teachers measure, as in B-Pref.
const TYPICAL_EPISODES: usize = 10;

impl Run {
    pub(super) fn asks_now(&self) -> bool {
        self.session.is_none()
            && self
                .next_session_at()
                .is_some_and(|due| self.progress.step >= due)
            && self.pool().holds_a_pair(&self.replay)
    }

    /// Environment step at which the next session is due; `None` where there is none to come. Where
    /// the run goes on while it waits, a session that was asked late moves those after it: between
    /// any two lie as many steps as are to.
    pub(super) fn next_session_at(&self) -> Option<u64> {
        let feedback = &self.config.feedback;
        let planned = feedback.step_of(self.progress.n_sessions);
        let due = match (self.config.training.while_waiting, self.progress.asked_at) {
            (WhileWaiting::Train, Some(asked_at)) => {
                planned.max(asked_at.saturating_add(feedback.every))
            }
            _ => planned,
        };
        let is_to_come = self.method.sampler.is_some()
            && due < self.config.training.total_steps
            && self.n_committed() < feedback.budget;
        is_to_come.then_some(due)
    }

    /// Chooses a session's queries, makes them durable, and asks.
    pub(super) fn ask(
        &mut self,
        teacher: &mut dyn Teacher,
        events: &mut dyn FnMut(Event),
    ) -> Result<(), RunError> {
        let index = self.progress.n_sessions;
        self.demonstrate(Some(index), events)?;
        let size = self.config.feedback.session_size(
            index,
            self.config.training.total_steps,
            self.n_committed(),
        );
        let queries = &self.config.queries;
        let mut rng = Rng::new(self.config.seed, Stream::Candidates, u64::from(index));
        let n_candidates = size as usize * queries.candidates_per_query as usize;
        let candidates = self.pool().draw(&self.replay, n_candidates, &mut rng);
        let asked = self.preferences.asked();
        let sampler: &dyn QuerySampler = match &self.method.sampler {
            Some(sampler) if self.progress.n_fits > 0 => sampler.as_ref(),
            _ => &Uniform, // nothing is believed before the first fit
        };
        let mut beliefs = LearnedBeliefs {
            replay: &self.replay,
            reward: &self.learner.reward,
            temporal: self.learner.temporal.as_ref(),
            stage: self.method.stage,
            asked: &asked,
        };
        let selection = Selection {
            index,
            size,
            seed: self.config.seed,
            same_stage_fraction: queries.same_stage_fraction,
            candidates: &candidates,
            typical_reward: self.replay.typical_reward(TYPICAL_EPISODES),
        };
        let session = Session::choose(&selection, sampler, &mut beliefs);
        let report = session.report(self.progress.step, &candidates, &mut beliefs, &self.replay);
        for planned in session.planned() {
            self.preferences.ask(planned.key(), planned.query());
        }
        self.session = Some(session);
        self.progress.n_sessions += 1;
        self.progress.asked_at = Some(self.progress.step);
        self.say(Event::SessionOffered(report), events)?;
        self.checkpoint_and_say(events)?;
        self.offer_open_queries(teacher)
    }

    /// Where queries may come from.
    pub(super) fn pool(&self) -> Pool {
        let queries = &self.config.queries;
        let own = self.method.sampler.as_ref();
        let newest_episodes = own.and_then(|sampler| sampler.newest_episodes());
        Pool {
            newest_episodes: newest_episodes.unwrap_or(queries.newest_episodes),
            segment_len: self.config.segment_len(&self.spec),
            leaves_last_start: queries.bpref_starts,
            pairs_with_itself: queries.bpref_pairs,
        }
    }

    /// Puts what is open to the teacher again: after a resume nobody may have been asked yet.
    pub(super) fn offer_open_queries(&mut self, teacher: &mut dyn Teacher) -> Result<(), RunError> {
        let Some(session) = &self.session else {
            return Ok(());
        };
        let open = session.planned().iter();
        let open = open.filter(|p| self.preferences.state(p.key()) == Some(AnswerState::Open));
        let offers: Vec<_> = open.map(|p| p.offer(&self.replay)).collect();
        Ok(teacher.ask(&offers)?)
    }

    /// Takes in answers that arrived; asks a replacement for each skip of the open session, unless
    /// skips are to use up budget.
    pub(super) fn take_answers(&mut self, teacher: &mut dyn Teacher) -> Result<(), RunError> {
        let mut answers = std::mem::take(&mut self.early);
        answers.extend(teacher.collect(self.progress.consumed_sequence)?);
        for answered in answers {
            let consumed = &mut self.progress.consumed_sequence;
            *consumed = (*consumed).max(answered.sequence);
            let Some(before) = self.preferences.answer(&answered) else {
                self.early.push(answered);
                continue;
            };
            let is_new_skip = answered.preference.is_none() && before == AnswerState::Open;
            let Some(session) = self
                .session
                .as_mut()
                .filter(|s| s.index() == answered.key.session)
            else {
                let was_preferred = matches!(before, AnswerState::Preferred(_));
                let is_news = was_preferred || answered.preference.is_some();
                self.progress.n_late += u32::from(is_news);
                continue;
            };
            let is_replaced = is_new_skip && !self.config.queries.bpref_skips;
            if is_replaced && let Some(replacement) = session.replacement() {
                self.preferences.ask(replacement.key(), replacement.query());
                teacher.ask(&[replacement.offer(&self.replay)])?;
            }
        }
        Ok(())
    }

    pub(super) fn has_budget(&self) -> bool {
        self.n_spent() < self.config.feedback.budget
    }

    /// Of the budget, with queries that may still be answered: what was not answered of a session
    /// that went on with fewer can be answered later.
    fn n_committed(&self) -> u32 {
        self.n_spent() + self.preferences.n_open()
    }

    /// Of the budget.
    pub(super) fn n_spent(&self) -> u32 {
        let n_skipped = if self.config.queries.bpref_skips {
            self.preferences.n_skipped()
        } else {
            0
        };
        self.preferences.n_preferred() + n_skipped
    }
}
