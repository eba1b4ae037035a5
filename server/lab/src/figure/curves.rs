//! Learning curves: one panel a task, one line a method, every seed thin behind.

use std::collections::BTreeMap;

use super::plot::{Entry, Labels, Panel, Scale, Sheet, series};
use super::seeds::{BAND, Curve, draw_seeds, in_order_of_appearance};
use super::{
    CurveRow, FigureEntry, FigureError, Request, choose, make_center, read_rows, shown_method,
};
use crate::method::METHODS;

pub(super) const ENTRY: FigureEntry = FigureEntry {
    name: "curves",
    summary: "learning curves by task and method, every seed thin behind their mean",
    input: "task, method, seed, setting, step, labels, success_rate, return_mean, wall_s; or the folders of runs",
    choices: &["x", "y", "center"],
    make,
};

type Column = fn(&CurveRow) -> f64;

/// Method and setting: what shares a line.
type Group = (String, String);

/// What the axes show.
#[derive(Clone, Copy)]
struct Axes {
    x: (&'static str, Column),
    y: (&'static str, Column),
    is_rate: bool,
}

fn make(request: &Request) -> Result<String, FigureError> {
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
    let rows: Vec<CurveRow> = read_rows(&ENTRY, request.sources)?;
    let tasks = in_order_of_appearance(rows.iter().map(|row| row.task.clone()));
    let groups = groups(&rows);
    let key: Vec<Entry> = groups
        .iter()
        .enumerate()
        .map(|(n, group)| Entry {
            look: series(n),
            name: key_name(group, &rows),
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
        let rows: Vec<&CurveRow> = rows.iter().filter(|row| row.task == *task).collect();
        let curves = groups
            .iter()
            .map(|group| curves(&rows, group, axes))
            .collect::<Result<Vec<_>, _>>()?;
        let points = || curves.iter().flatten().flatten();
        let panel = Panel {
            frame: sheet.frame(n),
            x: Scale::exact(
                0.0,
                points().fold(0.0, |greatest: f64, p| greatest.max(p.0)),
            ),
            y: if axes.is_rate {
                Scale::exact(0.0, 100.0)
            } else {
                Scale::around(points().map(|p| p.1).chain([0.0]), 5)
            },
        };
        let labels = Labels {
            title: task,
            x: axes.x.0,
            y: axes.y.0,
        };
        panel.draw_axes(&mut svg, labels);
        draw_seeds(&mut svg, &panel, &curves, center);
    }
    let title = format!("{} over {}, by method", axes.y.0, axes.x.0.to_lowercase());
    Ok(svg.finish(&title))
}

/// The curve of each seed of a group, in order of seed.
fn curves(rows: &[&CurveRow], group: &Group, axes: Axes) -> Result<Vec<Curve>, FigureError> {
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
    Ok(seeds.into_values().map(curve).collect())
}

/// Methods in the registry's order, others after them; settings in order of appearance.
fn groups(rows: &[CurveRow]) -> Vec<Group> {
    let all = rows
        .iter()
        .map(|row| (row.method.clone(), row.setting.clone()));
    let mut groups = in_order_of_appearance(all);
    let rank = |method: &str| METHODS.iter().position(|m| m.name == method);
    groups.sort_by_key(|(method, _)| rank(method).unwrap_or(METHODS.len()));
    groups
}

fn is_in(row: &CurveRow, (method, setting): &Group) -> bool {
    row.method == *method && row.setting == *setting
}

/// "STAIR, N = 500 (5 seeds)".
fn key_name(group: &Group, rows: &[CurveRow]) -> String {
    let mut seeds: BTreeMap<&str, Vec<u64>> = BTreeMap::new();
    for row in rows.iter().filter(|row| is_in(row, group)) {
        let of_task = seeds.entry(&row.task).or_default();
        if !of_task.contains(&row.seed) {
            of_task.push(row.seed);
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
