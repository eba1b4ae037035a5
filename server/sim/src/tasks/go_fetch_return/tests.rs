use super::*;
use crate::course::tests::{assert_loses_the_episode, spoil_a_free_body};
use crate::expert::{Rollout, rollout};
use crate::robots::planar_robot::PlanarState;

type Policy<'a> = &'a mut dyn FnMut(&[f32]) -> Vec<f32>;

fn play(seed: u64, policy: Policy<'_>) -> Rollout {
    rollout(&mut GoFetchReturn::new(), seed, policy).expect("a valid action")
}

fn success_rate(policy: Policy<'_>) -> f64 {
    let n_successes = (0..300).filter(|&seed| play(seed, policy).success).count();
    n_successes as f64 / 300.0
}

/// A state in which nothing but these numbers matters.
fn view(to_object: f32, openness: f32, is_held: bool, to_goal: f32) -> View {
    View {
        robot: PlanarState {
            position: [0.0; 2],
            velocity: [0.0; 2],
            heading: [1.0, 0.0],
            turn_rate: 0.0,
        },
        openness,
        is_held,
        jaws_to_object: [to_object, 0.0],
        object_to_goal: [to_goal, 0.0],
    }
}

/// A step in a direction of the world's axes.
fn drive(environment: &mut GoFetchReturn, way: [f32; 2], jaws: f32) {
    let [ahead, left] = environment.state.view().robot.to_own(way);
    environment.step(&[ahead, left, jaws]).expect("valid");
}

/// An episode of the expert up to the first step at which the object is held.
fn holding(seed: u64) -> GoFetchReturn {
    let mut environment = GoFetchReturn::new();
    let mut observation = environment.reset(seed);
    while !environment.state.is_held {
        observation = environment
            .step(&expert(&observation))
            .expect("a valid action")
            .observation;
        assert_eq!(
            environment.state.course.end(EPISODE_LEN),
            None,
            "never held"
        );
    }
    environment
}

#[test]
fn the_expert_succeeds_and_a_random_policy_does_not() {
    let expert_rate = success_rate(&mut expert);
    assert!(expert_rate >= 0.98, "expert: {expert_rate}");
    let mut rng = Rng::new(1, Stream::Rollout, 0);
    let random_rate = success_rate(&mut |_| {
        (0..ACTION_SIZE)
            .map(|_| rng.uniform_in(-1.0, 1.0) as f32)
            .collect()
    });
    assert!(random_rate <= 0.02, "random: {random_rate}");
}

#[test]
fn the_expert_passes_through_the_stages_in_order_and_lingers_in_each() {
    let mut mean_steps = [0.0; STAGES.len()];
    for seed in 0..100 {
        let stages = play(seed, &mut expert).stages;
        assert!(stages.is_sorted(), "seed {seed}: {stages:?}");
        for stage in stages {
            mean_steps[usize::from(stage)] += 0.01;
        }
    }
    assert!(mean_steps.iter().all(|&n| n >= 6.0), "{mean_steps:?}");
}

#[test]
fn the_reward_grows_along_the_experts_way() {
    let (mut losses, mut gains) = (0.0, 0.0);
    for seed in 0..50 {
        let rewards = play(seed, &mut expert).task_rewards;
        // Turning at the start costs a little, and so does the way round when a taken object
        // swings about the robot towards the goal.
        losses += rewards
            .windows(2)
            .map(|w| (w[0] - w[1]).max(0.0))
            .sum::<f64>();
        gains += rewards[rewards.len() - 1] - rewards[0];
        let quarters: Vec<f64> = rewards.chunks(25).map(|c| c.iter().sum()).collect();
        assert!(quarters.is_sorted(), "seed {seed}: {quarters:?}");
    }
    assert!(losses < 0.25 * gains, "lost {losses}, won {gains}");
}

#[test]
fn no_state_before_a_stage_pays_as_much_as_the_worst_one_after_it() {
    let grid = |n: u8| (0..=n).map(move |i| f32::from(i) / f32::from(n));
    for to_goal in grid(20).map(|x| GOAL_RADIUS + 0.01 + 3.0 * x) {
        let held = view(0.0, HELD_OPENNESS, true, to_goal).task_reward();
        for openness in grid(20).map(|x| HELD_OPENNESS + (1.0 - HELD_OPENNESS) * x) {
            for to_object in grid(60).map(|x| 3.0 * x) {
                let loose = view(to_object, openness, false, to_goal).task_reward();
                assert!(loose < held && loose.0 <= 4.0);
                if to_object > JAW_ZONE {
                    let between = view(0.0, 1.0, false, to_goal).task_reward();
                    assert!(loose <= between);
                }
            }
        }
        assert!(held < view(0.0, 0.5, true, GOAL_RADIUS).task_reward());
    }
}

