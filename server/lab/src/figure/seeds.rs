//! Several seeds of several groups as lines: every seed thin, their centre on top.

use domain::agreement::Bootstrap;

use super::plot::{Entry, Labels, Panel, Pen, Scale, Sheet, Svg, series};

mod panels;

pub(super) use panels::{Bundle, Shown, apart, is_by_setting, line_name, seeds_in_words};

/// Points from left to right.
pub(super) type Curve = Vec<(f64, f64)>;

/// What the lines and areas of [`draw_seeds`] are, with the centre's name.
pub(super) fn note(center: &str) -> String {
    format!(
        "Thick: {center}. Thin: each seed. Band: 95 % bootstrap interval over seeds, from three seeds on."
    )
}

/// Fewer seeds have no interval worth telling.
pub(crate) const LEAST_FOR_INTERVAL: usize = 3;

/// What stands between two places at which a seed was measured.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Between {
    /// A straight line: what is measured goes on in between.
    #[default]
    Line,
    /// Nothing: a seed counts where it was measured and nowhere else.
    Nothing,
}

/// Panels of seeds side by side, with one key for all.
pub(super) struct SeedSheet<'a> {
    /// What each group is; the n-th looks like the n-th series.
    pub(super) groups: Vec<String>,
    /// Under each panel.
    pub(super) x: &'a str,
    /// Beside each panel.
    pub(super) y: &'a str,
    /// Whether the vertical axes go from 0 to 100 rather than as far as the points do.
    pub(super) is_rate: bool,
    /// How several seeds become one line.
    pub(super) center: fn(&[f64]) -> f64,
    /// What that is called.
    pub(super) center_name: &'a str,
    /// What a seed counts for between two of its points.
    pub(super) between: Between,
}

impl SeedSheet<'_> {
    /// Draws a panel for each title, with the curves of each group.
    pub(super) fn draw(self, panels: &[(String, Vec<Vec<Curve>>)], title: &str) -> String {
        let entry = |(n, name)| Entry {
            look: series(n),
            name,
            has_line: true,
        };
        let key = self.groups.into_iter().enumerate().map(entry).collect();
        let size = if panels.len() == 1 {
            (440.0, 250.0)
        } else {
            (270.0, 180.0)
        };
        let sheet = Sheet::new(panels.len(), 3, size, key).noted(&note(self.center_name));
        let mut svg = sheet.start();
        for (n, (title, curves)) in panels.iter().enumerate() {
            let points = || curves.iter().flatten().flatten();
            let furthest = points().fold(0.0, |greatest: f64, p| greatest.max(p.0));
            let panel = Panel {
                frame: sheet.frame(n),
                x: Scale::exact(0.0, furthest),
                y: if self.is_rate {
                    Scale::exact(0.0, 100.0)
                } else {
                    Scale::around(points().map(|p| p.1).chain([0.0]), 5)
                },
            };
            let labels = Labels {
                title,
                x: self.x,
                y: self.y,
            };
            panel.draw_axes(&mut svg, labels);
            draw_seeds(&mut svg, &panel, curves, self.center, self.between);
        }
        svg.finish(title)
    }
}

/// Draws the seeds of each group, below all centres; the n-th group looks like the n-th series.
pub(super) fn draw_seeds(
    svg: &mut Svg,
    panel: &Panel,
    groups: &[Vec<Curve>],
    center: fn(&[f64]) -> f64,
    between: Between,
) {
    let line = |seeds: &Vec<Curve>| Line::of(seeds, center, between);
    let lines: Vec<Line> = groups.iter().map(line).collect();
    for (n, line) in lines.iter().enumerate() {
        panel.band(svg, &line.band, series(n).color);
    }
    for (n, seeds) in groups.iter().enumerate() {
        let look = series(n);
        let thin = Pen {
            opacity: 0.3,
            dash: look.thin_dash,
            ..Pen::solid(look.color, 0.8)
        };
        for seed in seeds {
            panel.line(svg, seed, thin);
        }
    }
    for (n, line) in lines.iter().enumerate() {
        let every = line.center.len().div_ceil(7).max(1);
        panel.marked_line(svg, &line.center, series(n), (n % every, every));
    }
}

/// The centre of a group's seeds with its interval.
struct Line {
    center: Curve,
    band: Vec<(f64, f64, f64)>,
}

impl Line {
    /// Where all seeds have been evaluated, or, with nothing between evaluations, where any has.
    fn of(seeds: &[Curve], center: fn(&[f64]) -> f64, between: Between) -> Self {
        let mut line = Self {
            center: Vec::new(),
            band: Vec::new(),
        };
        let at = |seed: &Curve, x: f64| match between {
            Between::Line => Some(interpolate(seed, x)),
            Between::Nothing => seed.iter().find(|p| p.0.total_cmp(&x).is_eq()).map(|p| p.1),
        };
        let mut grid = places(seeds);
        if between == Between::Line {
            let (from, to) = common_range(seeds);
            grid.retain(|x| (from..=to).contains(x));
        }
        for x in grid {
            let values: Vec<f64> = seeds.iter().filter_map(|seed| at(seed, x)).collect();
            line.center.push((x, center(&values)));
            if values.len() >= LEAST_FOR_INTERVAL {
                let found = Bootstrap::default().center(&values, center);
                line.band
                    .extend(found.map(|e| (x, e.interval.lo, e.interval.hi)));
            }
        }
        line
    }
}

