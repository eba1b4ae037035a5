//! Which segment people prefer, by where both start in their episodes.
//!
//! Source: STAIR, the left of the figure on stage reward bias.

use super::plot::{Entry, Labels, Panel, Pen, Scale, Sheet, series};
use super::preferences::{INPUT, PreferenceRow, Preferred};
use super::seeds::in_order_of_appearance;
use super::{FigureEntry, FigureError, Request, read_rows};

pub(super) const ENTRY: FigureEntry = FigureEntry {
    name: "preference-scatter",
    summary: "each preference as a point at the starts of both segments",
    input: INPUT,
    choices: &[],
    make,
};

const NOTE: &str = "Above the broken line σ₁ starts later: whoever prefers later segments answers σ₁ there \
                    and σ₀ below.";

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
    let sheet = Sheet::new(tasks.len(), 3, (230.0, 230.0), key).noted(NOTE);
    let mut svg = sheet.start();
    let starts = rows.iter().flat_map(|row| [row.t_x, row.t_y]);
    let scale = Scale::around(starts.map(f64::from).chain([0.0]), 5);
    for (n, task) in tasks.iter().enumerate() {
        let panel = Panel {
            frame: sheet.frame(n),
            x: scale,
            y: scale,
        };
        let labels = Labels {
            title: task,
            x: "Start of σ₀ (step)",
            y: "Start of σ₁ (step)",
        };
        panel.draw_axes(&mut svg, labels);
        panel.draw_diagonal(
            &mut svg,
            Pen {
                dash: "4 4",
                ..Pen::solid("#59636e", 1.0)
            },
        );
        for row in rows.iter().filter(|row| row.task == *task) {
            let kind = Preferred::ALL.iter().position(|p| *p == row.preference);
            let look = series(kind.unwrap_or_default());
            let at = panel.at((f64::from(row.t_x), f64::from(row.t_y)));
            look.marker.draw(&mut svg, at, 4.2, look.color);
        }
    }
    Ok(svg.finish("Preferences by the starts of both segments"))
}
