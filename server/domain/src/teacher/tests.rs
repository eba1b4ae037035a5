use super::*;
use crate::environment::TaskReward;
use crate::episode::{EpisodeId, Segment};

const FIRST: Option<Preference> = Some(Preference::Prefer(Which::First));
const SECOND: Option<Preference> = Some(Preference::Prefer(Which::Second));

fn query(index: u32, first: &[f64], second: &[f64]) -> OfferedQuery {
    let record = |rewards: &[f64]| SegmentRecord {
        segment: Segment {
            episode: EpisodeId(0),
            start: 0,
            len: rewards.len() as u32,
        },
        poses: vec![],
        task_rewards: rewards.iter().copied().map(TaskReward).collect(),
        stages: vec![],
    };
    OfferedQuery {
        key: QueryKey { session: 1, index },
        first: record(first),
        second: record(second),
        asks_same_stage: false,
        disagreement: None,
        stage_gap: None,
        typical_reward: Some(TaskReward(2.0)),
    }
}

fn teacher(name: &str) -> Box<dyn Judge> {
    judge(name, 3, &TeacherSettings::default()).expect("a name of the registry")
}

/// How many of 4000 queries are answered with the first segment.
fn n_first(judge: &dyn Judge, first: &[f64], second: &[f64]) -> usize {
    let answers = (0..4000).map(|i| judge.judge(&query(i, first, second)));
    answers.filter(|a| *a == FIRST).count()
}

#[test]
fn every_teacher_of_the_registry_answers_and_always_alike() {
    for (name, _) in SCRIPTED {
        let answers = || {
            (0..50)
                .map(|i| teacher(name).judge(&query(i, &[5.0, 1.0], &[4.0, 3.0])))
                .collect::<Vec<_>>()
        };
        assert_eq!(answers(), answers(), "{name}");
        assert!(answers().iter().any(Option::is_some), "{name}");
    }
    assert!(judge("nobody", 3, &TeacherSettings::default()).is_none());
}

#[test]
fn the_oracle_prefers_the_larger_return_and_the_first_of_a_tie() {
    assert_eq!(Oracle.judge(&query(0, &[1.0, 1.0], &[0.0, 3.0])), SECOND);
    assert_eq!(Oracle.judge(&query(0, &[1.0, 2.0], &[3.0, 0.0])), FIRST);
}

#[test]
fn one_answer_in_ten_is_flipped_by_the_mistaken_teacher() {
    let n_flipped = n_first(&*teacher("mistaken"), &[1.0], &[2.0]);
    assert!((340..460).contains(&n_flipped), "{n_flipped} of 4000");
}

/// 0.9³ · 10 = 7.29 < 8.
#[test]
fn an_early_reward_counts_less_for_the_myopic_teacher() {
    let query = query(0, &[10.0, 0.0, 0.0, 0.0], &[0.0, 0.0, 0.0, 8.0]);
    assert_eq!(Oracle.judge(&query), FIRST);
    assert_eq!(teacher("myopic").judge(&query), SECOND);
    assert_eq!(Myopic { discount: 1.0 }.judge(&query), FIRST);
}

/// σ(1) = 0.731 of 4000 is 2924.
#[test]
fn the_noisy_teacher_is_right_as_often_as_boltzmann_says() {
    let n_right = n_first(&*teacher("noisy"), &[1.5, 0.5], &[1.0, 0.0]);
    assert!((2840..3010).contains(&n_right), "{n_right} of 4000");
}

/// A typical segment of two steps gathers 4, a tenth of it is 0.4, a hundredth 0.04.
#[test]
fn thresholds_follow_the_agent_and_the_slip_squares_them_from_the_second_session() {
    let slipping = TeacherSettings {
        teacher_eps_squared: true,
        ..TeacherSettings::default()
    };
    let slip = |name| judge(name, 3, &slipping).expect("a name of the registry");
    let close = query(0, &[2.0, 0.3], &[2.0, 0.0]);
    assert_eq!(teacher("equal").judge(&close), Some(Preference::Equal));
    assert_eq!(slip("equal").judge(&close), FIRST);
    let poor = query(0, &[0.3, 0.0], &[0.2, 0.0]);
    assert_eq!(teacher("skip").judge(&poor), None);
    assert_eq!(slip("skip").judge(&poor), FIRST);
    let mut first_session = poor.clone();
    first_session.key.session = 0;
    assert_eq!(slip("skip").judge(&first_session), None);
    let far = query(0, &[2.0, 0.5], &[2.0, 0.0]);
    assert_eq!(teacher("equal").judge(&far), FIRST);
    assert_eq!(teacher("skip").judge(&far), FIRST);
    let unknown = OfferedQuery {
        typical_reward: None,
        ..poor
    };
    assert_eq!(teacher("skip").judge(&unknown), FIRST);
    let beginner = OfferedQuery {
        typical_reward: Some(TaskReward(0.0)),
        ..query(0, &[0.0, 0.0], &[0.0, 0.0])
    };
    assert!(teacher("skip").judge(&beginner).is_some());
}

/// Where myopia and the oracle differ: half the answers are myopic, a fifth of the rest flipped,
/// 0.5 + 0.1 of 4000 is 2400. Where they agree: 0.1 is 400.
#[test]
fn the_inconsistent_teacher_is_half_myopic_and_half_mistaken() {
    let inconsistent = teacher("inconsistent");
    let early: (&[f64], &[f64]) = (&[0.0, 0.0, 0.0, 8.0], &[10.0, 0.0, 0.0, 0.0]);
    let n_wrong = n_first(&*inconsistent, early.0, early.1);
    assert!((2280..2520).contains(&n_wrong), "{n_wrong} of 4000");
    let n_wrong = n_first(&*inconsistent, &[1.0, 1.0], &[2.0, 2.0]);
    assert!((340..460).contains(&n_wrong), "{n_wrong} of 4000");
}
