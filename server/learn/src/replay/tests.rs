use domain::random::{Rng, Stream};

use super::*;

const SHAPE: ReplayShape = ReplayShape {
    observation: 3,
    action: 2,
    pose: 1,
};

/// Two lanes stepping side by side, episodes of 5 and 7 steps; every number tells where it is
/// from: episode + time / 100.
fn push_steps(replay: &mut Replay, from: usize, to: usize) {
    for k in from..to {
        for lane in 0..2 {
            let episode_len = 5 + 2 * lane;
            let t = k % episode_len;
            if t == 0 {
                let id = replay.n_episodes() as f32;
                replay.begin_episode(lane, 70 + id as u64, &[id; 3], &[id], Some(0));
            }
            let id = replay.lanes[lane].running.expect("running").0 as f32;
            let next = id + (t + 1) as f32 / 100.0;
            let end = match (t + 1 == episode_len, lane) {
                (false, _) => None,
                (true, 0) => Some(EpisodeEnd::Terminal),
                (true, _) => Some(EpisodeEnd::TimeLimit),
            };
            replay.push(
                lane,
                NewStep {
                    action: &[next, -next],
                    learned_reward: 2.0 * next,
                    task_reward: TaskReward(f64::from(next)),
                    success: t == 3,
                    stage: Some(t as u8),
                    end,
                    next_observation: &[next; 3],
                    next_pose: &[next],
                },
            );
        }
    }
}

fn folder(name: &str) -> std::path::PathBuf {
    let folder = std::env::temp_dir().join(format!("stair-replay-{}-{name}", std::process::id()));
    let _ = std::fs::remove_dir_all(&folder);
    std::fs::create_dir_all(&folder).expect("a folder for the test");
    folder
}

fn same(a: &Replay, b: &Replay) -> bool {
    let draw = |r: &Replay| r.sample(200, &mut Rng::new(1, Stream::Test, 0));
    let infos = |r: &Replay| {
        (0..r.n_episodes())
            .map(|i| r.episode(EpisodeId(i as u32)))
            .collect::<Vec<_>>()
    };
    draw(a) == draw(b) && infos(a) == infos(b) && a.complete == b.complete
}

#[test]
fn a_segment_shows_the_states_after_its_steps() {
    let mut replay = Replay::new(SHAPE, 2);
    push_steps(&mut replay, 0, 12);
    let segment = Segment {
        episode: EpisodeId(2),
        start: 1,
        len: 3,
    };
    let record = replay.record(segment);
    assert_eq!(record.poses, [[2.02], [2.03], [2.04]]);
    assert_eq!(record.stages, [1, 2, 3]);
    assert_eq!(record.task_rewards[0], TaskReward(f64::from(2.02_f32)));
    assert_eq!(replay.observation(EpisodeId(2), 1), [2.01; 3]);
    assert_eq!(replay.action(EpisodeId(2), 1), [2.02, -2.02]);
    let info = replay.episode(EpisodeId(2));
    assert_eq!(
        (info.lane, info.len, info.end),
        (0, 5, Some(EpisodeEnd::Terminal))
    );
    assert!(info.is_success);
    assert_eq!(
        replay.complete_episodes(),
        [EpisodeId(0), EpisodeId(1), EpisodeId(2)]
    );
}

#[test]
fn every_transition_is_drawn_equally_often_and_keeps_its_parts_together() {
    let mut replay = Replay::new(SHAPE, 2);
    push_steps(&mut replay, 0, 10);
    let batch = replay.sample(20_000, &mut Rng::new(3, Stream::Test, 0));
    let mut counts = std::collections::BTreeMap::new();
    for i in 0..batch.len() {
        let next = batch.next_observation[3 * i];
        assert!((next - batch.observation[3 * i] - 0.01).abs() < 1e-5);
        assert_eq!(batch.action[2 * i].to_bits(), next.to_bits());
        assert_eq!(batch.reward[i].to_bits(), (2.0 * next).to_bits());
        let is_terminal = (next.fract() - 0.05).abs() < 1e-4 && matches!(next as u32, 0 | 2);
        assert_eq!(batch.not_terminal[i] == 0.0, is_terminal, "{next}");
        *counts.entry((next * 100.0).round() as u32).or_insert(0_u32) += 1;
    }
    assert_eq!(counts.len(), 20);
    assert!(
        counts.values().all(|&n| (850..1150).contains(&n)),
        "{counts:?}"
    );
}

