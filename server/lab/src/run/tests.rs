//! What a method's recipe makes of a run, by looking into one.

use std::path::PathBuf;
use std::sync::atomic::{AtomicU32, Ordering};
use std::sync::mpsc::channel;

use domain::answer::Preference;
use domain::query::OfferedQuery;
use domain::teacher::{Judge, Oracle, Scripted};
use learn::exploration::Novelty;

use super::*;
use crate::config::Layers;

/// For a name of its own for each folder: tests run side by side.
static N_FOLDERS: AtomicU32 = AtomicU32::new(0);

/// A run of the small task with its folder, which goes with it.
struct Trained {
    run: Run,
    folder: PathBuf,
}

impl Trained {
    /// To its end: 3 sessions of 4 at steps 300, 450 and 600.
    fn new(method: &str, more: &[&str]) -> Self {
        Self::taught_by(Box::new(Oracle), method, more)
    }

    fn taught_by(judge: Box<dyn Judge>, method: &str, more: &[&str]) -> Self {
        let settings = [
            "training.total_steps=700",
            "training.seed_steps=100",
            "training.updates_after_reset=2",
            "feedback.first_step=300",
            "feedback.every=150",
            "feedback.queries_per_session=4",
            "feedback.budget=12",
            "evaluation.episodes=1",
            "agent.hidden=[16]",
            "agent.batch=16",
            "reward.hidden=[16]",
        ];
        let overrides = settings.iter().chain(more);
        let config = RunConfig::resolve(&Layers {
            task: Some("go-fetch-return".into()),
            method: Some(method.into()),
            overrides: overrides.map(ToString::to_string).collect(),
            ..Layers::default()
        });
        let number = N_FOLDERS.fetch_add(1, Ordering::Relaxed);
        let name = format!("stair-run-{method}-{number}-{}", std::process::id());
        let folder = std::env::temp_dir().join(name);
        let _ = std::fs::remove_dir_all(&folder); // an earlier test run may have been killed
        let mut run = Run::start(config.expect("settings"), &folder).expect("a run");
        let (_commands, receiver) = channel();
        let mut teacher = Scripted::new(judge, 0);
        let outcome = run.drive(&mut teacher, &receiver, &mut |_| {});
        assert!(matches!(outcome, Ok(Outcome::Finished(_))), "{outcome:?}");
        Self { run, folder }
    }
}

impl Drop for Trained {
    fn drop(&mut self) {
        let _ = std::fs::remove_dir_all(&self.folder); // best effort: it is a temporary folder
    }
}

#[test]
fn a_run_without_random_steps_learns_from_its_first_transition_on() {
    let trained = Trained::new("sac", &["training.seed_steps=0", "training.total_steps=20"]);
    assert_eq!(trained.run.step(), 20);
}

#[test]
fn sac_explores_first_where_it_is_told_to() {
    let resets = |more: &[&str]| {
        let trained = Trained::new("sac", more);
        trained.run.learner.n_critic_resets()
    };
    assert_eq!(resets(&[]), 0);
    let released = [
        "exploration.is_unsupervised=true",
        "training.reset_critic=true",
    ];
    assert_eq!(
        resets(&released),
        1,
        "once, at the step of the first session"
    );

    // Without a reset the way that it goes is another from the first exploring update on.
    let weights = |more: &[&str]| Trained::new("sac", more).run.learner.fingerprint();
    assert_ne!(weights(&[]), weights(&["exploration.is_unsupervised=true"]));
}

