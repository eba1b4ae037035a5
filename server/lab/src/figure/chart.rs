//! A panel a task, a line a method and setting, every seed thin behind: what learning curves and
//! their kin are drawn and listed with.

use std::collections::BTreeMap;
use std::fmt::Write as _;

use domain::agreement::interquartile_mean;

use super::plot::{Entry, Labels, Panel, Scale, Sheet, series};
use super::seeds::{BAND, Curve, Line, draw_seeds, in_order_of_appearance};
use super::{FigureError, shown_method};
use crate::method::METHODS;

/// One number of one run at one time.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Point {
    /// The task's name.
    pub(super) task: String,
    /// The method's name.
    pub(super) method: String,
    /// What else differs between groups of runs; may be empty.
    pub(super) setting: String,
    /// Of the run.
    pub(super) seed: u64,
    /// Environment steps taken: what orders the points of a run, and tells them apart.
    pub(super) step: u64,
    /// Where it is drawn.
    pub(super) at: (f64, f64),
}

/// Points and how to show them.
pub(super) struct Chart {
    /// In the order of the rows.
    pub(super) points: Vec<Point>,
    /// Under the horizontal axis.
    pub(super) x: &'static str,
    /// Beside the vertical axis.
    pub(super) y: &'static str,
    /// Whether the vertical axis goes from 0 to 100.
    pub(super) is_rate: bool,
    /// How several seeds become one line.
    pub(super) center: fn(&[f64]) -> f64,
}

/// Method and setting: what shares a line.
type Group = (String, String);

impl Chart {
    /// As an SVG document.
    ///
    /// # Errors
    /// When a run has two values at one step.
    pub(super) fn draw(&self) -> Result<String, FigureError> {
        let tasks = self.tasks();
        let groups = self.groups();
        let key: Vec<Entry> = groups
            .iter()
            .enumerate()
            .map(|(n, group)| Entry {
                look: series(n),
                name: self.key_name(group),
                has_line: true,
            })
            .collect();
        let size = if tasks.len() == 1 {
            (440.0, 250.0)
        } else {
            (270.0, 180.0)
        };
        let sheet = Sheet::new(tasks.len(), 3, size, key).noted(BAND);
        let mut svg = sheet.start();
        for (n, task) in tasks.iter().enumerate() {
            let curves = groups
                .iter()
                .map(|group| Ok(self.curves(task, group)?.into_values().collect()))
                .collect::<Result<Vec<Vec<Curve>>, FigureError>>()?;
            let points = || curves.iter().flatten().flatten();
            let panel = Panel {
                frame: sheet.frame(n),
                x: Scale::exact(
                    0.0,
                    points().fold(0.0, |greatest: f64, p| greatest.max(p.0)),
                ),
                y: if self.is_rate {
                    Scale::exact(0.0, 100.0)
                } else {
                    Scale::around(points().map(|p| p.1).chain([0.0]), 5)
                },
            };
            let labels = Labels {
                title: task,
                x: self.x,
                y: self.y,
            };
            panel.draw_axes(&mut svg, labels);
            draw_seeds(&mut svg, &panel, &curves, self.center);
        }
        let title = format!("{} over {}, by method", self.y, self.x.to_lowercase());
        Ok(svg.finish(&title))
    }

    /// Every drawn point as a line of CSV: `task,method,setting,line,x,y` with a header; `line`
    /// is `seed N`, the centre (`mean` or `iqm`), or `lo` and `hi` of its interval.
    ///
    /// # Errors
    /// When a run has two values at one step.
    pub(super) fn csv(&self) -> Result<String, FigureError> {
        let mut text = "task,method,setting,line,x,y\n".to_owned();
        let is_iqm = std::ptr::fn_addr_eq(self.center, interquartile_mean as fn(&[f64]) -> f64);
        let center = if is_iqm { "iqm" } else { "mean" };
        for task in self.tasks() {
            for group in self.groups() {
                let (method, setting) = (&group.0, csv_cell(&group.1));
                let mut put = |line: &str, (x, y): (f64, f64)| {
                    writeln!(text, "{task},{method},{setting},{line},{x},{y}")
                        .expect("writing to a string cannot fail");
                };
                let curves = self.curves(&task, &group)?;
                for (seed, curve) in &curves {
                    for point in curve {
                        put(&format!("seed {seed}"), *point);
                    }
                }
                let curves: Vec<Curve> = curves.into_values().collect();
                let line = Line::of(&curves, self.center);
                for point in line.center {
                    put(center, point);
                }
                for (x, lo, hi) in line.band {
                    put("lo", (x, lo));
                    put("hi", (x, hi));
                }
            }
        }
        Ok(text)
    }

