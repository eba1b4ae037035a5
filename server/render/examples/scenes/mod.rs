//! A window scene built by hand, for looking at and for measuring without physics.

use domain::scene::{Arm, Camera, Frame, Geometry, Material, Pattern, Scene, Shape, Transform};

const HAND: usize = 1;
const RIGHT: usize = 2;
const LEFT: usize = 3;
const PANE: usize = 4;

fn cuboid(body: usize, at: [f32; 3], half: [f32; 3], material: Material) -> Shape {
    Shape {
        body,
        local: Transform::at(at[0], at[1], at[2]),
        geometry: Geometry::Cuboid { half },
        material,
    }
}

/// Where the window stands, metres.
const P: [f32; 3] = [0.019_732, 0.731_204, 0.16];
const DARK: Material = Material::plain(0.2, 0.2, 0.2);
const METAL: Material = Material::plain(0.42, 0.43, 0.44);
const FRAME: Material = Material::plain(0.36, 0.26, 0.27);
const WOOD: Material = Material {
    color: [0.55, 0.40, 0.29, 1.0],
    pattern: Pattern::Wood,
    is_marker: false,
};
const TILES: Material = Material {
    color: [0.86, 0.86, 0.85, 1.0],
    pattern: Pattern::Tiles,
    is_marker: false,
};
const GLASS: Material = Material {
    color: [0.3, 0.45, 0.5, 0.25],
    pattern: Pattern::Plain,
    is_marker: false,
};

/// A window on a table before a Sawyer, as METAWORLD.md 1.5 to 1.8 and 3.3 describe it.
pub(crate) fn window() -> Scene {
    let mut shapes = scenery();
    shapes.extend(fixed_window());
    shapes.extend(pane());
    shapes.extend(gripper());
    let camera = |name: &str, eye, forward, up, fovy_deg| Camera {
        name: name.into(),
        eye,
        forward,
        up,
        fovy_deg,
    };
    let down_left = [-0.74571, 0.45824, -0.48367];
    let up_left = [-0.37621, 0.30955, 0.87330];
    let down = [-0.42738, 0.31713, -0.84662];
    let down_up = [-0.76075, 0.37982, 0.52630];
    let along = [0.68041, 0.68041, -0.27217];
    let along_up = [0.19245, 0.19245, 0.96225];
    Scene {
        n_bodies: 5,
        shapes,
        arm: Some(Arm::Sawyer { hand: HAND }),
        cameras: vec![
            camera("corner2", [1.3, -0.2, 1.1], down_left, up_left, 60.0),
            camera("corner3", [0.9, 0.0, 1.5], down, down_up, 45.0),
            camera("corner", [-1.1, -0.4, 0.6], along, along_up, 45.0),
        ],
        background: [0.5, 0.495, 0.48],
        focus: ([0.0, 0.5, 0.1], 1.1),
    }
}

fn scenery() -> Vec<Shape> {
    let mut shapes = vec![
        cuboid(0, [0.0, 0.0, -0.923], [4.0, 4.0, 0.01], TILES),
        cuboid(0, [0.0, 0.6, -0.027], [0.7, 0.4, 0.027], WOOD),
        cuboid(0, [0.0, 0.21, 0.06], [0.7, 0.01, 0.06], METAL),
        cuboid(0, [0.0, 0.99, 0.06], [0.7, 0.01, 0.06], METAL),
        cuboid(0, [-0.69, 0.6, 0.06], [0.01, 0.38, 0.06], METAL),
        cuboid(0, [0.69, 0.6, 0.06], [0.01, 0.38, 0.06], METAL),
        cuboid(0, [-0.325, 0.0, -0.38], [0.11, 0.2, 0.265], DARK),
        cuboid(0, [-0.1225, 0.0, -0.758], [0.385, 0.35, 0.155], DARK),
        Shape {
            body: 0,
            local: Transform::at(-0.02, 0.0, -0.29),
            geometry: Geometry::Cylinder {
                radius: 0.18,
                half_length: 0.31,
            },
            material: DARK,
        },
    ];
    for (x, y) in [(-0.6, 0.28), (-0.6, 0.92), (0.6, 0.28), (0.6, 0.92)] {
        shapes.push(cuboid(0, [x, y, -0.48], [0.045, 0.045, 0.43], WOOD));
    }
    shapes
}