#[test]
fn reopened_at_its_mark_it_goes_on_as_if_nothing_had_happened() {
    let folder = folder("reopen");
    let mut replay = Replay::new(SHAPE, 2);
    push_steps(&mut replay, 0, 8);
    replay.sync(&folder).expect("written");
    push_steps(&mut replay, 8, 13);
    replay.learned_rewards_mut(1)[2] = 9.0;
    let mark = replay.sync(&folder).expect("written");
    push_steps(&mut replay, 13, 20);
    replay.sync(&folder).expect("written"); // the process dies after this one

    let mut reopened = Replay::open(&folder, SHAPE, 2, &mark).expect("opens");
    assert_eq!(
        reopened.lanes[1].learned_rewards[2].to_bits(),
        9.0_f32.to_bits()
    );
    push_steps(&mut reopened, 13, 20);
    assert!(same(&reopened, &replay));
    let mark = reopened.sync(&folder).expect("written");
    assert!(same(
        &Replay::open(&folder, SHAPE, 2, &mark).expect("opens"),
        &replay
    ));
    std::fs::remove_dir_all(folder).expect("removed");
}

#[test]
fn damage_and_other_tasks_are_named() {
    let folder = folder("damage");
    let mut replay = Replay::new(SHAPE, 2);
    push_steps(&mut replay, 0, 8);
    let mark = replay.sync(&folder).expect("written");
    let other = ReplayShape {
        observation: 4,
        ..SHAPE
    };
    assert!(Replay::open(&folder, other, 2, &mark).is_err());
    assert!(Replay::open(&folder, SHAPE, 1, &mark).is_err());
    let path = folder.join("journal");
    let mut bytes = std::fs::read(&path).expect("read");
    bytes[40] ^= 1;
    std::fs::write(&path, bytes).expect("written");
    let error = Replay::open(&folder, SHAPE, 2, &mark).expect_err("damaged");
    assert!(error.to_string().contains("journal"), "{error}");
    std::fs::remove_dir_all(folder).expect("removed");
}

#[test]
fn a_step_takes_the_bytes_that_its_shape_says() {
    let mut replay = Replay::new(SHAPE, 2);
    push_steps(&mut replay, 0, 35);
    let bytes = |lane: &Lane| {
        size_of_val(&lane.observations[..])
            + size_of_val(&lane.poses[..])
            + size_of_val(&lane.stages[..])
            + size_of_val(&lane.actions[..])
            + size_of_val(&lane.learned_rewards[..])
            + size_of_val(&lane.task_rewards[..])
            + size_of_val(&lane.marks[..])
            + size_of_val(&lane.episode_of[..])
    };
    let held: usize = replay.lanes.iter().map(bytes).sum();
    let first_state = 4 * (SHAPE.observation + SHAPE.pose) + 1;
    let n_first_states = replay.n_episodes();
    assert_eq!(
        held - n_first_states * first_state,
        replay.len() * SHAPE.step_bytes()
    );
}

