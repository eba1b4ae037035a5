//! Test pictures that carry their number as bars, so that a page's pixels tell which frame it
//! shows. Survives encoding, scaling and colour conversion.
//!
//! Twenty upright bars of equal width: light, dark, then sixteen bits from the highest to the
//! lowest (light is 1), then dark, light. The lower half shows the same upside down in brightness,
//! so a picture that mixes two frames does not read as either.

use image::{Rgba, RgbaImage};

/// Bars along a picture.
const N_BARS: u32 = 20;

/// The picture of number `n`.
///
/// * `size` – width and height, pixels; at least 40 × 4
pub fn frame(n: u16, size: (u32, u32)) -> RgbaImage {
    RgbaImage::from_fn(size.0, size.1, |x, y| {
        let is_light = bar(n, x * N_BARS / size.0) != (y * 2 >= size.1);
        let level = if is_light { 235 } else { 20 };
        Rgba([level, level, level, 255])
    })
}

/// The number in a picture, or nothing where it is no such picture or two of them mixed.
pub fn read(image: &RgbaImage) -> Option<u16> {
    let (width, height) = image.dimensions();
    let bars = |y: u32| {
        (0..N_BARS).map(move |k| image.get_pixel((2 * k + 1) * width / (2 * N_BARS), y)[1] > 127)
    };
    let upper: Vec<bool> = bars(height / 4).collect();
    let lower: Vec<bool> = bars(height * 3 / 4).map(|is_light| !is_light).collect();
    let n = upper[2..18]
        .iter()
        .fold(0, |n, is_light| n << 1 | u16::from(*is_light));
    let is_whole = (0..N_BARS).all(|k| upper[k as usize] == bar(n, k)) && upper == lower;
    is_whole.then_some(n)
}

/// Whether bar `k` of number `n` is light in the upper half.
fn bar(n: u16, k: u32) -> bool {
    match k {
        0 | 19 => true,
        1 | 18 => false,
        _ => n >> (17 - k) & 1 == 1,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_number_is_read_back() {
        for n in [0, 1, 49, 0xa5a5, u16::MAX] {
            assert_eq!(read(&frame(n, (480, 360))), Some(n));
            assert_eq!(read(&frame(n, (100, 50))), Some(n));
        }
    }

    #[test]
    fn two_frames_mixed_are_no_number() {
        let mut torn = frame(7, (80, 40));
        let other = frame(8, (80, 40));
        for y in 20..40 {
            for x in 0..80 {
                torn.put_pixel(x, y, *other.get_pixel(x, y));
            }
        }
        assert_eq!(read(&torn), None);
    }
}