fn fixed_window() -> Vec<Shape> {
    let mut shapes: Vec<Shape> = [
        ([-0.216, 0.0, 0.0], [0.015, 0.03, 0.181]),
        ([0.216, 0.0, 0.0], [0.015, 0.03, 0.181]),
        ([0.0, 0.0, -0.166], [0.201, 0.03, 0.015]),
        ([0.0, 0.0, 0.166], [0.201, 0.03, 0.015]),
        ([0.1, 0.013, -0.14], [0.08, 0.012, 0.01]),
        ([0.1, 0.013, 0.14], [0.08, 0.012, 0.01]),
        ([0.1, 0.004, 0.0], [0.08, 0.003, 0.005]),
        ([0.01, 0.013, 0.0], [0.01, 0.012, 0.15]),
        ([0.19, 0.013, 0.0], [0.01, 0.012, 0.15]),
    ]
    .map(|(c, half)| cuboid(0, [P[0] + c[0], P[1] + c[1], P[2] + c[2]], half, FRAME))
    .into();
    let glass = [P[0] + 0.1, P[1] + 0.008, P[2]];
    shapes.push(cuboid(0, glass, [0.08, 0.001, 0.13], GLASS));
    shapes
}

fn pane() -> Vec<Shape> {
    let mut shapes: Vec<Shape> = [
        ([-0.014, -0.013, 0.0], [0.014, 0.012, 0.15]),
        ([-0.19, -0.013, 0.0], [0.01, 0.012, 0.15]),
        ([-0.104, -0.013, -0.14], [0.076, 0.012, 0.01]),
        ([-0.104, -0.013, 0.14], [0.076, 0.012, 0.01]),
        ([-0.104, -0.022, 0.0], [0.076, 0.003, 0.005]),
    ]
    .map(|(at, half)| cuboid(PANE, at, half, FRAME))
    .into();
    let glass = [-0.104, -0.018, 0.0];
    shapes.push(cuboid(PANE, glass, [0.076, 0.001, 0.13], GLASS));
    let quarter = std::f32::consts::FRAC_PI_2;
    for (y, z, half_length, angle) in [
        (-0.06, -0.045, 0.035, quarter),
        (-0.06, 0.045, 0.035, quarter),
        (-0.095, 0.0, 0.045, 0.0),
    ] {
        shapes.push(Shape {
            body: PANE,
            local: Transform::at(-0.014, y, z).turned([1.0, 0.0, 0.0], angle),
            geometry: Geometry::Capsule {
                radius: 0.008,
                half_length,
            },
            material: Material::plain(0.65, 0.65, 0.65),
        });
    }
    shapes
}

fn gripper() -> Vec<Shape> {
    let white = Material::plain(0.95, 0.95, 0.95);
    let cyan = Material::plain(0.0, 0.85, 0.85);
    let red = Material::plain(0.5, 0.1, 0.1);
    let grey = Material::plain(0.5, 0.5, 0.5);
    let finger = [0.015, 0.0045, 0.045];
    vec![
        cuboid(HAND, [-0.009, 0.0, 0.066], [0.033, 0.053, 0.027], red),
        cuboid(HAND, [0.0, 0.0, 0.05], [0.005, 0.055, 0.005], grey),
        cuboid(RIGHT, [0.0, 0.0015, 0.0], finger, white),
        cuboid(LEFT, [0.0, -0.0015, 0.0], finger, cyan),
    ]
}

/// The hand at `hand`, the fingers open by `open` in [0, 1], the pane pushed by `q` metres.
pub(crate) fn window_frame(hand: [f32; 3], open: f32, q: f32) -> Frame {
    let [x, y, z] = hand;
    vec![
        Transform::IDENTITY,
        Transform::at(x, y, z),
        Transform::at(x, y - 0.05 + 0.04 * (1.0 - open), z),
        Transform::at(x, y + 0.05 - 0.03 * (1.0 - open), z),
        Transform::at(0.019_732 + q, 0.731_204, 0.16),
    ]
}
