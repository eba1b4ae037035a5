//! What a run says of itself: evaluations, demonstrations, its phase, its end.

use super::{Outcome, Run, RunError};
use crate::evaluate::{Trial, correlation, evaluate};
use crate::message::{Activity, Demonstration, Evaluation, Event, Finished, Phase};

/// Held-out episodes are the same for every run, so that runs can be compared.
const HELD_OUT: u64 = 0;

impl Run {
    pub(super) fn evaluate(&mut self, events: &mut dyn FnMut(Event)) -> Result<(), RunError> {
        let trial = self.trial(self.config.evaluation.episodes)?;
        self.progress.last_evaluation = Some((trial.success_rate(), trial.return_mean()));
        self.progress.evaluated_at = Some(self.progress.step);
        let event = Event::Evaluation(Evaluation {
            step: self.progress.step,
            labels: self.preferences.n_preferred(),
            episodes: self.config.evaluation.episodes,
            success_rate: trial.success_rate(),
            return_mean: trial.return_mean(),
            return_std: trial.return_std(),
            reward_correlation: self.reward_correlation(&trial),
            returns: trial.returns,
        });
        self.say(event, events)
    }

    pub(super) fn trial(&self, n_episodes: u32) -> Result<Trial, RunError> {
        let mut policy = |observations: &[f32], _: u32| self.learner.act_mean(observations);
        Ok(evaluate(self.task, n_episodes, HELD_OUT, &mut policy)?)
    }

    pub(super) fn reward_correlation(&self, trial: &Trial) -> Option<f64> {
        if self.progress.n_fits == 0 {
            return None;
        }
        let learned = self
            .learner
            .reward
            .predict(&trial.kept.observations, &trial.kept.actions);
        let learned: Vec<f64> = learned.into_iter().map(f64::from).collect();
        correlation(&learned, &trial.kept.task_rewards)
    }

    pub(super) fn demonstrate(
        &mut self,
        session: Option<u32>,
        events: &mut dyn FnMut(Event),
    ) -> Result<(), RunError> {
        let trial = self.trial(1)?;
        events(Event::Demonstration(Demonstration {
            session,
            step: self.progress.step,
            success: trial.success_rate() > 0.0,
            task_return: trial.return_mean(),
            poses: trial.poses,
        }));
        Ok(())
    }

    pub(super) fn finish(&mut self, events: &mut dyn FnMut(Event)) -> Result<Outcome, RunError> {
        if self.progress.evaluated_at != Some(self.progress.step) {
            self.evaluate(events)?;
        }
        let is_said = std::mem::replace(&mut self.progress.is_finished, true);
        if !is_said {
            self.demonstrate(None, events)?;
        }
        let (success_rate, return_mean) = self.progress.last_evaluation.unwrap_or_default();
        let finished = Finished {
            step: self.progress.step,
            labels: self.preferences.n_preferred(),
            success_rate,
            return_mean,
            weights: self.learner.fingerprint(),
        };
        if !is_said {
            self.leave_policy()?;
            self.say(Event::Finished(finished.clone()), events)?;
            self.checkpoint_and_say(events)?;
        }
        Ok(Outcome::Finished(finished))
    }

    pub(super) fn say(
        &mut self,
        event: Event,
        events: &mut dyn FnMut(Event),
    ) -> Result<(), RunError> {
        self.folder.record(&event)?;
        events(event);
        Ok(())
    }

    pub(super) fn say_activity(&mut self, events: &mut dyn FnMut(Event)) {
        let activity = if self.is_paused {
            Activity::Paused
        } else if self.session.is_some() && self.stands_still() {
            Activity::Asking
        } else if self.progress.n_fits == 0 && self.method.sampler.is_some() {
            Activity::Exploring
        } else {
            Activity::Learning
        };
        if !self
            .meter
            .is_time_to_say(self.last_activity != Some(activity))
        {
            return;
        }
        self.last_activity = Some(activity);
        let planned = |n: u32| {
            n.checked_sub(1)
                .map(|last| self.config.feedback.step_of(last))
        };
        let began_at = self.progress.asked_at;
        let from_step = began_at.or_else(|| planned(self.progress.n_sessions)); // older checkpoints
        let until = self
            .next_session_at()
            .unwrap_or(self.config.training.total_steps);
        events(Event::Phase(Phase {
            activity,
            step: self.progress.step,
            total_steps: self.config.training.total_steps,
            from_step: from_step.unwrap_or(0),
            until_step: matches!(activity, Activity::Exploring | Activity::Learning)
                .then_some(until),
            session_answers: self.session.as_ref().map(|s| s.progress(&self.preferences)),
        }));
    }
}
