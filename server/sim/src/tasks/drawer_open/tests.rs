use domain::environment::Environment;

use super::*;
use crate::tasks::metaworld::Simulation;

/// METAWORLD.md 3.2, seed 100, step 81.
#[test]
fn the_worked_example_of_the_reward_holds() {
    let root = [0.008_68, 0.9, 0.0];
    let readings = Readings {
        hand: [0.005_096, 0.607_378, 0.075_956],
        tcp: [0.005, 0.607, 0.031],
        openness: 1.0,
        pads: [0.0; 2],
        command: -1.0,
        init_tcp: [0.006_00, 0.600_48, 0.149_35],
        object: Drawer {
            root,
            slide: 0.632_183 - 0.73,
        },
    };
    let judgement = DrawerOpen::judge(&readings);
    assert!((judgement.in_place_reward - 0.460_335).abs() < 1e-4);
    assert!((judgement.grasp_reward - 0.817_981).abs() < 1e-4);
    assert!((judgement.reward - 6.391_581).abs() < 1e-3, "{judgement:?}");
    assert!(!judgement.success);
}

/// METAWORLD_EXPERTS.md: q is about −0.202 in the end, 4 cm beyond the stop.
#[test]
fn the_expert_pulls_the_drawer_past_its_soft_stop() {
    let mut environment = Simulation::<DrawerOpen>::new();
    for seed in 0..5 {
        let mut observation = environment.reset(seed);
        for _ in 0..300 {
            let step = environment.step(&expert(&observation));
            observation = step.expect("the expert's actions fit").observation;
        }
        let slide = environment.readings().object.slide;
        assert!((slide + 0.202).abs() < 0.005, "seed {seed}: {slide}");
    }
}

#[test]
fn a_drawer_at_its_stop_is_three_centimetres_short_of_the_goal() {
    let root = [0.0, 0.9, 0.0];
    assert!((distance(handle(root, -0.16), goal(root)) - 0.03).abs() < 1e-12);
}
