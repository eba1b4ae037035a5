//! Ranges of the settings.

use domain::sampler::{SAMPLERS, sampler};

use super::{ConfigError, RunConfig, find_task, unknown};
use crate::method;

/// A value that is not what it must be.
fn out(key: &'static str, value: &dyn ToString, must_be: &'static str) -> Result<(), ConfigError> {
    Err(ConfigError::OutOfRange {
        key,
        value: value.to_string(),
        must_be,
    })
}

impl RunConfig {
    /// Whether a run can be made of these settings.
    ///
    /// # Errors
    /// The first value that is outside its range.
    pub(super) fn check(&self) -> Result<(), ConfigError> {
        let task = find_task(&self.task)?;
        method::find(&self.method)?;
        let (t, q, f) = (&self.training, &self.queries, &self.feedback);
        if !(1..=256).contains(&self.environment.n_envs) {
            return out(
                "environment.n_envs",
                &self.environment.n_envs,
                "from 1 to 256",
            );
        }
        if !(t.updates_per_step >= 0.0 && t.updates_per_step <= 64.0) {
            return out(
                "training.updates_per_step",
                &t.updates_per_step,
                "from 0 to 64",
            );
        }
        if !(t.task_reward_scale > 0.0 && t.task_reward_scale.is_finite()) {
            return out(
                "training.task_reward_scale",
                &t.task_reward_scale,
                "above 0",
            );
        }
        if t.total_steps == 0 {
            return out("training.total_steps", &0, "at least 1");
        }
        if f.first_step <= t.seed_steps {
            return out(
                "feedback.first_step",
                &f.first_step,
                "above training.seed_steps",
            );
        }
        if f.queries_per_session == 0 {
            return out("feedback.queries_per_session", &0, "at least 1");
        }
        if f.every == 0 {
            return out("feedback.every", &0, "at least 1 step");
        }
        if !(0.0..=1.0).contains(&q.same_stage_fraction) {
            return out(
                "queries.same_stage_fraction",
                &q.same_stage_fraction,
                "from 0 to 1",
            );
        }
        if !(q.sufficient_fraction > 0.0 && q.sufficient_fraction <= 1.0) {
            return out(
                "queries.sufficient_fraction",
                &q.sufficient_fraction,
                "above 0, at most 1",
            );
        }
        if q.candidates_per_query == 0 {
            return out("queries.candidates_per_query", &0, "at least 1");
        }
        if q.near_policy_episodes == 0 {
            return out("queries.near_policy_episodes", &0, "at least 1");
        }
        if !q.sampler.is_empty() && sampler(&q.sampler, &q.sampler_settings()).is_none() {
            let known = SAMPLERS.iter().map(|(name, _)| *name);
            return Err(unknown("sampler", &q.sampler, known));
        }
        self.check_agent()?;
        self.check_teacher()?;
        self.check_methods()?;
        if q.newest_episodes == 0 {
            return out("queries.newest_episodes", &0, "at least 1");
        }
        if self.evaluation.episodes == 0 {
            return out("evaluation.episodes", &0, "at least 1");
        }
        if q.segment_len > (task.spec)().episode_len {
            return out(
                "queries.segment_len",
                &q.segment_len,
                "at most an episode's length",
            );
        }
        self.check_sizes()
    }

    fn check_agent(&self) -> Result<(), ConfigError> {
        let agent = &self.agent;
        if !(0.0..=1.0).contains(&agent.actor_ema) {
            return out("agent.actor_ema", &agent.actor_ema, "from 0 to 1");
        }
        if !(agent.final_rate > 0.0 && agent.final_rate <= 1.0) {
            let must_be = "above 0, at most 1";
            return out("agent.final_rate", &agent.final_rate, must_be);
        }
        if !agent.final_entropy.is_finite() || agent.final_entropy > 0.0 {
            return out("agent.final_entropy", &agent.final_entropy, "at most 0");
        }
        Ok(())
    }

    /// Of networks and of what they are given at once.
    fn check_sizes(&self) -> Result<(), ConfigError> {
        let sizes = [
            ("agent.hidden", &self.agent.hidden),
            ("reward.hidden", &self.reward.hidden),
            ("temporal.hidden", &self.temporal.hidden),
        ];
        for (key, sizes) in sizes {
            if sizes.len() > 16 || sizes.iter().any(|n| !(1..=65_536).contains(n)) {
                let must_be = "at most 16 layers of 1 to 65536";
                return out(key, &format!("{sizes:?}"), must_be);
            }
        }
        let batches = [
            ("agent.batch", self.agent.batch),
            ("reward.batch", self.reward.batch),
            ("temporal.batch", self.temporal.batch),
        ];
        for (key, batch) in batches {
            if !(1..=1_000_000).contains(&batch) {
                return out(key, &batch, "from 1 to 1000000");
            }
        }
        let std = self.reward.normalized_std;
        if !(std >= 0.0 && std.is_finite()) {
            return out("reward.normalized_std", &std, "a number from 0 on");
        }
        let temperature = self.reward.temperature;
        if !(temperature > 0.0 && temperature.is_finite()) {
            return out("reward.temperature", &temperature, "a number above 0");
        }
        if !(1..=64).contains(&self.reward.members) {
            return out("reward.members", &self.reward.members, "from 1 to 64");
        }
        if !(1..=65_536).contains(&self.temporal.latent) {
            return out("temporal.latent", &self.temporal.latent, "from 1 to 65536");
        }
        Ok(())
    }

    /// What single methods read.
    fn check_methods(&self) -> Result<(), ConfigError> {
        let (b, d, s) = (&self.bonus, &self.denoising, &self.semi_supervised);
        let shares = [
            ("bonus.decay", b.decay, 0.0..1.0),
            ("denoising.flip_below", d.flip_below, 1e-12..0.5),
            ("semi_supervised.certainty", s.certainty, 0.5..1.0),
        ];
        for (key, value, range) in shares {
            if !range.contains(&value) {
                let must_be = "a share: bonus.decay in [0, 1), flip_below in (0, 0.5), \
                               certainty in [0.5, 1)";
                return out(key, &value, must_be);
            }
        }
        let weights = [
            ("bonus.initial", b.initial),
            ("steering.weight", self.steering.weight),
            ("denoising.slack", d.slack),
            ("denoising.doubt", d.doubt),
            ("denoising.least_doubt", d.least_doubt),
            ("semi_supervised.weight", s.weight),
        ];
        for (key, value) in weights {
            if !(value >= 0.0 && value.is_finite()) {
                return out(key, &value, "a number from 0 on");
            }
        }
        if s.passes == 0 {
            return out("semi_supervised.passes", &0, "at least 1");
        }
        Ok(())
    }

    fn check_teacher(&self) -> Result<(), ConfigError> {
        let t = &self.teacher;
        let shares = [
            ("teacher.mistake", t.mistake),
            ("teacher.inconsistent_mistake", t.inconsistent_mistake),
            ("teacher.equal", t.equal),
            ("teacher.skip", t.skip),
        ];
        for (key, value) in shares {
            if !(0.0..=1.0).contains(&value) {
                return out(key, &value, "from 0 to 1");
            }
        }
        if !(t.discount > 0.0 && t.discount <= 1.0) {
            return out("teacher.discount", &t.discount, "above 0, at most 1");
        }
        if !(t.rationality > 0.0 && t.rationality.is_finite()) {
            return out("teacher.rationality", &t.rationality, "a number above 0");
        }
        Ok(())
    }
}
