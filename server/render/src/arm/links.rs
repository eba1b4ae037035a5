//! What the arm's links look like: tapering tubes along the joints.
//!
//! Source: the boxes of the visual meshes in METAWORLD.md 1.8, filled with round forms.

use domain::scene::{Material, Transform};

/// A tube on a link. Both ends are round.
pub(crate) struct Link {
    /// 0 is the world, 1 to 7 are `l0` to `l6`, 8 is the flange.
    pub(crate) frame: usize,
    /// Ends of the middle line in the link's frame, metres.
    pub(crate) from: [f32; 3],
    /// See `from`.
    pub(crate) to: [f32; 3],
    /// Radius at each end, metres.
    pub(crate) radius: (f32, f32),
    /// Flat ends instead of round ones.
    pub(crate) is_flat: bool,
    /// Colour.
    pub(crate) material: Material,
}

const RED: Material = Material::plain(0.62, 0.09, 0.09);
const DARK_RED: Material = Material::plain(0.40, 0.06, 0.06);
const BLACK: Material = Material::plain(0.10, 0.10, 0.11);

const fn tube(frame: usize, from: [f32; 3], to: [f32; 3], radius: (f32, f32)) -> Link {
    Link {
        frame,
        from,
        to,
        radius,
        is_flat: false,
        material: RED,
    }
}

const fn drum(
    frame: usize,
    from: [f32; 3],
    to: [f32; 3],
    radius: (f32, f32),
    material: Material,
) -> Link {
    Link {
        frame,
        from,
        to,
        radius,
        is_flat: true,
        material,
    }
}

/// Every part of the arm between the pedestal and the gripper.
pub(crate) const LINKS: [Link; 18] = [
    // The base and the leaning column on it.
    drum(
        0,
        [0.0, 0.0, 0.0],
        [0.0, 0.0, 0.08],
        (0.115, 0.105),
        DARK_RED,
    ),
    drum(1, [0.0, 0.0, 0.0], [0.0, 0.0, 0.11], (0.098, 0.084), RED),
    tube(1, [0.0, 0.0, 0.10], [0.045, 0.0, 0.237], (0.082, 0.076)),
    // The head: a post with a screen's back, at the column's top.
    drum(1, [0.0, 0.0, 0.26], [0.0, 0.0, 0.535], (0.058, 0.052), RED),
    // Shoulder.
    tube(2, [0.0, 0.0, 0.055], [0.0, 0.0, 0.125], (0.076, 0.074)),
    tube(2, [0.0, 0.0, 0.135], [0.0, -0.10, 0.1425], (0.070, 0.064)),
    // Upper arm.
    drum(
        3,
        [0.0, 0.0, -0.05],
        [0.0, 0.0, 0.035],
        (0.060, 0.058),
        DARK_RED,
    ),
    tube(3, [0.0, 0.0, 0.02], [0.0, 0.0, 0.26], (0.060, 0.058)),
    // Elbow.
    tube(4, [0.0, 0.0, -0.02], [0.0, 0.0, -0.1265], (0.062, 0.060)),
    tube(
        4,
        [0.0, 0.0, -0.1265],
        [0.0, -0.09, -0.1265],
        (0.058, 0.054),
    ),
    // Forearm.
    drum(
        5,
        [0.0, 0.0, -0.03],
        [0.0, 0.0, 0.045],
        (0.054, 0.053),
        DARK_RED,
    ),
    tube(5, [0.0, 0.0, 0.03], [0.0, 0.0, 0.275], (0.053, 0.050)),
    // Wrist.
    tube(6, [0.0, 0.0, 0.02], [0.0, 0.0, 0.1053], (0.051, 0.049)),
    tube(6, [0.0, 0.0, 0.1053], [0.0, -0.07, 0.1053], (0.047, 0.045)),
    drum(
        7,
        [0.0, 0.0, -0.06],
        [0.0, 0.0, -0.028],
        (0.044, 0.044),
        DARK_RED,
    ),
    tube(7, [0.0, 0.0, -0.02], [0.0, 0.0, 0.0], (0.045, 0.043)),
    // Flange and gripper housing.
    drum(8, [0.0, 0.0, 0.0], [0.0, 0.0, 0.029], (0.036, 0.036), BLACK),
    drum(8, [0.0, 0.0, 0.027], [0.0, 0.0, 0.045], (0.042, 0.042), RED),
];

impl Link {
    /// The frame whose z axis runs along the middle line, and half its length, metres.
    pub(crate) fn placement(&self) -> (Transform, f32) {
        let along: [f32; 3] = std::array::from_fn(|k| self.to[k] - self.from[k]);
        let length = along.iter().map(|x| x * x).sum::<f32>().sqrt();
        let centre: [f32; 3] = std::array::from_fn(|k| f32::midpoint(self.from[k], self.to[k]));
        let z = along.map(|x| x / length);
        // The shortest turn from (0, 0, 1) to z; half a turn about x where they are opposite.
        let rotation = if z[2] < -0.9999 {
            [0.0, 1.0, 0.0, 0.0]
        } else {
            let size = (2.0 * (1.0 + z[2])).sqrt();
            [size / 2.0, -z[1] / size, z[0] / size, 0.0]
        };
        let transform = Transform {
            position: centre,
            rotation,
        };
        (transform, length / 2.0)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_tube_runs_from_one_end_to_the_other() {
        for link in &LINKS {
            let (transform, half_length) = link.placement();
            let end = transform
                .then(Transform::at(0.0, 0.0, half_length))
                .position;
            for (a, b) in end.iter().zip(link.to) {
                assert!((a - b).abs() < 1e-5, "{end:?} {:?}", link.to);
            }
        }
    }
}
