//! Runs taken up again: after stops, without their newest checkpoint, without a file, at their end.

use std::path::PathBuf;
use std::sync::mpsc::channel;

use domain::teacher::{Oracle, Scripted, Teacher};
use lab::message::{Command, Event};
use lab::run::{Outcome, Run};

use super::{Folder, drive, finished, interrupted, short, short_of, uninterrupted};

#[test]
fn a_run_stopped_again_and_again_ends_with_the_same_bits() {
    let config = short();
    let expected = uninterrupted(&config, "straight");
    assert_eq!(interrupted(&config, "stopped").weights, expected.weights);
}

#[test]
fn a_damaged_checkpoint_is_passed_over_for_the_one_before() {
    let folder = Folder::new("damaged");
    let config = short();
    let expected = uninterrupted(&config, "undamaged");
    let mut run = Run::start(config, &folder.0).unwrap();
    let mut n_seen = 0;
    let is_third_checkpoint = |event: &Event| {
        n_seen += usize::from(matches!(event, Event::Checkpointed(_)));
        n_seen == 3
    };
    let mut teacher = Scripted::new(Box::new(Oracle), 0);
    stop_at(&mut run, &mut teacher, is_third_checkpoint);
    drop(run);
    damage_newest_checkpoint(&folder);

    let (mut run, complaints) = Run::resume(&folder.0).unwrap();
    assert_eq!(complaints.len(), 1, "{complaints:?}");
    let mut teacher = Scripted::new(Box::new(Oracle), run.consumed_sequence());
    assert_eq!(
        finished(drive(&mut run, &mut teacher).0).weights,
        expected.weights
    );
}

/// Drives a run until it says something that is so, and lets it stop there.
fn stop_at(run: &mut Run, teacher: &mut dyn Teacher, mut is: impl FnMut(&Event) -> bool) {
    let (sender, commands) = channel();
    let stop = &mut |event: Event| {
        if is(&event) {
            sender.send(Command::Stop).unwrap();
        }
    };
    let outcome = run.drive(teacher, &commands, stop).unwrap();
    assert_eq!(outcome, Outcome::Stopped);
}

fn damage_newest_checkpoint(folder: &Folder) {
    let names = std::fs::read_dir(&folder.0)
        .unwrap()
        .map(|e| e.unwrap().path());
    let checkpoints = names.filter(|p| p.extension().is_some_and(|e| e == "stair"));
    let newest: PathBuf = checkpoints.max().unwrap();
    let mut bytes = std::fs::read(&newest).unwrap();
    let middle = bytes.len() / 2;
    bytes[middle] ^= 1;
    std::fs::write(newest, bytes).unwrap();
}

/// Its session was offered, answered and closed at the step of the checkpoint that is lost: by
/// people, who are not asked the same again.
#[test]
fn answers_to_what_a_lost_checkpoint_had_asked_count_when_the_run_comes_there_again() {
    let folder = Folder::new("answered");
    let expected = uninterrupted(&short(), "answered-undamaged");
    let mut run = Run::start(short(), &folder.0).unwrap();
    let mut mailbox = Scripted::new(Box::new(Oracle), 0);
    stop_at(&mut run, &mut mailbox, |event| {
        matches!(event, Event::SessionClosed(_))
    });
    assert_eq!((run.step(), run.consumed_sequence()), (600, 5));
    drop(run);
    damage_newest_checkpoint(&folder);

    let (mut run, complaints) = Run::resume(&folder.0).unwrap();
    assert_eq!(complaints.len(), 1, "{complaints:?}");
    assert_eq!((run.step(), run.consumed_sequence()), (400, 0));
    stop_at(&mut run, &mut mailbox, |event| {
        matches!(event, Event::Checkpointed(_))
    });
    drop(run);
    let (mut run, complaints) = Run::resume(&folder.0).unwrap();
    assert_eq!(complaints, [""; 0], "the damaged one is set aside");
    assert_eq!((run.step(), run.consumed_sequence()), (600, 5));
    let actual = finished(drive(&mut run, &mut mailbox).0);
    assert_eq!((actual.labels, actual.weights), (10, expected.weights));
}

#[test]
fn a_folder_that_has_lost_its_settings_or_its_metrics_is_left_as_it_is() {
    let folder = Folder::new("lost");
    let mut run = Run::start(short(), &folder.0).unwrap();
    finished(drive(&mut run, &mut Scripted::new(Box::new(Oracle), 0)).0);
    drop(run);
    let (settings, metrics) = (folder.0.join("config.toml"), folder.0.join("metrics.jsonl"));
    let aside = folder.0.join("aside");
    std::fs::rename(&settings, &aside).unwrap();
    let told = Run::start(short(), &folder.0).err().unwrap().to_string();
    assert!(told.contains("metrics.jsonl"), "{told}");
    std::fs::rename(&aside, &settings).unwrap();

    let whole = std::fs::read(&metrics).unwrap();
    std::fs::write(&metrics, &whole[..whole.len() / 2]).unwrap();
    let told = Run::resume(&folder.0).err().unwrap().to_string();
    assert!(told.contains("metrics.jsonl"), "{told}");
    std::fs::write(&metrics, &whole).unwrap();
    assert!(Run::resume(&folder.0).is_ok());
}

#[test]
fn a_finished_run_that_is_taken_up_again_adds_nothing() {
    let folder = Folder::new("finished");
    let config = short_of("stair", &["evaluation.every=500"]); // the end lies beyond a trial
    let mut run = Run::start(config, &folder.0).unwrap();
    let expected = finished(drive(&mut run, &mut Scripted::new(Box::new(Oracle), 0)).0);
    drop(run);
    let metrics = || std::fs::read(folder.0.join("metrics.jsonl")).unwrap();
    let before = metrics();
    let (mut run, _) = Run::resume(&folder.0).unwrap();
    let mut teacher = Scripted::new(Box::new(Oracle), run.consumed_sequence());
    let (outcome, events) = drive(&mut run, &mut teacher);
    assert_eq!(finished(outcome), expected);
    assert_eq!(events, []);
    assert_eq!(metrics(), before);
}