#[test]
fn qpa_asks_about_the_newest_episodes_and_trains_on_them_until_its_budget_is_spent() {
    let more = ["queries.near_policy_episodes=2", "feedback.budget=16"];
    let trained = Trained::new("qpa", &more);
    let run = &trained.run;
    assert_eq!(run.pool().newest_episodes, 2);
    let complete = run.replay.complete_episodes();
    let newest = &complete[complete.len() - 2..];
    let mut rng = Rng::new(1, Stream::Test, 0);
    let drawn = run.pool().draw(&run.replay, 50, &mut rng);
    let segments = drawn.iter().flat_map(|query| [query.first, query.second]);
    let episodes: Vec<_> = segments.map(|segment| segment.episode).collect();
    assert!(episodes.iter().all(|id| newest.contains(id)));
    assert!(newest.iter().all(|id| episodes.contains(id)));

    let steps = 2 * run.spec.episode_len as usize;
    assert_eq!(run.batches(700).recent, Some(steps), "12 of 16 answers");
    let spent = Trained::new("qpa", &more[..1]);
    assert_eq!(spent.run.batches(700).recent, None, "all answers are given");
    let pebble = Trained::new("pebble", &more);
    assert_eq!(pebble.run.batches(700).recent, None);
    assert_eq!(pebble.run.pool().newest_episodes, 100);
}

#[test]
fn the_released_codes_slips_in_drawing_pairs_are_the_runs_when_it_wants_them() {
    let drawn = |more: &[&str]| {
        let pool = Trained::new("pebble", more).run.pool();
        (pool.leaves_last_start, pool.pairs_with_itself)
    };
    assert_eq!(drawn(&[]), (false, false));
    assert_eq!(drawn(&["queries.bpref_starts=true"]), (true, false));
    assert_eq!(drawn(&["queries.bpref_pairs=true"]), (false, true));
}

/// Cannot tell, whatever it sees.
struct SkipsAll;

impl Judge for SkipsAll {
    fn judge(&self, _query: &OfferedQuery) -> Option<Preference> {
        None
    }
}

/// Nobody answers a single query: all are skipped, and there is nothing to steer by.
#[test]
fn mrn_goes_on_where_every_query_is_skipped() {
    let more = ["steering.every=50", "queries.bpref_skips=true"];
    let trained = Trained::taught_by(Box::new(SkipsAll), "mrn", &more);
    assert_eq!(trained.run.preferences.n_preferred(), 0);
    assert_eq!(trained.run.n_spent(), 12);
}

#[test]
fn mrn_steers_every_n_steps_by_the_latest_session_until_its_budget_is_spent() {
    let more = ["steering.every=200", "feedback.budget=16"];
    let mut trained = Trained::new("mrn", &more);
    let run = &mut trained.run;
    assert!(run.steering(400).is_some());
    assert!(
        run.steering(401).is_none() && run.steering(399).is_none() && run.steering(0).is_none()
    );
    let latest = run.latest_answers();
    assert_eq!(latest, run.preferences.labeled(true)[8..]);
    assert_eq!(latest.len(), 4);
    run.progress.n_fits = 0;
    assert!(run.steering(400).is_none(), "no reward is learned yet");
    let spent = Trained::new("mrn", &more[..1]);
    assert!(spent.run.steering(400).is_none());
    let pebble = Trained::new("pebble", &[]);
    assert!(pebble.run.steering(400).is_none());
}

/// In Meta-World's settings every step that steers asks as well.
#[test]
fn mrn_steers_after_the_session_of_the_same_step() {
    let more = |every| ["feedback.budget=16", every, "training.total_steps=303"];
    let [at_session, never] = ["steering.every=300", "steering.every=1000"]
        .map(|every| Trained::new("mrn", &more(every)).run.learner.fingerprint());
    assert_ne!(
        at_session, never,
        "session 0, at step 300, has been fitted when it steers"
    );
}

#[test]
fn a_run_that_ends_beyond_a_multiple_is_tried_there_once() {
    for (total, last) in [(700, 702), (702, 702)] {
        let more = [
            "environment.n_envs=3".to_owned(),
            "evaluation.every=350".to_owned(),
            format!("training.total_steps={total}"),
        ];
        let trained = Trained::new("uniform", &more.each_ref().map(String::as_str));
        let metrics = std::fs::read_to_string(trained.folder.join("metrics.jsonl")).unwrap();
        let events = metrics
            .lines()
            .map(|line| serde_json::from_str(line).unwrap());
        let tried: Vec<u64> = events
            .filter_map(|event| match event {
                Event::Evaluation(evaluation) => Some(evaluation.step),
                _ => None,
            })
            .collect();
        assert_eq!(tried, [0, 351, last]);
    }
}

