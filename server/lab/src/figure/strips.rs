//! What methods asked about: both segments of a query as strips of pictures, one above the other.

use serde::{Deserialize, Serialize};

use super::plot::{Anchor, Font, INK, PAPER, SMALL, Svg, series};
use super::{FigureEntry, FigureError, Request, read_rows, shown_method};

pub(super) const ENTRY: FigureEntry = FigureEntry {
    name: "strips",
    summary: "pictures of both segments of each method's top queries, one above the other",
    input: "packed query sets (stair study pack) or folders of finished runs",
    choices: &[],
    make,
};

/// One segment of a query with pictures of some of its states.
///
/// Whoever can draw makes such rows; this figure knows no more of pictures than their place.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct StripRow {
    /// The task's name.
    pub task: String,
    /// The method that chose.
    pub method: String,
    /// Round of asking, from 0.
    pub session: u32,
    /// Place in the round, from 0: its rank among the candidates.
    pub index: u32,
    /// Whether it is σ₁ rather than σ₀.
    pub is_second: bool,
    /// Number of the episode in its run.
    pub episode: u32,
    /// Of each picture.
    pub shots: Vec<Shot>,
}

/// A picture of one state.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Shot {
    /// The step of the episode that led to it, from 0.
    pub step: u32,
    /// Name of its true stage, where the task knows.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub stage: Option<String>,
    /// A PNG file, four wide to three high, in base64.
    pub png: String,
}

/// Room for the names of rounds and segments.
const LEFT: f64 = 130.0;
const MARGIN: f64 = 22.0;
/// A picture.
const SIZE: (f64, f64) = (132.0, 99.0);
/// Between pictures side by side.
const GAP: f64 = 6.0;
/// Below a picture, for its step.
const CAPTION: f64 = 21.0;
/// Between queries.
const BETWEEN: f64 = 14.0;
/// Above a method's queries, for its name.
const HEADING: f64 = 36.0;
const NOTE_HEIGHT: f64 = 34.0;

const TITLE: Font = Font {
    size: 15.0,
    color: INK,
    is_strong: true,
};
const NAME: Font = Font {
    size: 12.5,
    color: INK,
    is_strong: false,
};

const NOTE: &str = "Below each picture: the step that led to it. Place 1 is the query that the method ranked first in its round.";

fn make(request: &Request) -> Result<String, FigureError> {
    let rows: Vec<StripRow> = read_rows(&ENTRY, request.sources)?;
    rows.iter().try_for_each(check)?;
    let blocks = blocks(&rows);
    let n_shots = rows.iter().map(|row| row.shots.len()).max().unwrap_or(0);
    let width = MARGIN + LEFT + n_shots as f64 * (SIZE.0 + GAP) - GAP + MARGIN;
    let strip = SIZE.1 + CAPTION;
    let heights = blocks.iter().map(|block| {
        let n_strips = block.iter().map(Vec::len).sum::<usize>();
        HEADING + n_strips as f64 * strip + block.len() as f64 * BETWEEN
    });
    let height = heights.sum::<f64>() + NOTE_HEIGHT;
    let mut svg = Svg::new(width, height, PAPER);
    let mut top = 0.0;
    for (n, block) in blocks.iter().enumerate() {
        draw_heading(&mut svg, top, n, block[0][0]);
        top += HEADING;
        for query in block {
            for row in query {
                draw_strip(&mut svg, top, row, row.is_second && query.len() > 1);
                top += strip;
            }
            top += BETWEEN;
        }
    }
    svg.text((MARGIN, height - 14.0), NOTE, Anchor::Start, SMALL);
    let methods: Vec<String> = blocks
        .iter()
        .map(|block| shown_method(&block[0][0].method))
        .collect();
    let title = format!("Queries that {} asked, as pictures", methods.join(" and "));
    Ok(svg.finish(&title))
}

/// Text that goes into an attribute must be what it says it is.
fn check(row: &StripRow) -> Result<(), FigureError> {
    let misfit = |what: String| {
        let place = (row.session + 1, row.index + 1);
        FigureError::Misfit(format!(
            "round {}, place {} of {} on {}: {what}",
            place.0, place.1, row.method, row.task
        ))
    };
    if row.shots.is_empty() {
        return Err(misfit("there is no picture".into()));
    }
    let is_base64 = |c: char| c.is_ascii_alphanumeric() || "+/=".contains(c);
    match row
        .shots
        .iter()
        .find(|shot| !shot.png.chars().all(is_base64))
    {
        Some(shot) => Err(misfit(format!(
            "the picture of step {} is no base64",
            shot.step
        ))),
        None => Ok(()),
    }
}

/// The segments of a query.
type QueryRows<'a> = Vec<&'a StripRow>;

