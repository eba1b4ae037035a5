//! The cheetah against the original: drops, joint responses and gaits, measured with MuJoCo 2.3.7.

use super::*;

const STEP_S: f64 = 0.01;

fn raised_by(height: f64) -> Simulation<N_DOFS> {
    let mut q = cheetah::model().rest();
    q[1] = height;
    Simulation::new(q)
}

fn wait(cheetah: &mut Simulation<N_DOFS>, n_steps: usize) {
    for _ in 0..n_steps {
        cheetah.step(cheetah::model(), &[0.0; N_DOFS]);
    }
}

#[test]
fn it_drops_onto_its_springs_as_the_original_does() {
    // After each tenth of a second: torso height, pitch, speed.
    let from_standing = [
        [0.64604, 0.0, 0.0],
        [0.58798, 0.03679, -0.34842],
        [0.59225, 0.05739, -0.10906],
        [0.58955, 0.05289, 0.13318],
        [0.59418, 0.04186, 0.23258],
        [0.60139, 0.02778, 0.11092],
        [0.60134, 0.02504, -0.05026],
    ];
    let from_above = [
        [1.14604, 0.0, 0.0],
        [0.99399, 0.0, 0.0],
        [0.74383, 0.0, 0.0],
        [0.56391, 0.03193, -0.81542],
        [0.58052, 0.08914, -0.19105],
        [0.5822, 0.07082, 0.3832],
        [0.59508, 0.03962, 0.5548],
    ];
    for (height, rows) in [(0.0, from_standing), (0.5, from_above)] {
        let mut cheetah = raised_by(height);
        for expected in rows {
            wait(&mut cheetah, 10);
            let found = [
                cheetah.q[1] + cheetah::STANDING_HEIGHT,
                cheetah.q[2],
                Readings::of(&mut cheetah).speed,
            ];
            for (found, expected) in found.iter().zip(expected) {
                assert!(
                    (found - expected).abs() < 0.002,
                    "{found} instead of {expected}"
                );
            }
        }
    }
}

#[test]
fn it_comes_to_rest_where_the_original_does() {
    let mut cheetah = raised_by(0.0);
    wait(&mut cheetah, 300);
    let rest = [
        -0.00289, -0.10866, 0.04063, -0.01192, 0.02879, -0.05404, -0.00083, -0.08364, -0.07433,
    ];
    for (found, expected) in cheetah.q.iter().zip(rest) {
        assert!(
            (found - expected).abs() < 0.001,
            "{found} instead of {expected}"
        );
    }
}

#[test]
fn each_motor_turns_its_joint_against_spring_damper_and_rotor() {
    // Torso pitch, joint, rate of the joint after 0.02, 0.05, 0.1, 0.2 s.
    let responses = [
        [
            [-0.0006, 0.0150, 0.9589],
            [-0.0035, 0.0564, 1.4793],
            [-0.0108, 0.1155, 0.8587],
            [-0.0120, 0.1189, -0.3564],
        ],
        [
            [-0.0025, 0.0221, 1.3864],
            [-0.0087, 0.0745, 1.7328],
            [-0.0156, 0.1222, 0.3637],
            [-0.0131, 0.1015, -0.1691],
        ],
        [
            [0.0001, 0.0227, 1.4305],
            [0.0001, 0.0777, 1.8301],
            [-0.0008, 0.1263, 0.2974],
            [-0.0014, 0.0949, -0.1646],
        ],
        [
            [-0.0006, 0.0132, 0.8508],
            [-0.0007, 0.0111, -0.1070],
            [-0.0006, 0.0086, -0.0246],
            [-0.0003, 0.0080, -0.0008],
        ],
        [
            [-0.0011, 0.0184, 1.1706],
            [-0.0039, 0.0665, 1.6625],
            [-0.0077, 0.1211, 0.5769],
            [-0.0065, 0.1089, -0.2888],
        ],
        [
            [-0.0001, 0.0140, 0.9051],
            [-0.0005, 0.0559, 1.5420],
            [-0.0014, 0.1223, 0.9880],
            [-0.0019, 0.1130, -0.5797],
        ],
    ];
    for (motor, rows) in responses.into_iter().enumerate() {
        let mut cheetah = Cheetah {
            simulation: raised_by(5.0),
        };
        let mut action = [0.0; ACTION_SIZE];
        action[motor] = 0.2;
        for (n_steps, expected) in [2, 3, 5, 10].into_iter().zip(rows) {
            for _ in 0..n_steps {
                cheetah.advance(&action);
            }
            let Simulation { q, v, .. } = &cheetah.simulation;
            let joint = FIRST_LEG_JOINT + motor;
            for (found, expected) in [q[2], q[joint], v[joint]].into_iter().zip(expected) {
                let error = (found - expected).abs();
                assert!(
                    error < 2e-4 + 1e-3 * expected.abs(),
                    "{motor}: {found} {expected}"
                );
            }
        }
    }
}

#[test]
fn open_loop_gaits_carry_it_as_far_as_the_original() {
    // Angular frequency, phases; advance after 1, 2, 5 s; return of the 500 steps.
    for (w, phases, advances, expected_return) in [
        (
            16.19,
            [4.44, 2.59, 3.79, 6.10, 2.05, 5.78],
            [1.137, 3.946, 10.628],
            106.86,
        ),
        (
            19.62,
            [5.28, 2.75, 3.59, 4.27, 4.96, 2.80],
            [1.330, 3.435, 8.721],
            85.87,
        ),
        (
            17.22,
            [3.36, 1.80, 3.01, 5.17, 5.50, 5.91],
            [1.108, 3.271, 11.073],
            111.80,
        ),
    ] {
        let mut cheetah = Cheetah {
            simulation: raised_by(0.0),
        };
        wait(&mut cheetah.simulation, SETTLING_STEPS);
        let start = cheetah.simulation.q[0];
        let (mut task_return, mut advance) = (0.0, Vec::new());
        for step in 0..500 {
            let t = f64::from(step) * STEP_S;
            cheetah.advance(&phases.map(|phase| (w * t + phase).sin()));
            task_return += cheetah.judge().1;
            if [100, 200, 500].contains(&(step + 1)) {
                advance.push(cheetah.simulation.q[0] - start);
            }
        }
        for (found, expected) in advance.iter().zip(advances) {
            assert!(
                (found / expected - 1.0).abs() < 0.05,
                "{w}: {found} m, not {expected}"
            );
        }
        assert!(
            (task_return / expected_return - 1.0).abs() < 0.05,
            "{w}: {task_return}"
        );
    }
}

#[test]
fn an_episode_begins_standing() {
    let heights: Vec<f64> = (0..50)
        .map(|seed| Cheetah::begin(seed).simulation.q[1] + cheetah::STANDING_HEIGHT)
        .collect();
    let mean = heights.iter().sum::<f64>() / heights.len() as f64;
    assert!((mean - 0.600).abs() < 0.005, "{mean}");
    assert!(
        heights.iter().all(|z| (0.55..0.64).contains(z)),
        "{heights:?}"
    );
}
