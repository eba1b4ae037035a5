//! The quadruped against the original: drops, slides, motors and postures, measured with MuJoCo
//! 2.3.7.

use domain::random::{Rng, Stream};

use super::*;
use crate::articulated::vector::{Mat3, Vec3};

/// Level, straight legs, the torso at a height.
fn level(height: f64) -> Quadruped {
    let mut q = quadruped::model().rest();
    q[2] = height;
    Quadruped::new(q)
}

/// How upright the torso is.
fn upright(quadruped: &Quadruped) -> f64 {
    let q = &quadruped.simulation.q;
    Mat3::from_quaternion([q[3], q[4], q[5], q[6]]).columns[2].z
}

fn leg(quadruped: &Quadruped, index: usize) -> &[f64] {
    &quadruped.simulation.q[FIRST_LEG_COORDINATE + 4 * index..][..4]
}

fn hold(quadruped: &mut Quadruped, commands: [f64; N_MOTORS], n_steps: usize) {
    for _ in 0..n_steps {
        quadruped.advance(&commands);
    }
}

/// The same for every leg: yaw, lift, extend.
fn each_leg(commands: [f64; 3]) -> [f64; N_MOTORS] {
    std::array::from_fn(|motor| commands[motor % 3])
}

#[test]
fn it_drops_and_springs_back_as_the_original_does() {
    // Torso height every 0.08 s.
    let from_standing = [
        0.53665, 0.46434, 0.43003, 0.43302, 0.45018, 0.46199, 0.4632, 0.45872, 0.4545, 0.45298,
    ];
    let from_a_metre = [
        1.53665, 1.44051, 1.28159, 1.05988, 0.77539, 0.43384, 0.29171, 0.38377, 0.47232, 0.50202,
    ];
    for (height, rows) in [(0.57, from_standing), (1.57, from_a_metre)] {
        let mut quadruped = level(height);
        for expected in rows {
            hold(&mut quadruped, [0.0; N_MOTORS], 4);
            let found = quadruped.simulation.q[2];
            assert!(
                (found - expected).abs() < 0.003,
                "{found} instead of {expected}"
            );
            assert!(upright(&quadruped) > 0.999);
        }
    }
}

#[test]
fn at_rest_it_stands_and_feels_as_the_original_does() {
    let mut quadruped = level(0.57);
    hold(&mut quadruped, [0.0; N_MOTORS], 150);
    assert!((quadruped.simulation.q[2] - 0.4538).abs() < 0.001);
    for index in 0..4 {
        for (found, expected) in leg(&quadruped, index)
            .iter()
            .zip([0.0, -0.11213, -0.00749, 0.11882])
        {
            assert!(
                (found - expected).abs() < 0.002,
                "{found} instead of {expected}"
            );
        }
    }
    let senses = quadruped.senses;
    assert!((Vec3::from(senses.accelerometer) - Vec3::Z * 9.81).length() < 0.05);
    for [_, _, z] in senses.toe_forces {
        assert!((z + 252.19).abs() < 1.0, "{z} N");
    }
}

#[test]
fn upside_down_it_rests_on_its_back() {
    let mut quadruped = level(1.0);
    quadruped.simulation.q[3..7].copy_from_slice(&[0.0, 1.0, 0.0, 0.0]);
    hold(&mut quadruped, [0.0; N_MOTORS], 150);
    assert!((quadruped.simulation.q[2] - 0.1999).abs() < 0.002);
}

#[test]
fn thrown_forward_it_slides_and_rocks_back() {
    let mut quadruped = level(0.57);
    hold(&mut quadruped, [0.0; N_MOTORS], 150);
    let start = quadruped.simulation.q[0];
    quadruped.simulation.v.fill(0.0);
    quadruped.simulation.v[0] = 3.0;
    for (x, speed) in [
        (0.2005, 2.0721),
        (0.3264, 1.1253),
        (0.3759, 0.2151),
        (0.3667, -0.3496),
        (0.3257, -0.6285),
        (0.2672, -0.8139),
    ] {
        hold(&mut quadruped, [0.0; N_MOTORS], 4);
        let (at, v) = (quadruped.simulation.q[0] - start, quadruped.simulation.v[0]);
        assert!((at - x).abs() < 0.02, "{at} m instead of {x}");
        assert!((v - speed).abs() < 0.15, "{v} m/s instead of {speed}");
    }
}