/// Queries by method and task, both in the order in which they first appear.
fn blocks(rows: &[StripRow]) -> Vec<Vec<QueryRows<'_>>> {
    let mut blocks: Vec<Vec<QueryRows<'_>>> = Vec::new();
    for row in rows {
        let is_of = |block: &&mut Vec<QueryRows<'_>>| {
            let there = block[0][0];
            there.method == row.method && there.task == row.task
        };
        let Some(block) = blocks.iter_mut().find(is_of) else {
            blocks.push(vec![vec![row]]);
            continue;
        };
        let is_same = |query: &&mut QueryRows<'_>| {
            (query[0].session, query[0].index) == (row.session, row.index)
        };
        match block.iter_mut().find(is_same) {
            Some(query) => query.push(row),
            None => block.push(vec![row]),
        }
    }
    blocks
}

fn draw_heading(svg: &mut Svg, top: f64, n: usize, row: &StripRow) {
    let look = series(n);
    let at = (MARGIN + 6.0, top + 20.0);
    look.marker.draw(svg, at, 5.0, look.color);
    let title = format!("{} on {}", shown_method(&row.method), row.task);
    svg.text((MARGIN + 20.0, top + 25.0), &title, Anchor::Start, TITLE);
}

fn draw_strip(svg: &mut Svg, top: f64, row: &StripRow, names_segment_alone: bool) {
    let middle = top + SIZE.1 / 2.0;
    if !names_segment_alone {
        let name = format!("Round {}, place {}", row.session + 1, row.index + 1);
        svg.text((MARGIN, top + 12.0), &name, Anchor::Start, NAME);
    }
    let segment = if row.is_second { "σ₁" } else { "σ₀" };
    let segment = format!("{segment}, episode {}", row.episode);
    svg.text((MARGIN, middle + 4.0), &segment, Anchor::Start, SMALL);
    for (n, shot) in row.shots.iter().enumerate() {
        let left = MARGIN + LEFT + n as f64 * (SIZE.0 + GAP);
        svg.image([left, top, SIZE.0, SIZE.1], &shot.png);
        let mut caption = shot.step.to_string();
        if let Some(stage) = &shot.stage {
            caption = format!("{caption} · {stage}");
        }
        let at = (left + SIZE.0 / 2.0, top + SIZE.1 + 14.0);
        svg.text(at, &caption, Anchor::Middle, SMALL);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::figure::Source;

    fn row(method: &str, (session, index): (u32, u32), is_second: bool) -> StripRow {
        let shot = |step: u32| Shot {
            step,
            stage: (step == 40).then(|| "fetch".to_owned()),
            png: format!("iVBOR{session}{index}{step}"),
        };
        StripRow {
            task: "window-open".into(),
            method: method.into(),
            session,
            index,
            is_second,
            episode: 7,
            shots: vec![shot(30), shot(40), shot(50)],
        }
    }

    fn draw(rows: &[StripRow]) -> Result<String, FigureError> {
        let lines: Vec<String> = rows
            .iter()
            .map(|row| serde_json::to_string(row).unwrap())
            .collect();
        let sources = [Source {
            name: "rows.jsonl".into(),
            text: lines.join("\n"),
        }];
        crate::figure::make(
            &ENTRY,
            &Request {
                sources: &sources,
                ..Request::default()
            },
        )
    }

    /// Top edges of the pictures, in the order in which they are drawn.
    fn tops(svg: &str) -> Vec<f64> {
        let images = svg.lines().filter(|line| line.starts_with("<image"));
        let top = |line: &str| line.split("y=\"").nth(1)?.split('"').next()?.parse().ok();
        images.map(|line| top(line).unwrap()).collect()
    }

    #[test]
    fn segments_of_a_query_and_queries_of_a_method_stand_together() {
        let rows = [
            row("stair", (4, 0), false),
            row("pebble", (2, 3), false),
            row("stair", (4, 0), true),
            row("pebble", (2, 3), true),
            row("stair", (5, 0), false),
        ];
        let svg = draw(&rows).unwrap();
        let tops = tops(&svg);
        assert_eq!(tops.len(), 15);
        assert!(tops.is_sorted(), "{tops:?}");
        let order = [
            "STAIR on",
            "Round 5, place 1",
            "Round 6, place 1",
            "PEBBLE on",
            "Round 3, place 4",
        ];
        let places: Vec<usize> = order.iter().map(|name| svg.find(name).unwrap()).collect();
        assert!(places.is_sorted(), "{places:?}");
        assert_eq!(svg.matches("Round 5, place 1").count(), 1, "once a query");
        assert!(svg.contains(">40 · fetch<") && svg.contains("iVBOR2350"));
        assert_eq!(draw(&rows).unwrap(), svg, "the same bytes each time");
    }

    #[test]
    fn pictures_that_are_none_are_named_with_their_query() {
        let mut bad = row("stair", (4, 0), false);
        bad.shots[1].png = "\" onload=\"".into();
        let told = draw(&[bad.clone()]).unwrap_err().to_string();
        assert!(
            told.contains("round 5, place 1 of stair on window-open: the picture of step 40"),
            "{told}"
        );
        bad.shots.clear();
        let told = draw(&[bad]).unwrap_err().to_string();
        assert!(told.contains("there is no picture"), "{told}");
        assert!(matches!(draw(&[]), Err(FigureError::NoRows { .. })));
    }
}
