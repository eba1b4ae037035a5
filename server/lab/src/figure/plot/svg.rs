//! SVG elements as text, numbers cut to hundredths of a pixel.

use std::fmt::Write as _;

/// How a line is drawn.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Pen {
    /// `#rrggbb`.
    pub color: &'static str,
    /// Pixels.
    pub width: f64,
    /// Lengths of strokes and gaps as SVG has them; empty for an unbroken line.
    pub dash: &'static str,
    /// From 0 (nothing) to 1.
    pub opacity: f64,
}

impl Pen {
    /// An unbroken, opaque line.
    pub(crate) fn solid(color: &'static str, width: f64) -> Self {
        Self {
            color,
            width,
            dash: "",
            opacity: 1.0,
        }
    }
}

/// Which point of a text is placed.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) enum Anchor {
    /// Its left end.
    Start,
    /// Its middle.
    Middle,
    /// Its right end.
    End,
}

/// How a text is set; always in the reader's sans-serif family.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Font {
    /// Pixels.
    pub size: f64,
    /// `#rrggbb`.
    pub color: &'static str,
    /// Semibold instead of regular.
    pub is_strong: bool,
}

/// A picture being drawn; later elements lie on top.
#[derive(Debug, Clone)]
pub(crate) struct Svg {
    width: f64,
    height: f64,
    body: String,
}

impl Svg {
    /// An empty sheet of paper.
    pub(crate) fn new(width: f64, height: f64, paper: &str) -> Self {
        let mut svg = Self {
            width,
            height,
            body: String::new(),
        };
        svg.rect([0.0, 0.0, width, height], paper, 1.0);
        svg
    }

    /// The finished document. `title` is read out to those who do not see the picture.
    pub(crate) fn finish(self, title: &str) -> String {
        let (w, h) = (number(self.width), number(self.height));
        format!(
            "<svg xmlns=\"http://www.w3.org/2000/svg\" width=\"{w}\" height=\"{h}\" viewBox=\"0 0 {w} {h}\" \
             role=\"img\" font-family=\"sans-serif\">\n<title>{}</title>\n{}</svg>\n",
            escape(title),
            self.body
        )
    }

    /// A line through points.
    pub(crate) fn polyline(&mut self, points: &[(f64, f64)], pen: Pen) {
        if points.len() < 2 {
            return;
        }
        let points = pairs(points);
        self.put(&format!(
            "<polyline points=\"{points}\" fill=\"none\"{}/>",
            stroke(pen)
        ));
    }

    /// A filled area.
    pub(crate) fn polygon(&mut self, points: &[(f64, f64)], color: &str, opacity: f64) {
        let points = pairs(points);
        self.put(&format!(
            "<polygon points=\"{points}\" fill=\"{color}\"{}/>",
            fill_opacity(opacity)
        ));
    }

    /// A filled area with an outline.
    pub(crate) fn outlined(&mut self, points: &[(f64, f64)], color: &str, pen: Pen) {
        let points = pairs(points);
        self.put(&format!(
            "<polygon points=\"{points}\" fill=\"{color}\"{}/>",
            stroke(pen)
        ));
    }

    /// A filled rectangle: left, top, width, height.
    pub(crate) fn rect(&mut self, [x, y, w, h]: [f64; 4], color: &str, opacity: f64) {
        self.put(&format!(
            "<rect x=\"{}\" y=\"{}\" width=\"{}\" height=\"{}\" fill=\"{color}\"{}/>",
            number(x),
            number(y),
            number(w),
            number(h),
            fill_opacity(opacity)
        ));
    }

    /// A rectangle that joins its neighbours without a seam.
    pub(crate) fn cell(&mut self, [x, y, w, h]: [f64; 4], color: &str) {
        self.put(&format!(
            "<rect x=\"{}\" y=\"{}\" width=\"{}\" height=\"{}\" fill=\"{color}\" shape-rendering=\"crispEdges\"/>",
            number(x),
            number(y),
            number(w),
            number(h)
        ));
    }

