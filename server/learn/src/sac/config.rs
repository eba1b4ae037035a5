//! Settings of the agent.

use serde::{Deserialize, Serialize};

use crate::net::NetShape;
use crate::precision::Precision;

/// Entropy that the released code wants of a policy, nats for each number of an action.
const RELEASED_ENTROPY: f64 = -1.0;

/// Settings of the agent. Defaults: STAIR's released settings for MetaWorld (which are BPref's).
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct SacConfig {
    /// Hidden layers of actor and critics.
    pub hidden: Vec<i64>,
    /// Transitions in an update, `B`.
    pub batch: usize,
    /// Adam's rate for the actor.
    pub actor_learning_rate: f64,
    /// Adam's rate for the critics.
    pub critic_learning_rate: f64,
    /// Adam's rate for log α.
    pub alpha_learning_rate: f64,
    /// γ.
    pub discount: f64,
    /// α at the start.
    ///
    /// Differs from the paper: its table says 0.2, the released code uses 0.1.
    pub initial_temperature: f64,
    /// τ: how far the target critics move towards the critics.
    ///
    /// Differs from the paper: its table says 0.01, the released code uses 0.005.
    pub critic_ema: f64,
    /// τ at the run's last step, to which it grows by equal factors; 0, as in the released code,
    /// keeps [`Self::critic_ema`].
    ///
    /// A state that follows itself can lose value only with a time constant of 1 / (τ (1 − γ))
    /// updates: slow targets let an agent hope and so explore, later they keep it where it is
    /// stuck. Rates that fall ([`Self::final_rate`]) let τ grow. No gain was seen on window-open's
    /// learned rewards.
    pub final_critic_ema: f64,
    /// Updates between two movements of the target critics.
    pub target_every: u64,
    /// How far the averaged actor, whose mean action is evaluated and kept, moves towards the
    /// actor at each update, [0, 1]; 0 takes the actor itself, as the released code does.
    ///
    /// High rates make the last few updates decide where a mean action lies; an average over
    /// some 1 / `actor_ema` updates lies where most of them agree.
    pub actor_ema: f64,
    /// Share of the learning rates that is left at the run's last step, (0, 1]: they fall in
    /// a straight line. 1, the released code's, keeps them.
    pub final_rate: f64,
    /// Entropy that the policy shall have at the run's first step, nats for each number of an
    /// action: below ln 2, that of even chance. −1 is the released code's.
    pub initial_entropy: f64,
    /// Entropy that the policy shall have at the run's last step, nats for each number of an
    /// action; it is led there from [`Self::initial_entropy`] in a straight line. −1, the released
    /// code's, stays.
    ///
    /// On a task reward success holds better with −3, and on go-fetch-return's learned one; on
    /// window-open's, which still moves, no gain was seen.
    pub final_entropy: f64,
    /// Whether the critics' targets hold α's bonus for chance, as SAC's and the released code's do.
    ///
    /// Without it chance still spreads each action, but no state is worth more for the chance that
    /// it allows: where actions do nothing, as beside a jammed window, that bonus costs nothing
    /// and could outweigh what the task pays elsewhere. No gain was seen on learned rewards.
    pub backup_entropy: bool,
    /// Whether the critics' hidden layers are normalised; the released code's are not. With it,
    /// higher learning rates hold.
    pub layer_norm: bool,
    /// `f32`, or `bf16` for faster and coarser updates.
    pub precision: Precision,
}

impl Default for SacConfig {
    fn default() -> Self {
        Self {
            hidden: vec![256; 3],
            batch: 512,
            actor_learning_rate: 3e-4,
            critic_learning_rate: 3e-4,
            alpha_learning_rate: 1e-4,
            discount: 0.99,
            initial_temperature: 0.1,
            critic_ema: 0.005,
            final_critic_ema: 0.0,
            target_every: 2,
            actor_ema: 0.0,
            final_rate: 1.0,
            initial_entropy: RELEASED_ENTROPY,
            final_entropy: RELEASED_ENTROPY,
            backup_entropy: true,
            layer_norm: false,
            precision: Precision::F32,
        }
    }
}

impl SacConfig {
    /// Actor and critics for states of `s` and actions of `a` numbers.
    pub(super) fn shapes(&self, s: i64, a: i64) -> (NetShape, NetShape) {
        let precision = self.precision;
        let actor = NetShape {
            precision,
            ..NetShape::new(1, s, &self.hidden, 2 * a)
        };
        let critic = NetShape {
            layer_norm: self.layer_norm,
            precision,
            ..NetShape::new(2, s + a, &self.hidden, 1)
        };
        (actor, critic)
    }

    /// Bytes that an agent and its updates hold.
    pub fn bytes(&self, observation_size: usize, action_size: usize) -> u64 {
        let (actor, critic) = self.shapes(observation_size as i64, action_size as i64);
        let target = 4 * critic.n_values() as u64;
        let passes = actor.pass_bytes(self.batch) + critic.pass_bytes(self.batch);
        actor.trained_bytes() + critic.trained_bytes() + target + passes
    }
}
