use domain::environment::Environment;

use super::*;
use crate::tasks::metaworld::Simulation;

fn readings(hand: Point, angle: f64) -> Readings<Door> {
    // The handle of a shut door is at (0.24506, 0.67070, 0.15004).
    let root = minus([0.245_06, 0.670_70, 0.150_04], handle([0.0; 3], 0.0));
    Readings {
        hand,
        tcp: plus(hand, [0.0, 0.0, -0.045]),
        openness: 0.3,
        pads: [0.0; 2],
        command: 1.0,
        init_tcp: [0.006_00, 0.600_48, 0.149_35],
        object: Door {
            root,
            angle,
            seen_angle: angle,
        },
    }
}

/// METAWORLD.md 3.1, seed 100, step 12.
#[test]
fn the_worked_example_of_a_shut_door_holds() {
    let judgement = DoorOpen::judge(&readings([0.084_50, 0.674_44, 0.274_72], 0.0));
    assert!(
        (judgement.near_object - 0.548_498).abs() < 1e-4,
        "{judgement:?}"
    );
    assert!((judgement.in_place_reward - 0.036_591_5).abs() < 1e-6);
    assert!((judgement.reward - 1.389_728).abs() < 1e-3, "{judgement:?}");
}

/// METAWORLD.md 3.1, seed 100, step 57: ready, with a closed fist.
#[test]
fn the_worked_example_of_a_half_open_door_holds() {
    let angle = -0.808_85;
    let shut = readings([0.0; 3], 0.0);
    let behind = plus(handle(shut.object.root, angle), [0.0, 0.03, -0.01]);
    let judgement = DoorOpen::judge(&readings(behind, angle));
    assert!((judgement.near_object - 1.0).abs() < 1e-9);
    assert!((judgement.in_place_reward - 0.331_918).abs() < 1e-5);
    assert!((judgement.reward - 4.655_34).abs() < 1e-4, "{judgement:?}");
}

#[test]
fn a_door_that_is_open_too_wide_no_longer_counts() {
    let at = |angle| DoorOpen::judge(&readings([0.2, 0.6, 0.2], angle)).success;
    assert!(!at(-1.36) && at(-1.40) && at(-1.80) && !at(-1.83));
}

#[test]
fn handle_and_quaternion_turn_with_the_door() {
    let root = [0.05, 0.9, 0.15];
    for angle in [0.01, -0.4, -1.3, -2.02] {
        assert!((angle_of(root, handle(root, angle)) - angle).abs() < 1e-12);
        let [_, _, _, w] = handle_turn(angle);
        let length: f64 = handle_turn(angle).iter().map(|x| x * x).sum();
        assert!((length - 1.0).abs() < 1e-6 && w > 0.0, "{angle}: {w}");
    }
}

#[test]
fn the_expert_passes_the_window_of_success_and_goes_on() {
    let mut environment = Simulation::<DoorOpen>::new();
    let mut observation = environment.reset(4);
    for _ in 0..300 {
        let step = environment.step(&expert(&observation));
        observation = step.expect("the expert's actions fit").observation;
    }
    let angle = environment.readings().object.angle;
    assert!((-2.15..-1.83).contains(&angle), "{angle}");
}
