//! Forms that are both collided with and seen.

use domain::scene::{Geometry, Material, Shape, Transform};
use rapier3d::prelude::{ColliderBuilder, Pose, Rotation, Vector};

/// One form of a body, in the body's frame.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Solid {
    /// Its form.
    pub geometry: Geometry,
    /// Its place.
    pub at: Transform,
    /// Its look.
    pub look: Material,
}

impl Solid {
    /// A box by its centre and half extents.
    pub const fn cuboid(centre: [f32; 3], half: [f32; 3], look: Material) -> Self {
        Self {
            geometry: Geometry::Cuboid { half },
            at: Transform::at(centre[0], centre[1], centre[2]),
            look,
        }
    }

    /// An upright cylinder by its centre.
    pub const fn cylinder(centre: [f32; 3], radius: f32, half_length: f32, look: Material) -> Self {
        Self {
            geometry: Geometry::Cylinder {
                radius,
                half_length,
            },
            at: Transform::at(centre[0], centre[1], centre[2]),
            look,
        }
    }

    /// A capsule from one end of its axis to the other; the ends differ.
    pub fn rod(from: [f32; 3], to: [f32; 3], radius: f32, look: Material) -> Self {
        let (from, to) = (Vector::from(from), Vector::from(to));
        let turn = Rotation::from_rotation_arc(Vector::Z, (to - from).normalize());
        let middle = (from + to) / 2.0;
        Self {
            geometry: Geometry::Capsule {
                radius,
                half_length: (to - from).length() / 2.0,
            },
            at: Transform {
                position: middle.into(),
                rotation: [turn.w, turn.x, turn.y, turn.z],
            },
            look,
        }
    }

    /// The same, turned in place by `angle` radians about a unit `axis`.
    #[must_use]
    pub fn turned(self, axis: [f32; 3], angle: f32) -> Self {
        Self {
            at: self.at.turned(axis, angle),
            ..self
        }
    }

    /// What collides, without mass; nothing for a mark, which has no thickness.
    pub fn collider(&self) -> Option<ColliderBuilder> {
        // Rapier's cylinders stand along y, the scene's along z.
        let upright = Rotation::from_rotation_x(std::f32::consts::FRAC_PI_2);
        let (builder, own) = match self.geometry {
            Geometry::Cuboid { half: [x, y, z] } => {
                (ColliderBuilder::cuboid(x, y, z), Rotation::IDENTITY)
            }
            Geometry::Cylinder {
                radius,
                half_length,
            } => (ColliderBuilder::cylinder(half_length, radius), upright),
            Geometry::Capsule {
                radius,
                half_length,
            } => (
                ColliderBuilder::capsule_z(half_length, radius),
                Rotation::IDENTITY,
            ),
            Geometry::Sphere { radius } => (ColliderBuilder::ball(radius), Rotation::IDENTITY),
            Geometry::Ring { .. } | Geometry::Ellipsoid { .. } => return None,
        };
        let [w, x, y, z] = self.at.rotation;
        let turn = Rotation::from_xyzw(x, y, z, w) * own;
        let pose = Pose::from_parts(Vector::from(self.at.position), turn);
        Some(builder.position(pose).density(0.0))
    }

    /// What is seen, as part of the scene's `body`.
    pub fn shape(&self, body: usize) -> Shape {
        Shape {
            body,
            local: self.at,
            geometry: self.geometry,
            material: self.look,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const GREY: Material = Material::plain(0.5, 0.5, 0.5);

    #[test]
    fn a_rod_ends_where_it_was_told_to() {
        let rod = Solid::rod([0.1, 0.2, 0.3], [0.4, 0.2, 0.7], 0.02, GREY);
        let Geometry::Capsule { half_length, .. } = rod.geometry else {
            panic!("a rod is a capsule")
        };
        let end = rod.at.then(Transform::at(0.0, 0.0, half_length)).position;
        for (is, should_be) in end.iter().zip([0.4, 0.2, 0.7]) {
            assert!((is - should_be).abs() < 1e-6, "{end:?}");
        }
    }

    #[test]
    fn a_cylinder_stands_where_it_is_seen_to_stand() {
        let post = Solid::cylinder([0.0, 0.0, 1.0], 0.1, 0.5, GREY);
        let collider = post.collider().expect("a cylinder has a volume").build();
        let bounds = collider.compute_aabb();
        assert!((bounds.maxs.z - 1.5).abs() < 1e-5 && (bounds.maxs.x - 0.1).abs() < 1e-5);
    }

    #[test]
    fn a_mark_is_no_obstacle() {
        let mark = Solid {
            geometry: Geometry::Ring {
                inner: 0.1,
                outer: 0.2,
            },
            ..Solid::cuboid([0.0; 3], [1.0; 3], GREY)
        };
        assert!(mark.collider().is_none());
    }
}
