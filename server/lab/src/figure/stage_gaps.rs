//! How far the segments of a pair are apart in the task, of chosen pairs and of all candidates:
//! where the chosen ones lie below, the queries climb through the task stage by stage.

use std::collections::BTreeMap;

use domain::agreement::interquartile_mean;
use learn::stage::StageApproximator;

use super::seeds::{
    Between, Curve, SeedSheet, add_line, drawn_lines, in_order_of_appearance, quoted,
};
use super::{FigureEntry, FigureError, Request, find, read_rows, shown_method};
use crate::config::RunConfig;
use crate::experiment::results::{Content, Row};
use crate::method;

const INPUT: &str = "the results of an experiment, from methods that have a stage gap";

pub(super) const ENTRY: FigureEntry = FigureEntry {
    name: "stage-gaps",
    summary: "stage gap of chosen pairs against all candidates, over environment steps",
    input: INPUT,
    choices: &[],
    make: |request| GAPS.draw(request),
};

pub(super) const RATIOS_ENTRY: FigureEntry = FigureEntry {
    name: "stage-gap-ratios",
    summary: "stage gap of chosen pairs by that of all candidates, over environment steps",
    input: INPUT,
    choices: &[],
    make: |request| RATIOS.draw(request),
};

/// The gaps themselves.
pub(crate) const GAPS: StageGaps = StageGaps {
    figure: "stage-gaps",
    lines: |chosen, pool| vec![("chosen", chosen), ("candidates", pool)],
    has_unit: true,
    y: "Stage gap",
    title: "Stage gap of chosen pairs and of all candidates over environment steps",
};

/// What choosing does to them: below 1 the chosen pairs lie closer than candidates do.
pub(crate) const RATIOS: StageGaps = StageGaps {
    figure: "stage-gap-ratios",
    lines: |chosen, pool| {
        let ratio = (pool > 0.0).then_some(("", chosen / pool));
        ratio.into_iter().collect()
    },
    has_unit: false,
    y: "Stage gap, chosen / candidates",
    title: "Stage gap of chosen pairs by that of all candidates over environment steps",
};

/// A figure of stage gaps over environment steps.
pub(crate) struct StageGaps {
    figure: &'static str,
    /// Lines and their heights, of the gaps of chosen pairs and of candidates in a session.
    lines: fn(f64, f64) -> Vec<(&'static str, f64)>,
    /// Whether nats and shares need panels of their own.
    has_unit: bool,
    y: &'static str,
    title: &'static str,
}

/// Method, setting, and which of its lines.
type Group = (String, String, &'static str);

/// The curve of each seed of a group.
type Seeds = Vec<(u64, Curve)>;

/// Task, and the unit where it needs to be told.
type Place = (String, &'static str);

/// Curves of each group by place.
struct Plan {
    groups: Vec<Group>,
    panels: Vec<(Place, Vec<Seeds>)>,
}

impl StageGaps {
    fn plan(&self, request: &Request) -> Result<Plan, FigureError> {
        let rows: Vec<Row> = read_rows(find(self.figure)?, request.sources)?;
        let mut points: BTreeMap<(Place, Group), BTreeMap<u64, Curve>> = BTreeMap::new();
        let (mut places, mut groups) = (Vec::new(), Vec::new());
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
            let unit = if self.has_unit { unit(&key.method) } else { "" };
            let place = (key.task.clone(), unit);
            for (line, height) in (self.lines)(chosen, pool) {
                let group = (key.method.clone(), key.shown_setting(), line);
                groups.push(group.clone());
                let curves = points.entry((place.clone(), group)).or_default();
                let curve = curves.entry(key.seed).or_default();
                curve.push((session.step as f64, height));
            }
            places.push(place);
        }
        let groups = in_order_of_appearance(groups);
        let panels = in_order_of_appearance(places).into_iter().map(|place| {
            let curves = groups.iter().map(|group| {
                let seeds = points.remove(&(place.clone(), group.clone()));
                seeds.unwrap_or_default().into_iter().collect()
            });
            let curves = curves.collect();
            (place, curves)
        });
        let panels: Vec<_> = panels.collect();
        if groups.is_empty() {
            return Err(FigureError::NoRows {
                figure: self.figure,
                input: INPUT,
            });
        }
        Ok(Plan { groups, panels })
    }

    /// # Errors
    /// Without rows of stage gaps.
    pub(crate) fn draw(&self, request: &Request) -> Result<String, FigureError> {
        let plan = self.plan(request)?;
        let name = |(method, setting, line): &Group| {
            let parts = [&shown_method(method), setting.as_str(), line];
            let parts: Vec<&str> = parts.into_iter().filter(|part| !part.is_empty()).collect();
            parts.join(", ")
        };
        let sheet = SeedSheet {
            groups: plan.groups.iter().map(name).collect(),
            x: "Environment steps",
            y: self.y,
            is_rate: false,
            center: interquartile_mean,
            between: Between::Line,
        };
        let panel = |((task, unit), groups): &(Place, Vec<Seeds>)| {
            let alone = |seeds: &Seeds| seeds.iter().map(|(_, curve)| curve.clone()).collect();
            let title = if unit.is_empty() {
                task.clone()
            } else {
                format!("{task} ({unit})")
            };
            (title, groups.iter().map(alone).collect::<Vec<_>>())
        };
        let panels: Vec<_> = plan.panels.iter().map(panel).collect();
        Ok(sheet.draw(&panels, self.title))
    }

    /// Every point of the figure as CSV.
    ///
    /// # Errors
    /// As for drawing it.
    pub(crate) fn points(&self, request: &Request) -> Result<String, FigureError> {
        let plan = self.plan(request)?;
        let mut csv = String::from("task,method,setting,pairs,line,x,y\n");
        for ((task, _), groups) in &plan.panels {
            for ((method, setting, pairs), seeds) in plan.groups.iter().zip(groups) {
                let named =
                    |line: String| format!("{task},{method},{},{pairs},{line}", quoted(setting));
                for (seed, curve) in seeds {
                    add_line(&mut csv, &named(format!("seed {seed}")), curve);
                }
                let curves: Vec<Curve> = seeds.iter().map(|(_, curve)| curve.clone()).collect();
                for (line, curve) in drawn_lines(&curves, interquartile_mean, Between::Line) {
                    add_line(&mut csv, &named(line.to_owned()), &curve);
                }
            }
        }
        Ok(csv)
    }
}

/// In what a method's gaps are told.
fn unit(method: &str) -> &'static str {
    let recipe = method::find(method).map(|entry| (entry.build)(&RunConfig::default()));
    let stage = recipe.ok().and_then(|recipe| recipe.stage);
    // A sampler that asks for a gap brings the quadrilateral along.
    stage.map_or("nats", StageApproximator::unit)
}
