use domain::environment::Environment;

use super::*;
use crate::tasks::metaworld::Simulation;

/// METAWORLD.md 2 and 3.7, seed 100, step 42.
fn example() -> Readings<Block> {
    Readings {
        hand: [-0.001, 0.785, 0.099],
        tcp: [-0.001_39, 0.790_10, 0.053_90],
        openness: 0.58,
        pads: [0.818_48, 0.754_41],
        command: 0.7,
        init_tcp: [0.006_00, 0.600_48, 0.149_35],
        object: Block {
            position: [0.002_308, 0.782_583, 0.069_951],
            turn: [0.0, 0.0, 0.0, 1.0],
            start: [0.008_68, 0.627_84, 0.069_94],
        },
    }
}

#[test]
fn the_worked_example_of_the_reward_holds() {
    let judgement = SweepInto::judge(&example());
    assert!((judgement.obj_to_target - 0.057_464).abs() < 1e-5);
    assert!((judgement.in_place_reward - 0.989_003).abs() < 1e-4);
    assert!((judgement.grasp_reward - 0.463_793).abs() < 1e-4);
    assert!((judgement.reward - 3.696_070).abs() < 1e-3, "{judgement:?}");
}

#[test]
fn pads_far_outside_cage_a_tenth_however_far() {
    let at = |outside: f64| {
        let mut readings = example();
        let y = readings.object.position[1];
        readings.pads = [y + outside, y - outside];
        SweepInto::judge(&readings).grasp_reward
    };
    assert!((at(0.06) - at(0.3)).abs() < 1e-12);
    assert!(at(0.049) > 4.0 * at(0.051));
}

#[test]
fn a_block_left_alone_stays_where_it_lies() {
    let mut environment = Simulation::<SweepInto>::new();
    environment.reset(5);
    for _ in 0..200 {
        environment.step(&[0.0; 4]).expect("a valid action");
    }
    let Block {
        position, start, ..
    } = environment.readings().object;
    assert!(distance(position, start) < 1e-3, "{position:?}, {start:?}");
}

#[test]
fn a_block_over_the_hole_falls_in_and_comes_to_rest_at_the_bottom() {
    let mut environment = Simulation::<SweepInto>::with_root([0.0, 0.84, 0.07]);
    for _ in 0..100 {
        environment.step(&[0.0; 4]).expect("a valid action");
    }
    let z = environment.readings().object.position[2];
    assert!((z - 0.02).abs() < 0.001, "{z}");
}

/// The fist presses the block against the rim of the hole with hundreds of newtons.
#[test]
fn the_expert_never_pushes_the_block_through_the_table() {
    let mut environment = Simulation::<SweepInto>::new();
    for seed in 0..20 {
        let mut observation = environment.reset(seed);
        for _ in 0..500 {
            let step = environment.step(&expert(&observation));
            observation = step.expect("the expert's actions fit").observation;
        }
        let Block { position, .. } = environment.readings().object;
        assert!(position[2] > 0.0, "seed {seed}: {position:?}");
    }
}
