use super::*;
use crate::world::{Timing, World};

const STEP_S: f32 = 0.02;
const GREEN: usize = 1;

/// A desk without a robot, everything closed.
fn desk() -> (World, Desk) {
    let mut world = World::new(Timing {
        step_s: STEP_S,
        n_substeps: 5,
        gravity: 9.81,
    });
    let start = Start {
        sliding: [0.0; 2],
        loose: [
            [-0.4, 0.7, 0.799],
            [0.15, 0.78, 0.849_784_49],
            [0.15, 0.63, 0.774_784_49],
        ],
    };
    let desk = Desk::new(&mut world.physics, &start);
    (world, desk)
}

/// Presses on the green button for some steps, newtons; button and light after each.
fn press(world: &mut World, desk: &mut Desk, force: f32, n_steps: u32) -> Vec<[f64; 2]> {
    let body = &mut world.physics.bodies[desk.caps[GREEN]];
    body.reset_forces(true);
    body.add_force(Vector::new(0.0, 0.0, -force), true);
    let mut track = Vec::new();
    for _ in 0..n_steps {
        assert!(world.step());
        desk.follow(&world.physics, f64::from(STEP_S));
        let positions = desk.positions(&world.physics);
        track.push([positions[2 + GREEN], positions[LIGHTS + GREEN]]);
    }
    track
}

fn is_on([_, light]: [f64; 2]) -> bool {
    light < light::ON_BELOW_M
}

/// DYNAMICS R6: after 1.5 s of a constant push. Beyond 0.1 N the original's stop stiffens, ours
/// does not.
#[test]
fn a_button_and_its_light_go_as_deep_as_in_the_original() {
    for (force, button, light) in [
        (0.0, -0.000_524, 0.000_023),
        (0.02, -0.002, -0.001_436),
        (0.04, -0.004, -0.003_436),
        (0.05, -0.005, -0.004_436),
        (0.1, -0.005_203, -0.004_639),
    ] {
        let (mut world, mut desk) = desk();
        let last = press(&mut world, &mut desk, force, 75)[74];
        for (is, should_be) in last.into_iter().zip([button, light]) {
            let off = (is - should_be).abs();
            assert!(off < 3e-5, "{force} N: {is} m, not {should_be}");
        }
    }
}

/// DYNAMICS R6: 0.07225 N, at which the button is at −0.005094.
#[test]
fn the_light_goes_on_at_the_force_and_depth_of_the_original() {
    let lit = |force: f32| {
        let (mut world, mut desk) = desk();
        let last = press(&mut world, &mut desk, force, 75)[74];
        is_on(last).then_some(last[0])
    };
    assert_eq!(lit(0.9 * 0.072_25), None);
    let depth = lit(1.1 * 0.072_25).expect("it is on at a tenth more than the threshold");
    assert!((depth / -0.005_094 - 1.0).abs() < 0.1, "{depth} m");
}

/// DYNAMICS R6: on after 24 ms at 0.5 N, off 66 ms after a push of 5 N at the latest.
#[test]
fn the_light_goes_on_at_once_and_off_soon_after_the_button_is_let_go() {
    for force in [0.5, 5.0] {
        let (mut world, mut desk) = desk();
        let track = press(&mut world, &mut desk, force, 75);
        assert!(is_on(track[1]), "{force} N: {track:?}");
        let after = press(&mut world, &mut desk, 0.0, 5);
        assert!(!is_on(after[4]), "{force} N: {after:?}");
    }
}

/// DYNAMICS R6: 20 N end at −0.0346 in the original, whose table is as soft.
#[test]
fn a_hard_push_does_not_drive_a_button_through_the_table() {
    let (mut world, mut desk) = desk();
    let track = press(&mut world, &mut desk, 20.0, 75);
    assert!(
        track[74][0] > -0.0346 && is_on(track[74]),
        "{:?}",
        track[74]
    );
}

/// DYNAMICS R6: both at −0.005, let go; a fifth of a second.
#[test]
fn a_released_button_comes_up_as_recorded_and_its_light_with_it() {
    let (mut world, mut desk) = desk();
    set_slide(&mut world.physics, desk.caps[GREEN], -0.005);
    desk.lights[GREEN] = Light::at(-0.005);
    desk.caps_before[GREEN] = [-0.005, 0.0];
    let track = press(&mut world, &mut desk, 0.0, 10);
    for (step, button, light) in [
        (1, -0.004_693, -0.004_469),
        (2, -0.004_005, -0.003_536),
        (3, -0.003_211, -0.002_643),
        (5, -0.001_908, -0.001_341),
        (10, -0.000_499, 0.000_057),
    ] {
        let off = |i: usize, theirs: f64| (track[step - 1][i] - theirs).abs();
        assert!(off(0, button) < 1.5e-4, "step {step}: {track:?}");
        assert!(off(1, light) < 2e-4, "step {step}: {track:?}");
    }
}

/// DYNAMICS R9.
#[test]
fn everything_rests_where_it_was_put() {
    let (mut world, mut desk) = desk();
    let before = desk.positions(&world.physics);
    press(&mut world, &mut desk, 0.0, 100);
    let after = desk.positions(&world.physics);
    for (i, (before, after)) in before.iter().zip(after).enumerate() {
        assert!((before - after).abs() < 1e-3, "{i}: {before} to {after}");
    }
}

#[test]
fn a_pull_harder_than_its_friction_moves_the_drawer_and_a_weaker_one_does_not() {
    for (newtons, moves) in [(4.0, false), (20.0, true)] {
        let (mut world, desk) = desk();
        let drawer = &mut world.physics.bodies[desk.sliding[0]];
        drawer.add_force(Vector::new(0.0, -newtons, 0.0), true);
        for _ in 0..50 {
            assert!(world.step());
        }
        let slid = desk.positions(&world.physics)[0];
        assert_eq!(slid < -0.05, moves, "{newtons} N: {slid} m");
        assert!(moves || slid > -0.001, "{newtons} N: {slid} m");
    }
}

#[test]
fn a_start_lies_where_the_original_draws_it() {
    let mut rng = Rng::new(5, domain::random::Stream::Test, 0);
    for _ in 0..200 {
        let Start { sliding, loose } = Start::draw(&mut rng);
        assert!((-0.1..=0.0).contains(&sliding[0]) && (0.0..=0.2).contains(&sliding[1]));
        let ranges = [
            [-0.4, 0.08, 0.7, 0.78],
            [0.2, 0.5, 0.78, 0.83],
            [0.15, 0.45, 0.63, 0.7],
        ];
        for ([x, y, _], [x0, x1, y0, y1]) in loose.into_iter().zip(ranges) {
            assert!((x0..=x1).contains(&x) && (y0..=y1).contains(&y), "{x}, {y}");
        }
    }
}
