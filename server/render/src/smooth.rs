//! Smooths the stairs of slanted edges after drawing: FXAA on the processor.
//!
//! Four samples per pixel would cost three times as much as the whole picture in software. Edges
//! are few, so finding them costs one cheap sweep and only they are blended.
//!
//! Source: T. Lottes, FXAA 3.11 (quality variant), with its search in whole pixels.

use image::RgbaImage;

/// Contrast below which nothing is an edge, of 255.
const SMALLEST_CONTRAST: i32 = 14;
/// Contrast below which nothing is an edge, as a shift of the brightest neighbour (1/8).
const RELATIVE_CONTRAST: u32 = 3;
/// How far along an edge its end is looked for, pixels.
const REACH: [i32; 8] = [1, 2, 3, 4, 6, 8, 12, 16];
/// How much of single-pixel roughness is taken away.
const SUBPIXEL: f32 = 0.6;

/// A picture with smooth edges.
///
/// * `pixels` – red, green, blue, alpha; rows of `row_bytes` bytes
/// * `size` – width and height, pixels
pub(crate) fn smooth(pixels: &[u8], row_bytes: usize, size: (u32, u32)) -> RgbaImage {
    let (width, height) = (size.0 as usize, size.1 as usize);
    let mut image = vec![0; width * height * 4];
    let mut luma = vec![0_u8; width * height];
    for y in 0..height {
        let row = &pixels[y * row_bytes..][..width * 4];
        image[y * width * 4..][..width * 4].copy_from_slice(row);
        for (l, p) in luma[y * width..][..width]
            .iter_mut()
            .zip(row.chunks_exact(4))
        {
            *l = ((u32::from(p[0]) * 77 + u32::from(p[1]) * 150 + u32::from(p[2]) * 29) >> 8) as u8;
        }
    }
    let plane = Luma {
        values: &luma,
        width: size.0.cast_signed(),
        height: size.1.cast_signed(),
    };
    let source = |x: usize, y: usize| &pixels[y * row_bytes + x * 4..][..4];
    let mut is_edge = vec![0_u8; width];
    let inner_rows = if width < 3 { 0 } else { height };
    for y in 1..inner_rows.saturating_sub(1) {
        plane.mark_edges(y, &mut is_edge);
        for x in 1..width - 1 {
            if is_edge[x] == 0 {
                continue;
            }
            let (dx, dy, share) = plane.blend((x as u32).cast_signed(), (y as u32).cast_signed());
            if share == 0 {
                continue;
            }
            let here = source(x, y);
            let other = source(
                x.saturating_add_signed(dx as isize),
                y.saturating_add_signed(dy as isize),
            );
            let out = &mut image[(y * width + x) * 4..][..3];
            for k in 0..3 {
                let (a, b) = (i32::from(here[k]), i32::from(other[k]));
                out[k] = (a + (((b - a) * share + 128) >> 8)) as u8;
            }
        }
    }
    RgbaImage::from_raw(size.0, size.1, image).expect("four bytes for each pixel were made")
}

/// Brightness of every pixel.
struct Luma<'a> {
    values: &'a [u8],
    width: i32,
    height: i32,
}

