use domain::environment::Environment;

use super::*;
use crate::tasks::metaworld::Simulation;

/// METAWORLD.md 3.6, seed 100, step 51.
#[test]
fn the_worked_example_of_the_reward_holds() {
    let root = [0.004_34, 0.813_92, 0.0];
    let readings = Readings {
        hand: [0.064, 0.705, 0.136],
        tcp: [0.064_11, 0.710_30, 0.090_62],
        openness: 0.3,
        pads: [0.0; 2],
        command: 1.0,
        init_tcp: [0.005_88, 0.399_76, 0.149_98],
        object: Faucet {
            root,
            angle: angle_of(root, [0.124_691, 0.685_990, 0.114]),
        },
    };
    let judgement = FaucetOpen::judge(&readings);
    assert!(
        (judgement.in_place_reward - 0.222_965).abs() < 1e-3,
        "{judgement:?}"
    );
    assert!(
        (judgement.grasp_reward - 0.966_764).abs() < 1e-3,
        "{judgement:?}"
    );
    assert!((judgement.reward - 5.204_847).abs() < 1e-2, "{judgement:?}");
}

#[test]
fn a_handle_tells_its_angle_also_past_the_stops() {
    for angle in [-2.2, -1.57, 0.0, 1.2, 2.28] {
        let root = [0.05, 0.8, 0.0];
        assert!((angle_of(root, handle(root, angle)) - angle).abs() < 1e-12);
    }
}

/// METAWORLD.md 1.9: 147 N·m/rad, where a rigid stop would hold.
#[test]
fn the_expert_turns_the_knob_past_its_soft_stop() {
    let mut environment = Simulation::<FaucetOpen>::new();
    let mut observation = environment.reset(1);
    let mut widest: f64 = 0.0;
    for _ in 0..300 {
        let step = environment.step(&expert(&observation));
        observation = step.expect("the expert's actions fit").observation;
        widest = widest.max(environment.readings().object.angle);
    }
    assert!((1.6..2.5).contains(&widest), "{widest}");
}
