//! How many of a method's queries people judge to show one stage, by task.
//!
//! Source: STAIR, the figure on human judgements of stage alignment.

use domain::agreement::{Continuity, Share, Stratum, cochran_mantel_haenszel, newcombe};
use serde::{Deserialize, Serialize};

use super::plot::{Entry, Labels, Panel, Pen, Scale, Sheet, Svg, series};
use super::seeds::in_order_of_appearance;
use super::{FigureEntry, FigureError, Request, read_rows, shown_method};

pub(super) const ENTRY: FigureEntry = FigureEntry {
    name: "same-stage-bars",
    summary: "share of queries judged to show one stage, by method and task",
    input: "task, method, same (true or false); one judgement each",
    choices: &[],
    make,
};

const LEVEL: f64 = 0.95;

/// One judgement.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
struct Judgement {
    task: String,
    method: String,
    same: bool,
}

fn make(request: &Request) -> Result<String, FigureError> {
    let rows: Vec<Judgement> = read_rows(&ENTRY, request.sources)?;
    let tasks = in_order_of_appearance(rows.iter().map(|row| row.task.clone()));
    let methods = in_order_of_appearance(rows.iter().map(|row| row.method.clone()));
    let key: Vec<Entry> = methods
        .iter()
        .enumerate()
        .map(|(n, method)| Entry {
            look: series(n),
            name: shown_method(method),
            has_line: false,
        })
        .collect();
    let shares: Vec<Vec<Share>> = tasks
        .iter()
        .map(|task| {
            let of_method = methods.iter().map(|method| share(&rows, task, method));
            of_method.collect()
        })
        .collect();
    let width = (150.0 * tasks.len() as f64).max(420.0);
    let sheet = Sheet::new(1, 1, (width, 230.0), key).noted(&note(&shares));
    let mut svg = sheet.start();
    let panel = Panel {
        frame: sheet.frame(0),
        x: Scale::exact(-0.5, tasks.len() as f64 - 0.5),
        y: Scale::exact(0.0, 100.0),
    };
    let names: Vec<(f64, &str)> = tasks
        .iter()
        .enumerate()
        .map(|(n, task)| (n as f64, task.as_str()))
        .collect();
    let labels = Labels {
        title: "Queries judged to show one stage",
        x: "",
        y: "Share (%)",
    };
    panel.draw_axes_with_names(&mut svg, labels, &names);
    for (task, shares) in shares.iter().enumerate() {
        draw_task(&mut svg, &panel, task as f64, shares);
    }
    Ok(svg.finish("Share of queries judged to show one stage, by method and task"))
}

fn share(rows: &[Judgement], task: &str, method: &str) -> Share {
    let of_both = rows
        .iter()
        .filter(|row| row.task == task && row.method == method);
    Share::of(of_both.map(|row| row.same))
}

/// Bars side by side with their intervals; below them the difference of the first two methods.
fn draw_task(svg: &mut Svg, panel: &Panel, task: f64, shares: &[Share]) {
    let width = 0.7 / shares.len().max(2) as f64;
    for (n, share) in shares.iter().enumerate() {
        let Some(found) = share.wilson(LEVEL) else {
            continue;
        };
        let x = task + width * (n as f64 - (shares.len() as f64 - 1.0) / 2.0);
        let look = series(n);
        panel.bar(svg, (x, 100.0 * found.value), 0.86 * width, look.color);
        let (lo, hi) = (100.0 * found.interval.lo, 100.0 * found.interval.hi);
        panel.line(svg, &[(x, lo), (x, hi)], Pen::solid(look.color, 1.8));
        let top = panel.at((x, 100.0 * found.value));
        look.marker.draw(svg, top, 4.4, look.color);
    }
    if let [first, second] = shares
        && let Some(found) = newcombe(*first, *second, LEVEL)
    {
        let points = |v: f64| format!("{:+.0}", 100.0 * v).replace('-', "−");
        let (lo, hi) = (points(found.interval.lo), points(found.interval.hi));
        let told = format!("{} [{lo}, {hi}]", points(found.value));
        panel.below(svg, task, &told);
    }
}

fn note(shares: &[Vec<Share>]) -> String {
    let mut note = "Lines: Wilson's 95 % interval.".to_owned();
    let strata: Vec<Stratum> = shares
        .iter()
        .filter_map(|shares| match shares.as_slice() {
            &[first, second] => Some(Stratum { first, second }),
            _ => None,
        })
        .collect();
    if let Some(found) = cochran_mantel_haenszel(&strata, Continuity::Corrected, LEVEL) {
        let p = if found.p < 0.001 {
            "p < 0.001".to_owned()
        } else {
            format!("p = {:.3}", found.p)
        };
        note += " Below: difference (points), Newcombe's. Over all tasks (CMH): ";
        note += &p;
        if let Some(ratio) = found.odds_ratio {
            let (lo, hi) = (ratio.interval.lo, ratio.interval.hi);
            let told = format!(", odds ratio {:.1} [{lo:.1}, {hi:.1}]", ratio.value);
            note += &told;
        }
        note.push('.');
    }
    note
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::figure::{Source, make};

    #[test]
    fn two_methods_are_compared_and_three_only_shown() {
        let row = |method: &str, same: bool| {
            format!("{{\"task\":\"door-open\",\"method\":\"{method}\",\"same\":{same}}}\n")
        };
        let two: String = (0..20)
            .flat_map(|k| [row("stair", k > 2), row("pebble", k > 12)])
            .collect();
        let draw = |text: String| {
            let sources = [Source {
                name: "judgements.jsonl".into(),
                text,
            }];
            let request = Request {
                sources: &sources,
                ..Request::default()
            };
            make(&ENTRY, &request).unwrap()
        };
        let svg = draw(two.clone());
        assert!(
            svg.contains("+50 [+20, +70]"),
            "Newcombe, as by statsmodels 0.15.0"
        );
        assert!(
            svg.contains("p = 0.004"),
            "CMH, corrected, as by statsmodels 0.15.0"
        );
        let three = draw(two + &row("uniform", true));
        assert!(three.contains("uniform") && !three.contains("CMH"));
    }
}
