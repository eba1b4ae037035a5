//! Packed query sets of real runs: what was asked, as it was asked, and nothing made up.

use std::path::Path;
use std::sync::mpsc::channel;

use domain::query::OfferedQuery;
use domain::teacher::{Answered, Oracle, Scripted, Teacher, TeacherError};
use lab::message::{Command, Event};
use lab::run::Run;
use lab::study::{PackedQueries, PackedQuery, PackedSegment, QuerySet, QuerySetError};

use super::{Folder, drive, finished, short};

/// The oracle, which remembers what it was asked.
struct Asked {
    oracle: Scripted,
    queries: Vec<OfferedQuery>,
}

impl Teacher for Asked {
    fn ask(&mut self, queries: &[OfferedQuery]) -> Result<(), TeacherError> {
        self.queries.extend_from_slice(queries);
        self.oracle.ask(queries)
    }

    fn collect(&mut self, after: u64) -> Result<Vec<Answered>, TeacherError> {
        self.oracle.collect(after)
    }
}

/// A finished run of the small task, and the ten queries that it asked.
fn a_run(folder: &Path) -> Vec<OfferedQuery> {
    let mut run = Run::start(short(), folder).unwrap();
    let mut teacher = Asked {
        oracle: Scripted::new(Box::new(Oracle), 0),
        queries: Vec::new(),
    };
    finished(drive(&mut run, &mut teacher).0);
    assert_eq!(teacher.queries.len(), 10);
    teacher.queries
}

fn packed(query: &OfferedQuery) -> PackedQuery {
    let seen = |record: &domain::episode::SegmentRecord| PackedSegment {
        segment: record.segment,
        poses: record.poses.clone(),
        stages: record.stages.clone(),
    };
    PackedQuery {
        key: query.key,
        first: seen(&query.first),
        second: seen(&query.second),
    }
}

fn set(task: &str, method: &str, from: &str) -> QuerySet {
    QuerySet {
        task: task.into(),
        method: method.into(),
        from: from.into(),
    }
}

#[test]
fn a_packed_run_holds_the_queries_that_were_asked_by_its_method() {
    let folder = Folder::new("packed");
    let asked = a_run(&folder.0);
    let own: Vec<PackedQuery> = asked
        .iter()
        .filter(|q| q.key.session > 0)
        .map(packed)
        .collect();
    assert_eq!(own.len(), 5, "the first session is drawn at random");

    let all = PackedQueries::of_run(&folder.0, None, "abc").unwrap();
    assert_eq!(all.queries, own);
    assert_eq!((all.seed, all.segment_len), (1, asked[0].first.segment.len));
    assert!(
        all.command.contains("--set feedback.budget=10"),
        "{}",
        all.command
    );

    let some = PackedQueries::of_run(&folder.0, Some(3), "abc").unwrap();
    assert_eq!(some.queries.len(), 3);
    assert!(some.queries.iter().all(|query| own.contains(query)));
    let told = PackedQueries::of_run(&folder.0, Some(6), "abc").unwrap_err();
    let (there, wanted) = (5, 6);
    assert!(
        matches!(told, QuerySetError::TooFew { there: t, wanted: w, .. } if (t, w) == (there, wanted)),
        "{told}"
    );

    // A study takes the file and the folder alike.
    let path = folder.0.join("some.queries");
    std::fs::write(&path, some.pack()).unwrap();
    assert_eq!(PackedQueries::read(&path).unwrap(), some);
    let load = |set: QuerySet| set.load(&folder.0);
    let right = set("go-fetch-return", "stair", "some.queries");
    assert_eq!(load(right).unwrap(), some.queries);
    assert_eq!(load(set("go-fetch-return", "stair", ".")).unwrap(), own);
    for (task, method) in [("window-open", "stair"), ("go-fetch-return", "pebble")] {
        for from in ["some.queries", "."] {
            let told = load(set(task, method, from)).unwrap_err().to_string();
            assert!(told.contains("stair on go-fetch-return"), "{told}");
            assert!(told.contains(&format!("says {method} on {task}")), "{told}");
        }
    }
}

#[test]
fn a_run_that_is_not_finished_is_not_packed() {
    let folder = Folder::new("unfinished");
    let mut run = Run::start(short(), &folder.0).unwrap();
    let (sender, commands) = channel();
    let stop_at_first_session = &mut |event: Event| {
        if matches!(event, Event::SessionClosed(_)) {
            sender.send(Command::Stop).unwrap();
        }
    };
    let mut teacher = Scripted::new(Box::new(Oracle), 0);
    run.drive(&mut teacher, &commands, stop_at_first_session)
        .unwrap();
    let told = PackedQueries::of_run(&folder.0, None, "").unwrap_err();
    assert!(told.to_string().contains("600 of its 1200 steps"), "{told}");
    let nowhere = folder.0.join("nowhere");
    let told = PackedQueries::of_run(&nowhere, None, "").unwrap_err();
    assert!(told.to_string().contains("nowhere"), "{told}");
}
