//! What aligned queries gain on the abstract MDP: reward by stage reward bias, then the errors.

use domain::agreement::mean;

use super::plot::{Entry, Frame, Labels, Panel, Pen, Scale, Sheet, Svg, series};
use super::seeds::{Between, Curve, draw_seeds, in_order_of_appearance, note};
use super::{FigureEntry, FigureError, Request, read_rows};
use crate::experiment::abstract_mdp::{Outcome, Selection, over_seeds};

pub(super) const ENTRY: FigureEntry = FigureEntry {
    name: "abstract-mdp",
    summary: "reward and errors on the abstract MDP, aligned against any queries",
    input: "the abstract-mdp.jsonl of `stair experiment abstract-mdp`",
    choices: &[],
    make,
};

type Column = fn(&Outcome) -> f64;

/// The errors with their names.
const ERRORS: [([&str; 2], Column); 3] = [
    (["E1", "Whole tables, mean |Δ|, standardised"], |o| {
        o.errors.global_error
    }),
    (["E2", "Within stages, mean Δ², standardised"], |o| {
        o.errors.within_error
    }),
    (["E3", "Misordered pairs within stages (%)"], |o| {
        100.0 * o.errors.misordered
    }),
];

fn make(request: &Request) -> Result<String, FigureError> {
    let rows: Vec<Outcome> = read_rows(&ENTRY, request.sources)?;
    let biases = in_order_of_appearance(rows.iter().map(|row| row.bias));
    let selections = in_order_of_appearance(rows.iter().map(|row| row.selection));
    let key: Vec<Entry> = selections
        .iter()
        .enumerate()
        .map(|(n, selection)| Entry {
            look: series(n),
            name: format!("{} queries", selection.name()),
            has_line: true,
        })
        .collect();
    let n_above = biases.len().next_multiple_of(3);
    let sheet = Sheet::new(n_above + ERRORS.len(), 3, (250.0, 160.0), key).noted(&note("mean"));
    let mut svg = sheet.start();
    for (n, &bias) in biases.iter().enumerate() {
        let groups: Vec<Vec<Curve>> = selections
            .iter()
            .map(|&selection| group(&rows, bias, selection).map(curve).collect())
            .collect();
        draw_rewards(&mut svg, sheet.frame(n), bias, &groups);
    }
    for (n, error) in ERRORS.iter().enumerate() {
        let frame = sheet.frame(n_above + n);
        draw_error(&mut svg, frame, *error, &rows, (&biases, &selections));
    }
    Ok(svg.finish("Reward and errors on the abstract MDP by stage reward bias"))
}

fn group(rows: &[Outcome], bias: f64, selection: Selection) -> impl Iterator<Item = &Outcome> {
    let is_in =
        move |row: &&Outcome| row.bias.total_cmp(&bias).is_eq() && row.selection == selection;
    rows.iter().filter(is_in)
}

fn curve(outcome: &Outcome) -> Curve {
    let rewards = outcome.rewards.iter().enumerate();
    rewards.map(|(epoch, &r)| (epoch as f64, r)).collect()
}

fn draw_rewards(svg: &mut Svg, frame: Frame, bias: f64, groups: &[Vec<Curve>]) {
    let points = || groups.iter().flatten().flatten();
    let panel = Panel {
        frame,
        x: Scale::exact(0.0, points().map(|p| p.0).fold(0.0, f64::max)),
        // No policy earns more than one.
        y: Scale::exact(points().map(|p| p.1).fold(0.4, f64::min), 1.0),
    };
    let title = format!("R_bias = {bias}");
    let labels = Labels {
        title: &title,
        x: "Epochs of 200 queries",
        y: "Normalised episode reward",
    };
    panel.draw_axes(svg, labels);
    draw_seeds(svg, &panel, groups, mean, Between::Line);
}

/// Means with their intervals, the biases at equal distances: they span from 0 to hundreds.
fn draw_error(
    svg: &mut Svg,
    frame: Frame,
    ([title, name], of): ([&str; 2], Column),
    rows: &[Outcome],
    (biases, selections): (&[f64], &[Selection]),
) {
    let greatest = rows.iter().map(of).fold(0.0, f64::max);
    let panel = Panel {
        frame,
        x: Scale::exact(-0.5, biases.len() as f64 - 0.5),
        y: Scale::around([0.0, greatest], 4),
    };
    let names: Vec<String> = biases.iter().map(f64::to_string).collect();
    let names: Vec<(f64, &str)> = names
        .iter()
        .enumerate()
        .map(|(n, name)| (n as f64, name.as_str()))
        .collect();
    let labels = Labels {
        title,
        x: "R_bias",
        y: name,
    };
    panel.draw_axes_with_names(svg, labels, &names);
    for (n, &selection) in selections.iter().enumerate() {
        let look = series(n);
        let mut points = Curve::new();
        for (x, &bias) in biases.iter().enumerate() {
            let outcomes: Vec<&Outcome> = group(rows, bias, selection).collect();
            let Some(found) = over_seeds(&outcomes, of) else {
                continue;
            };
            let x = x as f64;
            let bar = [(x, found.interval.lo), (x, found.interval.hi)];
            panel.line(svg, &bar, Pen::solid(look.color, 1.4));
            points.push((x, found.value));
        }
        panel.marked_line(svg, &points, look, (0, 1));
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::figure::Source;

    #[test]
    fn rows_of_another_figure_are_refused() {
        let sources = [Source {
            name: "other.jsonl".into(),
            text: "{\"task\":\"window-open\"}".into(),
        }];
        let request = Request {
            sources: &sources,
            ..Request::default()
        };
        let told = make(&request).unwrap_err().to_string();
        assert!(told.starts_with("other.jsonl, line 1: "), "{told}");
    }
}
