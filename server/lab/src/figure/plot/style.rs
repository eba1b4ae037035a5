//! Colours, dashes and markers.

use super::svg::{Font, Pen, Svg};

/// Text.
pub(crate) const INK: &str = "#1f2328";
/// Text that may stand back.
pub(crate) const QUIET: &str = "#59636e";
/// Lines of the grid.
pub(crate) const RULE: &str = "#e4e7eb";
/// What everything lies on.
pub(crate) const PAPER: &str = "#ffffff";

/// Names of axes and rows.
pub(crate) const NAME: Font = Font {
    size: 12.0,
    color: QUIET,
    is_strong: false,
};
/// Numbers along axes, remarks and notes.
pub(crate) const SMALL: Font = Font {
    size: 11.5,
    color: QUIET,
    is_strong: false,
};

/// The shape that marks a series' points.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Marker {
    /// ●
    Disc,
    /// ■
    Square,
    /// ▲
    Up,
    /// ◆
    Diamond,
    /// ▼
    Down,
    /// ⬟
    Pentagon,
    /// ⬢
    Hexagon,
}

impl Marker {
    /// Draws it around a point, outlined by the paper so that it stands off its line.
    pub(crate) fn draw(self, svg: &mut Svg, at: (f64, f64), radius: f64, color: &'static str) {
        let outline = Pen::solid(PAPER, 1.2);
        match self.corners() {
            None => svg.disc(at, radius, color, outline),
            Some((n, turn)) => {
                let corner = |k: usize| {
                    let angle = std::f64::consts::TAU * (k as f64 / n as f64 + turn);
                    let reach = 1.25 * radius;
                    (at.0 + reach * angle.sin(), at.1 - reach * angle.cos())
                };
                let corners: Vec<_> = (0..n).map(corner).collect();
                svg.outlined(&corners, color, outline);
            }
        }
    }

    /// Corners of the polygon, and by which part of a turn the first one is off the top.
    fn corners(self) -> Option<(usize, f64)> {
        match self {
            Self::Disc => None,
            Self::Square => Some((4, 0.125)),
            Self::Up => Some((3, 0.0)),
            Self::Diamond => Some((4, 0.0)),
            Self::Down => Some((3, 0.5)),
            Self::Pentagon => Some((5, 0.0)),
            Self::Hexagon => Some((6, 0.0)),
        }
    }
}

/// How one series looks everywhere in a figure.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Series {
    /// `#rrggbb`.
    pub color: &'static str,
    /// Strokes and gaps.
    pub dash: &'static str,
    /// Those of its single seeds: unbroken while colours tell the series apart.
    pub thin_dash: &'static str,
    /// Of its points.
    pub marker: Marker,
}

impl Series {
    /// Its pen for a line of this width.
    pub(crate) fn pen(self, width: f64) -> Pen {
        Pen {
            color: self.color,
            width,
            dash: self.dash,
            opacity: 1.0,
        }
    }
}

/// Series that are told apart by their colour.
pub(crate) const N_COLORS: usize = 7;

/// The look of the n-th series: colours of Okabe and Ito (2008), without the yellow, which is
/// too pale on paper. After seven they start over with other dashes and markers, from the second
/// on: what is beside the first series in a panel of two has another colour than it.
pub(crate) fn series(n: usize) -> Series {
    const LOOKS: [(&str, &str, Marker); N_COLORS] = [
        ("#0072b2", "", Marker::Disc),
        ("#d55e00", "7 3", Marker::Square),
        ("#009e73", "2.5 2.5", Marker::Up),
        ("#cc79a7", "9 3 2.5 3", Marker::Diamond),
        ("#e69f00", "5 2", Marker::Down),
        ("#56b4e9", "12 4", Marker::Pentagon),
        ("#000000", "1.5 3", Marker::Hexagon),
    ];
    let round = n / LOOKS.len();
    let look = |ahead: usize| LOOKS[(n + ahead) % LOOKS.len()];
    Series {
        color: look(round).0,
        dash: look(2 * round).1,
        thin_dash: if round == 0 { "" } else { "3 2" },
        marker: look(3 * round).2,
    }
}

/// From paper through blue to almost black: the luminance falls all the way.
pub(crate) fn shade(share: f64) -> String {
    const STOPS: [[f64; 3]; 3] = [
        [255.0, 255.0, 255.0],
        [86.0, 160.0, 214.0],
        [8.0, 40.0, 84.0],
    ];
    let place = 2.0 * share.clamp(0.0, 1.0);
    let from = (place as usize).min(1);
    let part = place - from as f64;
    let mixed = [0, 1, 2].map(|k| {
        let (a, b) = (STOPS[from][k], STOPS[from + 1][k]);
        (a + part * (b - a)).round() as u8
    });
    format!("#{:02x}{:02x}{:02x}", mixed[0], mixed[1], mixed[2])
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_first_fourteen_series_can_be_told_apart_without_colour() {
        for n in 0..14 {
            for m in 0..n {
                let (a, b) = (series(n), series(m));
                assert!(a.dash != b.dash || a.marker != b.marker, "{m} and {n}");
            }
        }
    }

    #[test]
    fn seeds_of_two_series_of_one_colour_can_be_told_apart() {
        for n in 0..2 * N_COLORS {
            let alike = (0..n).map(series).filter(|m| m.color == series(n).color);
            let alike: Vec<Series> = alike.collect();
            assert_eq!(alike.len(), n / N_COLORS, "{n}");
            assert!(alike.iter().all(|m| m.thin_dash != series(n).thin_dash));
        }
        let first = series(0).color;
        assert!((1..2 * N_COLORS - 1).all(|n| series(n).color != first));
    }

    #[test]
    fn shades_darken_all_the_way() {
        let luminance = |share: f64| {
            let text = shade(share);
            let part = |k| f64::from(u8::from_str_radix(&text[k..k + 2], 16).unwrap());
            0.2126 * part(1) + 0.7152 * part(3) + 0.0722 * part(5)
        };
        let ramp: Vec<f64> = (0..=32).map(|k| luminance(f64::from(k) / 32.0)).collect();
        assert!(ramp.is_sorted_by(|a, b| a > b), "{ramp:?}");
    }
}
