//! Many pictures in one.

use image::{GenericImage, RgbaImage};

use crate::RenderError;

/// Pictures on a sheet at most; of more, evenly spaced ones are chosen.
const MOST: usize = 12;
/// Pixels between pictures, seen through so that the sheet suits light and dark pages.
const GAP: u32 = 4;

/// The frames in reading order, at most twelve, the first and the last among them.
///
/// # Errors
///
/// [`RenderError::NoFrames`] when there is none.
pub fn contact_sheet(frames: &[RgbaImage]) -> Result<RgbaImage, RenderError> {
    let first = frames.first().ok_or(RenderError::NoFrames)?;
    let (width, height) = first.dimensions();
    let n_shown = frames.len().min(MOST);
    let n_columns = match n_shown {
        1..=3 => n_shown,
        4 => 2,
        5..=9 => 3,
        _ => 4,
    };
    let n_rows = n_shown.div_ceil(n_columns);
    let along = |n: usize, each: u32| n as u32 * (each + GAP) - GAP;
    let mut sheet = RgbaImage::new(along(n_columns, width), along(n_rows, height));
    for place in 0..n_shown {
        let chosen = place * (frames.len() - 1) / (n_shown - 1).max(1);
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
    fn nothing_makes_no_sheet() {
        assert!(matches!(contact_sheet(&[]), Err(RenderError::NoFrames)));
    }
}
