//! What is handed to the GPU: every shape of every frame, in the order it is drawn.
//!
//! Order: what moves before what stands (near things hide far ones, so fewer pixels are shaded
//! twice), one run per look and mesh, nearest first; glass last, farthest first.

use std::ops::Range;

use domain::scene::{Arm, Camera, Frame, Geometry, Material, Pattern, Scene, Transform};

use crate::arm::{self, LINKS};
use crate::mesh::MeshKind;
use crate::projection::{dot, minus};

/// How a surface is shaded: one pipeline each.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub(crate) enum Look {
    /// One colour, lit.
    Plain,
    /// Boards, lit.
    Wood,
    /// Tiles, lit.
    Tiles,
    /// A grid, lit.
    Grid,
    /// Light and dark squares, lit.
    Checker,
    /// Unlit.
    Marker,
    /// Lit and seen through.
    Glass,
    /// Unlit and seen through.
    Veil,
}

impl Look {
    pub(crate) const ALL: [Self; 8] = [
        Self::Plain,
        Self::Wood,
        Self::Tiles,
        Self::Grid,
        Self::Checker,
        Self::Marker,
        Self::Glass,
        Self::Veil,
    ];

    pub(crate) fn is_seen_through(self) -> bool {
        matches!(self, Self::Glass | Self::Veil)
    }

    fn casts_shadow(self) -> bool {
        !matches!(self, Self::Marker | Self::Glass | Self::Veil)
    }

    fn of(material: &Material) -> Self {
        match (material.color[3] < 0.999, material.is_marker) {
            (true, true) => Self::Veil,
            (true, false) => Self::Glass,
            (false, true) => Self::Marker,
            (false, false) => match material.pattern {
                Pattern::Plain => Self::Plain,
                Pattern::Wood => Self::Wood,
                Pattern::Tiles => Self::Tiles,
                Pattern::Grid => Self::Grid,
                Pattern::Checker => Self::Checker,
            },
        }
    }
}

/// One shape as the shaders read it.
#[repr(C)]
#[derive(Clone, Copy, bytemuck::Pod, bytemuck::Zeroable)]
pub(crate) struct Instance {
    /// (x, y, z, w)
    rotation: [f32; 4],
    position: [f32; 4],
    /// See `mesh`; the fourth number is half the length.
    size: [f32; 4],
    other_size: [f32; 4],
    /// Linear light, alpha.
    color: [f32; 4],
}

impl Instance {
    pub(crate) const ATTRIBUTES: [wgpu::VertexAttribute; 5] = wgpu::vertex_attr_array![
        3 => Float32x4, 4 => Float32x4, 5 => Float32x4, 6 => Float32x4, 7 => Float32x4
    ];
}

/// Neighbouring instances that one call draws.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(crate) struct Batch {
    pub(crate) look: Look,
    pub(crate) mesh: MeshKind,
    /// Within one frame's instances.
    pub(crate) instances: Range<u32>,
    /// Whether any frame of the clip differs from another.
    pub(crate) moves: bool,
    pub(crate) casts_shadow: bool,
}

/// A clip's worth of shapes.
pub(crate) struct DrawList {
    /// `[n_frames × per_frame]`
    pub(crate) instances: Vec<Instance>,
    pub(crate) per_frame: u32,
    pub(crate) batches: Vec<Batch>,
}

/// A shape, or a part of the arm, before it is placed.
struct Part {
    body: usize,
    local: Transform,
    mesh: MeshKind,
    size: [f32; 4],
    other_size: [f32; 4],
    color: [f32; 4],
    look: Look,
    moves: bool,
}

impl DrawList {
    /// Places every shape of `scene` in every one of `frames`, which all fit the scene.
    pub(crate) fn new(scene: &Scene, frames: &[Frame], camera: &Camera) -> Self {
        let frames = with_arm(scene, frames);
        let mut parts: Vec<Part> = scene.shapes.iter().map(part_of_shape).collect();
        if scene.arm.is_some() {
            parts.extend(LINKS.iter().map(|link| part_of_link(link, scene.n_bodies)));
        }
        for part in &mut parts {
            part.moves = frames.iter().any(|f| f[part.body] != frames[0][part.body]);
        }
        parts.sort_by(|a, b| {
            let run = |p: &Part| (p.look.is_seen_through(), !p.moves, p.look, p.mesh);
            let distance = |p: &Part| {
                let middle = frames[0][p.body].then(p.local).position;
                let away = minus(middle, camera.eye);
                // Far sides, so that what a big floor carries comes before the floor.
                let far = dot(away, away).sqrt() + p.size[0].max(p.size[1]).max(p.size[3]);
                if p.look.is_seen_through() { -far } else { far }
            };
            run(a)
                .cmp(&run(b))
                .then(distance(a).total_cmp(&distance(b)))
        });
        let instances = frames
            .iter()
            .flat_map(|bodies| parts.iter().map(|part| part.placed(bodies[part.body])))
            .collect();
        Self {
            instances,
            per_frame: parts.len() as u32,
            batches: batches(&parts),
        }
    }
}

