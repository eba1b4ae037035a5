//! What a run's arithmetic comes to, and about how long this machine takes for it.

use std::sync::OnceLock;
use std::time::Duration;

use domain::environment::EnvSpec;
use domain::schedule::FeedbackSchedule;
use learn::reward::RewardLearner;

use crate::config::RunConfig;
use crate::method;

/// Share of the rate of plain products that whole updates reach (see learn's PERFORMANCE.md:
/// 0.61 to 0.90), less what a run does beside them.
const SHARE: f64 = 0.55;
/// Acting, physics and storing, seconds a control step.
const STEP_S: f64 = 0.000_15;

/// About how long the agent itself takes on this machine, without waiting for answers.
pub fn time_here(config: &RunConfig, spec: &EnvSpec) -> Duration {
    let arithmetic = gigaflop(config, spec) / (SHARE * gigaflop_per_second());
    Duration::from_secs_f64(arithmetic + STEP_S * config.training.total_steps as f64)
}

/// About how long a run takes where each core has a run of its own: nothing happens beside
/// anything, so the temporal distance counts, and so do the trials.
pub fn core_time_here(config: &RunConfig, spec: &EnvSpec) -> Duration {
    let trial = f64::from(config.evaluation.episodes) * f64::from(spec.episode_len);
    let periodic = config
        .training
        .total_steps
        .checked_div(config.evaluation.every);
    let trials = 1 + periodic.unwrap_or(0);
    let temporal = temporal_gigaflop(config, spec) / (SHARE * gigaflop_per_second());
    let beside = temporal + STEP_S * trial * trials as f64;
    time_here(config, spec) + Duration::from_secs_f64(beside)
}

/// How long runs take on some cores, each run on one, started in this order.
pub fn on_cores(runs: impl IntoIterator<Item = Duration>, n_cores: usize) -> Duration {
    let mut busy_until = vec![Duration::ZERO; n_cores.max(1)];
    for run in runs {
        if let Some(earliest) = busy_until.iter_mut().min() {
            *earliest += run;
        }
    }
    busy_until.into_iter().max().unwrap_or_default()
}

/// Matrix products of all steps of the temporal distance, there and twice as much back; each
/// pair has two states.
fn temporal_gigaflop(config: &RunConfig, spec: &EnvSpec) -> f64 {
    let (t, first) = (&config.temporal, config.feedback.first_step);
    let learns = method::build(config).is_ok_and(|method| method.learns_temporal_distance());
    if !learns {
        return 0.0;
    }
    let n_steps = config.training.total_steps.saturating_sub(first) / t.update_every.max(1);
    let weights = weights(spec.observation_size, &t.hidden, t.latent as usize);
    n_steps as f64 * 2.0 * 3.0 * 2.0 * t.batch as f64 * weights / 1e9
}

/// This machine's rate of plain products, measured once (a few hundredths of a second).
pub fn gigaflop_per_second() -> f64 {
    static RATE: OnceLock<f64> = OnceLock::new();
    *RATE.get_or_init(learn::device::gigaflop_per_second)
}

/// Matrix products of a whole run with all its answers, 10⁹ multiplications and additions.
///
/// The temporal distance is left out: it runs beside the agent's updates and is the smaller.
pub fn gigaflop(config: &RunConfig, spec: &EnvSpec) -> f64 {
    let t = &config.training;
    let updates = t.total_steps.saturating_sub(t.seed_steps) as f64 * t.updates_per_step;
    let method = method::build(config).ok().filter(|m| m.sampler.is_some());
    let fits = method.map_or(0.0, |method| {
        fits(config, spec, &*(method.reward_learner)(config))
    });
    (updates * sac_update(config, spec) + fits) / 1e9
}

/// Of one update of critics, actor and target.
///
/// With c and p weights in a critic and in the actor, each row takes 2c for the targets' values,
/// 6c for the critics' way there and back, 4c for the actor's way through them, and 4p for the
/// actor (next actions, actions, way back), twice two operations each.
fn sac_update(config: &RunConfig, spec: &EnvSpec) -> f64 {
    let (s, a) = (spec.observation_size, spec.action_size);
    let critic = weights(s + a, &config.agent.hidden, 1);
    let actor = weights(s, &config.agent.hidden, 2 * a);
    2.0 * config.agent.batch as f64 * (12.0 * critic + 4.0 * actor)
}

