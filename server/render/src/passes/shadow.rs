//! What the key light sees, as depth. What stands still is drawn once per clip.

use wgpu::{Device, TextureView};

use super::{Streams, vertex_streams};
use crate::instance::Batch;
use crate::projection::Matrix;

/// Texels along a side. At 1 m of focus a texel is 2.6 mm, about a pixel of a clip.
pub(crate) const SIDE: u32 = 768;
/// 65,536 steps over the focus: 0.03 mm each.
pub(crate) const FORMAT: wgpu::TextureFormat = wgpu::TextureFormat::Depth16Unorm;

pub(crate) struct ShadowPass {
    pipeline: wgpu::RenderPipeline,
    light: wgpu::Buffer,
    bind_group: wgpu::BindGroup,
    /// What stands still.
    still: wgpu::Texture,
    /// What stands still and what moves, for one frame.
    map: wgpu::Texture,
    pub(crate) view: TextureView,
    still_view: TextureView,
}

impl ShadowPass {
    pub(crate) fn new(device: &Device) -> Self {
        let module = device.create_shader_module(wgpu::include_wgsl!(
            "../../../../assets/shaders/shadow.wgsl"
        ));
        let layout = device.create_bind_group_layout(&wgpu::BindGroupLayoutDescriptor {
            label: Some("shadow"),
            entries: &[wgpu::BindGroupLayoutEntry {
                binding: 0,
                visibility: wgpu::ShaderStages::VERTEX,
                ty: wgpu::BindingType::Buffer {
                    ty: wgpu::BufferBindingType::Uniform,
                    has_dynamic_offset: false,
                    min_binding_size: None,
                },
                count: None,
            }],
        });
        let light = device.create_buffer(&wgpu::BufferDescriptor {
            label: Some("light"),
            size: size_of::<Matrix>() as u64,
            usage: wgpu::BufferUsages::UNIFORM | wgpu::BufferUsages::COPY_DST,
            mapped_at_creation: false,
        });
        let bind_group = device.create_bind_group(&wgpu::BindGroupDescriptor {
            label: Some("shadow"),
            layout: &layout,
            entries: &[wgpu::BindGroupEntry {
                binding: 0,
                resource: light.as_entire_binding(),
            }],
        });
        let pipeline_layout = device.create_pipeline_layout(&wgpu::PipelineLayoutDescriptor {
            label: Some("shadow"),
            bind_group_layouts: &[Some(&layout)],
            immediate_size: 0,
        });
        let pipeline = device.create_render_pipeline(&wgpu::RenderPipelineDescriptor {
            label: Some("shadow"),
            layout: Some(&pipeline_layout),
            vertex: wgpu::VertexState {
                module: &module,
                entry_point: Some("vertex"),
                compilation_options: wgpu::PipelineCompilationOptions::default(),
                buffers: &vertex_streams(),
            },
            primitive: wgpu::PrimitiveState {
                cull_mode: Some(wgpu::Face::Back),
                ..Default::default()
            },
            depth_stencil: Some(wgpu::DepthStencilState {
                format: FORMAT,
                depth_write_enabled: Some(true),
                depth_compare: Some(wgpu::CompareFunction::Less),
                stencil: wgpu::StencilState::default(),
                bias: wgpu::DepthBiasState {
                    constant: 2,
                    slope_scale: 1.5,
                    clamp: 0.0,
                },
            }),
            multisample: wgpu::MultisampleState::default(),
            fragment: None,
            multiview_mask: None,
            cache: None,
        });
        let texture = |label, usage| {
            device.create_texture(&wgpu::TextureDescriptor {
                label: Some(label),
                size: extent(),
                mip_level_count: 1,
                sample_count: 1,
                dimension: wgpu::TextureDimension::D2,
                format: FORMAT,
                usage: wgpu::TextureUsages::RENDER_ATTACHMENT | usage,
                view_formats: &[],
            })
        };
        let still = texture("shadows that stand", wgpu::TextureUsages::COPY_SRC);
        let map = texture(
            "shadows",
            wgpu::TextureUsages::COPY_DST | wgpu::TextureUsages::TEXTURE_BINDING,
        );
        Self {
            pipeline,
            light,
            bind_group,
            view: map.create_view(&wgpu::TextureViewDescriptor::default()),
            still_view: still.create_view(&wgpu::TextureViewDescriptor::default()),
            still,
            map,
        }
    }

    /// Where the light shines from, for the clip that follows.
    pub(crate) fn prepare(&self, queue: &wgpu::Queue, light: &Matrix) {
        queue.write_buffer(&self.light, 0, bytemuck::bytes_of(light));
    }

    /// Draws the shadows of what stands still, once per clip.
    pub(crate) fn draw_still(
        &self,
        encoder: &mut wgpu::CommandEncoder,
        streams: &Streams<'_>,
        batches: &[Batch],
    ) {
        let still = batches.iter().filter(|b| b.casts_shadow && !b.moves);
        self.draw(
            encoder,
            &self.still_view,
            wgpu::LoadOp::Clear(1.0),
            streams,
            still,
        );
    }

    /// Adds the shadows of what moves, once per frame.
    pub(crate) fn draw_moving(
        &self,
        encoder: &mut wgpu::CommandEncoder,
        streams: &Streams<'_>,
        batches: &[Batch],
    ) {
        encoder.copy_texture_to_texture(
            self.still.as_image_copy(),
            self.map.as_image_copy(),
            extent(),
        );
        let moving = batches.iter().filter(|b| b.casts_shadow && b.moves);
        self.draw(encoder, &self.view, wgpu::LoadOp::Load, streams, moving);
    }

    fn draw<'a>(
        &self,
        encoder: &mut wgpu::CommandEncoder,
        view: &TextureView,
        load: wgpu::LoadOp<f32>,
        streams: &Streams<'_>,
        batches: impl Iterator<Item = &'a Batch>,
    ) {
        let mut pass = encoder.begin_render_pass(&wgpu::RenderPassDescriptor {
            label: Some("shadow"),
            color_attachments: &[],
            depth_stencil_attachment: Some(wgpu::RenderPassDepthStencilAttachment {
                view,
                depth_ops: Some(wgpu::Operations {
                    load,
                    store: wgpu::StoreOp::Store,
                }),
                stencil_ops: None,
            }),
            timestamp_writes: None,
            occlusion_query_set: None,
            multiview_mask: None,
        });
        pass.set_pipeline(&self.pipeline);
        pass.set_bind_group(0, &self.bind_group, &[]);
        streams.bind(&mut pass);
        for batch in batches {
            streams.draw(&mut pass, batch);
        }
    }
}

fn extent() -> wgpu::Extent3d {
    wgpu::Extent3d {
        width: SIDE,
        height: SIDE,
        depth_or_array_layers: 1,
    }
}
