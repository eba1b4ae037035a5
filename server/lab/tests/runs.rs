//! Whole runs of the small task: what a run promises, and the direction of learning.
#![expect(
    clippy::unwrap_used,
    reason = "a story that cannot go on fails where it stands"
)]

mod late;
mod methods;
mod query_sets;
mod taken_up;
mod temporal_map;

use std::path::PathBuf;
use std::sync::mpsc::channel;

use domain::query::{OfferedQuery, QueryKey};
use domain::teacher::{
    Answered, Judge, Oracle, Scripted, Teacher, TeacherError, TeacherSettings, judge,
};
use lab::config::{Layers, RunConfig};
use lab::message::{Activity, Command, Event};
use lab::policy::TrainedPolicy;
use lab::run::{Outcome, Run};

/// A run's folder that goes when the test ends.
struct Folder(PathBuf);

impl Folder {
    fn new(name: &str) -> Self {
        let path = std::env::temp_dir().join(format!("stair-lab-{name}-{}", std::process::id()));
        let _ = std::fs::remove_dir_all(&path); // an earlier test run may have been killed
        Self(path)
    }
}

impl Drop for Folder {
    fn drop(&mut self) {
        let _ = std::fs::remove_dir_all(&self.0); // best effort: it is a temporary folder
    }
}

/// A few seconds of everything: exploring, two sessions, temporal distance, evaluation.
fn short() -> RunConfig {
    short_of("stair", &[])
}

fn short_of(method: &str, more: &[&str]) -> RunConfig {
    let settings = [
        "training.total_steps=1200",
        "training.seed_steps=200",
        "training.checkpoint_every=200",
        "training.updates_after_reset=10",
        "feedback.first_step=600",
        "feedback.every=300",
        "feedback.queries_per_session=5",
        "feedback.budget=10",
        "evaluation.every=600",
        "evaluation.episodes=3",
        "agent.hidden=[16, 16]",
        "agent.batch=32",
        "reward.hidden=[16, 16]",
        "temporal.block_episodes=2",
        "temporal.batch=32",
        "environment.n_envs=2",
    ];
    resolve(method, &[], &[&settings, more].concat())
}

fn resolve(method: &str, presets: &[&str], settings: &[&str]) -> RunConfig {
    let layers = Layers {
        task: Some("go-fetch-return".into()),
        method: Some(method.into()),
        presets: presets.iter().map(ToString::to_string).collect(),
        overrides: settings.iter().map(ToString::to_string).collect(),
        file: None,
    };
    RunConfig::resolve(&layers).unwrap()
}

fn finished(outcome: Outcome) -> lab::message::Finished {
    match outcome {
        Outcome::Finished(finished) => finished,
        Outcome::Stopped => panic!("nobody stopped the run"),
    }
}

fn drive(run: &mut Run, teacher: &mut dyn Teacher) -> (Outcome, Vec<Event>) {
    let (_sender, commands) = channel();
    let mut events = Vec::new();
    let outcome = run
        .drive(teacher, &commands, &mut |event| events.push(event))
        .unwrap();
    (outcome, events)
}

fn uninterrupted(config: &RunConfig, name: &str) -> lab::message::Finished {
    let folder = Folder::new(name);
    let mut run = Run::start(config.clone(), &folder.0).unwrap();
    finished(drive(&mut run, &mut Scripted::new(Box::new(Oracle), 0)).0)
}

/// The same run, stopped again and again and taken up from its folder each time.
fn interrupted(config: &RunConfig, name: &str) -> lab::message::Finished {
    let folder = Folder::new(name);
    drop(Run::start(config.clone(), &folder.0).unwrap());
    for n_events in [3, 1, 7, 2, 5, 11, usize::MAX] {
        let (mut run, complaints) = Run::resume(&folder.0).unwrap();
        assert!(complaints.is_empty(), "{complaints:?}");
        let mut teacher = Scripted::new(Box::new(Oracle), run.consumed_sequence());
        let (sender, commands) = channel();
        let mut n_seen = 0;
        let stop_later = &mut |_: Event| {
            n_seen += 1;
            if n_seen == n_events {
                sender.send(Command::Stop).unwrap();
            }
        };
        if let Outcome::Finished(actual) = run.drive(&mut teacher, &commands, stop_later).unwrap() {
            return actual;
        }
    }
    panic!("the run did not finish");
}

