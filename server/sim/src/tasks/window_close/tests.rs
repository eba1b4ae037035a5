use domain::environment::Environment;

use super::*;
use crate::tasks::metaworld::Simulation;

/// METAWORLD.md 3.4, seed 100, step 72 of the first episode.
#[test]
fn the_worked_example_of_the_reward_holds() {
    let root = [0.0, 0.791_755, 0.2];
    let readings = Readings {
        hand: [0.13, 0.67, 0.12],
        tcp: [0.131_69, 0.669_37, 0.077_07],
        openness: 0.3,
        pads: [0.0; 2],
        command: 1.0,
        init_tcp: [0.005_88, 0.399_76, 0.149_98],
        object: WindowReading {
            root,
            slide: 0.112_035 - 0.01,
            init_handle: [0.11, 0.69, 0.202],
        },
    };
    let judgement = WindowClose::judge(&readings);
    assert!((judgement.in_place_reward - 0.094_154).abs() < 1e-4);
    assert!((judgement.grasp_reward - 0.733_141).abs() < 1e-4);
    assert!((judgement.reward - 0.910_341).abs() < 1e-3, "{judgement:?}");
}

#[test]
fn the_window_starts_wide_open() {
    let mut environment = Simulation::<WindowClose>::new();
    let observation = environment.reset(3);
    let readings = environment.readings().object;
    assert!((readings.slide - 0.2).abs() < 1e-6, "{readings:?}");
    assert!((f64::from(observation[4]) - 0.21).abs() < 1e-6);
    assert!((readings.init_handle[0] - 0.21).abs() < 1e-6);
}