/// Every place at which some seed was evaluated.
fn places(seeds: &[Curve]) -> Vec<f64> {
    let mut places: Vec<f64> = seeds.iter().flatten().map(|p| p.0).collect();
    places.sort_by(f64::total_cmp);
    places.dedup();
    places
}

/// From the last of the seeds' beginnings to the first of their ends.
fn common_range(seeds: &[Curve]) -> (f64, f64) {
    let from = seeds.iter().filter_map(|s| s.first()).map(|p| p.0);
    let to = seeds.iter().filter_map(|s| s.last()).map(|p| p.0);
    (from.fold(f64::MIN, f64::max), to.fold(f64::MAX, f64::min))
}

/// The value of a curve at a place within its range.
fn interpolate(curve: &[(f64, f64)], x: f64) -> f64 {
    let right = curve.partition_point(|p| p.0 < x).min(curve.len() - 1);
    let (x1, y1) = curve[right];
    let (x0, y0) = curve[right.saturating_sub(1)];
    if x1 > x0 {
        y0 + (y1 - y0) * (x - x0) / (x1 - x0)
    } else {
        y1
    }
}

/// What is drawn of a group beside its seeds: the centre, and both ends of the band.
pub(super) fn drawn_lines(
    seeds: &[Curve],
    center: fn(&[f64]) -> f64,
    between: Between,
) -> [(&'static str, Curve); 3] {
    let line = Line::of(seeds, center, between);
    let lo = line.band.iter().map(|&(x, lo, _)| (x, lo)).collect();
    let hi = line.band.iter().map(|&(x, _, hi)| (x, hi)).collect();
    [("centre", line.center), ("lo", lo), ("hi", hi)]
}

/// The points of a line as rows of CSV behind what the line is.
pub(super) fn add_line(csv: &mut String, line: &str, points: &[(f64, f64)]) {
    for (x, y) in points {
        let row = format!("{line},{x},{y}\n");
        csv.push_str(&row);
    }
}

/// A text as a field of CSV (RFC 4180).
pub(super) fn quoted(text: &str) -> String {
    if text.contains([',', '"', '\n']) {
        format!("\"{}\"", text.replace('"', "\"\""))
    } else {
        text.to_owned()
    }
}

/// Each value once.
pub(super) fn in_order_of_appearance<T: PartialEq>(values: impl IntoIterator<Item = T>) -> Vec<T> {
    let mut seen = Vec::new();
    for value in values {
        if !seen.contains(&value) {
            seen.push(value);
        }
    }
    seen
}

#[cfg(test)]
mod tests {
    use super::*;
    use domain::agreement::mean;

    #[test]
    fn the_centre_is_taken_where_all_seeds_have_been_evaluated() {
        let seeds = [
            vec![(0.0, 0.0), (10.0, 1.0), (20.0, 1.0)],
            vec![(5.0, 1.0), (15.0, 0.0)],
        ];
        let line = Line::of(&seeds, mean, Between::Line);
        assert_eq!(line.center, [(5.0, 0.75), (10.0, 0.75), (15.0, 0.5)]);
        assert!(
            line.band.is_empty(),
            "two seeds have no interval worth showing"
        );
    }

    #[test]
    fn the_band_holds_the_centre_and_lies_within_the_seeds() {
        let seeds: Vec<Curve> = (0..5)
            .map(|k| vec![(0.0, f64::from(k)), (1.0, 2.0)])
            .collect();
        let line = Line::of(&seeds, mean, Between::Line);
        let (_, lo, hi) = line.band[0];
        assert!((0.0..2.0).contains(&lo) && hi > 2.0 && hi <= 4.0);
        assert_eq!(line.band[1], (1.0, 2.0, 2.0));
    }

    #[test]
    fn seeds_that_share_no_range_have_no_centre() {
        let seeds = [vec![(0.0, 1.0)], vec![(5.0, 1.0), (6.0, 1.0)], vec![]];
        let line = Line::of(&seeds[..2], mean, Between::Line);
        assert!(line.center.is_empty());
    }

    #[test]
    fn with_nothing_in_between_a_seed_counts_where_it_was_measured_alone() {
        let some = vec![(40.0, 0.2), (80.0, 1.0), (160.0, 0.4)];
        let others = vec![(40.0, 0.4), (160.0, 0.6)];
        let seeds = [some, others.clone(), others];
        let line = Line::of(&seeds, mean, Between::Nothing);
        let places: Vec<f64> = line.center.iter().map(|p| p.0).collect();
        assert_eq!(places, [40.0, 80.0, 160.0]);
        assert_eq!(line.center[1], (80.0, 1.0), "of the one seed there");
        let banded: Vec<f64> = line.band.iter().map(|p| p.0).collect();
        assert_eq!(banded, [40.0, 160.0], "one seed has no interval");
    }
}
