//! Small scenes against pictures in `tests/pictures`. Drivers differ in the last bits, so a mean
//! difference is allowed. `STAIR_NEW_PICTURES=1 cargo test -p render` draws the references anew:
//! look at them before you commit them.

use std::path::Path;

use domain::scene::{Arm, Geometry, Material, Pattern, Shape, Transform};

use super::*;

/// Mean difference per colour that passes, of 255.
const TOLERANCE: f64 = 4.0;

/// A renderer, or none (loudly) where the machine has no driver.
fn renderer() -> Option<Renderer> {
    match Renderer::new() {
        Ok(renderer) => Some(renderer),
        Err(error) => {
            eprintln!("\n*** SKIPPED, nothing was drawn: {error} ***\n");
            None
        }
    }
}

fn shape(at: [f32; 3], geometry: Geometry, material: Material) -> Shape {
    Shape {
        body: 0,
        local: Transform::at(at[0], at[1], at[2]),
        geometry,
        material,
    }
}

/// A floor of 2 × 2 m seen from above its near edge, with `things` on it.
fn scene(pattern: Pattern, things: Vec<Shape>) -> Scene {
    let floor = shape(
        [0.0, 0.0, -0.1],
        Geometry::Cuboid {
            half: [1.0, 1.0, 0.1],
        },
        Material {
            color: [0.8, 0.75, 0.7, 1.0],
            pattern,
            is_marker: false,
        },
    );
    Scene {
        n_bodies: 1,
        shapes: std::iter::once(floor).chain(things).collect(),
        arm: None,
        cameras: vec![Camera {
            name: "test".into(),
            eye: [0.0, -2.0, 1.6],
            forward: crate::projection::unit([0.0, -2.0, 1.4]).map(|x| -x),
            up: [0.0, 0.0, 1.0],
            fovy_deg: 45.0,
        }],
        background: [0.5, 0.6, 0.7],
        focus: ([0.0, 0.0, 0.2], 1.2),
    }
}

fn assert_looks_like(name: &str, scene: &Scene) {
    let Some(renderer) = renderer() else { return };
    let frame = vec![Transform::IDENTITY; scene.n_bodies];
    let image = renderer
        .draw(scene, &[frame], (32, 32), &scene.cameras[0])
        .expect("draws")
        .remove(0);
    let path = Path::new(env!("CARGO_MANIFEST_DIR"))
        .join("../../tests/pictures")
        .join(name);
    if std::env::var_os("STAIR_NEW_PICTURES").is_some() {
        image.save(&path).expect("writes");
    }
    let reference = image::open(&path).expect("a reference").to_rgba8();
    let total: u64 = image
        .iter()
        .zip(reference.iter())
        .map(|(a, b)| u64::from(a.abs_diff(*b)))
        .sum();
    let mean = total as f64 / (32.0 * 32.0 * 3.0);
    assert!(
        mean < TOLERANCE,
        "{name} differs by {mean:.2} of 255 on average"
    );
}

#[test]
fn every_form_stands_on_its_floor_with_a_shadow() {
    let blue = Material::plain(0.2, 0.4, 0.8);
    let things = vec![
        shape([-0.6, 0.3, 0.2], Geometry::Cuboid { half: [0.2; 3] }, blue),
        shape([0.0, 0.3, 0.2], Geometry::Sphere { radius: 0.2 }, blue),
        shape(
            [0.6, 0.3, 0.2],
            Geometry::Cylinder {
                radius: 0.2,
                half_length: 0.2,
            },
            blue,
        ),
        shape(
            [-0.4, -0.4, 0.3],
            Geometry::Capsule {
                radius: 0.12,
                half_length: 0.18,
            },
            Material::plain(0.8, 0.2, 0.1),
        ),
        shape(
            [0.4, -0.4, 0.01],
            Geometry::Ring {
                inner: 0.15,
                outer: 0.3,
            },
            Material::marker(0.0, 0.8, 0.0, 1.0),
        ),
    ];
    assert_looks_like("forms.png", &scene(Pattern::Plain, things));
}

