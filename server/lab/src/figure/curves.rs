//! Learning curves: one panel a task, one line a method, every seed thin behind.

use super::chart::{Chart, Point};
use super::{CurveRow, FigureEntry, FigureError, Request, choose, make_center, read_rows};

pub(super) const ENTRY: FigureEntry = FigureEntry {
    name: "curves",
    summary: "learning curves by task and method, every seed thin behind their mean",
    input: "task, method, seed, setting, step, labels, success_rate, return_mean, wall_s; or the folders of runs",
    choices: &["x", "y", "center"],
    make,
    list: Some(list),
};

type Column = fn(&CurveRow) -> f64;

fn make(request: &Request) -> Result<String, FigureError> {
    chart(request)?.draw()
}

fn list(request: &Request) -> Result<String, FigureError> {
    chart(request)?.csv()
}

fn chart(request: &Request) -> Result<Chart, FigureError> {
    let steps: (&str, Column) = ("Environment steps", |row| row.step as f64);
    let labels: (&str, Column) = ("Labels", |row| f64::from(row.labels));
    let success: (&str, Column) = ("Success (%)", |row| 100.0 * row.success_rate);
    let returns: (&str, Column) = ("Return", |row| row.return_mean);
    let x = choose("x", request.x, &[("step", steps), ("labels", labels)])?;
    let y = choose(
        "y",
        request.y,
        &[("success_rate", success), ("return_mean", returns)],
    )?;
    let rows: Vec<CurveRow> = read_rows(&ENTRY, request.sources)?;
    let point = |row: CurveRow| Point {
        at: ((x.1)(&row), (y.1)(&row)),
        task: row.task,
        method: row.method,
        setting: row.setting,
        seed: row.seed,
        step: row.step,
    };
    Ok(Chart {
        points: rows.into_iter().map(point).collect(),
        x: x.0,
        y: y.0,
        is_rate: request.y != Some("return_mean"),
        center: make_center(request.center)?,
    })
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
