//! Algorithm 1: act, ask, learn. One loop for every method.

use std::collections::BTreeMap;
use std::sync::mpsc::{Receiver, TryRecvError};
use std::time::Duration;

use domain::environment::EnvSpec;
use domain::query::Query;
use domain::random::{Rng, Stream};
use domain::schedule::Every;
use domain::teacher::{Answered, Teacher};
use learn::replay::{BatchRule, Replay, ReplayMark};
use learn::reward::{Estimate, Labeled, RewardFit, SteeringConfig};
use serde::{Deserialize, Serialize};

use crate::config::{RunConfig, WhileWaiting};
use crate::folder::RunFolder;
use crate::lanes::Lanes;
use crate::learner::{Due, Learner};
use crate::message::{Activity, Command, Event, Finished, Refitted, SessionClosed};
use crate::meter::Meter;
use crate::method::Method;
use crate::preferences::Preferences;
use crate::session::Session;

mod asking;
mod disk;
mod error;
mod telling;

pub use error::RunError;

/// How long the loop rests when there is nothing to do but wait for people.
const REST: Duration = Duration::from_millis(20);

/// A run: an agent, its experience, and what is known of the answers.
pub struct Run {
    config: RunConfig,
    task: &'static sim::tasks::Task,
    spec: EnvSpec,
    method: Method,
    folder: RunFolder,
    lanes: Lanes,
    replay: Replay,
    /// What the checkpoints that are there say of the replay, by their step.
    marks: BTreeMap<u64, ReplayMark>,
    learner: Learner,
    preferences: Preferences,
    /// Answers to queries that are still to be asked: given before a checkpoint was lost with
    /// which the run had asked them. It goes the same way again and will.
    early: Vec<Answered>,
    session: Option<Session>,
    progress: Progress,
    meter: Meter,
    is_paused: bool,
    last_activity: Option<Activity>,
}

/// Counters that a checkpoint keeps.
#[derive(Debug, Clone, Copy, Default, PartialEq, Serialize, Deserialize)]
pub(crate) struct Progress {
    /// Environment steps taken.
    pub(crate) step: u64,
    n_sessions: u32,
    n_fits: u32,
    /// Step at which the last session was asked.
    #[serde(default)]
    asked_at: Option<u64>,
    /// Answers to queries of sessions that are over, since the last fit.
    #[serde(default)]
    n_late: u32,
    consumed_sequence: u64,
    last_evaluation: Option<(f64, f64)>,
    /// Step of the last evaluation.
    #[serde(default)]
    evaluated_at: Option<u64>,
    /// Whether its end was said.
    #[serde(default)]
    is_finished: bool,
}

/// How [`Run::drive`] ended.
#[derive(Debug, Clone, PartialEq)]
pub enum Outcome {
    /// All environment steps are taken.
    Finished(Finished),
    /// A command stopped it; it can be resumed.
    Stopped,
}

impl Run {
    /// The resolved settings.
    pub fn config(&self) -> &RunConfig {
        &self.config
    }

    /// Environment steps taken.
    pub fn step(&self) -> u64 {
        self.progress.step
    }

    /// Answers up to this sequence number have been taken in.
    pub fn consumed_sequence(&self) -> u64 {
        self.progress.consumed_sequence
    }

    /// Runs Algorithm 1 to the end, or until told to stop.
    ///
    /// # Errors
    /// [`RunError`]; the last checkpoint remains.
    pub fn drive(
        &mut self,
        teacher: &mut dyn Teacher,
        commands: &Receiver<Command>,
        events: &mut dyn FnMut(Event),
    ) -> Result<Outcome, RunError> {
        learn::device::init();
        self.offer_open_queries(teacher)?;
        if self.progress.step == 0 && self.progress.last_evaluation.is_none() {
            self.evaluate(events)?; // what learning is measured against
        }
        while !self.is_over() {
            if self.obey(commands) == Some(Command::Stop) {
                self.checkpoint_and_say(events)?;
                return Ok(Outcome::Stopped);
            }
            let total_steps = self.config.training.total_steps;
            self.learner
                .anneal(self.progress.step as f64 / total_steps as f64);
            self.take_answers(teacher)?;
            if self.session_is_complete() {
                self.learn_from_session(events)?;
            } else if self.late_answers_suffice() {
                self.learn_from_late_answers(events)?;
            } else if self.stands_still() {
                self.say_activity(events);
                self.meter.rest(REST);
            } else if self.asks_now() {
                self.ask(teacher, events)?;
            } else {
                self.say_activity(events);
                self.advance(events)?;
            }
        }
        self.finish(events)
    }

    fn is_over(&self) -> bool {
        self.progress.step >= self.config.training.total_steps && self.session.is_none()
    }

