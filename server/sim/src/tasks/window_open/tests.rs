use domain::environment::Environment;

use super::*;
use crate::robots::sawyer_hand;
use crate::tasks::metaworld::{Simulation, picture::OBJECT_BODY};

fn window() -> Simulation<WindowOpen> {
    Simulation::new()
}

fn slide(environment: &Simulation<WindowOpen>) -> f64 {
    environment.readings().object.slide
}

/// METAWORLD.md 3.3, seed 100, step 75.
#[test]
fn the_worked_example_of_the_reward_holds() {
    let root = [0.008_681, 0.755_674, 0.16];
    let readings = Readings {
        hand: [0.07, 0.63, 0.08],
        tcp: [0.070_73, 0.634_13, 0.035_17],
        openness: 0.3,
        pads: [0.0; 2],
        command: 1.0,
        init_tcp: [0.005_88, 0.399_76, 0.149_98],
        object: WindowReading {
            root,
            slide: 0.081_712 + 0.04 - root[0],
            init_handle: [-0.14, 0.69, 0.202],
        },
    };
    let judgement = WindowOpen::judge(&readings);
    assert!((judgement.in_place_reward - 0.296_761).abs() < 1e-4);
    assert!((judgement.grasp_reward - 0.475_837).abs() < 1e-4);
    assert!((judgement.reward - 2.236_496).abs() < 1e-3, "{judgement:?}");
    assert!(!judgement.success);
}

#[test]
fn the_first_observation_shows_this_episode_twice_and_hides_the_goal() {
    let mut environment = window();
    let observation = environment.reset(7);
    assert_eq!(observation[..18], observation[18..36]);
    assert_eq!(observation[36..], [0.0; 3]);
    let handle = handle(environment.readings().object.root, 0.0);
    assert!((f64::from(observation[5]) - handle[1]).abs() < 1e-6);
}

#[test]
fn a_pushed_pane_stops_where_the_window_is_open() {
    let mut environment = window();
    let mut observation = environment.reset(1);
    let mut widest: f64 = 0.0;
    for _ in 0..500 {
        observation = environment
            .step(&expert(&observation))
            .expect("the expert's actions fit")
            .observation;
        widest = widest.max(slide(&environment));
    }
    assert!(widest < 0.21, "{widest} m");
}

#[test]
fn a_pose_is_drawn_where_the_physics_had_it() {
    let mut environment = window();
    let mut observation = environment.reset(3);
    for _ in 0..95 {
        let step = environment.step(&expert(&observation));
        observation = step.expect("the expert's actions fit").observation;
    }
    let readings = environment.readings();
    let frame = place(&environment.pose());
    assert_eq!(frame.len(), scene().n_bodies);
    let hand = frame[sawyer_hand::HAND_BODY].position;
    assert!((f64::from(hand[0]) - readings.hand[0]).abs() < 1e-6);
    let pane_x = f64::from(frame[OBJECT_BODY + 1].position[0]);
    assert!((pane_x - readings.object.root[0] - readings.object.slide).abs() < 1e-6);
    assert!(
        readings.object.slide > 0.05,
        "the window is on its way: {}",
        readings.object.slide
    );
}

#[test]
fn an_episode_goes_on_bit_for_bit_from_a_snapshot_taken_while_pushing() {
    let mut environment = window();
    let mut observation = environment.reset(5);
    let advance = |environment: &mut Simulation<WindowOpen>, observation: &mut Vec<f32>| {
        let step = environment.step(&expert(observation));
        *observation = step.expect("the expert's actions fit").observation;
        observation.iter().map(|x| x.to_bits()).collect::<Vec<_>>()
    };
    while slide(&environment) < 0.05 {
        advance(&mut environment, &mut observation);
    }
    let mut restored = window();
    let snapshot = environment.snapshot();
    restored.restore(&snapshot).expect("it is its own snapshot");
    let mut observation_restored = observation.clone();
    for _ in 0..300 {
        assert_eq!(
            advance(&mut environment, &mut observation),
            advance(&mut restored, &mut observation_restored)
        );
    }
}
