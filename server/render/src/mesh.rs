//! Four meshes of unit size; instances stretch them into every form a scene knows.
//!
//! A vertex lands at `unit · size + other · other_size + lift · half_length · ẑ` in its shape's
//! frame. Two sizes let one mesh taper; the lift keeps round caps round however long the shape.

use std::f32::consts::{PI, TAU};
use std::ops::Range;

/// One corner of a mesh.
#[repr(C)]
#[derive(Clone, Copy, bytemuck::Pod, bytemuck::Zeroable)]
pub(crate) struct Vertex {
    unit: [f32; 3],
    other_and_lift: [f32; 4],
    normal: [f32; 3],
}

impl Vertex {
    pub(crate) const ATTRIBUTES: [wgpu::VertexAttribute; 3] =
        wgpu::vertex_attr_array![0 => Float32x3, 1 => Float32x4, 2 => Float32x3];
}

/// Which mesh an instance stretches; also the order of drawing (see `instance`).
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub(crate) enum MeshKind {
    /// Balls and capsules, straight or tapering.
    Capsule,
    /// Cylinders and cones, closed.
    Cylinder,
    /// Boxes.
    Cuboid,
    /// Flat rings and discs, two-sided.
    Ring,
}

impl MeshKind {
    pub(crate) const ALL: [Self; 4] = [Self::Capsule, Self::Cylinder, Self::Cuboid, Self::Ring];
}

/// All meshes in one pair of buffers.
pub(crate) struct Meshes {
    pub(crate) vertices: Vec<Vertex>,
    pub(crate) indices: Vec<u16>,
    ranges: [Range<u32>; 4],
}

impl Meshes {
    pub(crate) fn new() -> Self {
        let mut meshes = Self {
            vertices: Vec::new(),
            indices: Vec::new(),
            ranges: [0..0, 0..0, 0..0, 0..0],
        };
        for kind in MeshKind::ALL {
            let start = meshes.indices.len() as u32;
            match kind {
                MeshKind::Capsule => meshes.add_capsule(20, 4),
                MeshKind::Cylinder => meshes.add_cylinder(24),
                MeshKind::Cuboid => meshes.add_cuboid(),
                MeshKind::Ring => meshes.add_ring(40),
            }
            meshes.ranges[kind as usize] = start..meshes.indices.len() as u32;
        }
        meshes
    }

    /// Where a mesh lies in the index buffer.
    pub(crate) fn range(&self, kind: MeshKind) -> Range<u32> {
        self.ranges[kind as usize].clone()
    }

    fn push(&mut self, unit: [f32; 3], other: [f32; 3], lift: f32, normal: [f32; 3]) -> u16 {
        self.vertices.push(Vertex {
            unit,
            other_and_lift: [other[0], other[1], other[2], lift],
            normal,
        });
        (self.vertices.len() - 1) as u16
    }

    fn quad(&mut self, corners: [u16; 4]) {
        let [a, b, c, d] = corners;
        self.indices.extend([a, b, c, a, c, d]);
    }

    fn add_cuboid(&mut self) {
        for axis in 0..3 {
            for sign in [-1.0, 1.0] {
                let mut normal = [0.0; 3];
                normal[axis] = sign;
                let (u, v) = ((axis + 1) % 3, (axis + 2) % 3);
                let corner = |along_u: f32, along_v: f32| {
                    let mut unit = normal;
                    unit[u] = along_u * sign;
                    unit[v] = along_v;
                    unit
                };
                let corners = [(-1.0, -1.0), (1.0, -1.0), (1.0, 1.0), (-1.0, 1.0)]
                    .map(|(a, b)| self.push(corner(a, b), [0.0; 3], 0.0, normal));
                self.quad(corners);
            }
        }
    }