#[test]
fn each_motor_moves_its_leg_as_in_the_original() {
    // Motor of the front left leg, command; yaw, pitch, knee, ankle after 0.04, 0.1, 0.2, 0.4 s.
    for (motor, command, rows) in [
        (
            0,
            0.5,
            [
                [0.0352, 0.0, -0.0001, 0.0001],
                [0.2229, 0.0008, -0.0029, 0.0020],
                [0.4418, 0.0001, -0.0027, 0.0026],
                [0.4890, 0.0001, -0.0001, 0.0001],
            ],
        ),
        (
            1,
            0.5,
            [
                [0.0, 0.0278, 0.0022, -0.0285],
                [0.0, 0.1664, 0.0007, -0.1673],
                [0.0, 0.3708, -0.0022, -0.3691],
                [0.0, 0.4836, -0.0005, -0.4832],
            ],
        ),
        (
            2,
            0.4,
            [
                [0.0, 0.0144, -0.0325, 0.0166],
                [0.0, 0.0787, -0.1599, 0.0814],
                [0.0, 0.1771, -0.3529, 0.1762],
                [0.0, 0.2516, -0.5025, 0.2511],
            ],
        ),
        (
            1,
            -0.5,
            [
                [0.0, -0.0277, -0.0023, 0.0285],
                [0.0, -0.1649, -0.0033, 0.1682],
                [0.0, -0.3646, -0.0043, 0.3690],
                [0.0, -0.3573, -0.0733, 0.4311],
            ],
        ),
        (
            2,
            -0.4,
            [
                [0.0, -0.0143, 0.0324, -0.0165],
                [0.0, -0.0780, 0.1587, -0.0809],
                [0.0, -0.1770, 0.3529, -0.1763],
                [0.0, -0.2523, 0.5038, -0.2516],
            ],
        ),
    ] {
        let mut quadruped = level(20.0);
        let mut commands = [0.0; N_MOTORS];
        commands[motor] = command;
        for (n_steps, expected) in [2, 3, 5, 10].into_iter().zip(rows) {
            hold(&mut quadruped, commands, n_steps);
            for (found, expected) in leg(&quadruped, 0).iter().zip(expected) {
                assert!(
                    (found - expected).abs() < 0.001,
                    "{motor}: {found} {expected}"
                );
            }
        }
    }
}

#[test]
fn held_commands_end_in_the_postures_of_the_original() {
    for (commands, height, joints) in [
        ([0.0, 1.1, 0.0], 0.9046, [0.0, 0.9227, -0.1227, -0.7993]),
        ([0.0, -1.0, 0.0], 0.1998, [0.0, -0.3584, -0.3763, 0.7369]),
        ([0.0, 0.0, 0.8], 0.4325, [0.0, 0.3889, -1.0547, 0.665]),
        ([0.0, 0.0, -0.8], 0.5117, [0.0, -0.3577, 0.881, -0.5232]),
    ] {
        let mut quadruped = level(0.57);
        hold(&mut quadruped, each_leg(commands), 600);
        assert!(
            (quadruped.simulation.q[2] - height).abs() < 0.003,
            "{commands:?}"
        );
        for (found, expected) in leg(&quadruped, 0).iter().zip(joints) {
            assert!(
                (found - expected).abs() < 0.005,
                "{commands:?}: {found} {expected}"
            );
        }
    }
}

#[test]
fn an_open_loop_trot_walks_at_the_original_pace() {
    let mut quadruped = level(0.57);
    let mut speed = 0.0;
    for step in 0..500 {
        let w = std::f64::consts::TAU * 3.0 * f64::from(step) * 0.02;
        let commands = std::array::from_fn(|motor| {
            let leg = motor / 3;
            let phase = w + if leg % 2 == 0 {
                0.0
            } else {
                std::f64::consts::PI
            };
            let side = if leg == 0 || leg == 3 { 1.0 } else { -1.0 };
            match motor % 3 {
                0 => side * 0.8 * (phase - std::f64::consts::FRAC_PI_2).sin(),
                1 => 0.8 * phase.sin().max(0.0) - 0.1,
                _ => 0.0,
            }
        });
        quadruped.advance(&commands);
        if step >= 250 {
            speed += readings(&mut quadruped).velocity[0] / 250.0;
        }
    }
    assert!((speed - 0.50).abs() < 0.05, "{speed} m/s");
    assert!(upright(&quadruped) > 0.99);
}

#[test]
fn chance_does_not_pull_the_coupled_joints_apart() {
    let mut rng = Rng::new(5, Stream::Test, 0);
    let mut widest = 0.0_f64;
    for seed in 0..10 {
        let mut quadruped = begin(seed);
        for _ in 0..1000 {
            let action = std::array::from_fn(|_| rng.uniform_in(-1.0, 1.0));
            quadruped.advance(&quadruped::commands(&action));
            for index in 0..4 {
                widest = widest.max(leg(&quadruped, index)[1..].iter().sum::<f64>().abs());
            }
        }
    }
    assert!(widest <= 0.08, "{widest} rad");
}

#[test]
fn an_episode_begins_free_of_contact_and_no_higher_than_it_must() {
    for seed in 0..20 {
        let mut quadruped = begin(seed);
        assert!(!quadruped.simulation.touches_anything(quadruped::model()));
        quadruped.simulation.q[2] -= 0.01;
        assert!(quadruped.simulation.touches_anything(quadruped::model()));
    }
}

#[test]
fn it_weighs_what_the_original_weighs() {
    assert!((quadruped::model().total_mass() - 107.117_906).abs() < 1e-5);
}

#[test]
fn standing_still_earns_half_and_falling_nothing() {
    let mut readings = readings(&mut level(0.57));
    let mut reward = |upright, speed, target| {
        readings.upright = upright;
        readings.velocity[0] = speed;
        readings.reward(target)
    };
    let is = |a: f64, b: f64| (a - b).abs() < 1e-12;
    for target in [0.5, 5.0] {
        assert!(is(reward(1.0, 0.0, target), 0.5));
        assert!(is(reward(1.0, 2.0 * target, target), 1.0));
        assert!(is(reward(1.0, -target, target), 0.0));
        assert!(is(reward(-1.0, target, target), 0.0));
    }
}
