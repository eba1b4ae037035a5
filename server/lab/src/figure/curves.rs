//! Learning curves: one panel a task, one line a method, every seed thin behind. Where several
//! methods are there in several settings each setting has a panel of its own; where there are more
//! lines than colours, each has one beside the first line.

use std::collections::{BTreeMap, BTreeSet};

use super::seeds::{
    Between, Bundle, Curve, SeedSheet, Shown, add_line, apart, drawn_lines, in_order_of_appearance,
    is_by_setting, line_name, quoted, seeds_in_words,
};
use super::{Center, CurveRow, FigureEntry, FigureError, Request, choose, make_center, read_rows};
use crate::experiment::grid::shown_setting;
use crate::method::rank;

pub(super) const ENTRY: FigureEntry = FigureEntry {
    name: "curves",
    summary: "learning curves by task and method, every seed thin behind their mean",
    input: "task, method, seed, setting, teacher, step, labels, budget, success_rate, return_mean, wall_s; or the folders of runs or experiments",
    choices: &["x", "y", "center"],
    make,
};

type Column = fn(&CurveRow) -> f64;

/// Method and setting: what shares a line. No setting where panels tell it.
type Group = (String, Option<String>);

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
    center_name: &'static str,
    between: Between,
    rows: Vec<CurveRow>,
    panels: Vec<Shown>,
    groups: Vec<Group>,
}

impl Plan {
    fn of(request: &Request) -> Result<Self, FigureError> {
        let steps: (&str, Column) = ("Environment steps", |row| row.step as f64);
        let labels: (&str, Column) = ("Labels", |row| f64::from(row.labels));
        let budget: (&str, Column) = ("Budget (labels)", |row| {
            row.budget.map_or(f64::NAN, f64::from) // every row has one, or there is no figure
        });
        let success: (&str, Column) = ("Success (%)", |row| 100.0 * row.success_rate);
        let returns: (&str, Column) = ("Return", |row| row.return_mean);
        let axes = Axes {
            x: choose(
                "x",
                request.x,
                &[("step", steps), ("labels", labels), ("budget", budget)],
            )?,
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
        let without = rows.iter().find(|row| row.budget.is_none());
        if let Some(row) = without.filter(|_| request.x == Some("budget")) {
            return Err(FigureError::Misfit(format!(
                "step {} of {} with {}, seed {}, tells no budget",
                row.step, row.task, row.method, row.seed
            )));
        }
        Ok(Self {
            axes,
            center,
            center_name: match request.center {
                Some("iqm") => "interquartile mean",
                _ => "mean",
            },
            between: request.between,
            panels: panels(&rows),
            groups: groups(&rows),
            rows,
        })
    }

    /// The curves of each group in a panel, each with its seed.
    fn curves(&self, panel: &Shown) -> Result<Vec<Vec<(u64, Curve)>>, FigureError> {
        let rows = self.rows.iter();
        let rows: Vec<&CurveRow> = rows.filter(|row| is_shown(row, panel)).collect();
        let of_group = |group| curves(&rows, group, self.axes);
        self.groups.iter().map(of_group).collect()
    }

    /// Each line by itself.
    fn bundles(&self) -> Vec<Bundle> {
        let bundle = |(n, (method, setting)): (usize, &Group)| Bundle {
            name: line_name(method, setting.as_deref().unwrap_or_default()),
            lines: vec![n],
        };
        self.groups.iter().enumerate().map(bundle).collect()
    }
}

fn is_shown(row: &CurveRow, panel: &Shown) -> bool {
    let is_setting = |setting: &String| *setting == row.setting;
    row.task == panel.task && panel.setting.as_ref().is_none_or(is_setting)
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
        center_name: plan.center_name,
        between: plan.between,
    };
    let bundles = plan.bundles();
    let panel = |shown: &Shown| {
        let alone = |(_, curve)| curve;
        let groups = plan.curves(shown)?.into_iter();
        let groups: Vec<Vec<Curve>> = groups
            .map(|seeds| seeds.into_iter().map(alone).collect())
            .collect();
        Ok(apart(&shown.title(&plan.panels), groups, &bundles))
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

/// Each task, or each task in each setting.
fn panels(rows: &[CurveRow]) -> Vec<Shown> {
    let is_split = is_split(rows);
    let shown = rows.iter().map(|row| Shown {
        task: row.task.clone(),
        setting: is_split.then(|| row.setting.clone()),
    });
    in_order_of_appearance(shown)
}

/// Whether each setting has panels of its own.
fn is_split(rows: &[CurveRow]) -> bool {
    is_by_setting(rows.iter().map(|row| {
        let (task, method) = (row.task.as_str(), row.method.as_str());
        (task, method, row.setting.as_str())
    }))
}

/// Methods in the registry's order, others after them; settings in order of appearance.
fn groups(rows: &[CurveRow]) -> Vec<Group> {
    let is_split = is_split(rows);
    let all = rows.iter().map(|row| {
        let setting = (!is_split).then(|| row.setting.clone());
        (row.method.clone(), setting)
    });
    let mut groups = in_order_of_appearance(all);
    groups.sort_by_key(|(method, _)| rank(method));
    groups
}

fn is_in(row: &CurveRow, (method, setting): &Group) -> bool {
    row.method == *method
        && setting
            .as_ref()
            .is_none_or(|setting| *setting == row.setting)
}

/// "STAIR, N = 500 (5 seeds)". Runs of several budgets are counted budget by budget.
fn key_name(group: &Group, rows: &[CurveRow]) -> String {
    let mut seeds: BTreeMap<(&str, &str, Option<u32>), BTreeSet<u64>> = BTreeMap::new();
    for row in rows.iter().filter(|row| is_in(row, group)) {
        let of_curve = seeds.entry((&row.task, &row.setting, row.budget));
        of_curve.or_default().insert(row.seed);
    }
    let name = line_name(&group.0, group.1.as_deref().unwrap_or_default());
    let n_seeds = seeds_in_words(seeds.values().map(BTreeSet::len));
    format!("{name} ({n_seeds})")
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
    fn the_note_tells_what_the_thick_line_is() {
        let sources = [Source {
            name: "rows.jsonl".into(),
            text: row("stair", 1, 0, 0.5),
        }];
        for (center, told) in [
            (None, "Thick: mean."),
            (Some("mean"), "Thick: mean."),
            (Some("iqm"), "Thick: interquartile mean."),
        ] {
            let request = Request {
                sources: &sources,
                center,
                ..Request::default()
            };
            let svg = crate::figure::make(&ENTRY, &request).unwrap();
            assert!(svg.contains(told), "{told} is not in: {svg}");
        }
    }

    #[test]
    fn a_budget_is_not_what_was_answered_so_far() {
        let draw = |text: String| {
            let sources = [Source {
                name: "rows.jsonl".into(),
                text,
            }];
            let request = Request {
                sources: &sources,
                x: Some("budget"),
                ..Request::default()
            };
            make(&request)
        };
        let told = draw(row("stair", 1, 0, 0.5)).unwrap_err().to_string();
        assert!(told.contains("tells no budget"), "{told}");
        let with = row("stair", 1, 0, 0.5).replace("\"labels\"", "\"budget\":80,\"labels\"");
        assert!(draw(with).unwrap().contains("Budget (labels)"));
    }

    #[test]
    fn one_evaluation_is_still_a_figure() {
        assert!(draw(row("stair", 1, 0, 0.5)).unwrap().contains("<circle"));
    }
}