#[test]
fn what_stands_behind_glass_is_seen_through_it() {
    let things = vec![
        shape(
            [0.0, -0.3, 0.4],
            Geometry::Cuboid {
                half: [0.5, 0.02, 0.4],
            },
            Material {
                color: [0.1, 0.3, 0.9, 0.4],
                pattern: Pattern::Plain,
                is_marker: false,
            },
        ),
        shape(
            [0.2, 0.3, 0.25],
            Geometry::Sphere { radius: 0.25 },
            Material::plain(0.9, 0.5, 0.1),
        ),
    ];
    assert_looks_like("glass.png", &scene(Pattern::Wood, things));
}

#[test]
fn an_arm_reaches_from_the_origin_to_the_hand() {
    let mut scene = scene(Pattern::Tiles, Vec::new());
    scene.arm = Some(Arm::Sawyer { hand: 1 });
    scene.n_bodies = 2;
    let mut camera = scene.cameras.remove(0);
    camera.eye = [1.4, -1.6, 1.6];
    camera.forward = crate::projection::unit([-1.4, 2.0, -1.3]);
    scene.cameras.push(camera);
    let Some(renderer) = renderer() else { return };
    let at = |hand: [f32; 3]| {
        vec![
            Transform::IDENTITY,
            Transform::at(hand[0], hand[1], hand[2]),
        ]
    };
    let frames = [at([0.0, 0.6, 0.2]), at([0.2, 0.6, 0.2])];
    let images = renderer
        .draw(&scene, &frames, (32, 32), &scene.cameras[0])
        .expect("draws");
    let n_red = |image: &RgbaImage| {
        let is_red = |p: &&image::Rgba<u8>| p[0] / 2 > p[1] && p[0] > 60;
        image.pixels().filter(is_red).count()
    };
    assert!(images.iter().all(|image| n_red(image) > 30));
    assert_ne!(images[0], images[1]);
}

#[test]
fn a_mark_has_exactly_the_colour_it_was_given() {
    let mut scene = scene(Pattern::Plain, Vec::new());
    scene.shapes[0].material = Material::marker(0.2, 0.4, 0.6, 1.0);
    let Some(renderer) = renderer() else { return };
    let frame = vec![Transform::IDENTITY];
    let image = renderer
        .draw(&scene, &[frame], (32, 32), &scene.cameras[0])
        .expect("draws")
        .remove(0);
    let [r, g, b, alpha] = image.get_pixel(16, 20).0;
    assert!(r.abs_diff(51) <= 1 && g.abs_diff(102) <= 1 && b.abs_diff(153) <= 1);
    assert_eq!(alpha, 255);
}

#[test]
fn the_same_frames_give_the_same_pixels_alone_and_in_a_clip() {
    let mut scene = scene(Pattern::Grid, Vec::new());
    scene.n_bodies = 2;
    let mut ball = shape(
        [0.0, 0.0, 0.2],
        Geometry::Sphere { radius: 0.2 },
        Material::plain(0.8, 0.2, 0.1),
    );
    ball.body = 1;
    scene.shapes.push(ball);
    let Some(renderer) = renderer() else { return };
    let frames: Vec<Frame> = (0..20)
        .map(|t| {
            vec![
                Transform::IDENTITY,
                Transform::at(t as f32 * 0.03, 0.0, 0.0),
            ]
        })
        .collect();
    let draw = |frames: &[Frame]| {
        renderer
            .draw(&scene, frames, (48, 32), &scene.cameras[0])
            .expect("draws")
    };
    let clip = draw(&frames);
    assert_eq!(clip, draw(&frames));
    assert_eq!(clip.len(), 20);
    assert_ne!(clip[0], clip[19]);
}

#[test]
fn a_pose_of_another_scene_is_refused() {
    let scene = scene(Pattern::Plain, Vec::new());
    let error = check(&scene, &[vec![Transform::IDENTITY; 3]], (32, 32));
    assert!(matches!(
        error,
        Err(RenderError::WrongBodies {
            frame: 0,
            found: 3,
            expected: 1
        })
    ));
}

#[test]
fn a_picture_without_pixels_is_refused() {
    let scene = scene(Pattern::Plain, Vec::new());
    let error = check(&scene, &[], (0, 32));
    assert!(matches!(error, Err(RenderError::Size { .. })));
}
