//! From metres to pixels, for the camera and for the light that casts shadows.

use domain::scene::Camera;

/// Column-major, as the shaders read it.
pub(crate) type Matrix = [[f32; 4]; 4];

pub(crate) fn dot(a: [f32; 3], b: [f32; 3]) -> f32 {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}

pub(crate) fn minus(a: [f32; 3], b: [f32; 3]) -> [f32; 3] {
    [a[0] - b[0], a[1] - b[1], a[2] - b[2]]
}

pub(crate) fn cross(a: [f32; 3], b: [f32; 3]) -> [f32; 3] {
    [
        a[1] * b[2] - a[2] * b[1],
        a[2] * b[0] - a[0] * b[2],
        a[0] * b[1] - a[1] * b[0],
    ]
}

pub(crate) fn unit(a: [f32; 3]) -> [f32; 3] {
    let length = dot(a, a).sqrt();
    a.map(|x| x / length)
}

/// World to clip space of a camera; depth runs from 0 (2 cm) to 1 (infinitely far).
pub(crate) fn perspective(camera: &Camera, size: (u32, u32)) -> Matrix {
    const NEAR: f32 = 0.02;
    let forward = unit(camera.forward);
    let right = unit(cross(forward, camera.up));
    let up = cross(right, forward);
    let tall = 1.0 / (camera.fovy_deg.to_radians() / 2.0).tan();
    let wide = tall * size.1 as f32 / size.0 as f32;
    let row = |axis: [f32; 3], scale: f32, extra: f32| {
        let a = axis.map(|x| x * scale);
        [a[0], a[1], a[2], -dot(a, camera.eye) + extra]
    };
    columns([
        row(right, wide, 0.0),
        row(up, tall, 0.0),
        row(forward, 1.0, -NEAR),
        row(forward, 1.0, 0.0),
    ])
}

/// World to clip space of a light from infinitely far that lights a ball.
///
/// * `direction` – the way the light travels, any length
/// * `focus` – centre and radius of the ball, metres
pub(crate) fn parallel(direction: [f32; 3], focus: ([f32; 3], f32)) -> Matrix {
    let (centre, radius) = focus;
    let forward = unit(direction);
    let right = unit(cross(forward, [0.0, 0.0, 1.0]));
    let up = cross(right, forward);
    let row = |axis: [f32; 3], scale: f32, middle: f32| {
        let a = axis.map(|x| x * scale / radius);
        [a[0], a[1], a[2], -dot(a, centre) + middle]
    };
    columns([
        row(right, 1.0, 0.0),
        row(up, 1.0, 0.0),
        row(forward, 0.5, 0.5),
        [0.0, 0.0, 0.0, 1.0],
    ])
}

fn columns(rows: [[f32; 4]; 4]) -> Matrix {
    std::array::from_fn(|column| std::array::from_fn(|row| rows[row][column]))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn apply(m: &Matrix, p: [f32; 3]) -> [f32; 3] {
        let p = [p[0], p[1], p[2], 1.0];
        let q: [f32; 4] = std::array::from_fn(|r| (0..4).map(|c| m[c][r] * p[c]).sum());
        [q[0] / q[3], q[1] / q[3], q[2] / q[3]]
    }

    #[test]
    fn the_point_looked_at_is_the_middle_of_the_picture() {
        let camera = Camera {
            name: "test".into(),
            eye: [1.0, -2.0, 3.0],
            forward: unit([-1.0, 2.0, -3.0]),
            up: [0.0, 0.0, 1.0],
            fovy_deg: 90.0,
        };
        let matrix = perspective(&camera, (200, 100));
        let [x, y, depth] = apply(&matrix, [0.0, 0.0, 0.0]);
        assert!(x.abs() < 1e-5 && y.abs() < 1e-5 && depth > 0.9 && depth < 1.0);
    }

    #[test]
    fn the_light_sees_the_whole_ball() {
        let matrix = parallel([-1.0, 1.0, -1.0], ([0.0, 0.6, 0.2], 0.5));
        for point in [[0.5, 0.6, 0.2], [0.0, 0.1, 0.2], [0.0, 0.6, 0.7]] {
            let [x, y, depth] = apply(&matrix, point);
            assert!(x.abs() <= 1.0 && y.abs() <= 1.0 && (0.0..=1.0).contains(&depth));
        }
    }
}
