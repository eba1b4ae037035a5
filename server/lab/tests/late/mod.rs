//! Answers that come after their session was over.

use std::collections::VecDeque;

use domain::query::OfferedQuery;
use domain::teacher::{Answered, Judge as _, Oracle, Teacher, TeacherError};
use lab::message::{Event, SessionOffered};
use lab::run::Run;

use super::{Folder, drive, finished, short_of};

/// Answers some queries of a session at once; the others when it was looked for answers so many
/// times since, one each time.
struct Slow {
    /// Queries of a session that are answered at once, by its number.
    at_once: fn(u32) -> u32,
    delay: u64,
    n_looks: u64,
    waiting: VecDeque<(u64, OfferedQuery)>,
    answered: Vec<Answered>,
}

impl Slow {
    fn new(at_once: fn(u32) -> u32, delay: u64) -> Self {
        Self {
            at_once,
            delay,
            n_looks: 0,
            waiting: VecDeque::new(),
            answered: Vec::new(),
        }
    }

    fn answer(&mut self, query: &OfferedQuery) {
        self.answered.push(Answered {
            key: query.key,
            preference: Oracle.judge(query),
            sequence: self.answered.len() as u64 + 1,
        });
    }
}

impl Teacher for Slow {
    fn ask(&mut self, queries: &[OfferedQuery]) -> Result<(), TeacherError> {
        for query in queries {
            if query.key.index < (self.at_once)(query.key.session) {
                self.answer(query);
            } else {
                let due = self.n_looks + self.delay;
                self.waiting.push_back((due, query.clone()));
            }
        }
        Ok(())
    }

    fn collect(&mut self, after: u64) -> Result<Vec<Answered>, TeacherError> {
        self.n_looks += 1;
        let is_due = |(due, _): &(u64, OfferedQuery)| *due <= self.n_looks;
        if self.waiting.front().is_some_and(is_due)
            && let Some((_, query)) = self.waiting.pop_front()
        {
            self.answer(&query);
        }
        Ok(self.answered[after as usize..].to_vec())
    }
}

/// Sessions of ten for a budget of twenty; half of one is enough to go on. What is still open of it
/// is not asked for in another session's place, and what comes when none is to come is learned
/// from, whenever half of what is missing is there.
#[test]
fn answers_that_come_after_the_last_session_are_learned_from_and_the_budget_holds() {
    let more = [
        "training.total_steps=2200",
        "feedback.queries_per_session=10",
        "feedback.budget=20",
        "queries.sufficient_fraction=0.5",
    ];
    let folder = Folder::new("late");
    let mut run = Run::start(short_of("pebble", &more), &folder.0).unwrap();
    let mut teacher = Slow::new(|_| 5, 450);
    let (outcome, events) = drive(&mut run, &mut teacher);
    assert_eq!(finished(outcome).labels, 20);
    assert_eq!(teacher.answered.len(), 20, "asked in all");

    let sessions: Vec<u32> = offered(&events).iter().map(|s| s.n_queries).collect();
    assert_eq!(sessions, [10, 10]);
    let refitted = |event: &Event| match event {
        Event::Refitted(refitted) => Some((refitted.n_late, refitted.labels, refitted.fit)),
        _ => None,
    };
    let refitted: Vec<_> = events.iter().filter_map(refitted).collect();
    assert_eq!(refitted, [(5, 15, 3), (3, 18, 4), (1, 19, 5), (1, 20, 6)]);
}

#[test]
fn a_session_answered_late_moves_the_next_ones_where_training_goes_on() {
    let more = [
        "training.total_steps=2200",
        "training.while_waiting=train",
        "feedback.budget=15",
    ];
    let folder = Folder::new("overdue");
    let mut run = Run::start(short_of("pebble", &more), &folder.0).unwrap();
    let mut teacher = Slow::new(|session| if session == 0 { 0 } else { 5 }, 400);
    let (_, events) = drive(&mut run, &mut teacher);
    let steps: Vec<u64> = offered(&events).iter().map(|s| s.step).collect();
    assert_eq!(steps[0], 600);
    assert!(steps[1] > 1_200, "{steps:?}: two were due");
    assert_eq!(steps[2], steps[1] + 300);
    assert_eq!(steps.len(), 3);
}

fn offered(events: &[Event]) -> Vec<&SessionOffered> {
    let sessions = events.iter().filter_map(|event| match event {
        Event::SessionOffered(session) => Some(session),
        _ => None,
    });
    sessions.collect()
}