/// QPA's batches: rows 0 to 49 from everything, 50 to 99 from the newest ten steps of both lanes.
#[test]
fn half_of_a_batch_is_recent_where_the_rule_says_so() {
    let mut replay = Replay::new(SHAPE, 2);
    push_steps(&mut replay, 0, 60);
    let rule = BatchRule {
        recent: Some(10),
        ..BatchRule::default()
    };
    let batch = replay.draw(100, &mut Rng::new(1, Stream::Test, 0), &rule);
    let newest: Vec<f32> = replay
        .lanes
        .iter()
        .flat_map(|lane| &lane.learned_rewards[55..60])
        .copied()
        .collect();
    let n_new = |rewards: &[f32]| rewards.iter().filter(|r| newest.contains(r)).count();
    assert_eq!(n_new(&batch.reward[50..]), 50);
    assert!(n_new(&batch.reward[..50]) < 20);
    for reward in newest {
        assert!(batch.reward[50..].contains(&reward), "{reward} is drawn");
    }
    let whole = BatchRule {
        recent: Some(1_000_000),
        ..BatchRule::default()
    };
    assert_eq!(
        replay
            .draw(7, &mut Rng::new(1, Stream::Test, 0), &whole)
            .len(),
        7
    );
}

#[test]
fn time_limits_end_where_the_rule_says_so() {
    let mut replay = Replay::new(SHAPE, 2);
    push_steps(&mut replay, 0, 70);
    let n_ends = |ends_at_time_limit| {
        let rule = BatchRule {
            ends_at_time_limit,
            ..BatchRule::default()
        };
        let batch = replay.draw(700, &mut Rng::new(1, Stream::Test, 0), &rule);
        batch.not_terminal.iter().filter(|x| **x == 0.0).count()
    };
    // lane 0 ends one step in five for good, lane 1 one in seven by the clock
    let (terminal, all) = (n_ends(false), n_ends(true));
    assert!(
        (50..90).contains(&terminal) && (90..150).contains(&all),
        "{terminal} {all}"
    );
}

/// RUNE's reward, and its column through a checkpoint.
#[test]
fn disagreement_is_weighed_into_the_reward_and_kept_on_disk() {
    let folder = folder("disagreement");
    let mut replay = Replay::new(SHAPE, 2);
    push_steps(&mut replay, 0, 9);
    replay.keep_disagreement();
    push_steps(&mut replay, 9, 12);
    replay.disagreements_mut(0).fill(0.5);
    replay.note_disagreement(1, 0.25);
    let rewards = |replay: &Replay, disagreement_weight| {
        let rule = BatchRule {
            disagreement_weight,
            ..BatchRule::default()
        };
        replay
            .draw(300, &mut Rng::new(1, Stream::Test, 0), &rule)
            .reward
    };
    let plain = rewards(&replay, 0.0);
    let mut added: Vec<f32> = rewards(&replay, 2.0)
        .iter()
        .zip(&plain)
        .map(|(curious, plain)| (curious - plain) * 100.0)
        .map(f32::round)
        .collect();
    added.sort_by(f32::total_cmp);
    added.dedup();
    assert_eq!(added, [0.0, 50.0, 100.0]);
    let mark = replay.sync(&folder).expect("synced");
    let opened = Replay::open(&folder, SHAPE, 2, &mark).expect("opened");
    assert!(opened.keeps_disagreement() && same(&replay, &opened));
    assert_eq!(rewards(&opened, 2.0), rewards(&replay, 2.0));
    let _ = std::fs::remove_dir_all(&folder);
}

#[test]
fn the_typical_reward_is_a_mean_over_the_newest_complete_episodes() {
    let mut replay = Replay::new(SHAPE, 1);
    assert_eq!(replay.typical_reward(10), None);
    for (episode, reward) in [9.0, 1.0, 2.0].into_iter().enumerate() {
        replay.begin_episode(0, episode as u64, &[0.0; 3], &[0.0], None);
        for t in 0..4 {
            let step = NewStep {
                action: &[0.0, 0.0],
                learned_reward: 0.0,
                task_reward: TaskReward(reward),
                success: false,
                stage: None,
                end: (t == 3).then_some(EpisodeEnd::TimeLimit),
                next_observation: &[0.0; 3],
                next_pose: &[0.0],
            };
            replay.push(0, step);
        }
    }
    assert_eq!(replay.typical_reward(2), Some(TaskReward(1.5)));
    assert_eq!(replay.typical_reward(10), Some(TaskReward(4.0)));
}