    /// Rectangles of one colour, as one element; they join without a seam.
    pub(crate) fn cells(&mut self, cells: &[[f64; 4]], color: &str) {
        let mut path = String::new();
        for [x, y, w, h] in cells {
            let (x, y, w, h) = (number(*x), number(*y), number(*w), number(*h));
            write!(path, "M{x} {y}h{w}v{h}h-{w}z").expect("writing to a string cannot fail");
        }
        self.put(&format!(
            "<path d=\"{path}\" fill=\"{color}\" shape-rendering=\"crispEdges\"/>"
        ));
    }

    /// A picture: a PNG file in base64, and nothing else.
    pub(crate) fn image(&mut self, [x, y, w, h]: [f64; 4], png: &str) {
        self.put(&format!(
            "<image x=\"{}\" y=\"{}\" width=\"{}\" height=\"{}\" href=\"data:image/png;base64,{png}\"/>",
            number(x),
            number(y),
            number(w),
            number(h)
        ));
    }

    /// A filled disc with an outline.
    pub(crate) fn disc(&mut self, (x, y): (f64, f64), radius: f64, color: &str, pen: Pen) {
        self.put(&format!(
            "<circle cx=\"{}\" cy=\"{}\" r=\"{}\" fill=\"{color}\"{}/>",
            number(x),
            number(y),
            number(radius),
            stroke(pen)
        ));
    }

    /// A text on its baseline.
    pub(crate) fn text(&mut self, (x, y): (f64, f64), text: &str, anchor: Anchor, font: Font) {
        let anchor = match anchor {
            Anchor::Start => "",
            Anchor::Middle => " text-anchor=\"middle\"",
            Anchor::End => " text-anchor=\"end\"",
        };
        let weight = if font.is_strong {
            " font-weight=\"600\""
        } else {
            ""
        };
        self.put(&format!(
            "<text x=\"{}\" y=\"{}\" font-size=\"{}\" fill=\"{}\"{weight}{anchor}>{}</text>",
            number(x),
            number(y),
            number(font.size),
            font.color,
            escape(text)
        ));
    }

    fn put(&mut self, element: &str) {
        self.body.push_str(element);
        self.body.push('\n');
    }
}

fn pairs(points: &[(f64, f64)]) -> String {
    let mut text = String::new();
    for (i, &(x, y)) in points.iter().enumerate() {
        let gap = if i == 0 { "" } else { " " };
        write!(text, "{gap}{},{}", number(x), number(y)).expect("writing to a string cannot fail");
    }
    text
}

fn stroke(pen: Pen) -> String {
    let mut text = format!(
        " stroke=\"{}\" stroke-width=\"{}\" stroke-linejoin=\"round\"",
        pen.color,
        number(pen.width)
    );
    if !pen.dash.is_empty() {
        text.extend([" stroke-dasharray=\"", pen.dash, "\""]);
    }
    if pen.opacity < 1.0 {
        text.extend([" stroke-opacity=\"", &number(pen.opacity), "\""]);
    }
    text
}

fn fill_opacity(opacity: f64) -> String {
    if opacity < 1.0 {
        format!(" fill-opacity=\"{}\"", number(opacity))
    } else {
        String::new()
    }
}

/// At most two decimals, no trailing zeros, no negative zero.
fn number(value: f64) -> String {
    let text = format!("{value:.2}");
    let text = text.trim_end_matches('0').trim_end_matches('.');
    if text == "-0" {
        "0".into()
    } else {
        text.into()
    }
}

fn escape(text: &str) -> String {
    text.replace('&', "&amp;")
        .replace('<', "&lt;")
        .replace('>', "&gt;")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_are_short_and_have_one_spelling() {
        let spelled = [1.0, -0.001, 2.504, 100.0, -3.25].map(number);
        assert_eq!(spelled, ["1", "0", "2.5", "100", "-3.25"]);
    }

    #[test]
    fn texts_cannot_break_out_of_their_element() {
        let mut svg = Svg::new(10.0, 10.0, "#fff");
        let font = Font {
            size: 10.0,
            color: "#000",
            is_strong: false,
        };
        svg.text((0.0, 0.0), "<script> & co", Anchor::Start, font);
        let text = svg.finish("a < b");
        assert!(text.contains("&lt;script&gt; &amp; co") && text.contains("a &lt; b"));
    }
}