    fn obey(&mut self, commands: &Receiver<Command>) -> Option<Command> {
        loop {
            match commands.try_recv() {
                Ok(Command::Pause) => self.is_paused = true,
                Ok(Command::Resume) => self.is_paused = false,
                Ok(Command::Stop) => return Some(Command::Stop),
                Err(TryRecvError::Empty | TryRecvError::Disconnected) => return None,
            }
        }
    }

    fn session_is_complete(&self) -> bool {
        let sufficient = self.config.queries.sufficient_fraction;
        self.session
            .as_ref()
            .is_some_and(|s| s.is_complete(&self.preferences, sufficient))
    }

    fn stands_still(&self) -> bool {
        let has_steps_left = self.progress.step < self.config.training.total_steps;
        let waits = self.config.training.while_waiting == WhileWaiting::Pause || !has_steps_left;
        self.is_paused || (self.session.is_some() && waits)
    }

    /// Pairs that nobody is asked about, for methods that learn from them too: as many as belong to
    /// a session.
    ///
    /// * `draw` – number of the draw, for random numbers of its own
    fn unlabeled(&self, session: u32, draw: u64) -> Vec<Query> {
        let per_query = self.learner.unlabeled_per_query() as usize;
        let n = per_query * self.full_size(session) as usize;
        let mut rng = Rng::new(self.config.seed, Stream::Unlabeled, draw);
        self.pool().draw(&self.replay, n, &mut rng)
    }

    /// Fits the reward to the answers of a session, and all before, and relabels the replay.
    fn learn_from_session(&mut self, events: &mut dyn FnMut(Event)) -> Result<(), RunError> {
        let Some(session) = self.session.take() else {
            return Ok(());
        };
        let is_first = self.progress.n_fits == 0;
        let index = session.index();
        let fit = self.fit(&self.unlabeled(index, u64::from(index)));
        if is_first {
            self.end_exploration();
        }
        let closed = SessionClosed {
            session: session.index(),
            step: self.progress.step,
            labels: self.preferences.n_preferred(),
            epochs: fit.n_epochs,
            loss: f64::from(fit.loss),
            accuracy: f64::from(fit.accuracy),
            oracle_agreement: session.oracle_agreement(&self.preferences, &self.replay),
        };
        self.say(Event::SessionClosed(closed), events)
    }

    /// Whether answers that came after their session was over are to be learned from by themselves:
    /// no session is to come that takes them with it, and of those that may still come as large a
    /// share is there as lets a session go on.
    fn late_answers_suffice(&self) -> bool {
        if self.progress.n_late == 0 || self.session.is_some() || self.next_session_at().is_some() {
            return false; // the first alone is so at nearly every step
        }
        let n_late = f64::from(self.progress.n_late);
        let n_open = f64::from(self.preferences.n_open());
        n_late >= (n_late + n_open) * self.config.queries.sufficient_fraction
    }

    /// The same as after a session, of answers that came too late for the last one.
    fn learn_from_late_answers(&mut self, events: &mut dyn FnMut(Event)) -> Result<(), RunError> {
        let n_late = self.progress.n_late;
        let last = self.progress.n_sessions.saturating_sub(1);
        let draw = (1 << 32) + u64::from(self.progress.n_fits); // beyond those of sessions
        let fit = self.fit(&self.unlabeled(last, draw));
        let refitted = Refitted {
            step: self.progress.step,
            labels: self.preferences.n_preferred(),
            n_late,
            fit: self.progress.n_fits,
            epochs: fit.n_epochs,
            loss: f64::from(fit.loss),
            accuracy: f64::from(fit.accuracy),
        };
        self.say(Event::Refitted(refitted), events)
    }

    /// Fits the reward to all answers that are there and relabels the replay.
    fn fit(&mut self, unlabeled: &[Query]) -> RewardFit {
        let labeled = self.preferences.labeled(self.config.queries.train_on_equal);
        self.progress.n_fits += 1;
        self.progress.n_late = 0;
        let fit = self.learner.fit_reward(&self.replay, &labeled, unlabeled);
        self.learner.reward.relabel(&mut self.replay);
        fit
    }

