//! Turns a scene and its frames into pictures.

use std::sync::{Mutex, PoisonError};

use domain::scene::{Camera, Frame, Scene};
use image::RgbaImage;

use crate::RenderError;
use crate::device::Gpu;
use crate::instance::DrawList;
use crate::mesh::Meshes;
use crate::passes::{ShadowPass, Streams, SurfacePass, View};
use crate::projection::{parallel, perspective};
use crate::smooth::smooth;
use crate::target::{FRAMES_AT_ONCE, Target};

/// The way the light that casts shadows travels.
///
/// Source: METAWORLD.md 5.
const KEY_LIGHT: [f32; 3] = [-1.0, 1.0, -1.0];
/// Widest and tallest picture, pixels: what every driver can do.
const LARGEST: u32 = 2048;

/// A warm device with its pipelines: make one, keep it, draw everything with it.
///
/// The first one of a process takes 0.2 to 2 s, while the driver compiles the shaders.
pub struct Renderer {
    gpu: Gpu,
    meshes: Meshes,
    vertices: wgpu::Buffer,
    indices: wgpu::Buffer,
    shadow: ShadowPass,
    surface: SurfacePass,
    /// Kept from the last clip, as the next one is likely to be of the same size.
    workspace: Mutex<Workspace>,
}

#[derive(Default)]
struct Workspace {
    target: Option<Target>,
    instances: Option<wgpu::Buffer>,
}

impl Renderer {
    /// Opens the best device of this machine: Vulkan on hardware, in software, then OpenGL.
    ///
    /// # Errors
    ///
    /// [`RenderError::NoDriver`], which names the package to install, or
    /// [`RenderError::DriverFailed`].
    pub fn new() -> Result<Self, RenderError> {
        let gpu = Gpu::open()?;
        let meshes = Meshes::new();
        let vertices = buffer(
            &gpu,
            wgpu::BufferUsages::VERTEX,
            bytemuck::cast_slice(&meshes.vertices),
        );
        let indices = buffer(
            &gpu,
            wgpu::BufferUsages::INDEX,
            bytemuck::cast_slice(&meshes.indices),
        );
        let shadow = ShadowPass::new(&gpu.device);
        let surface = SurfacePass::new(&gpu.device, &shadow.view);
        Ok(Self {
            gpu,
            meshes,
            vertices,
            indices,
            shadow,
            surface,
            workspace: Mutex::default(),
        })
    }

    /// The device, for people: `llvmpipe (LLVM 15.0.6, 256 bits) over vulkan`.
    pub fn device_name(&self) -> &str {
        &self.gpu.name
    }

    /// One opaque picture per frame.
    ///
    /// * `size` – width and height, pixels
    ///
    /// # Errors
    ///
    /// [`RenderError::WrongBodies`] when a frame belongs to another scene, [`RenderError::Size`]
    /// for pictures nothing can show, [`RenderError::Drawing`] when the device fails.
    pub fn draw(
        &self,
        scene: &Scene,
        frames: &[Frame],
        size: (u32, u32),
        camera: &Camera,
    ) -> Result<Vec<RgbaImage>, RenderError> {
        check(scene, frames, size)?;
        if frames.is_empty() {
            return Ok(Vec::new());
        }
        let list = DrawList::new(scene, frames, camera);
        // A panic while drawing leaves nothing half-done in here that the next clip would read.
        let mut workspace = self
            .workspace
            .lock()
            .unwrap_or_else(PoisonError::into_inner);
        let Workspace { target, instances } = &mut *workspace;
        if target.as_ref().is_none_or(|t| t.size != size) {
            *target = Some(Target::new(&self.gpu.device, size));
        }
        let bytes: &[u8] = bytemuck::cast_slice(&list.instances);
        match instances {
            Some(buffer) if buffer.size() >= bytes.len() as u64 => {
                self.gpu.queue.write_buffer(buffer, 0, bytes);
            }
            _ => *instances = Some(buffer(&self.gpu, wgpu::BufferUsages::VERTEX, bytes)),
        }
        let (Some(target), Some(instances)) = (target, instances) else {
            unreachable!("both were just made")
        };
        self.prepare(scene, size, camera);
        let mut images = Vec::with_capacity(frames.len());
        for first in (0..frames.len()).step_by(FRAMES_AT_ONCE) {
            let chunk = first..frames.len().min(first + FRAMES_AT_ONCE);
            let n_frames = chunk.len();
            self.submit(scene, &list, target, instances, chunk);
            target.read(&self.gpu.device, n_frames, |pixels| {
                images.push(smooth(pixels, target.row_bytes, size));
            })?;
        }
        Ok(images)
    }

