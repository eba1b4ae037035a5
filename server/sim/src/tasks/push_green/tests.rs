use super::*;
use crate::course::tests::{assert_loses_the_episode, spoil_a_free_body};
use crate::expert::{Rollout, rollout};

/// A desk with its arm at home and everything closed, as DYNAMICS R1–R5 start.
fn at_home() -> PushGreen {
    let start = desk::Start {
        sliding: [0.0; 2],
        loose: [
            [-0.4, 0.7, 0.799],
            [0.15, 0.78, 0.849_784_49],
            [0.15, 0.63, 0.774_784_49],
        ],
    };
    PushGreen {
        spec: spec(),
        state: State::with(0, &panda::HOME, &start),
    }
}

fn advance(environment: &mut PushGreen, action: [f32; ACTION_SIZE], n_steps: usize) {
    for _ in 0..n_steps {
        environment.step(&action).expect("the action fits");
    }
}

fn play(seeds: std::ops::Range<u64>, policy: &mut dyn FnMut(&[f32]) -> Vec<f32>) -> Vec<Rollout> {
    let mut environment = PushGreen::new();
    seeds
        .map(|seed| rollout(&mut environment, seed, policy).expect("the episode runs to its end"))
        .collect()
}

fn mean_return(rollouts: &[Rollout]) -> f64 {
    rollouts.iter().map(|r| r.task_return).sum::<f64>() / rollouts.len() as f64
}

/// DYNAMICS R3: millimetres along the commanded axis after so many steps of one constant unit
/// action from home.
#[test]
fn the_end_effector_follows_a_unit_action_as_recorded() {
    const AFTER: [usize; 6] = [1, 2, 5, 10, 20, 50];
    const RECORDED_MM: [(usize, f32, [f64; 6]); 6] = [
        (0, 1.0, [0.68, 2.01, 6.76, 14.90, 31.24, 79.96]),
        (0, -1.0, [0.68, 2.02, 6.78, 14.94, 31.28, 80.21]),
        (1, 1.0, [1.24, 2.82, 7.65, 15.74, 31.92, 80.49]),
        (1, -1.0, [1.24, 2.82, 7.66, 15.76, 31.98, 80.78]),
        (2, 1.0, [0.73, 2.10, 6.93, 15.19, 31.70, 81.13]),
        (2, -1.0, [0.73, 2.09, 6.91, 15.16, 31.67, 81.30]),
    ];
    for (axis, sign, recorded) in RECORDED_MM {
        let mut environment = at_home();
        let start = environment.readings().end_effector();
        let mut action = [0.0, 0.0, 0.0, 0.0, -0.5];
        action[axis] = sign;
        let mut n = 0;
        for (after, millimetres) in AFTER.into_iter().zip(recorded) {
            advance(&mut environment, action, after - n);
            n = after;
            let there = environment.readings().end_effector();
            let moved = f64::from(sign) * (there[axis] - start[axis]) * 1000.0;
            let error = (moved / millimetres - 1.0).abs();
            assert!(
                error < 0.05,
                "axis {axis}, {sign}, {after}: {moved} mm, not {millimetres}"
            );
        }
    }
}

/// DYNAMICS R2: gravity is compensated.
#[test]
fn an_arm_without_a_command_stays_where_it_is() {
    let mut environment = at_home();
    let start = environment.readings().end_effector();
    advance(&mut environment, [0.0, 0.0, 0.0, 0.0, -0.5], 100);
    let end = environment.readings().end_effector();
    for (start, end) in start.iter().zip(end) {
        assert!((start - end).abs() < 1e-4, "{start} to {end}");
    }
}

