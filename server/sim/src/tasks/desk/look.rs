//! How the desk looks, and from where.
//!
//! A light that is on shows as a bright disc; one that is off leaves its holder black.
//! Source: DMCONTROL_ROBODESK.md 5.3 and 5.8.

use domain::scene::{Camera, Geometry, Material, Shape, Transform};

use super::{BUTTONS, LIGHTS, N_BUTTONS, N_POSITIONS, light, parts};
use crate::solid::Solid;

/// Bodies that [`bodies`] gives and [`shapes`] uses: drawer, door, three caps, three lights,
/// ball, upright and flat block. What stands still is on body 0.
pub const N_BODIES: usize = 2 + 2 * N_BUTTONS + 3;
/// Behind everything (sRGB).
pub const BACKGROUND: [f32; 3] = [0.62, 0.66, 0.70];

const COLORS: [[f32; 3]; N_BUTTONS] = [[0.9, 0.05, 0.05], [0.0, 0.75, 0.1], [0.1, 0.2, 0.95]];
const BLACK: Material = Material::plain(0.03, 0.03, 0.03);
const HOLDER: Material = Material::plain(0.30, 0.31, 0.33);
/// Top of a light's holder over its middle, metres.
const HOLDER_TOP: f32 = 0.031;

/// The desk's look, with its bodies numbered from `first_body` in the order of [`bodies`].
pub fn shapes(first_body: usize) -> Vec<Shape> {
    let mut shapes: Vec<Shape> = parts::fixed().iter().map(|solid| solid.shape(0)).collect();
    for button in BUTTONS {
        let [x, y, z] = button.map(|x| x as f32);
        shapes.push(Solid::cylinder([x, y, z], 0.035, 0.01, HOLDER).shape(0));
    }
    for [x, y, z] in parts::LIGHTS {
        shapes.push(Solid::cylinder([x, y, z + HOLDER_TOP], 0.06, 0.001, BLACK).shape(0));
    }
    for (body, solids) in (first_body..).zip([parts::drawer(), parts::door()]) {
        shapes.extend(solids.iter().map(|solid| solid.shape(body)));
    }
    let (caps, lights) = (first_body + 2, first_body + 2 + N_BUTTONS);
    for (i, [r, g, b]) in COLORS.into_iter().enumerate() {
        let look = Material::plain(r, g, b);
        shapes.push(
            Solid {
                look,
                ..parts::cap()
            }
            .shape(caps + i),
        );
        shapes.push(Shape {
            body: lights + i,
            local: Transform::IDENTITY,
            geometry: Geometry::Cylinder {
                radius: 0.06,
                half_length: 0.004,
            },
            material: Material::marker(r, g, b, 1.0),
        });
    }
    let loose = lights + N_BUTTONS;
    shapes.extend((0..3).map(|i| parts::loose(i).0.shape(loose + i)));
    shapes
}

/// Where the desk's bodies are.
pub fn bodies(positions: &[f32; N_POSITIONS]) -> [Transform; N_BODIES] {
    let mut bodies = [Transform::IDENTITY; N_BODIES];
    bodies[0] = slid(super::DRAWER.origin, [0.0, positions[0], 0.0]);
    bodies[1] = slid(super::DOOR.origin, [positions[1], 0.0, 0.0]);
    for i in 0..N_BUTTONS {
        let button = BUTTONS[i].map(|x| x as f32);
        bodies[2 + i] = slid(button, [0.0, 0.0, positions[2 + i]]);
        let is_on = f64::from(positions[LIGHTS + i]) < light::ON_BELOW_M;
        let height = if is_on { HOLDER_TOP + 0.001 } else { 0.0 };
        bodies[2 + N_BUTTONS + i] = slid(parts::LIGHTS[i], [0.0, 0.0, height]);
    }
    for (body, numbers) in bodies[2 + 2 * N_BUTTONS..]
        .iter_mut()
        .zip(positions[8..].chunks(7))
    {
        *body = Transform {
            position: [numbers[0], numbers[1], numbers[2]],
            rotation: [numbers[3], numbers[4], numbers[5], numbers[6]],
        };
    }
    bodies
}

fn slid(origin: [f32; 3], by: [f32; 3]) -> Transform {
    Transform::at(origin[0] + by[0], origin[1] + by[1], origin[2] + by[2])
}

/// The original's view, cut to the part of the picture that it keeps; the same uncut; and one
/// from the front left, which shows how high the fingers are above a button.
pub fn cameras() -> Vec<Camera> {
    let eye = [0.0, -0.365, 2.659];
    // The kept part is 1.2° above the middle of the uncut picture.
    vec![
        looking("desk", eye, 58.8, 26.0),
        looking("whole", eye, 60.0, 45.0),
        Camera {
            name: "side".into(),
            eye: [-1.35, -0.15, 1.55],
            forward: [0.716_1, 0.537_1, -0.445_9],
            up: [0.356_7, 0.267_6, 0.895_1],
            fovy_deg: 40.0,
        },
    ]
}

/// A camera in the plane x = 0 that looks away from the robot and `down_deg` degrees down.
fn looking(name: &str, eye: [f32; 3], down_deg: f32, fovy_deg: f32) -> Camera {
    let (sin, cos) = down_deg.to_radians().sin_cos();
    Camera {
        name: name.into(),
        eye,
        forward: [0.0, cos, -sin],
        up: [0.0, sin, cos],
        fovy_deg,
    }
}