    /// The upper end has size `size`, the lower one `other_size`.
    fn add_cylinder(&mut self, n_sides: u16) {
        let none = [0.0; 3];
        for end in [1.0_f32, -1.0] {
            let centre = self.push(none, none, end, [0.0, 0.0, end]);
            for k in 0..=n_sides {
                let (sin, cos) = (end * f32::from(k) / f32::from(n_sides) * TAU).sin_cos();
                let rim = [cos, sin, 0.0];
                let (unit, other) = if end > 0.0 { (rim, none) } else { (none, rim) };
                let corner = self.push(unit, other, end, [0.0, 0.0, end]);
                if k > 0 {
                    self.indices.extend([centre, corner - 1, corner]);
                }
            }
        }
        for k in 0..=n_sides {
            let (sin, cos) = (f32::from(k) / f32::from(n_sides) * TAU).sin_cos();
            let rim = [cos, sin, 0.0];
            let low = self.push(none, rim, -1.0, rim);
            let high = self.push(rim, none, 1.0, rim);
            if k > 0 {
                self.quad([low - 2, low, high, high - 2]);
            }
        }
    }

    /// The upper cap has radius `size`, the lower one `other_size`.
    fn add_capsule(&mut self, n_sides: u16, n_rings: u16) {
        let none = [0.0; 3];
        let stride = n_sides + 1;
        let n_rows = 2 * (n_rings + 1);
        let first = self.vertices.len() as u16;
        for row in 0..n_rows {
            let is_upper = row > n_rings;
            let step = if is_upper { row - n_rings - 1 } else { row };
            let latitude = f32::from(step) / f32::from(n_rings) * PI / 2.0
                - if is_upper { 0.0 } else { PI / 2.0 };
            for k in 0..stride {
                let longitude = f32::from(k) / f32::from(n_sides) * TAU;
                let direction = [
                    latitude.cos() * longitude.cos(),
                    latitude.cos() * longitude.sin(),
                    latitude.sin(),
                ];
                if is_upper {
                    self.push(direction, none, 1.0, direction);
                } else {
                    self.push(none, direction, -1.0, direction);
                }
            }
        }
        for row in 0..n_rows - 1 {
            for k in 0..n_sides {
                let low = first + row * stride + k;
                let high = low + stride;
                // The first and the last row are points: one triangle each, not two.
                if row > 0 {
                    self.indices.extend([low, low + 1, high + 1]);
                }
                if row < n_rows - 2 {
                    self.indices.extend([low, high + 1, high]);
                }
            }
        }
    }

    /// The outer edge has radius `size`, the inner one `other_size`.
    fn add_ring(&mut self, n_sides: u16) {
        let none = [0.0; 3];
        for side in [1.0, -1.0] {
            for k in 0..=n_sides {
                let (sin, cos) = (side * f32::from(k) / f32::from(n_sides) * TAU).sin_cos();
                let rim = [cos, sin, 0.0];
                let outer = self.push(rim, none, 0.0, [0.0, 0.0, side]);
                let inner = self.push(none, rim, 0.0, [0.0, 0.0, side]);
                if k > 0 {
                    self.quad([outer - 2, outer, inner, inner - 2]);
                }
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn place(v: &Vertex) -> [f32; 3] {
        let [x, y, z, lift] = v.other_and_lift;
        [v.unit[0] + x, v.unit[1] + y, v.unit[2] + z + lift]
    }

    #[test]
    fn every_triangle_turns_counterclockwise_seen_from_outside() {
        let meshes = Meshes::new();
        // A flat ring's inner edge needs a size of its own, which this formula does not give it.
        let n_closed = meshes.range(MeshKind::Ring).start as usize;
        for triangle in meshes.indices[..n_closed].chunks_exact(3) {
            let [a, b, c] = [0, 1, 2].map(|k| place(&meshes.vertices[triangle[k] as usize]));
            let u = [0, 1, 2].map(|k| b[k] - a[k]);
            let v = [0, 1, 2].map(|k| c[k] - a[k]);
            let facing = [
                u[1] * v[2] - u[2] * v[1],
                u[2] * v[0] - u[0] * v[2],
                u[0] * v[1] - u[1] * v[0],
            ];
            let mut outward = [0.0; 3];
            for &corner in triangle {
                for (sum, n) in outward
                    .iter_mut()
                    .zip(meshes.vertices[corner as usize].normal)
                {
                    *sum += n;
                }
            }
            let agreement: f32 = (0..3).map(|k| facing[k] * outward[k]).sum();
            assert!(agreement > 0.0, "{triangle:?}");
        }
    }
}
