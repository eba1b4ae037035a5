//! Many pictures in one.

use image::{GenericImage, RgbaImage};

use crate::RenderError;

/// Pictures on a sheet at most; of more, evenly spaced ones are chosen.
pub const SHEET_FRAMES: usize = 12;
/// Pixels between pictures, seen through so that the sheet suits light and dark pages.
const GAP: u32 = 4;

/// Indices of `n_shown` of `n` things at even distances, the first and the last among them; all
/// where there are no more.
pub fn evenly(n: usize, n_shown: usize) -> impl Iterator<Item = usize> {
    let n_shown = n_shown.min(n);
    (0..n_shown).map(move |place| place * (n - 1) / (n_shown - 1).max(1))
}

/// The frames in reading order, at most twelve, the first and the last among them.
///
/// # Errors
///
/// [`RenderError::NoFrames`] when there is none.
pub fn contact_sheet(frames: &[RgbaImage]) -> Result<RgbaImage, RenderError> {
    let first = frames.first().ok_or(RenderError::NoFrames)?;
    let (width, height) = first.dimensions();
    let n_shown = frames.len().min(SHEET_FRAMES);
    let n_columns = match n_shown {
        1..=3 => n_shown,
        4 => 2,
        5..=9 => 3,
        _ => 4,
    };
    let n_rows = n_shown.div_ceil(n_columns);
    let along = |n: usize, each: u32| n as u32 * (each + GAP) - GAP;
    let mut sheet = RgbaImage::new(along(n_columns, width), along(n_rows, height));
    for (place, chosen) in evenly(frames.len(), SHEET_FRAMES).enumerate() {
        let (column, row) = ((place % n_columns) as u32, (place / n_columns) as u32);
        sheet
            .copy_from(
                &frames[chosen],
                column * (width + GAP),
                row * (height + GAP),
            )
            .map_err(|_| RenderError::Size {
                width,
                height,
                reason: "the pictures of a sheet must be of one size",
            })?;
    }
    Ok(sheet)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_sheet_shows_the_first_and_the_last_frame() {
        let frames: Vec<RgbaImage> = (0..50)
            .map(|n| RgbaImage::from_pixel(8, 6, image::Rgba([n, 0, 0, 255])))
            .collect();
        let sheet = contact_sheet(&frames).expect("there are frames");
        assert_eq!(sheet.dimensions(), (4 * 8 + 3 * 4, 3 * 6 + 2 * 4));
        assert_eq!(sheet.get_pixel(0, 0)[0], 0);
        assert_eq!(
            sheet.get_pixel(sheet.width() - 1, sheet.height() - 1)[0],
            49
        );
    }

    #[test]
    fn even_distances_reach_from_the_first_to_the_last() {
        let of = |n, n_shown| evenly(n, n_shown).collect::<Vec<_>>();
        assert_eq!(of(50, 6), [0, 9, 19, 29, 39, 49]);
        assert_eq!(of(3, 6), [0, 1, 2]);
        assert_eq!(of(9, 1), [0]);
        assert!(of(0, 6).is_empty() && of(6, 0).is_empty());
    }

    #[test]
    fn nothing_makes_no_sheet() {
        assert!(matches!(contact_sheet(&[]), Err(RenderError::NoFrames)));
    }
}
