//! Finds something to draw with: a graphics card, else the processor.
//!
//! Order: Vulkan on hardware, Vulkan in software (lavapipe), OpenGL.

use wgpu::{Adapter, Backend, Backends, DeviceType, Instance, InstanceDescriptor};

use crate::RenderError;

/// An open device and the queue its work goes through.
pub(crate) struct Gpu {
    pub(crate) device: wgpu::Device,
    pub(crate) queue: wgpu::Queue,
    /// For people: `llvmpipe (LLVM 15.0.6, 256 bits) over vulkan`.
    pub(crate) name: String,
}

impl Gpu {
    /// Opens the best device of this machine.
    ///
    /// # Errors
    ///
    /// [`RenderError::NoDriver`] when there is none, [`RenderError::DriverFailed`] when the best
    /// one does not start.
    pub(crate) fn open() -> Result<Self, RenderError> {
        let adapter = find(Backends::VULKAN).or_else(|| find(Backends::GL));
        Self::start(adapter)
    }

    fn start(adapter: Option<Adapter>) -> Result<Self, RenderError> {
        let adapter = adapter.ok_or(RenderError::NoDriver)?;
        let info = adapter.get_info();
        let name = format!("{} over {}", info.name, info.backend);
        let descriptor = wgpu::DeviceDescriptor {
            label: Some("clips"),
            // What every driver offers; an H100 and lavapipe draw alike.
            required_limits: wgpu::Limits::downlevel_defaults(),
            ..Default::default()
        };
        let (device, queue) =
            pollster::block_on(adapter.request_device(&descriptor)).map_err(|failure| {
                RenderError::DriverFailed {
                    driver: name.clone(),
                    reason: failure.to_string(),
                }
            })?;
        Ok(Self {
            device,
            queue,
            name,
        })
    }
}

/// The best adapter behind these interfaces, if there is any.
fn find(backends: Backends) -> Option<Adapter> {
    let instance = Instance::new(InstanceDescriptor {
        backends,
        flags: wgpu::InstanceFlags::empty(),
        ..InstanceDescriptor::new_without_display_handle()
    });
    pollster::block_on(instance.enumerate_adapters(backends))
        .into_iter()
        .min_by_key(|adapter| {
            preference(adapter.get_info().backend, adapter.get_info().device_type)
        })
}

/// Smaller is better.
fn preference(backend: Backend, kind: DeviceType) -> (u8, u8) {
    let backend = match backend {
        Backend::Vulkan => 0,
        Backend::Gl => 1,
        _ => 2,
    };
    let kind = match kind {
        DeviceType::DiscreteGpu => 0,
        DeviceType::IntegratedGpu => 1,
        DeviceType::VirtualGpu => 2,
        DeviceType::Cpu => 3,
        DeviceType::Other => 4,
    };
    (backend, kind)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_card_is_taken_before_the_processor_and_vulkan_before_opengl() {
        let card = preference(Backend::Vulkan, DeviceType::DiscreteGpu);
        let lavapipe = preference(Backend::Vulkan, DeviceType::Cpu);
        let opengl = preference(Backend::Gl, DeviceType::Other);
        assert!(card < lavapipe && lavapipe < opengl);
    }

    #[test]
    fn a_machine_without_a_driver_is_told_what_to_install() {
        let Err(error) = Gpu::start(None) else {
            panic!("started without an adapter")
        };
        let message = error.to_string();
        assert!(message.contains("no graphics driver found"), "{message}");
        assert!(
            message.contains("apt-get install -y mesa-vulkan-drivers libvulkan1"),
            "{message}"
        );
    }
}