    /// One control step in every environment, and the updates that are due beside it.
    fn advance(&mut self, events: &mut dyn FnMut(Event)) -> Result<(), RunError> {
        let before = self.progress.step;
        let now = before + self.lanes.len() as u64;
        let actions = self.actions(before);
        let mut due = self.due(before, now);
        let steering = self.steering(before);
        due.n_updates = due.n_updates.saturating_sub(u64::from(steering.is_some()));
        let observations = self.lanes.observations().to_vec();
        let has_reward = self.progress.n_fits > 0;
        let (mut updates, steps, rewards) = self.learner.work(&due, &self.replay, |reward| {
            let steps = self.lanes.step(&actions);
            let learned = if has_reward {
                reward.estimate(&observations, &actions)
            } else {
                Estimate::unknown(self.lanes.len())
            };
            (steps, learned)
        });
        let steps = steps?;
        self.lanes
            .store(&actions, &rewards, &steps, &mut self.replay);
        self.progress.step = now;
        if let Some((steering, latest)) = steering {
            let steered = self.learner.steer(&steering, &latest, &mut self.replay);
            updates.agent.push(steered);
        }
        self.meter.record(&updates);
        if self.method.sampler.is_none() && self.is_exploring(before) && !self.is_exploring(now) {
            self.end_exploration();
        }

        if Every(self.config.training.metrics_every).is_crossed(before, now) {
            let row = self
                .meter
                .row(now, self.preferences.n_preferred(), &self.replay);
            self.say(Event::Metrics(row), events)?;
        }
        if Every(self.config.evaluation.every).is_crossed(before, now) {
            self.evaluate(events)?;
        }
        if Every(self.config.training.checkpoint_every).is_crossed(before, now) {
            self.checkpoint_and_say(events)?;
        }
        Ok(())
    }

    fn actions(&self, step: u64) -> Vec<f32> {
        if step < self.config.training.seed_steps {
            let mut rng = Rng::new(self.config.seed, Stream::Action, step);
            let n = self.lanes.len() * self.spec.action_size;
            (0..n).map(|_| rng.uniform_in(-1.0, 1.0) as f32).collect()
        } else {
            self.learner.act_exploring(self.lanes.observations(), step)
        }
    }

    /// Whether the agent explores for the states' own sake at an environment step: before the
    /// first fit, or for a method that asks nothing, where it wants that, before the step at which
    /// others ask first.
    fn is_exploring(&self, step: u64) -> bool {
        if self.method.sampler.is_some() {
            self.progress.n_fits == 0
        } else {
            self.config.exploration.is_unsupervised && step < self.config.feedback.first_step
        }
    }

    fn end_exploration(&mut self) {
        let batches = self.batches(self.progress.step);
        self.learner
            .end_exploration(&self.config, &self.replay, &batches);
    }

    /// Which updates fall into the steps (before, now].
    fn due(&self, before: u64, now: u64) -> Due {
        let t = &self.config.training;
        let is_exploring = self.is_exploring(before);
        let has_target = !is_exploring || self.config.exploration.is_unsupervised;
        let owed =
            |step: u64| (step.saturating_sub(t.seed_steps) as f64 * t.updates_per_step) as u64;
        let can_learn = has_target && !self.replay.is_empty(); // as it is without seed steps
        Due {
            n_updates: if can_learn {
                owed(now) - owed(before)
            } else {
                0
            },
            is_exploring,
            batches: if is_exploring {
                BatchRule::default()
            } else {
                self.batches(before)
            },
            n_temporal: if self.method.learns_temporal_distance() && self.progress.n_fits > 0 {
                Every(self.config.temporal.update_every).n_crossed(before, now)
            } else {
                0
            },
        }
    }

    /// What SAC's batches are made of at an environment step.
    fn batches(&self, step: u64) -> BatchRule {
        let bonus = self.method.bonus.map_or(0.0, |bonus| bonus.weight(step));
        let episode_len = self.config.episode_len(&self.spec) as usize;
        let steps = |episodes| episodes * episode_len;
        BatchRule {
            reward: self.method.reward,
            disagreement_weight: bonus as f32,
            recent: self
                .method
                .recent_episodes
                .map(steps)
                .filter(|_| self.has_budget()),
            ends_at_time_limit: false,
        }
    }

    /// Whether the rewards are moved by the critics on the way on from `step`, how, and by which
    /// answers: after a session that is due at the same step, so that the newest answers move them
    /// and no fit follows at once. Where all were skipped there is nothing to move them by.
    fn steering(&self, step: u64) -> Option<(SteeringConfig, Vec<Labeled>)> {
        let earlier = step.saturating_sub(self.lanes.len() as u64);
        let steering = self.method.steering?;
        let is_due = Every(steering.every).is_crossed(earlier, step);
        if !is_due || self.progress.n_fits == 0 || !self.has_budget() {
            return None;
        }
        let latest = self.latest_answers();
        (!latest.is_empty()).then_some((steering, latest))
    }

    /// A session's worth of the newest answers.
    fn latest_answers(&self) -> Vec<Labeled> {
        let mut labeled = self.preferences.labeled(self.config.queries.train_on_equal);
        let n = self.full_size(self.progress.n_sessions.saturating_sub(1)) as usize;
        labeled.split_off(labeled.len().saturating_sub(n))
    }

    /// Queries of session `index`, whatever is left of the budget.
    fn full_size(&self, index: u32) -> u32 {
        let config = &self.config;
        config
            .feedback
            .full_size(index, config.training.total_steps)
    }
}

#[cfg(test)]
mod tests;
