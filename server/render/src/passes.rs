//! The drawing passes: what the key light sees, then what the camera sees.

mod shadow;
mod surface;

pub(crate) use shadow::{SIDE as SHADOW_SIDE, ShadowPass};
pub(crate) use surface::{SurfacePass, View};

use crate::instance::{Batch, Instance};
use crate::mesh::{Meshes, Vertex};

/// Vertices per shape form, numbers per shape: the two streams that both passes read.
fn vertex_streams() -> [Option<wgpu::VertexBufferLayout<'static>>; 2] {
    [
        Some(wgpu::VertexBufferLayout {
            array_stride: size_of::<Vertex>() as u64,
            step_mode: wgpu::VertexStepMode::Vertex,
            attributes: &Vertex::ATTRIBUTES,
        }),
        Some(wgpu::VertexBufferLayout {
            array_stride: size_of::<Instance>() as u64,
            step_mode: wgpu::VertexStepMode::Instance,
            attributes: &Instance::ATTRIBUTES,
        }),
    ]
}

/// The buffers that both passes draw from, for one frame.
pub(crate) struct Streams<'a> {
    pub(crate) meshes: &'a Meshes,
    pub(crate) vertices: &'a wgpu::Buffer,
    pub(crate) indices: &'a wgpu::Buffer,
    pub(crate) instances: &'a wgpu::Buffer,
    /// Index of the frame's first instance.
    pub(crate) first: u64,
}

impl Streams<'_> {
    fn bind(&self, pass: &mut wgpu::RenderPass<'_>) {
        pass.set_vertex_buffer(0, self.vertices.slice(..));
        pass.set_index_buffer(self.indices.slice(..), wgpu::IndexFormat::Uint16);
    }

    fn draw(&self, pass: &mut wgpu::RenderPass<'_>, batch: &Batch) {
        let stride = size_of::<Instance>() as u64;
        let first = self.first + u64::from(batch.instances.start);
        // An offset, not a first instance: OpenGL has no such thing everywhere.
        pass.set_vertex_buffer(1, self.instances.slice(first * stride..));
        let count = batch.instances.end - batch.instances.start;
        pass.draw_indexed(self.meshes.range(batch.mesh), 0, 0..count);
    }
}
