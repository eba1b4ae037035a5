//! Draws recorded scenes and encodes them as clips.
//!
//! Invariants: never steps physics; same scene, frames and camera give the same pixels on one
//! device; the only crate that touches the GPU driver.

pub mod arm;
pub mod bar_code;
pub mod clip;
mod contact_sheet;
mod device;
mod encode;
mod error;
mod instance;
mod mesh;
mod passes;
mod projection;
mod renderer;
mod smooth;
mod target;

pub use contact_sheet::{SHEET_FRAMES, contact_sheet, evenly};
pub use error::RenderError;
pub use image::RgbaImage;
pub use renderer::Renderer;

/// Width and height of a clip where nobody asks for another, pixels.
pub const CLIP_SIZE: (u32, u32) = (480, 360);
