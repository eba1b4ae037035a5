//! How far the segments of a pair are apart in the task, of chosen pairs and of all candidates:
//! where the chosen ones lie below, the queries climb through the task stage by stage.

use std::collections::BTreeMap;

use domain::agreement::interquartile_mean;

use super::seeds::{Curve, SeedSheet, add_line, drawn_lines, in_order_of_appearance, quoted};
use super::{FigureEntry, FigureError, Request, read_rows, shown_method};
use crate::experiment::results::{Content, Row};

pub(super) const ENTRY: FigureEntry = FigureEntry {
    name: "stage-gaps",
    summary: "stage gap of chosen pairs against all candidates, over environment steps",
    input: "the results of an experiment, from methods that have a stage gap",
    choices: &[],
    make,
};

/// Method and setting, and whether it is of the chosen pairs.
type Group = (String, String, bool);

/// The curve of each seed of a group.
type Seeds = Vec<(u64, Curve)>;

/// Curves of each group by task.
struct Plan {
    groups: Vec<Group>,
    tasks: Vec<(String, Vec<Seeds>)>,
}

impl Plan {
    fn of(request: &Request) -> Result<Self, FigureError> {
        let rows: Vec<Row> = read_rows(&ENTRY, request.sources)?;
        let mut points: BTreeMap<(String, Group), BTreeMap<u64, Curve>> = BTreeMap::new();
        let (mut tasks, mut groups) = (Vec::new(), Vec::new());
        for Row { key, content } in rows {
            let Content::Session(session) = content else {
                continue;
            };
            let (Some(chosen), Some(pool)) = (session.stage_gap_chosen, session.stage_gap_pool)
            else {
                continue;
            };
            if session.session == 0 {
                continue; // random, before anything is known of stages
            }
            let setting = key.shown_setting();
            for (is_chosen, gap) in [(true, chosen), (false, pool)] {
                let group = (key.method.clone(), setting.clone(), is_chosen);
                groups.push(group.clone());
                let curves = points.entry((key.task.clone(), group)).or_default();
                let curve = curves.entry(key.seed).or_default();
                curve.push((session.step as f64, gap));
            }
            tasks.push(key.task);
        }
        let groups = in_order_of_appearance(groups);
        let tasks = in_order_of_appearance(tasks).into_iter().map(|task| {
            let curves = groups.iter().map(|group| {
                let seeds = points
                    .remove(&(task.clone(), group.clone()))
                    .unwrap_or_default();
                seeds.into_iter().collect()
            });
            let curves = curves.collect();
            (task, curves)
        });
        let tasks: Vec<_> = tasks.collect();
        if tasks.is_empty() {
            return Err(FigureError::NoRows {
                figure: ENTRY.name,
                input: ENTRY.input,
            });
        }
        Ok(Self { groups, tasks })
    }
}

fn make(request: &Request) -> Result<String, FigureError> {
    let plan = Plan::of(request)?;
    let name = |(method, setting, is_chosen): &Group| {
        let what = if *is_chosen { "chosen" } else { "candidates" };
        let parts = [&shown_method(method), setting.as_str(), what];
        let parts: Vec<&str> = parts.into_iter().filter(|part| !part.is_empty()).collect();
        parts.join(", ")
    };
    let sheet = SeedSheet {
        groups: plan.groups.iter().map(name).collect(),
        x: "Environment steps",
        y: "Stage gap (temporal distance: nats)",
        is_rate: false,
        center: interquartile_mean,
    };
    let panel = |(task, groups): &(String, Vec<Seeds>)| {
        let alone = |seeds: &Seeds| seeds.iter().map(|(_, curve)| curve.clone()).collect();
        (task.clone(), groups.iter().map(alone).collect::<Vec<_>>())
    };
    let panels: Vec<_> = plan.tasks.iter().map(panel).collect();
    Ok(sheet.draw(
        &panels,
        "Stage gap of chosen pairs and of all candidates over environment steps",
    ))
}

/// Every point of the figure as CSV.
///
/// # Errors
/// As for drawing it.
pub fn points(request: &Request) -> Result<String, FigureError> {
    let plan = Plan::of(request)?;
    let mut csv = String::from("task,method,setting,pairs,line,x,y\n");
    for (task, groups) in &plan.tasks {
        for ((method, setting, is_chosen), seeds) in plan.groups.iter().zip(groups) {
            let pairs = if *is_chosen { "chosen" } else { "candidates" };
            let named =
                |line: String| format!("{task},{method},{},{pairs},{line}", quoted(setting));
            for (seed, curve) in seeds {
                add_line(&mut csv, &named(format!("seed {seed}")), curve);
            }
            let curves: Vec<Curve> = seeds.iter().map(|(_, curve)| curve.clone()).collect();
            for (line, curve) in drawn_lines(&curves, interquartile_mean) {
                add_line(&mut csv, &named(line.to_owned()), &curve);
            }
        }
    }
    Ok(csv)
}
