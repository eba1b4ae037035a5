//! What can go wrong between a recorded pose and a file.

/// Why nothing was drawn or encoded.
#[derive(Debug, thiserror::Error)]
pub enum RenderError {
    /// The machine offers no way to draw.
    #[error(
        "no graphics driver found, so clips cannot be drawn; on Debian and Ubuntu install a \
         software one with: apt-get install -y mesa-vulkan-drivers libvulkan1"
    )]
    NoDriver,
    /// A driver is there but would not start.
    #[error("the graphics driver {driver} did not start: {reason}")]
    DriverFailed {
        /// As the driver names itself.
        driver: String,
        /// In the driver's words.
        reason: String,
    },
    /// The device stopped in the middle of a picture.
    #[error("drawing stopped: {reason}")]
    Drawing {
        /// In the driver's words.
        reason: String,
    },
    /// A recorded pose that belongs to another scene.
    #[error("frame {frame} places {found} bodies, but the scene has {expected}")]
    WrongBodies {
        /// Index into the frames asked for.
        frame: usize,
        /// In the frame.
        found: usize,
        /// In the scene.
        expected: usize,
    },
    /// Too small, too large, or odd where the codec needs even numbers.
    #[error("a picture of {width} × {height} pixels cannot be made: {reason}")]
    Size {
        /// Pixels.
        width: u32,
        /// Pixels.
        height: u32,
        /// What is wrong with it.
        reason: &'static str,
    },
    /// No pictures to make something of.
    #[error("there are no frames to make a clip or a sheet of")]
    NoFrames,
    /// The video encoder or the file format refused.
    #[error("encoding the clip failed: {0}")]
    Encoding(String),
}
