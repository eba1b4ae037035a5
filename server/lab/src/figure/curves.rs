//! Learning curves: one panel a task, one line a method, every seed thin behind. Where several
//! methods are there in several settings each setting has a panel of its own; where there are more
//! lines than colours, each has one beside the first line.

use std::collections::{BTreeMap, BTreeSet};

use super::plot::N_COLORS;
use super::seeds::{
    Between, Curve, SeedSheet, add_line, drawn_lines, in_order_of_appearance, quoted,
};
use super::{
    Center, CurveRow, FigureEntry, FigureError, Request, choose, make_center, read_rows,
    shown_method,
};
use crate::experiment::grid::shown_setting;
use crate::method::METHODS;

pub(super) const ENTRY: FigureEntry = FigureEntry {
    name: "curves",
    summary: "learning curves by task and method, every seed thin behind their mean",
    input: "task, method, seed, setting, teacher, step, labels, success_rate, return_mean, wall_s; or the folders of runs",
    choices: &["x", "y", "center"],
    make,
};

type Column = fn(&CurveRow) -> f64;

/// Method and setting: what shares a line. No setting where panels tell it.
type Group = (String, Option<String>);

/// What a panel shows: a task, in one setting or in all.
#[derive(PartialEq)]
struct Shown {
    task: String,
    setting: Option<String>,
}