impl Part {
    fn placed(&self, body: Transform) -> Instance {
        let Transform { position, rotation } = body.then(self.local);
        let [w, x, y, z] = rotation;
        Instance {
            rotation: [x, y, z, w],
            position: [position[0], position[1], position[2], 1.0],
            size: self.size,
            other_size: self.other_size,
            color: self.color,
        }
    }
}

/// The frames with the arm's links appended as bodies: the world again, `l0` to `l6`, the flange.
fn with_arm(scene: &Scene, frames: &[Frame]) -> Vec<Frame> {
    let Some(Arm::Sawyer { hand }) = scene.arm else {
        return frames.to_vec();
    };
    let joints = arm::reach_all(frames, hand);
    frames
        .iter()
        .zip(&joints)
        .map(|(bodies, joints)| {
            let posture = arm::posture(joints);
            let mut bodies = bodies.clone();
            bodies.push(Transform::IDENTITY);
            bodies.extend(posture.links);
            bodies.push(posture.right_hand);
            bodies
        })
        .collect()
}

fn part_of_shape(shape: &domain::scene::Shape) -> Part {
    let (mesh, size, other_size) = stretch(shape.geometry);
    Part {
        body: shape.body,
        local: shape.local,
        mesh,
        size,
        other_size,
        color: linear(shape.material.color),
        look: Look::of(&shape.material),
        moves: false,
    }
}

fn part_of_link(link: &arm::Link, n_bodies: usize) -> Part {
    let (local, half_length) = link.placement();
    let (low, high) = link.radius;
    let thick = |r: f32| if link.is_flat { [r, r, 0.0] } else { [r; 3] };
    let ([hx, hy, hz], [lx, ly, lz]) = (thick(high), thick(low));
    Part {
        body: n_bodies + link.frame,
        local,
        mesh: if link.is_flat {
            MeshKind::Cylinder
        } else {
            MeshKind::Capsule
        },
        size: [hx, hy, hz, half_length],
        other_size: [lx, ly, lz, 0.0],
        color: linear(link.material.color),
        look: Look::Plain,
        moves: false,
    }
}

/// Which mesh a geometry is and how it is stretched.
fn stretch(geometry: Geometry) -> (MeshKind, [f32; 4], [f32; 4]) {
    let round = |r: f32, half_length: f32| ([r, r, r, half_length], [r, r, r, 0.0]);
    let flat = |r: f32, half_length: f32| ([r, r, 0.0, half_length], [r, r, 0.0, 0.0]);
    match geometry {
        Geometry::Cuboid { half: [x, y, z] } => (MeshKind::Cuboid, [x, y, z, 0.0], [0.0; 4]),
        Geometry::Cylinder {
            radius,
            half_length,
        } => {
            let (size, other) = flat(radius, half_length);
            (MeshKind::Cylinder, size, other)
        }
        Geometry::Capsule {
            radius,
            half_length,
        } => {
            let (size, other) = round(radius, half_length);
            (MeshKind::Capsule, size, other)
        }
        Geometry::Sphere { radius } => {
            let (size, other) = round(radius, 0.0);
            (MeshKind::Capsule, size, other)
        }
        Geometry::Ellipsoid {
            semi_axes: [x, y, z],
        } => (MeshKind::Capsule, [x, y, z, 0.0], [0.0; 4]),
        Geometry::Ring { inner, outer } => (
            MeshKind::Ring,
            [outer, outer, 0.0, 0.0],
            [inner, inner, 0.0, 0.0],
        ),
    }
}

fn batches(parts: &[Part]) -> Vec<Batch> {
    let mut batches: Vec<Batch> = Vec::new();
    for (k, part) in parts.iter().enumerate() {
        let k = k as u32;
        match batches.last_mut() {
            Some(last)
                if (last.look, last.mesh, last.moves) == (part.look, part.mesh, part.moves) =>
            {
                last.instances.end = k + 1;
            }
            _ => batches.push(Batch {
                look: part.look,
                mesh: part.mesh,
                instances: k..k + 1,
                moves: part.moves,
                casts_shadow: part.look.casts_shadow(),
            }),
        }
    }
    batches
}

/// sRGB to linear light; alpha stays.
fn linear([r, g, b, alpha]: [f32; 4]) -> [f32; 4] {
    let decode = |c: f32| {
        if c <= 0.04045 {
            c / 12.92
        } else {
            ((c + 0.055) / 1.055).powf(2.4)
        }
    };
    [decode(r), decode(g), decode(b), alpha]
}
