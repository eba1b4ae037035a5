//! One pair of axes and what is drawn between them.

use super::scale::Scale;
use super::style::{INK, NAME, QUIET, RULE, SMALL, Series};
use super::svg::{Anchor, Font, Pen, Svg};

/// The area between the axes.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Frame {
    /// Left edge.
    pub x: f64,
    /// Top edge.
    pub y: f64,
    /// Width.
    pub width: f64,
    /// Height.
    pub height: f64,
}

/// Words around a panel; empty ones are left out.
#[derive(Debug, Clone, Copy, Default)]
pub(crate) struct Labels<'a> {
    /// What the panel shows.
    pub title: &'a str,
    /// Below the horizontal axis.
    pub x: &'a str,
    /// Above the vertical axis, so that nobody has to turn their head.
    pub y: &'a str,
}

/// Axes with their scales.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Panel {
    /// Where it is.
    pub frame: Frame,
    /// Left to right.
    pub x: Scale,
    /// Bottom to top.
    pub y: Scale,
}

const TITLE: Font = Font {
    size: 14.0,
    color: INK,
    is_strong: true,
};

impl Panel {
    /// Where a point lies on the sheet.
    pub(crate) fn at(&self, (x, y): (f64, f64)) -> (f64, f64) {
        let Frame {
            x: left,
            y: top,
            width,
            height,
        } = self.frame;
        (
            left + self.x.place(x) * width,
            top + (1.0 - self.y.place(y)) * height,
        )
    }

    /// Title, names, a light grid and numbers at both axes. First of all, so that data lies on
    /// top of it.
    pub(crate) fn draw_axes(&self, svg: &mut Svg, labels: Labels) {
        self.draw_labels(svg, labels);
        self.draw_y_axis(svg);
        let bottom = self.frame.y + self.frame.height;
        let n_ticks = (self.frame.width / 62.0) as usize;
        for (value, label) in self.x.ticks(n_ticks) {
            let x = self.frame.x + self.x.place(value) * self.frame.width;
            svg.polyline(&[(x, bottom), (x, bottom + 4.0)], Pen::solid(QUIET, 1.0));
            svg.text((x, bottom + 17.0), &label, Anchor::Middle, SMALL);
        }
        self.draw_floor(svg);
    }

    /// The same with a name in place of each number at the horizontal axis.
    pub(crate) fn draw_axes_with_names(
        &self,
        svg: &mut Svg,
        labels: Labels,
        names: &[(f64, &str)],
    ) {
        self.draw_labels(svg, labels);
        self.draw_y_axis(svg);
        let bottom = self.frame.y + self.frame.height;
        for (value, name) in names {
            let x = self.frame.x + self.x.place(*value) * self.frame.width;
            svg.text((x, bottom + 17.0), name, Anchor::Middle, SMALL);
        }
        self.draw_floor(svg);
    }

    fn draw_labels(&self, svg: &mut Svg, labels: Labels) {
        let Frame {
            x,
            y,
            width,
            height,
        } = self.frame;
        let left = x - 8.0;
        svg.text((left, y - 28.0), labels.title, Anchor::Start, TITLE);
        svg.text((left, y - 11.0), labels.y, Anchor::Start, NAME);
        let middle = (x + width / 2.0, y + height + 35.0);
        svg.text(middle, labels.x, Anchor::Middle, NAME);
    }

    fn draw_y_axis(&self, svg: &mut Svg) {
        let Frame {
            x, width, height, ..
        } = self.frame;
        for (value, label) in self.y.ticks((height / 38.0) as usize) {
            let (_, y) = self.at((0.0, value));
            svg.polyline(&[(x, y), (x + width, y)], Pen::solid(RULE, 1.0));
            svg.text((x - 8.0, y + 4.0), &label, Anchor::End, SMALL);
        }
    }

    fn draw_floor(&self, svg: &mut Svg) {
        let Frame {
            x,
            y,
            width,
            height,
        } = self.frame;
        let floor = [(x, y + height), (x + width, y + height)];
        svg.polyline(&floor, Pen::solid(QUIET, 1.0));
    }

    /// A line through points.
    pub(crate) fn line(&self, svg: &mut Svg, points: &[(f64, f64)], pen: Pen) {
        let points: Vec<_> = points.iter().map(|&p| self.at(p)).collect();
        svg.polyline(&points, pen);
    }

    /// From the lower left to the upper right corner.
    pub(crate) fn draw_diagonal(&self, svg: &mut Svg, pen: Pen) {
        let Frame {
            x,
            y,
            width,
            height,
        } = self.frame;
        svg.polyline(&[(x, y + height), (x + width, y)], pen);
    }

    /// A bar from the floor up to a point, this wide on the horizontal axis.
    pub(crate) fn bar(&self, svg: &mut Svg, (x, y): (f64, f64), width: f64, color: &str) {
        let (left, top) = self.at((x - width / 2.0, y));
        let (right, floor) = self.at((x + width / 2.0, 0.0));
        svg.rect([left, top, right - left, floor - top], color, 0.28);
    }

    /// The n-th line of words in the upper left corner, inside.
    pub(crate) fn remark(&self, svg: &mut Svg, n: usize, text: &str) {
        let at = (self.frame.x + 8.0, self.frame.y + 28.0 + 15.0 * n as f64);
        svg.text(at, text, Anchor::Start, SMALL);
    }

    /// Words below a name at the horizontal axis.
    pub(crate) fn below(&self, svg: &mut Svg, x: f64, text: &str) {
        let (x, floor) = self.at((x, 0.0));
        svg.text((x, floor + 33.0), text, Anchor::Middle, SMALL);
    }

    /// The area between the second and the third number of each row, over the first.
    pub(crate) fn band(&self, svg: &mut Svg, rows: &[(f64, f64, f64)], color: &str) {
        if rows.len() < 2 {
            return;
        }
        let below = rows.iter().map(|&(x, lo, _)| self.at((x, lo)));
        let above = rows.iter().rev().map(|&(x, _, hi)| self.at((x, hi)));
        svg.polygon(&below.chain(above).collect::<Vec<_>>(), color, 0.16);
    }

    /// A series' line with a marker at every `every`-th point from `first` on.
    pub(crate) fn marked_line(
        &self,
        svg: &mut Svg,
        points: &[(f64, f64)],
        look: Series,
        (first, every): (usize, usize),
    ) {
        self.line(svg, points, look.pen(2.2));
        for &point in points.iter().skip(first).step_by(every.max(1)) {
            look.marker.draw(svg, self.at(point), 3.8, look.color);
        }
    }
}
