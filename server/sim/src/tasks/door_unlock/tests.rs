use domain::environment::Environment;

use super::*;
use crate::tasks::metaworld::Simulation;

/// METAWORLD.md 3.5, seed 100, step 39.
#[test]
fn the_worked_example_of_the_reward_holds() {
    let root = minus([0.008_68, 0.695_92, 0.211], pivot([0.0; 3]));
    let readings = Readings {
        hand: [0.014_957, 0.638_964, 0.096_118],
        tcp: [0.015, 0.644, 0.051],
        openness: 0.3,
        pads: [0.0; 2],
        command: 1.0,
        init_tcp: [0.006_00, 0.600_48, 0.149_35],
        object: Lock {
            root,
            angle: angle_of(root, [0.075_053, 0.655_918, 0.149_398]),
        },
    };
    let judgement = DoorUnlock::judge(&readings);
    assert!(
        (judgement.in_place_reward - 0.575_504).abs() < 1e-3,
        "{judgement:?}"
    );
    assert!(
        (judgement.grasp_reward - 0.279_722).abs() < 1e-4,
        "{judgement:?}"
    );
    assert!((judgement.reward - 5.163_479).abs() < 1e-2, "{judgement:?}");
}

#[test]
fn the_lever_hangs_down_at_first_and_stays_so_untouched() {
    let mut environment = Simulation::<DoorUnlock>::new();
    let observation = environment.reset(2);
    let hanging = environment.readings().object;
    let tip = tip(hanging.root, std::f64::consts::FRAC_PI_2);
    assert!((f64::from(observation[6]) - tip[2]).abs() < 1e-5);
    for _ in 0..100 {
        environment.step(&[0.0; 4]).expect("a valid action");
    }
    let angle = environment.readings().object.angle;
    assert!((angle - 1.57).abs() < 0.002, "{angle}");
}

#[test]
fn a_tip_tells_its_angle() {
    for angle in [-0.7, 0.0, 0.6, 1.57, 2.2] {
        let root = [0.05, 0.8, 0.15];
        assert!((angle_of(root, tip(root, angle)) - angle).abs() < 1e-12);
    }
}

/// METAWORLD.md 1.9: recordings reach −0.74, where a rigid stop would hold.
#[test]
fn the_expert_overturns_the_lever_into_its_soft_stop() {
    let mut environment = Simulation::<DoorUnlock>::new();
    for seed in 0..5 {
        let mut observation = environment.reset(seed);
        let mut least: f64 = 0.0;
        for _ in 0..300 {
            let step = environment.step(&expert(&observation));
            observation = step.expect("the expert's actions fit").observation;
            least = least.min(environment.readings().object.angle);
        }
        assert!((-0.9..-0.2).contains(&least), "seed {seed}: {least}");
    }
}