/// DYNAMICS R4.
#[test]
fn wrist_and_fingers_follow_their_commands_as_recorded() {
    let mut environment = at_home();
    let mut n = 0;
    for (after, turned) in [(1, 0.012_66), (2, 0.025_47), (5, 0.063_87), (50, 0.639_98)] {
        advance(&mut environment, [0.0, 0.0, 0.0, 1.0, -0.5], after - n);
        n = after;
        let is = environment.readings().joints[6] - panda::HOME[6];
        assert!(
            (is / turned - 1.0).abs() < 0.05,
            "{after}: {is} rad, not {turned}"
        );
    }
    for (command, track) in [
        (
            1.0,
            [
                (2, 0.011_87),
                (5, 0.0179),
                (10, 0.0278),
                (20, 0.037_33),
                (50, 0.039_99),
            ],
        ),
        (
            -1.0,
            [
                (2, 0.009_38),
                (5, 0.007_37),
                (10, 0.004_07),
                (20, 0.000_89),
                (50, 0.0),
            ],
        ),
    ] {
        let mut environment = at_home();
        let mut n = 0;
        for (after, width) in track {
            advance(&mut environment, [0.0, 0.0, 0.0, 0.0, command], after - n);
            n = after;
            for finger in &environment.readings().joints[7..] {
                let off = (finger - width).abs();
                assert!(off < 1e-3, "{command}, {after}: {finger} m, not {width}");
            }
        }
    }
}

/// A start may have joint 6 beyond what its servo takes (2.1817); the end effector is still asked
/// to stay where it is, wrist and fingers only where their servos can bring them.
#[test]
fn what_is_asked_of_the_arm_ends_at_the_servos_only_for_wrist_and_fingers() {
    let mut q = panda::HOME;
    q[5] = 2.195;
    q[6] = 2.96;
    let targets = panda::targets(&q, &[0.0, 0.0, 0.0, 1.0, 1.0]);
    assert_eq!(targets[..6], q[..6]);
    assert_eq!(targets[6..], [2.9671, 0.04, 0.04]);
}

/// DYNAMICS R5: change of one joint whose target is 0.1 rad away, after 0.02, 0.1, 0.2 and 0.5 s.
#[test]
fn each_joint_follows_a_step_as_recorded() {
    const RECORDED: [[f64; 4]; 7] = [
        [0.012_626, 0.057_455, 0.083_624, 0.099_02],
        [0.009_309, 0.056_485, 0.084_489, 0.099_27],
        [0.011_255, 0.057_091, 0.083_975, 0.099_12],
        [0.011_493, 0.057_409, 0.083_787, 0.099_073],
        [0.018_782, 0.070_407, 0.091_874, 0.099_82],
        [0.018_451, 0.070_427, 0.091_936, 0.099_826],
        [0.021_339, 0.070_34, 0.091_236, 0.099_774],
    ];
    for (joint, recorded) in RECORDED.into_iter().enumerate() {
        let State {
            mut world, panda, ..
        } = at_home().state;
        let mut targets = panda::HOME;
        targets[joint] += 0.1;
        for step in 1..=25 {
            panda.hold(&mut world.physics, &targets);
            assert!(world.step());
            let changed = panda.joints(&world.physics)[joint] - panda::HOME[joint];
            let at = [1, 5, 10, 25].iter().position(|n| *n == step);
            if let Some(theirs) = at.map(|i| recorded[i]) {
                let error = (changed / theirs - 1.0).abs();
                assert!(
                    error < 0.1,
                    "joint {joint}, {step}: {changed} rad, not {theirs}"
                );
            }
        }
    }
}

/// DYNAMICS R7, `press`: 20 of 20, return 395.5 ± 31.4.
#[test]
fn the_expert_turns_the_light_on_in_every_episode() {
    let rollouts = play(0..20, &mut expert);
    let failed: Vec<_> = (0..20).filter(|i| !rollouts[*i].success).collect();
    assert!(
        failed.is_empty(),
        "no light in the episodes of seeds {failed:?}"
    );
    let mean = mean_return(&rollouts);
    assert!((mean / 395.5 - 1.0).abs() < 0.15, "mean return {mean}");
}