    fn tasks(&self) -> Vec<String> {
        in_order_of_appearance(self.points.iter().map(|p| p.task.clone()))
    }

    /// Methods in the registry's order, others after them; settings in order of appearance.
    fn groups(&self) -> Vec<Group> {
        let all = self
            .points
            .iter()
            .map(|p| (p.method.clone(), p.setting.clone()));
        let mut groups = in_order_of_appearance(all);
        let rank = |method: &str| METHODS.iter().position(|m| m.name == method);
        groups.sort_by_key(|(method, _)| rank(method).unwrap_or(METHODS.len()));
        groups
    }

    /// The curve of each seed of a group.
    fn curves(&self, task: &str, group: &Group) -> Result<BTreeMap<u64, Curve>, FigureError> {
        let mut seeds: BTreeMap<u64, BTreeMap<u64, (f64, f64)>> = BTreeMap::new();
        let of_task = self.points.iter().filter(|p| p.task == task);
        for point in of_task.filter(|p| is_in(p, group)) {
            let steps = seeds.entry(point.seed).or_default();
            if steps.insert(point.step, point.at).is_some() {
                let setting = match point.setting.as_str() {
                    "" => String::new(),
                    setting => format!(" ({setting})"),
                };
                return Err(FigureError::Misfit(format!(
                    "step {} of {} with {}{setting}, seed {}, is given twice",
                    point.step, point.task, point.method, point.seed
                )));
            }
        }
        let curve = |steps: BTreeMap<u64, (f64, f64)>| {
            let mut curve = Curve::new();
            for point in steps.into_values() {
                match curve.last_mut() {
                    // Once the budget is spent the number of labels stands still: the last one
                    // counts.
                    Some(last) if last.0 >= point.0 => last.1 = point.1,
                    _ => curve.push(point),
                }
            }
            curve
        };
        let seeds = seeds.into_iter();
        Ok(seeds.map(|(seed, steps)| (seed, curve(steps))).collect())
    }

    /// "STAIR, N = 500 (5 seeds)".
    fn key_name(&self, group: &Group) -> String {
        let mut seeds: BTreeMap<&str, Vec<u64>> = BTreeMap::new();
        for point in self.points.iter().filter(|p| is_in(p, group)) {
            let of_task = seeds.entry(&point.task).or_default();
            if !of_task.contains(&point.seed) {
                of_task.push(point.seed);
            }
        }
        let least = seeds.values().map(Vec::len).min().unwrap_or(0);
        let most = seeds.values().map(Vec::len).max().unwrap_or(0);
        let n_seeds = match (least, most) {
            (1, 1) => "1 seed".to_owned(),
            (least, most) if least == most => format!("{most} seeds"),
            (least, most) => format!("{least}–{most} seeds"),
        };
        let method = shown_method(&group.0);
        if group.1.is_empty() {
            format!("{method} ({n_seeds})")
        } else {
            format!("{method}, {} ({n_seeds})", group.1)
        }
    }
}

fn is_in(point: &Point, (method, setting): &Group) -> bool {
    point.method == *method && point.setting == *setting
}

/// A cell of CSV (RFC 4180).
pub(crate) fn csv_cell(text: &str) -> String {
    if text.contains([',', '"', '\n', '\r']) {
        format!("\"{}\"", text.replace('"', "\"\""))
    } else {
        text.to_owned()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_drawn_point_is_listed() {
        let point = |seed: u64, step: u64, y: f64| Point {
            task: "window-open".into(),
            method: "stair".into(),
            setting: "N = 40, mistaken".into(),
            seed,
            step,
            at: (step as f64, y),
        };
        let chart = Chart {
            points: vec![
                point(1, 0, 0.0),
                point(1, 10, 50.0),
                point(2, 0, 10.0),
                point(2, 10, 70.0),
            ],
            x: "Environment steps",
            y: "Success (%)",
            is_rate: true,
            center: interquartile_mean,
        };
        let csv = chart.csv().unwrap();
        let expected = "task,method,setting,line,x,y\n\
            window-open,stair,\"N = 40, mistaken\",seed 1,0,0\n\
            window-open,stair,\"N = 40, mistaken\",seed 1,10,50\n\
            window-open,stair,\"N = 40, mistaken\",seed 2,0,10\n\
            window-open,stair,\"N = 40, mistaken\",seed 2,10,70\n\
            window-open,stair,\"N = 40, mistaken\",iqm,0,5\n\
            window-open,stair,\"N = 40, mistaken\",iqm,10,60\n";
        assert_eq!(csv, expected);
    }
}
