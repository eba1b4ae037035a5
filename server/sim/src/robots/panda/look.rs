//! The Panda's forms: for collisions and for pictures.
//!
//! Hulls of the original's meshes are replaced by capsules along them, with the radius that gives
//! the hull's volume; the hand and the fingers are boxes.
//! Source: DMCONTROL_ROBODESK.md 5.1, the table of primitive stand-ins.

use domain::scene::{Material, Shape, Transform};

use super::N_JOINTS;
use super::links::{Pose, frames};
use crate::solid::Solid;

const WHITE: Material = Material::plain(0.95, 0.99, 0.92);
const GREY: Material = Material::plain(0.36, 0.38, 0.41);
const DARK: Material = Material::plain(0.16, 0.17, 0.19);

/// Bodies that [`bodies`] gives and [`shapes`] uses: the base, seven links, two fingers.
pub const N_BODIES: usize = N_JOINTS + 1;

/// The base's forms, in its frame.
pub(super) fn pedestal() -> [Solid; 1] {
    [Solid::rod(
        [0.0, -0.002, 0.051],
        [-0.057, -0.003, 0.015],
        0.0754,
        WHITE,
    )]
}

/// The forms of link `i` of the table, in its frame.
pub(super) fn solids(i: usize) -> Vec<Solid> {
    match i {
        0 => vec![Solid::rod(
            [0.0, -0.053, 0.001],
            [-0.001, 0.0, -0.140],
            0.0635,
            WHITE,
        )],
        1 => vec![Solid::rod(
            [0.0, -0.144, 0.002],
            [0.0, 0.003, 0.054],
            0.0631,
            WHITE,
        )],
        2 => vec![Solid::rod(
            [0.083, 0.046, 0.0],
            [-0.002, 0.007, -0.086],
            0.0599,
            WHITE,
        )],
        3 => vec![Solid::rod(
            [0.0, 0.005, 0.041],
            [-0.083, 0.086, 0.007],
            0.0611,
            WHITE,
        )],
        4 => vec![Solid::rod(
            [0.0, 0.009, -0.242],
            [-0.002, 0.064, 0.003],
            0.0576,
            WHITE,
        )],
        5 => vec![Solid::rod(
            [0.020, 0.006, 0.017],
            [0.086, 0.008, -0.001],
            0.0565,
            WHITE,
        )],
        6 => {
            let eighth = -std::f32::consts::FRAC_PI_4;
            let hand = Solid::cuboid([0.0, 0.0, 0.127], [0.032, 0.104, 0.046], GREY);
            vec![
                Solid::rod(
                    [-0.006, -0.004, 0.072],
                    [0.050, 0.034, 0.089],
                    0.0351,
                    WHITE,
                ),
                hand.turned([0.0, 0.0, 1.0], eighth),
            ]
        }
        left_or_right => {
            let side = if left_or_right == 7 { 1.0 } else { -1.0 };
            vec![
                Solid::cuboid([0.0, 0.014 * side, 0.015], [0.0185, 0.012, 0.0175], DARK),
                Solid::cuboid([0.0, 0.008 * side, 0.0625], [0.014, 0.008, 0.032], DARK),
            ]
        }
    }
}

/// The arm's look, with its bodies numbered from `first_body` in the order of [`bodies`].
pub fn shapes(first_body: usize) -> Vec<Shape> {
    let base = pedestal().map(|solid| solid.shape(first_body));
    let links = (0..N_JOINTS).flat_map(|i| {
        let on_link = move |solid: Solid| solid.shape(first_body + 1 + i);
        solids(i).into_iter().map(on_link)
    });
    base.into_iter().chain(links).collect()
}

/// Where the base and the links of an arm with joints `q` are.
pub fn bodies(q: &[f64; N_JOINTS]) -> [Transform; N_BODIES] {
    frames(q).map(|frame| drawn(&frame))
}

fn drawn(frame: &Pose) -> Transform {
    let (at, turn) = (frame.translation, frame.rotation);
    Transform {
        position: [at.x, at.y, at.z].map(|x| x as f32),
        rotation: [turn.w, turn.i, turn.j, turn.k].map(|x| x as f32),
    }
}