#[test]
fn the_policy_that_a_finished_run_leaves_acts_as_its_checkpoint_does() {
    let folder = Folder::new("policy");
    let mut run = Run::start(short(), &folder.0).unwrap();
    finished(drive(&mut run, &mut Scripted::new(Box::new(Oracle), 0)).0);
    let states: Vec<f32> = (0..32_u8).map(|i| (f32::from(i) * 0.7).sin()).collect();
    let act = |path: &std::path::Path| TrainedPolicy::open(path).unwrap().act(&states);
    let of_checkpoint = act(&folder.0);
    assert_eq!(act(&folder.0.join("policy.stair")), of_checkpoint);

    let names = std::fs::read_dir(&folder.0)
        .unwrap()
        .map(|e| e.unwrap().path());
    let checkpoints = names.filter(|path| path.to_string_lossy().contains("checkpoint-"));
    checkpoints.for_each(|path| std::fs::remove_file(path).unwrap());
    assert_eq!(act(&folder.0), of_checkpoint);
}

#[test]
fn episodes_of_training_are_as_long_as_the_settings_want_them_and_trials_as_the_tasks_are() {
    let config = short_of("stair", &["environment.episode_len=50"]);
    let folder = Folder::new("shorter");
    let mut run = Run::start(config.clone(), &folder.0).unwrap();
    let (outcome, events) = drive(&mut run, &mut Scripted::new(Box::new(Oracle), 0));
    let metrics = events.iter().filter_map(|event| match event {
        Event::Metrics(metrics) => Some((metrics.step, metrics.episodes)),
        _ => None,
    });
    let seen: Vec<_> = metrics.collect();
    assert!(!seen.is_empty());
    for (step, episodes) in seen {
        assert_eq!(u64::from(episodes), 2 * (step / 2 / 50), "at step {step}");
    }
    let trial = events.iter().find_map(|event| match event {
        Event::Demonstration(demonstration) => Some(demonstration.poses.len()),
        _ => None,
    });
    assert_eq!(trial, Some(100));
    let expected = finished(outcome).weights;
    assert_eq!(interrupted(&config, "shorter-stopped").weights, expected);
    assert_ne!(uninterrupted(&short(), "longer").weights, expected);
}

#[test]
fn another_seed_is_another_run_and_the_same_seed_the_same() {
    let config = short();
    let first = uninterrupted(&config, "same-1");
    assert_eq!(first.weights, uninterrupted(&config, "same-2").weights);
    let other = RunConfig { seed: 2, ..config };
    assert_ne!(first.weights, uninterrupted(&other, "other").weights);
}

/// Skips every third query, answers the others as the oracle does.
struct Choosy {
    oracle: Scripted,
    skipped: Vec<QueryKey>,
}

impl Teacher for Choosy {
    fn ask(&mut self, queries: &[OfferedQuery]) -> Result<(), TeacherError> {
        let refused = queries
            .iter()
            .map(|q| q.key)
            .filter(|key| key.index % 3 == 0);
        self.skipped.extend(refused);
        self.oracle.ask(queries)
    }

    fn collect(&mut self, after: u64) -> Result<Vec<Answered>, TeacherError> {
        let answers = self.oracle.collect(after)?;
        let refuse = |a: Answered| Answered {
            preference: a.preference.filter(|_| !self.skipped.contains(&a.key)),
            ..a
        };
        Ok(answers.into_iter().map(refuse).collect())
    }
}

#[test]
fn a_skipped_query_is_replaced_and_uses_no_budget() {
    let (n_skipped, n_labels) = answered_by_choice("choosy", short());
    assert!(n_skipped >= 4, "{n_skipped}");
    assert_eq!(n_labels, 10);
}

#[test]
fn a_skipped_query_uses_up_budget_where_the_released_codes_slip_is_wanted() {
    let mut config = short();
    config.queries.bpref_skips = true;
    // two sessions of 5, the queries 0 and 3 of each skipped
    assert_eq!(answered_by_choice("choosy-slip", config), (4, 6));
}

/// Queries that a choosy teacher skips in a run, and answers that the run is given.
fn answered_by_choice(name: &str, config: RunConfig) -> (usize, u32) {
    let folder = Folder::new(name);
    let mut run = Run::start(config, &folder.0).unwrap();
    let mut teacher = Choosy {
        oracle: Scripted::new(Box::new(Oracle), 0),
        skipped: Vec::new(),
    };
    let (outcome, _) = drive(&mut run, &mut teacher);
    (teacher.skipped.len(), finished(outcome).labels)
}

#[test]
fn a_session_tells_how_often_its_answers_were_those_of_the_task_reward() {
    let agreements = |name: &str, judge: Box<dyn Judge>| -> Vec<f64> {
        let folder = Folder::new(name);
        let mut run = Run::start(short(), &folder.0).unwrap();
        let (_, events) = drive(&mut run, &mut Scripted::new(judge, 0));
        let of_session = |event: Event| match event {
            Event::SessionClosed(session) => session.oracle_agreement,
            _ => None,
        };
        events.into_iter().filter_map(of_session).collect()
    };
    assert_eq!(agreements("agreeing", Box::new(Oracle)), [1.0, 1.0]);
    let always_wrong = TeacherSettings {
        mistake: 1.0,
        ..TeacherSettings::default()
    };
    let judge = judge("mistaken", 1, &always_wrong).unwrap();
    assert_eq!(agreements("disagreeing", judge), [0.0, 0.0]);
}

