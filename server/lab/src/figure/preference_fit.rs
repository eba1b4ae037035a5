//! How the preference for a segment grows with how much later it starts.

use domain::agreement::{Estimate, Share, firth};

use super::plot::{Entry, Labels, Panel, Pen, Scale, Sheet, Svg, series};
use super::preferences::{INPUT, PreferenceRow, Preferred};
use super::seeds::in_order_of_appearance;
use super::{FigureEntry, FigureError, Request, read_rows};

pub(super) const ENTRY: FigureEntry = FigureEntry {
    name: "preference-fit",
    summary: "logistic fit of the preference for σ₁ by how much later it starts, and ties",
    input: INPUT,
    choices: &[],
    make,
};

const LEVEL: f64 = 0.95;
/// Places along the axis at which the fit is evaluated.
const N_PLACES: u32 = 40;

const NOTE: &str = "Line and band: Firth's logistic regression without ties, 95 % profile likelihood interval. \
                    Points: answers. Ties with Wilson's 95 % interval.";

fn make(request: &Request) -> Result<String, FigureError> {
    let rows: Vec<PreferenceRow> = read_rows(&ENTRY, request.sources)?;
    let tasks = in_order_of_appearance(rows.iter().map(|row| row.task.clone()));
    let key: Vec<Entry> = Preferred::ALL
        .iter()
        .enumerate()
        .map(|(n, preferred)| Entry {
            look: series(n),
            name: preferred.name().to_owned(),
            has_line: false,
        })
        .collect();
    let sheet = Sheet::new(tasks.len(), 3, (270.0, 200.0), key).noted(NOTE);
    let mut svg = sheet.start();
    let widest = rows.iter().map(|row| delay(row).abs()).fold(1.0, f64::max);
    for (n, task) in tasks.iter().enumerate() {
        let rows: Vec<&PreferenceRow> = rows.iter().filter(|row| row.task == *task).collect();
        let panel = Panel {
            frame: sheet.frame(n),
            x: Scale::around([-widest, widest], 4),
            y: Scale::exact(0.0, 1.0),
        };
        let labels = Labels {
            title: task,
            x: "Start of σ₁ − start of σ₀ (steps)",
            y: "Probability that σ₁ is better",
        };
        panel.draw_axes(&mut svg, labels);
        draw_answers(&mut svg, &panel, &rows);
        draw_fit(&mut svg, &panel, &rows, widest);
    }
    Ok(svg.finish("Preference for the second segment by how much later it starts"))
}

fn delay(row: &PreferenceRow) -> f64 {
    f64::from(row.t_y) - f64::from(row.t_x)
}

fn draw_answers(svg: &mut Svg, panel: &Panel, rows: &[&PreferenceRow]) {
    for row in rows {
        let (kind, height) = match row.preference {
            Preferred::First => (0, 0.0),
            Preferred::Second => (1, 1.0),
            Preferred::Equal => (2, 0.5),
        };
        let at = panel.at((delay(row), height));
        series(kind).marker.draw(svg, at, 3.6, series(kind).color);
    }
}

/// The curve with its band, and the numbers in the corner that a rising curve leaves free.
fn draw_fit(svg: &mut Svg, panel: &Panel, rows: &[&PreferenceRow], widest: f64) {
    let look = series(6);
    if let Some(slope) = fit_around(rows, 0.0).map(|fit| fit[1]) {
        let curve: Vec<(f64, Estimate)> = (0..=N_PLACES)
            .map(|k| widest * (2.0 * f64::from(k) / f64::from(N_PLACES) - 1.0))
            .filter_map(|place| Some((place, fit_around(rows, place)?[0])))
            .collect();
        let chance = |logit: f64| 1.0 / (1.0 + (-logit).exp());
        let band: Vec<_> = curve
            .iter()
            .map(|(x, e)| (*x, chance(e.interval.lo), chance(e.interval.hi)))
            .collect();
        panel.band(svg, &band, look.color);
        let line: Vec<_> = curve.iter().map(|(x, e)| (*x, chance(e.value))).collect();
        panel.line(svg, &line, Pen::solid(look.color, 2.0));
        panel.remark(svg, 0, "slope a step");
        panel.remark(svg, 1, &shown(slope, 1.0, 3));
    }
    let ties = Share::of(rows.iter().map(|row| row.preference == Preferred::Equal));
    if let Some(rate) = ties.wilson(LEVEL) {
        panel.remark(svg, 3, &format!("ties of {} (%)", ties.n));
        panel.remark(svg, 4, &shown(rate, 100.0, 0));
    }
}

/// Logit of preferring σ₁ at a delay, and its slope; `None` where the answers do not determine
/// them. The intercept of a regression whose origin is `place` is the logit there, so that its
/// profile interval is one of the curve.
fn fit_around(rows: &[&PreferenceRow], place: f64) -> Option<Vec<Estimate>> {
    let decided = rows.iter().filter(|row| row.preference != Preferred::Equal);
    let (covariates, outcomes): (Vec<_>, Vec<_>) = decided
        .map(|row| {
            let is_second = row.preference == Preferred::Second;
            (vec![1.0, delay(row) - place], is_second)
        })
        .unzip();
    firth(&covariates, &outcomes, LEVEL).ok()
}

/// "0.046 [0.010, 0.113]".
fn shown(estimate: Estimate, times: f64, n_decimals: usize) -> String {
    let number = |v: f64| format!("{:.n_decimals$}", v * times).replace('-', "−");
    let (lo, hi) = (estimate.interval.lo, estimate.interval.hi);
    format!(
        "{} [{}, {}]",
        number(estimate.value),
        number(lo),
        number(hi)
    )
}

#[cfg(test)]
mod tests {
    use super::*;

    fn row(t_x: u32, t_y: u32, preference: Preferred) -> PreferenceRow {
        PreferenceRow {
            task: "window-open".into(),
            t_x,
            t_y,
            preference,
        }
    }

    #[test]
    fn people_who_always_prefer_the_later_segment_have_a_rising_finite_fit() {
        let rows: Vec<PreferenceRow> = (0..20)
            .map(|k| (5 * k, 90 - 3 * k))
            .map(|(x, y)| {
                row(
                    x,
                    y,
                    if y > x {
                        Preferred::Second
                    } else {
                        Preferred::First
                    },
                )
            })
            .collect();
        let rows: Vec<&PreferenceRow> = rows.iter().collect();
        let fit = fit_around(&rows, 0.0).unwrap();
        assert!(fit[1].interval.lo > 0.0 && fit[1].interval.hi.is_finite());
        let later = fit_around(&rows, 30.0).unwrap();
        let moved = fit[0].value + 30.0 * fit[1].value;
        assert!((later[0].value - moved).abs() < 1e-6, "the same line");
    }

    #[test]
    fn answers_at_one_delay_alone_have_no_fit() {
        let rows = [
            row(10, 20, Preferred::Second),
            row(30, 40, Preferred::First),
        ];
        let rows: Vec<&PreferenceRow> = rows.iter().collect();
        assert!(fit_around(&rows, 0.0).is_none());
    }
}