/// DYNAMICS R7: 234 ± 37, no success.
#[test]
fn random_actions_earn_what_they_earn_in_the_original() {
    let mut rng = Rng::new(3, Stream::Test, 0);
    let rollouts = play(0..200, &mut |_| {
        (0..ACTION_SIZE)
            .map(|_| rng.uniform_in(-1.0, 1.0) as f32)
            .collect()
    });
    let mean = mean_return(&rollouts);
    assert!((mean / 234.0 - 1.0).abs() < 0.2, "mean return {mean}");
    let n_lit = rollouts.iter().filter(|r| r.success).count();
    assert!(n_lit <= 2, "{n_lit} of 200 episodes with a light");
}

/// DYNAMICS R8: over 200 resets of the original.
#[test]
fn episodes_begin_where_the_originals_do() {
    let mut environment = PushGreen::new();
    let starts: Vec<Vec<f32>> = (0..400).map(|seed| environment.reset(seed)).collect();
    let mean = |i: usize| starts.iter().map(|s| f64::from(s[i])).sum::<f64>() / 400.0;
    for (i, theirs) in [-0.0008, 0.5616, 0.9385].into_iter().enumerate() {
        assert!((mean(i) - theirs).abs() < 0.03, "{i}: {}", mean(i));
    }
    let button = BUTTONS[GREEN];
    let away = |s: &Vec<f32>| -> f64 {
        let squares = (0..3).map(|i| (f64::from(s[i]) - button[i]).powi(2));
        squares.sum::<f64>().sqrt()
    };
    let mean_away = starts.iter().map(away).sum::<f64>() / 400.0;
    assert!((mean_away - 0.374).abs() < 0.02, "{mean_away}");
    for start in &starts {
        assert_eq!(start[..MOMENT_SIZE], start[MOMENT_SIZE..]);
        assert_eq!(start[7..13], [0.0; 6], "buttons and lights");
    }
}

#[test]
fn an_observation_shows_the_step_before_in_its_second_half() {
    let mut environment = PushGreen::new();
    let first = environment.reset(4);
    let step = environment
        .step(&[1.0, 0.0, 1.0, 0.0, 1.0])
        .expect("the action fits");
    assert_eq!(step.observation[MOMENT_SIZE..], first[..MOMENT_SIZE]);
    assert_ne!(step.observation[..MOMENT_SIZE], first[..MOMENT_SIZE]);
}

#[test]
fn a_lit_light_is_worth_a_quarter_and_distance_the_rest() {
    let mut readings = at_home().readings();
    readings.desk[LIGHTS + GREEN] = -0.004_53;
    let off = readings.reward();
    assert!(!readings.is_lit());
    readings.desk[LIGHTS + GREEN] = -0.004_531;
    assert!(readings.is_lit());
    assert!((readings.reward() - off - 0.25).abs() < 1e-12);
    // ‖(0.01732, 0.65303, 1.11305) − (−0.25, 0.625, 0.76)‖ = 0.44373
    assert!((off - 0.75 * (1.0 - 0.443_73)).abs() < 1e-4, "{off}");
}

#[test]
fn a_pose_shows_the_hand_where_it_is_and_the_light_when_it_is_on() {
    let environment = at_home();
    let mut pose = environment.pose();
    let frame = place(&pose);
    let hand = frame[ARM_BODY + 7]
        .then(Transform::at(0.0, 0.0, 0.21))
        .position;
    for (drawn, is) in hand.iter().zip(environment.readings().end_effector()) {
        assert!((f64::from(*drawn) - is).abs() < 1e-5, "{hand:?}");
    }
    let light = DESK_BODY + 2 + desk::N_BUTTONS + GREEN;
    let height = |frame: &Frame| frame[light].position[2];
    pose[N_JOINTS + LIGHTS + GREEN] = -0.0046;
    assert!(height(&place(&pose)) > height(&frame) + 0.02);
}

#[test]
fn a_number_that_is_none_or_too_large_to_be_shown_loses_the_episode() {
    assert_loses_the_episode(PushGreen::new(), |environment| {
        spoil_a_free_body(&mut environment.state.world);
    });
    assert_loses_the_episode(PushGreen::new(), |environment| {
        environment.state.before[0] = 1e300;
    });
}