/// Never answers.
struct Silent;

impl Teacher for Silent {
    fn ask(&mut self, _queries: &[OfferedQuery]) -> Result<(), TeacherError> {
        Ok(())
    }
    fn collect(&mut self, _after: u64) -> Result<Vec<Answered>, TeacherError> {
        Ok(Vec::new())
    }
}

#[test]
fn a_run_stands_still_while_a_session_is_unanswered_and_says_so() {
    let folder = Folder::new("silent");
    let mut run = Run::start(short(), &folder.0).unwrap();
    let (sender, commands) = channel();
    let mut waiting = None;
    let stop_when_asking = &mut |event: Event| {
        if let Event::Phase(phase) = event
            && phase.activity == Activity::Asking
        {
            waiting = Some(phase);
            sender.send(Command::Stop).unwrap();
        }
    };
    assert_eq!(
        run.drive(&mut Silent, &commands, stop_when_asking).unwrap(),
        Outcome::Stopped
    );
    let phase = waiting.unwrap();
    assert_eq!((phase.step, phase.session_answers), (600, Some((0, 5))));
}

#[test]
fn a_second_run_is_not_started_in_the_folder_of_the_first() {
    let folder = Folder::new("occupied");
    drop(Run::start(short(), &folder.0).unwrap());
    let Err(error) = Run::start(short(), &folder.0) else {
        panic!("it started")
    };
    assert!(error.to_string().contains("holds a run already"), "{error}");
}

#[test]
fn a_run_that_cannot_fit_into_memory_is_refused_before_anything_is_written() {
    let folder = Folder::new("too-long");
    let mut config = short();
    config.training.total_steps = u64::MAX;
    let Err(error) = Run::start(config, &folder.0) else {
        panic!("it started")
    };
    let text = error.to_string();
    assert!(text.contains("training.total_steps"), "{text}");
    assert!(!folder.0.exists());
}

fn edit_settings(folder: &Folder, from: &str, to: &str) {
    let path = folder.0.join("config.toml");
    let text = std::fs::read_to_string(&path).unwrap();
    assert!(text.contains(from), "{text}");
    std::fs::write(&path, text.replacen(from, to, 1)).unwrap();
}

#[test]
fn a_checkpoint_of_other_settings_is_refused_and_kept() {
    let folder = Folder::new("misfit");
    drop(Run::start(short(), &folder.0).unwrap());
    for (from, to, words) in [
        (
            "task = \"go-fetch-return\"",
            "task = \"window-open\"",
            ["task", "go-fetch-return", "window-open"],
        ),
        (
            "hidden = [16, 16]",
            "hidden = [32, 16]",
            ["agent.hidden", "[16, 16]", "[32, 16]"],
        ),
        ("n_envs = 2", "n_envs = 3", ["environment.n_envs", "2", "3"]),
        (
            "device = \"cpu\"",
            "device = \"tpu\"",
            ["no device", "tpu", "cpu"],
        ),
    ] {
        edit_settings(&folder, from, to);
        let Err(error) = Run::resume(&folder.0) else {
            panic!("{to} goes unnoticed")
        };
        let text = error.to_string();
        for word in words {
            assert!(text.contains(word), "'{word}' is not in: {text}");
        }
        edit_settings(&folder, to, from);
    }
    edit_settings(&folder, "device = \"cpu\"", "device = \"cuda:77\"");
    let (run, complaints) = Run::resume_on(&folder.0, Some("cpu")).unwrap();
    assert_eq!((run.config().device.as_str(), complaints), ("cpu", vec![]));
}

/// The small task from 48 answers: the oracle's teach it, a coin's do not.
#[test]
fn answers_teach_the_task_and_a_coin_does_not() {
    let task_return = |teacher: &str| {
        let folder = Folder::new(teacher);
        let settings = [
            "evaluation.every=0",
            "training.total_steps=28000",
            "feedback.queries_per_session=8",
            "feedback.budget=48",
        ];
        let mut run = Run::start(resolve("stair", &["quick"], &settings), &folder.0).unwrap();
        finished(
            drive(
                &mut run,
                &mut Scripted::new(judge(teacher, 1, &TeacherSettings::default()).unwrap(), 0),
            )
            .0,
        )
        .return_mean
    };
    let (taught, untaught) = (task_return("oracle"), task_return("coin"));
    assert!(
        taught > untaught + 100.0,
        "oracle {taught}, coin {untaught}"
    );
}