/// What the axes show.
#[derive(Clone, Copy)]
struct Axes {
    x: (&'static str, Column),
    y: (&'static str, Column),
    is_rate: bool,
}

/// What is drawn, before it is.
struct Plan {
    axes: Axes,
    center: Center,
    between: Between,
    rows: Vec<CurveRow>,
    panels: Vec<Shown>,
    groups: Vec<Group>,
}

impl Plan {
    fn of(request: &Request) -> Result<Self, FigureError> {
        let steps: (&str, Column) = ("Environment steps", |row| row.step as f64);
        let labels: (&str, Column) = ("Labels", |row| f64::from(row.labels));
        let success: (&str, Column) = ("Success (%)", |row| 100.0 * row.success_rate);
        let returns: (&str, Column) = ("Return", |row| row.return_mean);
        let axes = Axes {
            x: choose("x", request.x, &[("step", steps), ("labels", labels)])?,
            y: choose(
                "y",
                request.y,
                &[("success_rate", success), ("return_mean", returns)],
            )?,
            is_rate: request.y != Some("return_mean"),
        };
        let center = make_center(request.center)?;
        let mut rows: Vec<CurveRow> = read_rows(&ENTRY, request.sources)?;
        for row in &mut rows {
            row.setting = shown_setting(&row.setting, &row.teacher);
        }
        Ok(Self {
            axes,
            center,
            between: request.between,
            panels: panels(&rows),
            groups: groups(&rows),
            rows,
        })
    }

    /// The curves of each group in a panel, each with its seed.
    fn curves(&self, panel: &Shown) -> Result<Vec<Vec<(u64, Curve)>>, FigureError> {
        let rows: Vec<&CurveRow> = self.rows.iter().filter(|row| panel.shows(row)).collect();
        let of_group = |group| curves(&rows, group, self.axes);
        self.groups.iter().map(of_group).collect()
    }

    /// A panel, or, with more groups than colours, one for each group beside the first.
    fn apart(&self, title: &str, groups: Vec<Vec<Curve>>) -> Vec<(String, Vec<Vec<Curve>>)> {
        let there = (1..groups.len()).filter(|n| !groups[*n].is_empty());
        let there: Vec<usize> = there.collect();
        if there.len() < N_COLORS {
            return vec![(title.to_owned(), groups)];
        }
        let beside_first = |n: usize| {
            let alone = (0..groups.len()).map(|k| {
                let is_shown = k == 0 || k == n;
                if is_shown {
                    groups[k].clone()
                } else {
                    Vec::new()
                }
            });
            let (method, setting) = &self.groups[n];
            let name = match setting.as_deref().unwrap_or_default() {
                "" => shown_method(method),
                setting => format!("{}, {setting}", shown_method(method)),
            };
            (format!("{title}: {name}"), alone.collect())
        };
        there.into_iter().map(beside_first).collect()
    }

    /// Over a panel: its task, and the setting where the task has several.
    fn title(&self, panel: &Shown) -> String {
        let is_of_task = |other: &&Shown| other.task == panel.task;
        let n = self.panels.iter().filter(is_of_task).count();
        match panel
            .setting
            .as_deref()
            .filter(|setting| n > 1 && !setting.is_empty())
        {
            Some(setting) => format!("{}, {setting}", panel.task),
            None => panel.task.clone(),
        }
    }
}

impl Shown {
    fn shows(&self, row: &CurveRow) -> bool {
        let is_setting = |setting: &String| *setting == row.setting;
        row.task == self.task && self.setting.as_ref().is_none_or(is_setting)
    }
}

fn make(request: &Request) -> Result<String, FigureError> {
    let plan = Plan::of(request)?;
    let axes = plan.axes;
    let name = |group| key_name(group, &plan.rows);
    let sheet = SeedSheet {
        groups: plan.groups.iter().map(name).collect(),
        x: axes.x.0,
        y: axes.y.0,
        is_rate: axes.is_rate,
        center: plan.center,
        between: plan.between,
    };
    let panel = |shown: &Shown| {
        let alone = |(_, curve)| curve;
        let groups = plan.curves(shown)?.into_iter();
        let groups: Vec<Vec<Curve>> = groups
            .map(|seeds| seeds.into_iter().map(alone).collect())
            .collect();
        Ok(plan.apart(&plan.title(shown), groups))
    };
    let panels = plan.panels.iter().map(panel);
    let panels = panels.collect::<Result<Vec<_>, FigureError>>()?.concat();
    let title = format!("{} over {}, by method", axes.y.0, axes.x.0.to_lowercase());
    Ok(sheet.draw(&panels, &title))
}

/// Every point of the figure as CSV: those of each seed, of the centres, and of both ends of the
/// bands.
///
/// # Errors
/// As for drawing it.
pub fn points(request: &Request) -> Result<String, FigureError> {
    let plan = Plan::of(request)?;
    let mut csv = String::from("task,method,setting,line,x,y\n");
    for panel in &plan.panels {
        let task = &panel.task;
        for ((method, setting), seeds) in plan.groups.iter().zip(plan.curves(panel)?) {
            let setting = setting.as_ref().or(panel.setting.as_ref());
            let setting = quoted(setting.map_or("", String::as_str));
            let named = |line: String| format!("{task},{method},{setting},{line}");
            for (seed, curve) in &seeds {
                add_line(&mut csv, &named(format!("seed {seed}")), curve);
            }
            let curves: Vec<Curve> = seeds.into_iter().map(|(_, curve)| curve).collect();
            for (line, curve) in drawn_lines(&curves, plan.center, plan.between) {
                add_line(&mut csv, &named(line.to_owned()), &curve);
            }
        }
    }
    Ok(csv)
}

/// The curve of each seed of a group, in order of seed.
fn curves(rows: &[&CurveRow], group: &Group, axes: Axes) -> Result<Vec<(u64, Curve)>, FigureError> {
    let mut seeds: BTreeMap<u64, BTreeMap<u64, &CurveRow>> = BTreeMap::new();
    for row in rows.iter().filter(|row| is_in(row, group)) {
        if seeds
            .entry(row.seed)
            .or_default()
            .insert(row.step, row)
            .is_some()
        {
            let setting = match row.setting.as_str() {
                "" => String::new(),
                setting => format!(" ({setting})"),
            };
            return Err(FigureError::Misfit(format!(
                "step {} of {} with {}{setting}, seed {}, is given twice",
                row.step, row.task, row.method, row.seed
            )));
        }
    }
    let curve = |steps: BTreeMap<u64, &CurveRow>| {
        let mut curve = Curve::new();
        for row in steps.values() {
            let point = ((axes.x.1)(row), (axes.y.1)(row));
            match curve.last_mut() {
                // Once the budget is spent the number of labels stands still: the last one counts.
                Some(last) if last.0 >= point.0 => last.1 = point.1,
                _ => curve.push(point),
            }
        }
        curve
    };
    let curves = seeds.into_iter().map(|(seed, steps)| (seed, curve(steps)));
    Ok(curves.collect())
}

/// Each task, or each task in each setting where lines of several methods in several settings
/// would lie over each other.
fn panels(rows: &[CurveRow]) -> Vec<Shown> {
    let is_split = has_panels_of_settings(rows);
    let shown = rows.iter().map(|row| Shown {
        task: row.task.clone(),
        setting: is_split.then(|| row.setting.clone()),
    });
    in_order_of_appearance(shown)
}

/// Whether on any task two settings or more are there with two methods or more.
fn has_panels_of_settings(rows: &[CurveRow]) -> bool {
    let mut methods: BTreeMap<(&str, &str), BTreeSet<&str>> = BTreeMap::new();
    for row in rows {
        let of_setting = methods.entry((&row.task, &row.setting)).or_default();
        of_setting.insert(&row.method);
    }
    let with_several = |task: &str| {
        let of_task = methods.iter().filter(|((of, _), _)| *of == task);
        of_task.filter(|(_, methods)| methods.len() > 1).count()
    };
    methods.keys().any(|(task, _)| with_several(task) > 1)
}

/// Methods in the registry's order, others after them; settings in order of appearance.
fn groups(rows: &[CurveRow]) -> Vec<Group> {
    let is_split = has_panels_of_settings(rows);
    let all = rows.iter().map(|row| {
        let setting = (!is_split).then(|| row.setting.clone());
        (row.method.clone(), setting)
    });
    let mut groups = in_order_of_appearance(all);
    let rank = |method: &str| METHODS.iter().position(|m| m.name == method);
    groups.sort_by_key(|(method, _)| rank(method).unwrap_or(METHODS.len()));
    groups
}

fn is_in(row: &CurveRow, (method, setting): &Group) -> bool {
    row.method == *method
        && setting
            .as_ref()
            .is_none_or(|setting| *setting == row.setting)
}

/// "STAIR, N = 500 (5 seeds)".
fn key_name(group: &Group, rows: &[CurveRow]) -> String {
    let mut seeds: BTreeMap<(&str, &str), BTreeSet<u64>> = BTreeMap::new();
    for row in rows.iter().filter(|row| is_in(row, group)) {
        let of_curve = seeds.entry((&row.task, &row.setting)).or_default();
        of_curve.insert(row.seed);
    }
    let least = seeds.values().map(BTreeSet::len).min().unwrap_or(0);
    let most = seeds.values().map(BTreeSet::len).max().unwrap_or(0);
    let n_seeds = match (least, most) {
        (1, 1) => "1 seed".to_owned(),
        (least, most) if least == most => format!("{most} seeds"),
        (least, most) => format!("{least}–{most} seeds"),
    };
    let method = shown_method(&group.0);
    match group.1.as_deref().unwrap_or_default() {
        "" => format!("{method} ({n_seeds})"),
        setting => format!("{method}, {setting} ({n_seeds})"),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::figure::Source;

    fn row(method: &str, seed: u64, step: u64, success_rate: f64) -> String {
        format!(
            "{{\"task\":\"window-open\",\"method\":\"{method}\",\"seed\":{seed},\"setting\":\"\",\"step\":{step},\
             \"labels\":{},\"success_rate\":{success_rate},\"return_mean\":1.5,\"wall_s\":2.0}}\n",
            step / 10
        )
    }

    fn draw(text: String) -> Result<String, FigureError> {
        let sources = [Source {
            name: "rows.jsonl".into(),
            text,
        }];
        let request = Request {
            sources: &sources,
            ..Request::default()
        };
        crate::figure::make(&ENTRY, &request)
    }

    #[test]
    fn a_figure_has_a_line_for_every_seed_and_one_for_each_method() {
        let mut text = String::new();
        for (method, seed) in [("pebble", 1), ("stair", 1), ("stair", 2)] {
            text.extend((0..5).map(|k| row(method, seed, 1_000 * k, 0.2 * k as f64)));
        }
        let svg = draw(text.clone()).unwrap();
        assert_eq!(svg.matches("stroke-width=\"0.8\"").count(), 3);
        assert!(svg.contains("STAIR (2 seeds)") && svg.contains("PEBBLE (1 seed)"));
        assert!(
            svg.find("STAIR") < svg.find("PEBBLE"),
            "the registry's order"
        );
        assert_eq!(draw(text).unwrap(), svg, "the same bytes");
    }

    #[test]
    fn several_methods_in_several_settings_have_a_panel_for_each_setting() {
        let in_setting = |method: &str, setting: &str| {
            let rows = row(method, 1, 0, 0.0) + &row(method, 1, 1_000, 0.5);
            rows.replace("\"setting\":\"\"", &format!("\"setting\":\"{setting}\""))
        };
        let one = in_setting("stair", "40 answers")
            + &in_setting("stair", "80 answers")
            + &in_setting("pebble", "40 answers");
        let svg = draw(one.clone()).unwrap();
        assert!(svg.contains("STAIR, 80 answers (1 seed)") && svg.contains(">window-open<"));

        let both = one + &in_setting("pebble", "80 answers");
        let svg = draw(both.clone()).unwrap();
        assert!(svg.contains("STAIR (1 seed)") && !svg.contains("STAIR, "));
        for title in ["window-open, 40 answers", "window-open, 80 answers"] {
            assert!(svg.contains(title), "{title}");
        }
        let sources = [Source {
            name: "rows.jsonl".into(),
            text: both,
        }];
        let request = Request {
            sources: &sources,
            ..Request::default()
        };
        let csv = points(&request).unwrap();
        assert!(
            csv.contains("window-open,pebble,80 answers,seed 1,1000,50\n"),
            "{csv}"
        );
        assert_eq!(csv.matches("seed 1,0,0").count(), 4, "each point once");
    }

    #[test]
    fn more_methods_than_colours_have_a_panel_each_beside_the_first() {
        let methods = [
            "stair", "pebble", "uniform", "rune", "mrn", "rime", "qpa", "sac",
        ];
        let of = |methods: &[&str]| {
            let rows = methods
                .iter()
                .map(|m| row(m, 1, 0, 0.0) + &row(m, 1, 1_000, 0.5));
            draw(rows.collect()).unwrap()
        };
        let n_seeds = |svg: &str| svg.matches("stroke-width=\"0.8\"").count();
        let together = of(&methods[..7]);
        assert_eq!(n_seeds(&together), 7);
        assert!(!together.contains("window-open: "));
        let apart = of(&methods);
        assert_eq!(n_seeds(&apart), 2 * 7, "each beside STAIR");
        assert!(apart.contains("window-open: SAC") && !apart.contains("window-open: STAIR"));
    }

    #[test]
    fn every_plotted_point_can_be_had_as_a_number() {
        let text = row("stair", 1, 0, 0.0) + &row("stair", 2, 0, 0.5) + &row("stair", 3, 0, 1.0);
        let sources = [Source {
            name: "rows.jsonl".into(),
            text,
        }];
        let request = Request {
            sources: &sources,
            ..Request::default()
        };
        let csv = points(&request).unwrap();
        let lines: Vec<&str> = csv.lines().collect();
        assert_eq!(lines[1], "window-open,stair,,seed 1,0,0");
        assert_eq!(lines[3], "window-open,stair,,seed 3,0,100");
        assert_eq!(lines[4], "window-open,stair,,centre,0,50");
        assert!(
            lines[5].starts_with("window-open,stair,,lo,0,") && lines.len() == 7,
            "{csv}"
        );
    }

    #[test]
    fn bad_rows_are_named_with_their_file_and_line() {
        let told = draw(row("stair", 1, 0, 0.5) + "{\"task\":1}\n").unwrap_err();
        assert!(
            told.to_string().starts_with("rows.jsonl, line 2: "),
            "{told}"
        );
        let told = draw(row("stair", 1, 0, 0.5) + &row("stair", 1, 0, 0.6)).unwrap_err();
        assert!(told.to_string().contains("given twice"), "{told}");
        assert!(matches!(
            draw(String::new()),
            Err(FigureError::NoRows { .. })
        ));
    }

    #[test]
    fn one_evaluation_is_still_a_figure() {
        assert!(draw(row("stair", 1, 0, 0.5)).unwrap().contains("<circle"));
    }
}