impl Luma<'_> {
    fn at(&self, x: i32, y: i32) -> i32 {
        let x = x.clamp(0, self.width - 1);
        let y = y.clamp(0, self.height - 1);
        i32::from(self.values[(y * self.width + x) as usize])
    }

    /// Marks with 1 the pixels of row `y` that differ enough from a neighbour. Written without
    /// branches, so that the compiler does many pixels at once.
    fn mark_edges(&self, y: usize, is_edge: &mut [u8]) {
        let width = self.width as usize;
        let row = |y: usize| &self.values[y * width..][..width];
        let (above, here, below) = (row(y - 1), row(y), row(y + 1));
        let n = width - 2;
        let (above, below) = (&above[1..=n], &below[1..=n]);
        let (left, here, right) = (&here[..n], &here[1..=n], &here[2..n + 2]);
        let out = &mut is_edge[1..=n];
        for k in 0..n {
            let low = here[k]
                .min(above[k])
                .min(below[k])
                .min(left[k])
                .min(right[k]);
            let high = here[k]
                .max(above[k])
                .max(below[k])
                .max(left[k])
                .max(right[k]);
            let least = (high >> RELATIVE_CONTRAST).max(SMALLEST_CONTRAST as u8);
            out[k] = u8::from(high - low >= least);
        }
    }

    /// Which neighbour an edge pixel is mixed with (its offset) and how much of it, of 256.
    fn blend(&self, x: i32, y: i32) -> (i32, i32, i32) {
        let m = self.at(x, y);
        let [n, s, e, w] = [
            self.at(x, y - 1),
            self.at(x, y + 1),
            self.at(x + 1, y),
            self.at(x - 1, y),
        ];
        let [nw, ne, sw, se] = [
            self.at(x - 1, y - 1),
            self.at(x + 1, y - 1),
            self.at(x - 1, y + 1),
            self.at(x + 1, y + 1),
        ];
        let level = (nw + sw - 2 * w).abs() + 2 * (n + s - 2 * m).abs() + (ne + se - 2 * e).abs();
        let upright = (nw + ne - 2 * n).abs() + 2 * (w + e - 2 * m).abs() + (sw + se - 2 * s).abs();
        let is_level = level >= upright;
        let (before, after) = if is_level { (n, s) } else { (w, e) };
        let towards_before = (before - m).abs() >= (after - m).abs();
        let step = if towards_before { -1 } else { 1 };
        let neighbour = if towards_before { before } else { after };
        let (across, along) = if is_level {
            ((0, step), (1, 0))
        } else {
            ((step, 0), (0, 1))
        };
        // Along the edge, where does the step between the two sides end?
        let gradient = (neighbour - m).abs();
        let middle = m + neighbour;
        let seek = |sign: i32| {
            let mut found = (REACH[REACH.len() - 1], 0);
            for distance in REACH {
                let (px, py) = (x + sign * distance * along.0, y + sign * distance * along.1);
                let end = self.at(px, py) + self.at(px + across.0, py + across.1) - middle;
                found = (distance, end);
                if 2 * end.abs() >= gradient {
                    break;
                }
            }
            found
        };
        let (back, back_end) = seek(-1);
        let (ahead, ahead_end) = seek(1);
        let (nearest, end) = if back < ahead {
            (back, back_end)
        } else {
            (ahead, ahead_end)
        };
        let is_on_the_short_side = (end < 0) != (2 * m < middle);
        let from_edge = if is_on_the_short_side {
            0.5 - nearest as f32 / (back + ahead) as f32
        } else {
            0.0
        };
        // Single pixels that stick out.
        let mean = (2 * (n + s + e + w) + nw + ne + sw + se) as f32 / 12.0;
        let low = m.min(n).min(s).min(e).min(w);
        let high = m.max(n).max(s).max(e).max(w);
        let rough = ((mean - m as f32).abs() / (high - low).max(1) as f32).min(1.0);
        let soft = rough * rough * (3.0 - 2.0 * rough);
        let share = from_edge.max(soft * soft * SUBPIXEL);
        (across.0, across.1, (share * 256.0) as i32)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn picture(size: (u32, u32), is_light: impl Fn(u32, u32) -> bool) -> Vec<u8> {
        let (width, height) = size;
        (0..width * height)
            .flat_map(|k| {
                let v = if is_light(k % width, k / width) {
                    220
                } else {
                    30
                };
                [v, v, v, 255]
            })
            .collect()
    }

    #[test]
    fn an_even_picture_stays_as_it_is() {
        let pixels = picture((16, 9), |_, _| true);
        assert_eq!(smooth(&pixels, 64, (16, 9)).into_raw(), pixels);
    }

    #[test]
    fn a_straight_upright_edge_stays_sharp() {
        let pixels = picture((16, 16), |x, _| x < 8);
        let smoothed = smooth(&pixels, 64, (16, 16)).into_raw();
        let largest = smoothed
            .iter()
            .zip(&pixels)
            .map(|(a, b)| a.abs_diff(*b))
            .max();
        assert!(largest < Some(12), "{largest:?}");
    }

    #[test]
    fn the_stairs_of_a_slanted_edge_become_steps_of_grey() {
        let size = (48, 24);
        let pixels = picture(size, |x, y| y * 4 > x + 8);
        let image = smooth(&pixels, 48 * 4, size);
        let n_greys = image.pixels().filter(|p| p[0] > 50 && p[0] < 200).count();
        assert!(n_greys > 20, "{n_greys}");
    }
}
