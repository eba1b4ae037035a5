//! Ranges of the settings.

use std::ops::RangeBounds;

use domain::sampler::{SAMPLERS, sampler};

use super::{ConfigError, RunConfig, find_task, unknown};
use crate::method;

/// Pairs that a session may draw.
const MOST_PAIRS: u64 = 10_000_000;

/// Says what a value must be where it is not so.
fn require(
    holds: bool,
    key: &'static str,
    value: &dyn ToString,
    must_be: &'static str,
) -> Result<(), ConfigError> {
    if holds {
        return Ok(());
    }
    Err(ConfigError::OutOfRange {
        key,
        value: value.to_string(),
        must_be,
    })
}

/// Values of one kind; the first one out of the range is refused.
fn all_within<T: PartialOrd + ToString>(
    values: impl IntoIterator<Item = (&'static str, T)>,
    range: &impl RangeBounds<T>,
    must_be: &'static str,
) -> Result<(), ConfigError> {
    for (key, value) in values {
        require(range.contains(&value), key, &value, must_be)?;
    }
    Ok(())
}

fn not_zero(values: impl IntoIterator<Item = (&'static str, u64)>) -> Result<(), ConfigError> {
    all_within(values, &(1..), "at least 1")
}

/// Finite and above 0.
fn positive(values: impl IntoIterator<Item = (&'static str, f64)>) -> Result<(), ConfigError> {
    all_within(values, &(f64::MIN_POSITIVE..=f64::MAX), "a number above 0")
}

fn not_negative(values: impl IntoIterator<Item = (&'static str, f64)>) -> Result<(), ConfigError> {
    all_within(values, &(0.0..=f64::MAX), "a number from 0 on")
}

/// In [0, 1].
fn shares(values: impl IntoIterator<Item = (&'static str, f64)>) -> Result<(), ConfigError> {
    all_within(values, &(0.0..=1.0), "from 0 to 1")
}

/// In (0, 1].
fn shares_above_0(
    values: impl IntoIterator<Item = (&'static str, f64)>,
) -> Result<(), ConfigError> {
    all_within(values, &(f64::MIN_POSITIVE..=1.0), "above 0, at most 1")
}

/// In [0, 1): such a number's powers die out.
fn discounts(values: impl IntoIterator<Item = (&'static str, f64)>) -> Result<(), ConfigError> {
    all_within(values, &(0.0..1.0), "from 0 to below 1")
}

impl RunConfig {
    /// Whether a run can be made of these settings.
    ///
    /// # Errors
    /// The first value that is outside its range.
    pub(super) fn check(&self) -> Result<(), ConfigError> {
        find_task(&self.task)?;
        method::find(&self.method)?;
        let n_envs = [("environment.n_envs", self.environment.n_envs)];
        all_within(n_envs, &(1..=256), "from 1 to 256")?;
        self.check_training()?;
        self.check_queries()?;
        self.check_agent()?;
        self.check_reward()?;
        self.check_temporal()?;
        self.check_teacher()?;
        self.check_methods()?;
        self.check_sizes()
    }

    /// Whether what the budget pays for is asked before the run ends.
    ///
    /// No part of [`RunConfig::check`]: a tree that a run saved is read whatever it asked.
    ///
    /// # Errors
    /// A first session that the run does not come to.
    pub(super) fn check_asks(&self) -> Result<(), ConfigError> {
        let (first_step, total_steps) = (self.feedback.first_step, self.training.total_steps);
        let asks = self.feedback.budget > 0 && method::build(self)?.sampler.is_some();
        require(
            !asks || first_step < total_steps,
            "feedback.first_step",
            &first_step,
            "below training.total_steps, or nothing is ever asked; where that is meant, \
             feedback.budget is 0",
        )
    }

    fn check_training(&self) -> Result<(), ConfigError> {
        let (t, f) = (&self.training, &self.feedback);
        let updates = [("training.updates_per_step", t.updates_per_step)];
        all_within(updates, &(0.0..=64.0), "from 0 to 64")?;
        let scale = f64::from(t.task_reward_scale);
        positive([("training.task_reward_scale", scale)])?;
        not_zero([
            ("training.total_steps", t.total_steps),
            ("feedback.every", f.every),
        ])?;
        let trials = [("evaluation.episodes", self.evaluation.episodes)];
        all_within(trials, &(1..=10_000), "from 1 to 10000")?;
        let neighbours = [("exploration.neighbours", self.exploration.neighbours)];
        all_within(neighbours, &(1..=1_000), "from 1 to 1000")?;
        require(
            f.first_step > t.seed_steps,
            "feedback.first_step",
            &f.first_step,
            "above training.seed_steps",
        )
    }

    fn check_queries(&self) -> Result<(), ConfigError> {
        let q = &self.queries;
        let per_session = self.feedback.queries_per_session;
        not_zero([
            ("feedback.queries_per_session", u64::from(per_session)),
            (
                "queries.candidates_per_query",
                u64::from(q.candidates_per_query),
            ),
            (
                "queries.near_policy_episodes",
                q.near_policy_episodes as u64,
            ),
            ("queries.newest_episodes", q.newest_episodes as u64),
        ])?;
        let session = u64::from(per_session.min(self.feedback.budget));
        for (key, per_query) in [
            ("queries.candidates_per_query", q.candidates_per_query),
            (
                "semi_supervised.unlabeled_per_query",
                self.semi_supervised.unlabeled_per_query,
            ),
        ] {
            require(
                session * u64::from(per_query) <= MOST_PAIRS,
                key,
                &per_query,
                "so few that a session has at most 10000000 of them",
            )?;
        }
        shares([("queries.same_stage_fraction", q.same_stage_fraction)])?;
        shares_above_0([("queries.sufficient_fraction", q.sufficient_fraction)])?;
        for (key, weight) in [
            ("queries.coefficients.stage", q.coefficients.stage),
            ("queries.coefficients.state", q.coefficients.state),
        ] {
            require(weight.is_finite(), key, &weight, "a number")?;
        }
        if !q.sampler.is_empty() && sampler(&q.sampler, &q.sampler_settings()).is_none() {
            let known = SAMPLERS.iter().map(|(name, _)| *name);
            return Err(unknown("sampler", &q.sampler, known));
        }
        let spec = (find_task(&self.task)?.spec)();
        require(
            !spec.stages.is_empty() || !method::build(self)?.needs_true_stages(),
            "method",
            &self.method,
            "one that needs no true stages: this task does not know its own",
        )?;
        require(
            q.segment_len <= spec.episode_len,
            "queries.segment_len",
            &q.segment_len,
            "at most an episode's length",
        )?;
        // Whole episodes, of which one alone makes no pair.
        let is_whole = self.segment_len(&spec) == self.episode_len(&spec);
        for (key, n) in [
            ("queries.newest_episodes", q.newest_episodes),
            ("queries.near_policy_episodes", q.near_policy_episodes),
        ] {
            let must_be = "at least 2 where segments are whole episodes";
            require(!is_whole || n > 1, key, &n, must_be)?;
        }
        let episode_len = self.environment.episode_len;
        require(
            episode_len == 0 || (self.segment_len(&spec)..=spec.episode_len).contains(&episode_len),
            "environment.episode_len",
            &episode_len,
            "0 or from a segment's length to that of the task's episodes",
        )
    }

    fn check_agent(&self) -> Result<(), ConfigError> {
        let agent = &self.agent;
        positive([
            ("agent.actor_learning_rate", agent.actor_learning_rate),
            ("agent.critic_learning_rate", agent.critic_learning_rate),
            ("agent.initial_temperature", agent.initial_temperature),
        ])?;
        not_negative([("agent.alpha_learning_rate", agent.alpha_learning_rate)])?;
        discounts([("agent.discount", agent.discount)])?;
        shares([
            ("agent.actor_ema", agent.actor_ema),
            ("agent.final_critic_ema", agent.final_critic_ema),
        ])?;
        shares_above_0([
            ("agent.critic_ema", agent.critic_ema),
            ("agent.final_rate", agent.final_rate),
        ])?;
        not_zero([("agent.target_every", agent.target_every)])?;
        require(
            agent.initial_entropy.is_finite() && agent.initial_entropy < std::f64::consts::LN_2,
            "agent.initial_entropy",
            &agent.initial_entropy,
            "below ln 2, that of even chance",
        )?;
        require(
            agent.final_entropy.is_finite() && agent.final_entropy <= 0.0,
            "agent.final_entropy",
            &agent.final_entropy,
            "at most 0",
        )
    }

    fn check_reward(&self) -> Result<(), ConfigError> {
        let r = &self.reward;
        all_within([("reward.members", r.members)], &(1..=64), "from 1 to 64")?;
        positive([
            ("reward.learning_rate", r.learning_rate),
            ("reward.temperature", r.temperature),
        ])?;
        shares_above_0([("reward.final_rate", r.final_rate)])?;
        not_zero([("reward.max_epochs", u64::from(r.max_epochs))])?;
        not_negative([("reward.normalized_std", r.normalized_std)])?;
        shares([("reward.stop_accuracy", f64::from(r.stop_accuracy))])?;
        let margin = [("reward.label_margin", r.label_margin)];
        all_within(margin, &(0.0..0.5), "from 0 to below 0.5")
    }

    fn check_temporal(&self) -> Result<(), ConfigError> {
        let t = &self.temporal;
        require(
            (2..=65_536).contains(&t.latent) && t.latent % 2 == 0,
            "temporal.latent",
            &t.latent,
            "even, from 2 to 65536: half of it is symmetric",
        )?;
        not_zero([
            ("temporal.block_episodes", t.block_episodes as u64),
            ("temporal.update_every", t.update_every),
        ])?;
        positive([
            ("temporal.learning_rate", t.learning_rate),
            ("temporal.max_gradient_norm", t.max_gradient_norm),
        ])?;
        discounts([("temporal.discount", t.discount)])
    }

    /// Of networks and of what they are given at once.
    fn check_sizes(&self) -> Result<(), ConfigError> {
        for (key, sizes) in [
            ("agent.hidden", &self.agent.hidden),
            ("reward.hidden", &self.reward.hidden),
            ("temporal.hidden", &self.temporal.hidden),
        ] {
            let is_right = |n: &i64| (1..=65_536).contains(n);
            let must_be = "at most 16 layers of 1 to 65536";
            let holds = sizes.len() <= 16 && sizes.iter().all(is_right);
            require(holds, key, &format!("{sizes:?}"), must_be)?;
        }
        let batches = [
            ("agent.batch", self.agent.batch),
            ("reward.batch", self.reward.batch),
            ("temporal.batch", self.temporal.batch),
        ];
        all_within(batches, &(1..=1_000_000), "from 1 to 1000000")
    }

    /// What single methods read.
    fn check_methods(&self) -> Result<(), ConfigError> {
        let (b, d, s) = (&self.bonus, &self.denoising, &self.semi_supervised);
        discounts([("bonus.decay", b.decay)])?;
        let flip = [("denoising.flip_below", d.flip_below)];
        all_within(flip, &(1e-12..0.5), "above 0, below 0.5")?;
        let reach = [
            ("semi_supervised.margin", s.margin),
            ("semi_supervised.crop_spread", s.crop_spread),
        ];
        all_within(reach, &(0..=1_000_000), "at most 1000000")?;
        let ratio = [("semi_supervised.batch_ratio", s.batch_ratio)];
        all_within(ratio, &(0..=1_000), "at most 1000")?;
        let certainty = [("semi_supervised.certainty", s.certainty)];
        all_within(certainty, &(0.5..1.0), "from 0.5 to below 1")?;
        not_negative([
            ("bonus.initial", b.initial),
            ("steering.weight", self.steering.weight),
            ("denoising.slack", d.slack),
            ("denoising.doubt", d.doubt),
            ("denoising.least_doubt", d.least_doubt),
            ("semi_supervised.weight", s.weight),
        ])?;
        not_zero([
            ("semi_supervised.passes", u64::from(s.passes)),
            ("steering.every", self.steering.every),
        ])
    }

    fn check_teacher(&self) -> Result<(), ConfigError> {
        let t = &self.teacher;
        shares([
            ("teacher.mistake", t.mistake),
            ("teacher.inconsistent_mistake", t.inconsistent_mistake),
            ("teacher.equal", t.equal),
            ("teacher.skip", t.skip),
        ])?;
        shares_above_0([("teacher.discount", t.discount)])?;
        positive([("teacher.rationality", t.rationality)])
    }
}