#[test]
fn rune_pays_for_disagreement_less_and_less_and_others_do_not() {
    let rune = Trained::new("rune", &[]);
    let paid = |step| f64::from(rune.run.batches(step).disagreement_weight);
    // β₀ (1 − ρ)ᵗ with 0.05 and 1e-5, of environment steps
    assert!((paid(0) - 0.05).abs() < 1e-9);
    assert!((paid(100_000) - 0.05 * (1.0 - 1e-5_f64).powi(100_000)).abs() < 1e-8);
    assert!(rune.run.replay.keeps_disagreement());
    let pebble = Trained::new("pebble", &[]);
    assert!(pebble.run.batches(700).disagreement_weight.abs() < 1e-12);
    assert!(!pebble.run.replay.keeps_disagreement());
}

#[test]
fn rime_keeps_its_critics_and_centres_novelty() {
    let rime = Trained::new("rime", &[]);
    assert_eq!(rime.run.learner.n_critic_resets(), 0);
    assert_eq!(rime.run.config.exploration.novelty, Novelty::Centred);
    let pebble = Trained::new("pebble", &[]);
    assert_eq!(pebble.run.learner.n_critic_resets(), 1);
}

/// Before any answer, so nothing but novelty can have taught it.
#[test]
fn rimes_rewards_begin_with_novelty_and_no_others_do() {
    let rewards = |method, more: &[&str]| {
        let unasked = ["training.total_steps=250", "feedback.budget=0"];
        let more = [&unasked[..], more].concat();
        let trained = Trained::new(method, &more);
        let replay = &trained.run.replay;
        let state = replay.observation(replay.complete_episodes()[0], 5);
        trained.run.learner.reward.predict(state, &[0.1, 0.2, 0.3])
    };
    let untaught = rewards("rime", &["denoising.warm_start_steps=0"]);
    assert_ne!(untaught, rewards("rime", &[]));
    assert_eq!(untaught, rewards("pebble", &[]));
}

/// How often the temporal distance learns, and from how long blocks, each on its own; in the
/// released code one number says both.
#[test]
fn steps_of_the_temporal_distance_and_its_blocks_are_set_apart() {
    let n_steps = |every, block: u32| {
        let more = [
            format!("temporal.update_every={every}"),
            format!("temporal.block_episodes={block}"),
        ];
        let trained = Trained::new("stair", &more.each_ref().map(String::as_str));
        trained.run.learner.temporal.as_ref().unwrap().n_updates()
    };
    // From the first session on, at step 300, when three episodes of 100 steps are over.
    assert_eq!(n_steps(10, 1), 40);
    assert_eq!(n_steps(10, 3), 40);
    assert_eq!(n_steps(20, 1), 20);
    // Only from step 500 on there is a block to learn from.
    assert_eq!(n_steps(10, 5), 20);
    assert_eq!(n_steps(20, 5), 10);
}

#[test]
fn surf_adds_pairs_that_nobody_was_asked_about_for_every_query() {
    for (method, per_query) in [("surf", 10), ("surf_whole", 10), ("pebble", 0)] {
        let trained = Trained::new(method, &[]);
        assert_eq!(trained.run.unlabeled(1, 1).len(), per_query * 4, "{method}");
    }
}

#[test]
fn decreasing_sessions_ask_less_as_the_run_goes_on() {
    let trained = Trained::new("pebble", &["feedback.session_sizes=decreasing"]);
    let run = &trained.run;
    // 4, then 4 · 250/700 and 4 · 100/700, rounded down to one at least
    assert_eq!(run.progress.n_sessions, 3);
    assert_eq!(run.preferences.labeled(true).len(), 6);
    assert_eq!(run.latest_answers(), run.preferences.labeled(true)[5..]);
}
