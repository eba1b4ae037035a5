//! Queries until the actions of every stage are in order: the paper's counts as lines, random
//! queries that were really asked as points.

use domain::agreement::{Bootstrap, mean};

use super::plot::{Entry, Frame, Labels, Panel, Pen, Scale, Sheet, Svg, series};
use super::seeds::in_order_of_appearance;
use super::{FigureEntry, FigureError, Request, read_rows};
use crate::experiment::query_counts::{Asked, Counts, World, counts};

pub(super) const ENTRY: FigureEntry = FigureEntry {
    name: "query-counts",
    summary: "queries by number of stages: the paper's formulas and random queries, counted",
    input: "the query-counts.jsonl of `stair experiment query-counts`",
    choices: &[],
    make,
};

type Formula = fn(&Counts) -> f64;

/// The formula of a world, its name in the key and its column.
const FORMULAS: [(World, &str, Formula); 3] = [
    (World::Aligned, "aligned", |c| c.aligned),
    (World::Conventional, "conventional", |c| c.conventional),
    (
        World::ConventionalUnderBias,
        "conventional, large stage bias",
        |c| c.conventional_under_bias,
    ),
];

const NOTE: &str = "Lines: worst cases by formula. Points: random queries asked until the order follows, mean \
                    over seeds with its 95 % bootstrap interval.";

fn make(request: &Request) -> Result<String, FigureError> {
    let rows: Vec<Asked> = read_rows(&ENTRY, request.sources)?;
    if let Some(row) = rows.iter().find(|r| r.n_stages < 1 || r.n_actions < 2) {
        return Err(FigureError::Misfit(format!(
            "{} stages of {} actions leave nothing to order",
            row.n_stages, row.n_actions
        )));
    }
    let key: Vec<Entry> = FORMULAS
        .iter()
        .enumerate()
        .map(|(n, (_, name, _))| Entry {
            look: series(n),
            name: (*name).to_owned(),
            has_line: true,
        })
        .collect();
    let mut actions = in_order_of_appearance(rows.iter().map(|row| row.n_actions));
    actions.sort_unstable();
    let sheet = Sheet::new(actions.len(), 3, (260.0, 220.0), key).noted(NOTE);
    let mut svg = sheet.start();
    for (n, &n_actions) in actions.iter().enumerate() {
        draw_panel(&mut svg, sheet.frame(n), n_actions, &rows);
    }
    Ok(svg.finish("Queries to order the actions of every stage, by number of stages"))
}

fn draw_panel(svg: &mut Svg, frame: Frame, n_actions: usize, rows: &[Asked]) {
    let stages = || rows.iter().map(|row| row.n_stages);
    let span = [stages().min().unwrap_or(1), stages().max().unwrap_or(1)];
    let fewest = rows.iter().map(|row| row.n_actions).min();
    let least = counts(span[0], fewest.unwrap_or(n_actions)).aligned;
    let panel = Panel {
        frame,
        x: Scale::magnitudes(span.map(|s| s as f64)),
        y: Scale::magnitudes(
            rows.iter()
                .map(|row| row.n_queries.max(1) as f64)
                .chain([least]),
        ),
    };
    let title = format!("{n_actions} actions a stage");
    let labels = Labels {
        title: &title,
        x: "Stages",
        y: "Queries",
    };
    panel.draw_axes(svg, labels);
    for (n, (world, _, of)) in FORMULAS.into_iter().enumerate() {
        let look = series(n);
        let line: Vec<(f64, f64)> = (span[0]..=span[1])
            .map(|s| (s as f64, of(&counts(s, n_actions))))
            .collect();
        panel.line(svg, &line, look.pen(1.8));
        for n_stages in in_order_of_appearance(stages()) {
            let is_here = |row: &&Asked| {
                (row.world, row.n_stages, row.n_actions) == (world, n_stages, n_actions)
            };
            let here = rows.iter().filter(is_here);
            let values: Vec<f64> = here.map(|row| row.n_queries as f64).collect();
            let Some(found) = Bootstrap::default().center(&values, mean) else {
                continue;
            };
            let x = n_stages as f64;
            let bar = [(x, found.interval.lo), (x, found.interval.hi)];
            panel.line(svg, &bar, Pen::solid(look.color, 1.4));
            look.marker
                .draw(svg, panel.at((x, found.value)), 4.2, look.color);
        }
    }
}