#[test]
fn the_reward_agrees_with_values_worked_out_by_hand() {
    let reward = |v: View| v.task_reward().0;
    // near(1) = 0.6 · (1 − 1/3.4) + 0.4 · e⁻⁵ = 0.423529 + 0.002695
    assert!((reward(view(JAW_ZONE + 1.0, 1.0, false, 1.0)) - 3.0 * 0.426_225).abs() < 1e-5);
    assert!((reward(view(JAW_ZONE + 1.0, 0.5, false, 1.0)) - 3.0 * 0.426_225).abs() < 1e-5);
    assert!(
        (reward(view(0.0, 0.45, true, 1.0 + GOAL_RADIUS)) - (5.0 + 3.0 * 0.426_225)).abs() < 1e-5
    );
    assert!((reward(view(0.05, 0.725, false, 1.0)) - 3.5).abs() < 1e-5);
    assert!((reward(view(0.05, 0.725, false, 0.1)) - 10.0).abs() < 1e-12);
}

#[test]
fn a_held_object_comes_along_and_a_dropped_one_stays() {
    let mut environment = holding(3);
    let start = environment.state.view();
    for _ in 0..10 {
        environment.step(&[0.0, 0.0, 1.0]).expect("valid");
    }
    let view = environment.state.view();
    assert!(
        norm(view.jaws_to_object) < 0.01,
        "{:?}",
        view.jaws_to_object
    );
    let goal = start.object_to_goal;
    let away = [-goal[0] / norm(goal), -goal[1] / norm(goal)];
    for _ in 0..15 {
        drive(&mut environment, [-away[0], -away[1]], 0.0);
    }
    let carried = environment.state.view();
    assert!(carried.is_held && norm(carried.object_to_goal) < norm(goal) - 0.2);
    for _ in 0..15 {
        drive(&mut environment, away, -1.0);
    }
    let dropped = environment.state.view();
    assert!(!dropped.is_held && norm(dropped.jaws_to_object) > 0.1);
}

#[test]
fn a_robot_that_runs_against_the_walls_stays_inside() {
    let mut environment = GoFetchReturn::new();
    for (seed, way) in [[1.0, 0.0], [-1.0, 0.3], [0.1, 1.0], [1.0, -1.0]]
        .into_iter()
        .enumerate()
    {
        environment.reset(seed as u64);
        for _ in 0..EPISODE_LEN {
            drive(&mut environment, way, 1.0);
        }
        let [x, y] = environment.state.view().robot.position;
        assert!(x.abs() < FLOOR_HALF && y.abs() < FLOOR_HALF, "{x} {y}");
    }
}

#[test]
fn a_state_is_the_same_wherever_and_whichever_way_the_robot_stands() {
    let quarter = |v: [f32; 2]| [-v[1], v[0]];
    let here = View {
        robot: PlanarState {
            position: [0.3, -0.2],
            velocity: [0.4, 0.1],
            heading: [0.6, 0.8],
            turn_rate: 2.0,
        },
        openness: 0.7,
        is_held: true,
        jaws_to_object: [0.1, 0.2],
        object_to_goal: [-0.5, 0.3],
    };
    let there = View {
        robot: PlanarState {
            position: [0.1, 0.7],
            velocity: quarter(here.robot.velocity),
            heading: quarter(here.robot.heading),
            ..here.robot
        },
        jaws_to_object: quarter(here.jaws_to_object),
        object_to_goal: quarter(here.object_to_goal),
        ..here
    };
    let (seen, again) = (here.observation(), there.observation());
    assert_eq!(seen.len(), OBSERVATION_SIZE);
    let close = |a: &[f32], b: &[f32]| a.iter().zip(b).all(|(a, b)| (a - b).abs() < 1e-6);
    assert!(close(&seen, &again), "{seen:?} {again:?}");
    // ahead 0.4 · 0.6 + 0.1 · 0.8, to the left 0.1 · 0.6 − 0.4 · 0.8, a quarter of 8 rad/s
    assert!(
        close(&seen[..5], &[0.32, -0.26, 0.25, 0.4, 1.0]),
        "{seen:?}"
    );
}

#[test]
fn the_observation_stays_within_a_few_units() {
    let mut rng = Rng::new(8, Stream::Test, 0);
    let mut largest = [0.0_f32; OBSERVATION_SIZE];
    for seed in 0..100 {
        let keep = rng.uniform_in(-1.0, 1.0) as f32;
        play(seed, &mut |observation| {
            for (largest, value) in largest.iter_mut().zip(observation) {
                *largest = largest.max(value.abs());
            }
            let mut action = expert(observation);
            action[2] *= keep;
            action
        });
    }
    assert!(largest.iter().all(|&x| x <= 2.0), "{largest:?}");
}

#[test]
fn a_number_that_is_none_loses_the_episode() {
    assert_loses_the_episode(GoFetchReturn::new(), |environment| {
        spoil_a_free_body(&mut environment.state.world);
    });
    assert_loses_the_episode(GoFetchReturn::new(), |environment| {
        environment.state.goal[0] = f32::NAN;
    });
}
