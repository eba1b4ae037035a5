//! H.264 into MP4.
//!
//! Constant quality rather than a bit rate: with a bit rate the encoder drops pictures. One thread
//! and no clock, so the same pictures give the same bytes.

use image::RgbaImage;
use muxide::api::{MuxerBuilder, VideoCodec};
use openh264::OpenH264API;
use openh264::encoder::{
    BitRate, Complexity, Encoder, EncoderConfig, FrameRate, FrameType, IntraFramePeriod, QpRange,
    RateControlMode, UsageType, VuiConfig,
};
use openh264::formats::{RgbaSliceU8, YUVBuffer};

use crate::RenderError;

/// Quantiser, 0 (exact) to 51: at 20 a gripper's fingers stay crisp.
const QUALITY: u8 = 20;
/// Pictures from one that stands alone to the next: a seek decodes at most this many.
const KEY_EVERY: u32 = 5;

/// An encoded picture.
pub(crate) struct Sample {
    /// Annex B: each unit behind its start code.
    bytes: Vec<u8>,
    is_key: bool,
}

/// Encodes pictures of one even size.
pub(crate) fn h264(frames: &[RgbaImage], fps: u32) -> Result<Vec<Sample>, RenderError> {
    let failed = |e: openh264::Error| RenderError::Encoding(e.to_string());
    let config = EncoderConfig::new()
        .usage_type(UsageType::CameraVideoRealTime)
        .rate_control_mode(RateControlMode::Bitrate)
        .bitrate(BitRate::from_bps(100_000_000))
        .skip_frames(true)
        .max_frame_rate(FrameRate::from_hz(fps as f32))
        .qp(QpRange::new(QUALITY, QUALITY))
        .complexity(Complexity::Low)
        .adaptive_quantization(false)
        .background_detection(false)
        .scene_change_detect(false)
        .intra_frame_period(IntraFramePeriod::from_num_frames(KEY_EVERY))
        .num_threads(1)
        // How the conversion below weighs red, green and blue.
        .vui(VuiConfig::bt601());
    let mut encoder =
        Encoder::with_api_config(OpenH264API::from_source(), config).map_err(failed)?;
    let mut yuv: Option<YUVBuffer> = None;
    let mut samples = Vec::with_capacity(frames.len());
    for frame in frames {
        let (width, height) = frame.dimensions();
        let size = (width as usize, height as usize);
        let yuv = yuv.get_or_insert_with(|| YUVBuffer::new(size.0, size.1));
        yuv.read_rgba8(RgbaSliceU8::new(frame.as_raw(), size));
        let encoded = encoder.encode(yuv).map_err(failed)?;
        samples.push(Sample {
            bytes: encoded.to_vec(),
            is_key: matches!(encoded.frame_type(), FrameType::IDR),
        });
    }
    Ok(samples)
}

/// Puts encoded pictures into a file whose index comes first, so that playing starts at once.
pub(crate) fn mp4(
    samples: &[Sample],
    (width, height): (u32, u32),
    fps: u32,
) -> Result<Vec<u8>, RenderError> {
    let failed = |e: muxide::api::MuxerError| RenderError::Encoding(e.to_string());
    let mut file = Vec::new();
    let mut muxer = MuxerBuilder::new(&mut file)
        .video(VideoCodec::H264, width, height, f64::from(fps))
        .with_fast_start(true)
        .build()
        .map_err(failed)?;
    for (n, sample) in samples.iter().enumerate() {
        muxer
            .write_video(n as f64 / f64::from(fps), &sample.bytes, sample.is_key)
            .map_err(failed)?;
    }
    muxer.finish().map_err(failed)?;
    Ok(file)
}

#[cfg(test)]
mod tests {
    use openh264::decoder::Decoder;
    use openh264::formats::YUVSource;

    use super::*;
    use crate::bar_code;

    fn numbered(n_frames: u16) -> Vec<RgbaImage> {
        (0..n_frames)
            .map(|n| bar_code::frame(n, (160, 120)))
            .collect()
    }

    #[test]
    fn every_picture_comes_out_of_the_decoder_with_its_number() {
        let samples = h264(&numbered(30), 25).expect("encodes");
        assert_eq!(samples.len(), 30);
        let mut decoder = Decoder::new().expect("decoder starts");
        for (n, sample) in samples.iter().enumerate() {
            let picture = decoder
                .decode(&sample.bytes)
                .expect("decodes")
                .expect("each unit gives its picture at once");
            let (width, height) = picture.dimensions();
            let mut pixels = vec![0; width * height * 4];
            picture.write_rgba8(&mut pixels);
            let image = RgbaImage::from_raw(160, 120, pixels).expect("sizes agree");
            assert_eq!(bar_code::read(&image), Some(n as u16));
        }
    }

    #[test]
    fn a_seek_finds_a_picture_that_stands_alone_nearby() {
        let samples = h264(&numbered(12), 25).expect("encodes");
        let keys: Vec<usize> = (0..12).filter(|&n| samples[n].is_key).collect();
        assert_eq!(keys, [0, 5, 10]);
    }

    #[test]
    fn the_index_of_a_clip_comes_before_its_pictures() {
        let samples = h264(&numbered(3), 25).expect("encodes");
        let file = mp4(&samples, (160, 120), 25).expect("muxes");
        let find = |name: &[u8]| file.windows(4).position(|w| w == name);
        assert!(find(b"moov").expect("an index") < find(b"mdat").expect("pictures"));
    }
}