/// Of the ensemble's warm start, of all its fits, each to all answers so far, and of relabelling after
/// each.
fn fits(config: &RunConfig, spec: &EnvSpec, learner: &dyn RewardLearner) -> f64 {
    let (reward, t) = (&config.reward, &config.training);
    let row = 2.0
        * reward.members as f64
        * weights(spec.observation_size + spec.action_size, &reward.hidden, 1);
    let rows_per_label = 2.0 * f64::from(config.segment_len(spec));
    let feedback: &FeedbackSchedule = &config.feedback;
    let n_exploring = feedback.first_step.saturating_sub(t.seed_steps) as f64 * t.updates_per_step;
    let warm_rows = n_exploring * f64::from(learner.warm_start_steps()) * config.agent.batch as f64;
    let mut total = 3.0 * row * warm_rows;
    let mut labels = 0;
    for (step, size) in feedback.sessions(t.total_steps) {
        labels += size;
        let ways = learner.ways_through(reward.max_epochs);
        total += row * (ways * rows_per_label * f64::from(labels) + step as f64);
    }
    total
}

/// Weights of a perceptron without its biases.
fn weights(n_in: usize, hidden: &[i64], n_out: usize) -> f64 {
    let mut sizes = vec![n_in as f64];
    sizes.extend(hidden.iter().map(|&n| n as f64));
    sizes.push(n_out as f64);
    sizes.windows(2).map(|pair| pair[0] * pair[1]).sum()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::config::Layers;

    fn resolved(method: &str, preset: &str) -> (RunConfig, EnvSpec) {
        let layers = Layers {
            task: Some("window-open".into()),
            method: Some(method.into()),
            presets: (!preset.is_empty())
                .then(|| preset.to_owned())
                .into_iter()
                .collect(),
            ..Layers::default()
        };
        let config = RunConfig::resolve(&layers).expect("a preset");
        let spec = (crate::config::find_task(&config.task).expect("a task").spec)();
        (config, spec)
    }

    #[test]
    fn an_update_of_the_released_sizes_takes_the_known_2_3_gigaflop() {
        let (config, spec) = resolved("sac", "");
        let gigaflop = sac_update(&config, &spec) / 1e9;
        assert!((gigaflop - 2.30).abs() < 0.05, "{gigaflop}");
    }

    #[test]
    fn a_method_that_passes_over_more_pairs_or_warms_up_costs_more() {
        let cost = |method| {
            let (config, spec) = resolved(method, "");
            gigaflop(&config, &spec)
        };
        assert!(
            cost("surf") > 1.2 * cost("pebble"),
            "20 · 19 ways instead of 10 · 3"
        );
        assert!(cost("rime") > cost("pebble"));
        assert!(cost("sac") < cost("pebble"));
    }

    #[test]
    fn a_step_of_the_temporal_distance_is_the_known_0_9_gigaflop() {
        let (mut config, spec) = resolved("stair", "");
        config.training.total_steps = config.feedback.first_step + 1;
        let gigaflop = temporal_gigaflop(&config, &spec);
        assert!((gigaflop - 0.87).abs() < 0.1, "{gigaflop}");
        config.method = "pebble".into();
        assert!(temporal_gigaflop(&config, &spec).abs() < 1e-12);
    }

    #[test]
    fn a_run_waits_for_the_core_that_is_free_first() {
        let runs = [5, 1, 1, 1].map(Duration::from_secs);
        assert_eq!(on_cores(runs, 2), Duration::from_secs(5));
        assert_eq!(on_cores(runs, 1), Duration::from_secs(8));
        assert_eq!(on_cores([], 2), Duration::ZERO);
    }

    #[test]
    fn methods_that_ask_cost_more_and_quick_presets_less() {
        let total = |method, preset| {
            let (config, spec) = resolved(method, preset);
            gigaflop(&config, &spec)
        };
        assert!(total("stair", "") > 1.1 * total("sac", ""));
        assert!(total("stair", "quick") < 0.2 * total("stair", ""));
    }
}
