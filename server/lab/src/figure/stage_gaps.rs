//! How far apart in the task the two segments of chosen queries are, session by session: the
//! curriculum that nobody wrote down.

use serde::{Deserialize, Serialize};

use super::chart::{Chart, Point};
use super::{FigureEntry, FigureError, Request, choose, make_center, read_rows};

pub(super) const ENTRY: FigureEntry = FigureEntry {
    name: "stage-gaps",
    summary: "stage gap of chosen queries by session, and their share in one true stage",
    input: "task, method, seed, setting, session, step, stage_gap_chosen, stage_gap_pool, same_stage_chosen",
    choices: &["y", "center"],
    make,
    list: Some(list),
};

/// A session of one run.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct SessionRow {
    /// The task's name.
    pub task: String,
    /// The method's name.
    pub method: String,
    /// Of the run.
    pub seed: u64,
    /// What else differs between groups of runs; may be empty.
    #[serde(default)]
    pub setting: String,
    /// Round of asking, from 0.
    pub session: u32,
    /// Environment steps taken.
    pub step: u64,
    /// Mean stage gap of the chosen queries, nats, where the method has one.
    pub stage_gap_chosen: Option<f64>,
    /// Mean stage gap of all candidates, nats.
    pub stage_gap_pool: Option<f64>,
    /// Share of chosen queries in one true stage, where the task knows it.
    pub same_stage_chosen: Option<f64>,
}

type Column = fn(&SessionRow) -> Option<f64>;

fn make(request: &Request) -> Result<String, FigureError> {
    chart(request)?.draw()
}

fn list(request: &Request) -> Result<String, FigureError> {
    chart(request)?.csv()
}

fn chart(request: &Request) -> Result<Chart, FigureError> {
    let gap: (&str, Column) = ("Stage gap of chosen (nats)", |row| row.stage_gap_chosen);
    let ratio: (&str, Column) = ("Stage gap, chosen in % of pool", |row| {
        let pool = row.stage_gap_pool.filter(|pool| *pool > 0.0)?;
        Some(100.0 * row.stage_gap_chosen? / pool)
    });
    let same: (&str, Column) = ("Chosen in one true stage (%)", |row| {
        Some(100.0 * row.same_stage_chosen?)
    });
    let known = [
        ("stage_gap_chosen", gap),
        ("stage_gap_ratio", ratio),
        ("same_stage_chosen", same),
    ];
    let (title, column) = choose("y", request.y, &known)?;
    let rows: Vec<SessionRow> = read_rows(&ENTRY, request.sources)?;
    let point = |row: SessionRow| {
        Some(Point {
            at: (row.step as f64, column(&row)?),
            task: row.task,
            method: row.method,
            setting: row.setting,
            seed: row.seed,
            step: row.step,
        })
    };
    let points: Vec<Point> = rows.into_iter().filter_map(point).collect();
    if points.is_empty() {
        return Err(FigureError::Misfit(format!(
            "no session has a value of {}",
            request.y.unwrap_or("stage_gap_chosen")
        )));
    }
    Ok(Chart {
        points,
        x: "Environment steps",
        y: title,
        is_rate: request.y == Some("same_stage_chosen"),
        center: make_center(request.center)?,
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::figure::Source;

    fn draw(y: Option<&str>) -> Result<String, FigureError> {
        let row = |method: &str, session: u32, gap: Option<f64>| {
            let row = SessionRow {
                task: "go-fetch-return".into(),
                method: method.into(),
                seed: 1,
                setting: String::new(),
                session,
                step: 1_000 * u64::from(session),
                stage_gap_chosen: gap,
                stage_gap_pool: gap.map(|g| 2.0 * g),
                same_stage_chosen: None,
            };
            serde_json::to_string(&row).unwrap() + "\n"
        };
        let text =
            row("stair", 0, Some(0.0)) + &row("stair", 1, Some(3.0)) + &row("pebble", 1, None);
        let sources = [Source {
            name: "rows.jsonl".into(),
            text,
        }];
        let request = Request {
            sources: &sources,
            y,
            ..Request::default()
        };
        (ENTRY.list.unwrap())(&request)
    }

    #[test]
    fn sessions_without_a_value_are_left_out() {
        let header = "task,method,setting,line,x,y\n";
        let ratio = draw(Some("stage_gap_ratio")).unwrap();
        let expected =
            "go-fetch-return,stair,,seed 1,1000,50\ngo-fetch-return,stair,,mean,1000,50\n";
        assert_eq!(ratio, format!("{header}{expected}"));
        assert!(draw(None).unwrap().contains("seed 1,0,0"));
        let told = draw(Some("same_stage_chosen")).unwrap_err().to_string();
        assert!(told.contains("no session"), "{told}");
    }
}
