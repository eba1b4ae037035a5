//! The walker against the original: falls, a slide and joint responses, measured with MuJoCo
//! 2.3.7, whose newer versions agree with it to 0.001.

use super::*;
use crate::course::tests::assert_loses_the_episode;

const STEP_S: f64 = 0.0025;

fn at(q: [f64; N_DOFS]) -> Simulation<N_DOFS> {
    Simulation::new(q.to_vec())
}

/// Torso height, pitch and the speed of the centre of mass after `seconds` in all.
fn watch(walker: &mut Simulation<N_DOFS>, time: &mut f64, seconds: f64) -> [f64; 3] {
    while *time < seconds - STEP_S / 2.0 {
        walker.step(walker::model(), &[0.0; N_DOFS]);
        *time += STEP_S;
    }
    let readings = Readings::of(walker);
    [readings.height, walker.q[2], readings.speed]
}

fn assert_falls(mut walker: Simulation<N_DOFS>, rows: &[(f64, [f64; 3])]) {
    let mut time = 0.0;
    for (seconds, expected) in rows {
        let found = watch(&mut walker, &mut time, *seconds);
        for (found, expected) in found.iter().zip(expected) {
            assert!(
                (found - expected).abs() < 0.005,
                "{seconds} s: {found} instead of {expected}"
            );
        }
    }
}

const FALLING: [f64; N_DOFS] = [0.0, 0.0, 0.1, 0.4, -0.6, 0.2, 0.0, -0.3, 0.1];

#[test]
fn it_falls_on_its_knees_as_the_original_does() {
    assert_falls(
        at(FALLING),
        &[
            (0.1, [1.25141, 0.10002, -0.0371]),
            (0.2, [1.15601, 0.14238, 0.25428]),
            (0.3, [0.97075, 0.16654, 0.33923]),
            (0.4, [0.68589, 0.14252, 0.3666]),
            (0.5, [0.69255, 0.04977, 0.41347]),
            (0.6, [0.72278, 0.08519, 0.23941]),
            (0.7, [0.71249, 0.24475, 0.07608]),
            // Propped on bent legs: right friction and right stops.
            (5.0, [0.53936, 0.98075, 0.0]),
        ],
    );
}

#[test]
fn it_falls_from_half_a_metre_higher_as_the_original_does() {
    let mut higher = FALLING;
    higher[0] = 0.5;
    assert_falls(
        at(higher),
        &[
            (0.1, [1.74972, 0.1, 0.0]),
            (0.2, [1.60135, 0.1, 0.0]),
            (0.3, [1.35487, 0.1, 0.0]),
            (0.4, [1.09276, 0.15964, 0.62703]),
            (0.5, [0.76068, 0.12279, 0.56817]),
            (0.6, [0.67303, 0.03019, 0.32195]),
            (0.7, [0.69474, 0.07277, 0.13425]),
        ],
    );
}

#[test]
fn it_slides_on_its_belly_until_friction_stops_it() {
    let mut lying = [0.0; N_DOFS];
    lying[0] = -1.2;
    lying[2] = std::f64::consts::FRAC_PI_2;
    let mut walker = at(lying);
    walker.v[1] = 5.0;
    let mut time = 0.0;
    for (seconds, x, speed) in [
        (0.1, 0.4501, 3.8271),
        (0.2, 0.8105, 3.7308),
        (0.4, 1.3859, 2.4436),
        (0.6, 1.7471, 1.2245),
        (0.9, 1.8285, 0.0),
    ] {
        let [_, _, found] = watch(&mut walker, &mut time, seconds);
        assert!(
            (walker.q[1] - x).abs() < 0.01,
            "{seconds} s: {}",
            walker.q[1]
        );
        assert!((found - speed).abs() < 0.05, "{seconds} s: {found} m/s");
    }
}

#[test]
fn each_motor_turns_its_joint_and_the_torso_as_in_the_original() {
    // Change of the torso's pitch, of the joint, the joint's rate; after 1, 2, 4 control steps.
    for (motor, rows) in [
        [
            [0.0063, 0.0144, 1.0399],
            [0.0236, 0.0540, 2.0230],
            [0.0889, 0.2015, 3.7215],
        ],
        [
            [-0.0006, 0.0095, 0.6942],
            [-0.0025, 0.0366, 1.3996],
            [-0.0097, 0.1461, 2.9490],
        ],
        [
            [-0.0002, 0.0223, 1.6037],
            [-0.0007, 0.0829, 3.0681],
            [-0.0026, 0.3051, 5.6165],
        ],
    ]
    .into_iter()
    .enumerate()
    {
        for side in [0, 3] {
            let start = [5.0, 0.0, 0.0, 0.5, -0.8, 0.0, 0.5, -0.8, 0.0];
            let mut walker = Walker {
                simulation: at(start),
            };
            let mut action = [0.0; ACTION_SIZE];
            action[side + motor] = 0.1;
            let joint = FIRST_LEG_JOINT + side + motor;
            for (n_steps, expected) in [1, 1, 2].into_iter().zip(rows) {
                for _ in 0..n_steps {
                    walker.advance(&action);
                }
                let Simulation { q, v, .. } = &walker.simulation;
                for (found, expected) in [q[2], q[joint] - start[joint], v[joint]]
                    .into_iter()
                    .zip(expected)
                {
                    let error = (found - expected).abs();
                    assert!(
                        error < 2e-4 + 1e-3 * expected.abs(),
                        "{motor}: {found} {expected}"
                    );
                }
            }
        }
    }
}

#[test]
fn it_weighs_what_the_original_weighs() {
    assert!((walker::model().total_mass() - 28.540_322).abs() < 1e-6);
}

#[test]
fn reward_needs_height_uprightness_and_speed() {
    let readings = |height, upright, speed| Readings {
        orientations: [[upright, 0.0]; 7],
        height,
        rates: [0.0; N_DOFS],
        speed,
    };
    let reward = |height, upright, speed| readings(height, upright, speed).reward();
    let is = |a: f64, b: f64| (a - b).abs() < 1e-12;
    assert!(is(reward(1.3, 1.0, 0.0), 1.0 / 6.0));
    assert!(is(reward(1.3, 1.0, 8.0), 1.0) && is(reward(1.3, 1.0, 20.0), 1.0));
    assert!(is(reward(1.3, 1.0, -3.0), 1.0 / 6.0));
    assert!(is(reward(0.6, -1.0, 4.0), 0.3 / 4.0 * 3.5 / 6.0));
}

#[test]
fn a_number_that_is_none_or_too_large_loses_the_episode() {
    let spoilt = |spoil: fn(&mut Simulation<N_DOFS>)| {
        assert_loses_the_episode(Locomotion::<Walker, ACTION_SIZE>::new(), |environment| {
            spoil(&mut environment.gait().simulation);
        });
    };
    spoilt(|walker| walker.v[4] = f64::NAN);
    spoilt(|walker| walker.v[4] = 1e300);
    // A place that the pose cannot show.
    spoilt(|walker| walker.q[1] = 1e39);
}
