//! The desk's forms.

use domain::scene::{Geometry, Material, Pattern, Transform};

use crate::solid::Solid;

const WOOD: Material = Material {
    color: [0.90, 0.68, 0.36, 1.0],
    pattern: Pattern::Wood,
    is_marker: false,
};
const DARK_WOOD: Material = Material::plain(0.26, 0.17, 0.11);
const METAL: Material = Material::plain(0.62, 0.63, 0.65);
const BIN: Material = Material::plain(0.0, 0.55, 0.58);
const BALL: Material = Material::plain(1.0, 0.0, 0.35);
const UPRIGHT: Material = Material::plain(0.55, 0.78, 0.86);
const FLAT: Material = Material::plain(0.61, 1.0, 0.71);
const RIM: Material = Material::plain(0.30, 0.31, 0.33);
const TILES: Material = Material {
    color: [0.62, 0.63, 0.65, 1.0],
    pattern: Pattern::Tiles,
    is_marker: false,
};

/// Middles of the holders of the red, the green and the blue light, on the shelf.
pub(super) const LIGHTS: [[f32; 3]; 3] = [[-0.45, 1.0, 1.1], [-0.25, 1.0, 1.1], [-0.05, 1.0, 1.1]];

/// Everything that stands still, in the world.
pub(super) fn fixed() -> Vec<Solid> {
    let mut solids = vec![
        Solid::cuboid([0.0, 0.0, -0.5], [4.0, 4.0, 0.5], TILES),
        Solid::cuboid([0.0, 0.85, 0.735], [0.6, 0.275, 0.025], WOOD),
        Solid::cuboid([0.0, 1.115, 0.935], [0.6, 0.01, 0.175], WOOD),
        Solid::cuboid([0.0, 1.015, 1.1], [0.6, 0.11, 0.01], WOOD),
    ];
    for x in [-0.59, 0.0, 0.59] {
        solids.push(Solid::cuboid([x, 1.015, 0.935], [0.01, 0.11, 0.175], WOOD));
    }
    for side in [-1.0, 1.0] {
        solids.push(Solid::cuboid(
            [0.42 * side, 0.85, 0.66],
            [0.17, 0.26, 0.05],
            WOOD,
        ));
        for y in [0.615, 1.085] {
            solids.push(Solid::cuboid(
                [0.565 * side, y, 0.305],
                [0.025, 0.025, 0.305],
                WOOD,
            ));
        }
    }
    solids.extend(bin());
    for [x, y, z] in LIGHTS {
        solids.push(Solid::cylinder([x, y, z + 0.011], 0.08, 0.02, RIM));
    }
    solids
}

/// The bin in front of the desk: a bottom and four walls that lean outward by 5°.
fn bin() -> [Solid; 5] {
    const LEAN: f32 = 5.0 * std::f32::consts::PI / 180.0;
    let [x, y] = [0.4, 0.55];
    let across = |side: f32| {
        Solid::cuboid([x + 0.12 * side, y, 0.2], [0.01, 0.11, 0.2], BIN)
            .turned([0.0, 1.0, 0.0], LEAN * side)
    };
    let along = |side: f32| {
        Solid::cuboid([x, y + 0.12 * side, 0.2], [0.11, 0.01, 0.2], BIN)
            .turned([1.0, 0.0, 0.0], -LEAN * side)
    };
    [
        Solid::cuboid([x, y, 0.05], [0.1, 0.1, 0.005], BIN),
        across(-1.0),
        across(1.0),
        along(-1.0),
        along(1.0),
    ]
}

/// The drawer around its own origin: a box without a lid, and its handle in front.
pub(super) fn drawer() -> Vec<Solid> {
    let mut solids = vec![
        Solid::cuboid([0.0, 0.0, -0.04], [0.24, 0.26, 0.01], DARK_WOOD),
        Solid::rod([-0.08, -0.36, 0.01], [0.08, -0.36, 0.01], 0.014, METAL),
    ];
    for side in [-1.0, 1.0] {
        let wall = |centre, half| Solid::cuboid(centre, half, DARK_WOOD);
        solids.push(wall([0.0, 0.25 * side, 0.0], [0.24, 0.01, 0.05]));
        solids.push(wall([0.23 * side, 0.0, 0.0], [0.01, 0.26, 0.05]));
        let x = 0.082_03 * side;
        solids.push(Solid::rod([x, -0.36, 0.01], [x, -0.27, 0.01], 0.014, METAL));
    }
    solids
}

/// The sliding door at the left, in the world's axes, closed; its handle towards the robot.
pub(super) fn door() -> Vec<Solid> {
    let [x, y, z] = [-0.3, 0.89, 0.935];
    let mut solids = vec![
        Solid::cuboid([x, y, z], [0.3, 0.01, 0.175], DARK_WOOD),
        Solid::rod(
            [x, y - 0.11, z - 0.08],
            [x, y - 0.11, z + 0.08],
            0.014,
            METAL,
        ),
    ];
    for z in [z - 0.083, z + 0.083] {
        solids.push(Solid::rod(
            [x, y - 0.107, z],
            [x, y - 0.023, z],
            0.014,
            METAL,
        ));
    }
    solids
}

/// A button's cap, seen from the middle of its holder.
pub(super) fn cap() -> Solid {
    Solid::cylinder([0.0, 0.0, 0.02], 0.03, 0.01, METAL)
}

/// What stops the caps: the table's top, continued downwards.
pub(super) fn well() -> Solid {
    Solid::cuboid([-0.25, 0.625, 0.51], [0.3, 0.05, 0.25], WOOD)
}

/// Form and mass of the ball, the upright and the flat block.
pub(super) fn loose(i: usize) -> (Solid, f32) {
    let around_itself = |geometry, look| Solid {
        geometry,
        at: Transform::IDENTITY,
        look,
    };
    let block = |half, look| around_itself(Geometry::Cuboid { half }, look);
    match i {
        0 => (
            around_itself(Geometry::Sphere { radius: 0.04 }, BALL),
            0.268_083,
        ),
        1 => (block([0.023, 0.023, 0.09], UPRIGHT), 0.380_88),
        _ => (block([0.08, 0.035, 0.015], FLAT), 0.336),
    }
}
