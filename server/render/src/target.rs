//! The picture being drawn, and the way its pixels come back.

use wgpu::Device;

use crate::RenderError;

/// Shaders encode to sRGB themselves, so that blending and smoothing see what people see.
pub(crate) const COLOR_FORMAT: wgpu::TextureFormat = wgpu::TextureFormat::Rgba8Unorm;
pub(crate) const DEPTH_FORMAT: wgpu::TextureFormat = wgpu::TextureFormat::Depth32Float;
/// Frames that are drawn before any is read back; 6 MB at a clip's size.
pub(crate) const FRAMES_AT_ONCE: usize = 8;

/// One picture on the device and room for a few to be read back.
pub(crate) struct Target {
    /// Width and height, pixels.
    pub(crate) size: (u32, u32),
    color: wgpu::Texture,
    pub(crate) color_view: wgpu::TextureView,
    pub(crate) depth_view: wgpu::TextureView,
    read_back: wgpu::Buffer,
    /// Bytes from one row of pixels to the next.
    pub(crate) row_bytes: usize,
}

impl Target {
    pub(crate) fn new(device: &Device, size: (u32, u32)) -> Self {
        let texture = |format, usage| {
            device.create_texture(&wgpu::TextureDescriptor {
                label: Some("picture"),
                size: extent(size),
                mip_level_count: 1,
                sample_count: 1,
                dimension: wgpu::TextureDimension::D2,
                format,
                usage: wgpu::TextureUsages::RENDER_ATTACHMENT | usage,
                view_formats: &[],
            })
        };
        let color = texture(COLOR_FORMAT, wgpu::TextureUsages::COPY_SRC);
        let depth = texture(DEPTH_FORMAT, wgpu::TextureUsages::empty());
        let row_bytes = (size.0 * 4).next_multiple_of(wgpu::COPY_BYTES_PER_ROW_ALIGNMENT) as usize;
        let read_back = device.create_buffer(&wgpu::BufferDescriptor {
            label: Some("read back"),
            size: (row_bytes * size.1 as usize * FRAMES_AT_ONCE) as u64,
            usage: wgpu::BufferUsages::COPY_DST | wgpu::BufferUsages::MAP_READ,
            mapped_at_creation: false,
        });
        Self {
            size,
            color_view: color.create_view(&wgpu::TextureViewDescriptor::default()),
            depth_view: depth.create_view(&wgpu::TextureViewDescriptor::default()),
            color,
            read_back,
            row_bytes,
        }
    }

    /// Bytes of one picture, its rows' padding included.
    fn frame_bytes(&self) -> usize {
        self.row_bytes * self.size.1 as usize
    }

    /// Keeps the picture just drawn in place `slot` of [`FRAMES_AT_ONCE`].
    pub(crate) fn keep(&self, encoder: &mut wgpu::CommandEncoder, slot: usize) {
        encoder.copy_texture_to_buffer(
            self.color.as_image_copy(),
            wgpu::TexelCopyBufferInfo {
                buffer: &self.read_back,
                layout: wgpu::TexelCopyBufferLayout {
                    offset: (slot * self.frame_bytes()) as u64,
                    bytes_per_row: Some(self.row_bytes as u32),
                    rows_per_image: None,
                },
            },
            extent(self.size),
        );
    }

    /// Waits for the device and hands each kept picture, padded rows, to `take`.
    pub(crate) fn read(
        &self,
        device: &Device,
        n_frames: usize,
        mut take: impl FnMut(&[u8]),
    ) -> Result<(), RenderError> {
        let failed = |reason: String| RenderError::Drawing { reason };
        let bytes = (n_frames * self.frame_bytes()) as u64;
        let (sender, receiver) = std::sync::mpsc::channel();
        self.read_back
            .map_async(wgpu::MapMode::Read, ..bytes, move |result| {
                // The receiver waits below for as long as this can be called.
                let _ = sender.send(result);
            });
        device
            .poll(wgpu::PollType::wait_indefinitely())
            .map_err(|e| failed(e.to_string()))?;
        receiver
            .try_recv()
            .map_err(|_| failed("the device went away".into()))?
            .map_err(|e| failed(e.to_string()))?;
        {
            let pixels = self
                .read_back
                .get_mapped_range(..bytes)
                .map_err(|e| failed(e.to_string()))?;
            pixels.chunks_exact(self.frame_bytes()).for_each(&mut take);
        }
        self.read_back.unmap();
        Ok(())
    }
}

fn extent((width, height): (u32, u32)) -> wgpu::Extent3d {
    wgpu::Extent3d {
        width,
        height,
        depth_or_array_layers: 1,
    }
}