    /// Tells the passes where the camera and the light are.
    fn prepare(&self, scene: &Scene, size: (u32, u32), camera: &Camera) {
        let light = parallel(KEY_LIGHT, scene.focus);
        let texel = 2.0 * scene.focus.1 / crate::passes::SHADOW_SIDE as f32;
        let [x, y, z] = camera.eye;
        self.shadow.prepare(&self.gpu.queue, &light);
        self.surface.prepare(
            &self.gpu.queue,
            &View {
                camera: perspective(camera, size),
                light,
                eye: [x, y, z, 1.0],
                shadow: [1.2 * texel, 0.0, 0.0, 0.0],
            },
        );
    }

    /// Sends the drawing of a few frames to the device.
    fn submit(
        &self,
        scene: &Scene,
        list: &DrawList,
        target: &Target,
        instances: &wgpu::Buffer,
        frames: std::ops::Range<usize>,
    ) {
        let mut encoder = self
            .gpu
            .device
            .create_command_encoder(&wgpu::CommandEncoderDescriptor::default());
        let streams = |frame: usize| Streams {
            meshes: &self.meshes,
            vertices: &self.vertices,
            indices: &self.indices,
            instances,
            first: frame as u64 * u64::from(list.per_frame),
        };
        if frames.start == 0 {
            self.shadow
                .draw_still(&mut encoder, &streams(0), &list.batches);
        }
        for (slot, frame) in frames.enumerate() {
            let streams = streams(frame);
            self.shadow
                .draw_moving(&mut encoder, &streams, &list.batches);
            self.surface.draw(
                &mut encoder,
                target,
                scene.background,
                &streams,
                &list.batches,
            );
            target.keep(&mut encoder, slot);
        }
        self.gpu.queue.submit([encoder.finish()]);
    }
}

fn check(scene: &Scene, frames: &[Frame], size: (u32, u32)) -> Result<(), RenderError> {
    let (width, height) = size;
    let reason = if width == 0 || height == 0 {
        Some("it would be empty")
    } else if width > LARGEST || height > LARGEST {
        Some("2048 is the most along a side")
    } else {
        None
    };
    if let Some(reason) = reason {
        return Err(RenderError::Size {
            width,
            height,
            reason,
        });
    }
    for (frame, bodies) in frames.iter().enumerate() {
        if bodies.len() != scene.n_bodies {
            return Err(RenderError::WrongBodies {
                frame,
                found: bodies.len(),
                expected: scene.n_bodies,
            });
        }
    }
    Ok(())
}

/// A buffer with these contents, which may be written again.
fn buffer(gpu: &Gpu, usage: wgpu::BufferUsages, bytes: &[u8]) -> wgpu::Buffer {
    let buffer = gpu.device.create_buffer(&wgpu::BufferDescriptor {
        label: None,
        size: (bytes.len() as u64).next_multiple_of(wgpu::COPY_BUFFER_ALIGNMENT),
        usage: usage | wgpu::BufferUsages::COPY_DST,
        mapped_at_creation: false,
    });
    let mut padded = bytes.to_vec();
    padded.resize(buffer.size() as usize, 0);
    gpu.queue.write_buffer(&buffer, 0, &padded);
    buffer
}

#[cfg(test)]
mod tests;
