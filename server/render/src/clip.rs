//! Clips: a segment's pictures as an H.264 MP4 that starts, seeks and steps quickly in a browser.

use image::RgbaImage;
use sha2::{Digest, Sha256};

use crate::RenderError;
use crate::encode;

/// A video file and its name.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Clip {
    /// The MP4 file; the same frames give the same bytes.
    pub bytes: Vec<u8>,
    /// Of the bytes, 64 lower-case hexadecimal digits: the clip's name.
    pub sha256: String,
    /// Pictures in it.
    pub n_frames: u32,
    /// Pictures per second.
    pub fps: u32,
    /// Pixels.
    pub width: u32,
    /// Pixels.
    pub height: u32,
}

/// How fast a segment of `n_steps` is shown, frames per second.
///
/// Source: the studies show 50 steps in about 2 s and 20 steps in about 1 s.
pub fn frames_per_second(n_steps: usize) -> u32 {
    if n_steps <= 20 { 20 } else { 25 }
}

/// Encodes pictures of one size as a clip.
///
/// # Errors
///
/// [`RenderError::NoFrames`] without pictures, [`RenderError::Size`] where they differ in size or
/// have an odd number of pixels along a side, [`RenderError::Encoding`] when the encoder fails.
pub fn encode(frames: &[RgbaImage], fps: u32) -> Result<Clip, RenderError> {
    let (width, height) = frames.first().ok_or(RenderError::NoFrames)?.dimensions();
    let reason = if frames.iter().any(|f| f.dimensions() != (width, height)) {
        Some("the frames of a clip must be of one size")
    } else if width % 2 == 1 || height % 2 == 1 || width < 16 || height < 16 {
        Some("clips need even numbers of at least 16")
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
    let bytes = encode::mp4(&encode::h264(frames, fps)?, (width, height), fps)?;
    Ok(Clip {
        sha256: hex(&Sha256::digest(&bytes)),
        bytes,
        n_frames: frames.len() as u32,
        fps,
        width,
        height,
    })
}

/// Bytes that [`padded`] adds at least: the head of an MP4 box.
pub const LEAST_PADDING: usize = 8;

/// A clip's file with a `free` box behind it, `len` bytes in all, and the SHA-256 that names it
/// then. Players skip such a box.
///
/// # Panics
/// When the file is within [`LEAST_PADDING`] bytes of `len`, or longer.
pub fn padded(file: &[u8], len: usize) -> (Vec<u8>, String) {
    let padding = len.saturating_sub(file.len());
    assert!(padding >= LEAST_PADDING, "room for the head of a box");
    let mut bytes = file.to_vec();
    bytes.extend((padding as u32).to_be_bytes());
    bytes.extend(b"free");
    bytes.resize(len, 0);
    let sha256 = hex(&Sha256::digest(&bytes));
    (bytes, sha256)
}

fn hex(bytes: &[u8]) -> String {
    use std::fmt::Write;
    bytes.iter().fold(String::new(), |mut text, byte| {
        // Writing to a String cannot fail.
        let _ = write!(text, "{byte:02x}");
        text
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::bar_code;

    #[test]
    fn the_same_pictures_make_the_same_file() {
        let frames: Vec<RgbaImage> = (0..6).map(|n| bar_code::frame(n, (64, 48))).collect();
        let clip = encode(&frames, 20).expect("encodes");
        assert_eq!(clip, encode(&frames, 20).expect("encodes"));
        assert_eq!((clip.n_frames, clip.width, clip.height), (6, 64, 48));
        assert_eq!(clip.sha256.len(), 64);
    }

    #[test]
    fn a_padded_clip_is_the_clip_and_a_box_that_players_skip() {
        let frames: Vec<RgbaImage> = (0..3).map(|n| bar_code::frame(n, (64, 48))).collect();
        let clip = encode(&frames, 20).expect("encodes");
        let len = clip.bytes.len() + LEAST_PADDING + 5;
        let (bytes, sha256) = padded(&clip.bytes, len);
        assert_eq!((bytes.len(), sha256.len()), (len, 64));
        assert_ne!(sha256, clip.sha256);
        let (file, padding) = bytes.split_at(clip.bytes.len());
        assert_eq!(
            (file, padding),
            (&clip.bytes[..], &b"\0\0\0\x0dfree\0\0\0\0\0"[..])
        );
    }

    #[test]
    fn pictures_of_two_sizes_make_no_clip() {
        let frames = [bar_code::frame(0, (64, 48)), bar_code::frame(1, (48, 48))];
        assert!(matches!(encode(&frames, 20), Err(RenderError::Size { .. })));
    }

    #[test]
    fn short_segments_take_about_a_second_and_long_ones_two() {
        assert_eq!(frames_per_second(10), 20);
        assert_eq!(frames_per_second(20), 20);
        assert_eq!(frames_per_second(50), 25);
    }
}
