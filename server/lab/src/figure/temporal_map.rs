//! The temporal distance between the states of an episode, the stages that follow from it, and
//! what was asked about the episode.

use super::plot::{Anchor, Font, Frame, INK, Labels, NAME, PAPER, Panel, Pen, Scale, Svg, shade};
use super::{FigureEntry, FigureError, Request, read_rows, shown_method};
use crate::temporal_map::TemporalMap;

pub(super) const ENTRY: FigureEntry = FigureEntry {
    name: "temporal-map",
    summary: "temporal distance between the states of an episode, its stages and what was asked",
    input: "the folder of a run that learns a temporal distance",
    choices: &[],
    make,
};

const SIDE: f64 = 440.0;
const LEFT: f64 = 128.0;
const TOP: f64 = 62.0;
const RIGHT: f64 = 92.0;
/// From the map to the first lane: room for the axis.
const AXIS: f64 = 54.0;
/// A lane of stages.
const LANE: f64 = 26.0;
/// A line of segments that were asked about.
const LINE: f64 = 13.0;
/// Segments that do not overlap share a line; more lines than these are not drawn.
const MOST_LINES: usize = 8;
const N_SHADES: u8 = 24;
const SEGMENTATION: &str = "#d55e00";
const ASKED: &str = "#0072b2";

const INSIDE: Font = Font {
    size: 11.5,
    color: INK,
    is_strong: false,
};

fn make(request: &Request) -> Result<String, FigureError> {
    let maps: Vec<TemporalMap> = read_rows(&ENTRY, request.sources)?;
    maps.iter().try_for_each(check)?;
    let height: f64 = maps.iter().map(height).sum();
    let mut svg = Svg::new(LEFT + SIDE + RIGHT, height, PAPER);
    let mut top = 0.0;
    for map in &maps {
        draw(&mut svg, top, map);
        top += self::height(map);
    }
    Ok(svg.finish("Temporal distance between the states of an episode, with its stages and what was asked about it"))
}

fn check(map: &TemporalMap) -> Result<(), FigureError> {
    let n = map.steps.len();
    let is_square = map.distance.len() == n && map.distance.iter().all(|row| row.len() == n);
    let fits = n > 0
        && is_square
        && (map.stages.is_empty() || map.stages.len() == n)
        && map.starts.iter().all(|&start| start < n)
        && map.steps.is_sorted()
        && map.steps.iter().all(|&step| step < map.len);
    if fits {
        return Ok(());
    }
    Err(FigureError::Misfit(format!(
        "the map of episode {} does not hold what it says: {n} steps, {} rows of distances",
        map.episode,
        map.distance.len()
    )))
}

fn n_lanes(map: &TemporalMap) -> usize {
    1 + usize::from(!map.stages.is_empty())
}

fn height(map: &TemporalMap) -> f64 {
    let n_lines = lines(map).len().max(1);
    TOP + SIDE + AXIS + LANE * n_lanes(map) as f64 + LINE * n_lines as f64 + 44.0
}

fn draw(svg: &mut Svg, top: f64, map: &TemporalMap) {
    let panel = Panel {
        frame: Frame {
            x: LEFT,
            y: top + TOP,
            width: SIDE,
            height: SIDE,
        },
        x: Scale::exact(0.0, f64::from(map.len)),
        y: Scale::exact(0.0, f64::from(map.len)),
    };
    let title = format!(
        "{} on {}, seed {}: episode {}",
        shown_method(&map.method),
        map.task,
        map.seed,
        map.episode
    );
    let labels = Labels {
        title: &title,
        x: "… to the state of step",
        y: "Temporal distance from the state of step …",
    };
    panel.draw_axes(svg, labels);
    let farthest = draw_distances(svg, &panel, map);
    draw_ramp(svg, &panel, farthest);
    draw_squares(svg, &panel, map);
    let mut y = top + TOP + SIDE + AXIS;
    draw_lane(svg, &panel, y, "Best segmentation", &found_stages(map));
    y += LANE;
    if !map.stages.is_empty() {
        draw_lane(svg, &panel, y, "True stages", &true_stages(map));
        y += LANE;
    }
    draw_asked(svg, &panel, y, map);
    let note = format!(
        "Darker: nearer, as learned in {} steps of the run. Outlined: the best segmentation.",
        map.run_step
    );
    let below = top + height(map) - 14.0;
    svg.text((LEFT - 8.0, below), &note, Anchor::Start, NAME);
}

/// Where a compared state begins and ends on the axis: half-way to its neighbours.
fn extent(map: &TemporalMap, index: usize) -> (f64, f64) {
    let start = f64::from(map.steps[index]);
    let next = map.steps.get(index + 1).copied().unwrap_or(map.len);
    (start, f64::from(next))
}

/// Neighbours of one shade are one rectangle; returns the largest distance, nats.
fn draw_distances(svg: &mut Svg, panel: &Panel, map: &TemporalMap) -> f64 {
    let all = map.distance.iter().flatten().copied();
    let farthest = all.filter(|d| d.is_finite()).fold(0.0, f32::max);
    let level = |d: f32| {
        let near = if farthest > 0.0 && d.is_finite() {
            1.0 - (d / farthest).sqrt() // what is near has most of the shades
        } else {
            1.0
        };
        (near.clamp(0.0, 1.0) * f32::from(N_SHADES)).round() as u8
    };
    let mut cells: Vec<Vec<[f64; 4]>> = vec![Vec::new(); usize::from(N_SHADES) + 1];
    for (from, row) in map.distance.iter().enumerate() {
        let (bottom, top) = extent(map, from);
        let mut start = 0;
        while start < row.len() {
            let here = level(row[start]);
            let end = (start..row.len()).find(|&to| level(row[to]) != here);
            let end = end.unwrap_or(row.len());
            let (left, upper) = panel.at((extent(map, start).0, top));
            let (right, lower) = panel.at((extent(map, end - 1).1, bottom));
            cells[usize::from(here)].push([left, upper, right - left, lower - upper]);
            start = end;
        }
    }
    for (level, cells) in cells.iter().enumerate().filter(|(_, c)| !c.is_empty()) {
        svg.cells(cells, &shade(level as f64 / f64::from(N_SHADES)));
    }
    f64::from(farthest)
}

/// What the shades mean, right of the map: they go with the root of the distance.
fn draw_ramp(svg: &mut Svg, panel: &Panel, farthest: f64) {
    let Frame {
        x,
        y,
        width,
        height,
        ..
    } = panel.frame;
    let (left, n) = (x + width + 20.0, f64::from(N_SHADES) + 1.0);
    for level in 0..=N_SHADES {
        let share = f64::from(level) / f64::from(N_SHADES);
        let top = y + height * 0.5 * f64::from(level) / n;
        svg.cell([left, top, 14.0, height * 0.5 / n + 0.5], &shade(share));
    }
    let label = |svg: &mut Svg, y: f64, text: &str| {
        svg.text((left + 20.0, y), text, Anchor::Start, NAME);
    };
    label(svg, y + 9.0, &format!("{farthest:.1} nats"));
    label(
        svg,
        y + height * 0.25 + 4.0,
        &format!("{:.1}", farthest / 4.0),
    );
    label(svg, y + height * 0.5, "0");
}

/// The stages along the diagonal.
fn draw_squares(svg: &mut Svg, panel: &Panel, map: &TemporalMap) {
    for (from, to, _) in found_stages(map) {
        let corners = [(from, from), (to, from), (to, to), (from, to), (from, from)];
        panel.line(svg, &corners, Pen::solid("#ffffff", 4.2));
        panel.line(svg, &corners, Pen::solid(SEGMENTATION, 2.0));
    }
}

/// First step, end and name of each stage.
type Stages = Vec<(f64, f64, String)>;

fn found_stages(map: &TemporalMap) -> Stages {
    let ends = map.starts.iter().skip(1).copied();
    let ends = ends.chain([map.steps.len()]);
    let spans = map.starts.iter().zip(ends).enumerate();
    spans
        .filter(|(_, (start, end))| *start < end)
        .map(|(n, (&start, end))| {
            let (from, to) = (extent(map, start).0, extent(map, end - 1).1);
            (from, to, (n + 1).to_string())
        })
        .collect()
}

fn true_stages(map: &TemporalMap) -> Stages {
    let mut stages: Stages = Vec::new();
    for (index, &stage) in map.stages.iter().enumerate() {
        let name = map.stage_names.get(usize::from(stage));
        let name = name.cloned().unwrap_or_else(|| stage.to_string());
        let (from, to) = extent(map, index);
        match stages.last_mut() {
            Some(last) if last.2 == name => last.1 = to,
            _ => stages.push((from, to, name)),
        }
    }
    stages
}

/// Spans with their names, each a shade of its own so that neighbours stand apart.
fn draw_lane(svg: &mut Svg, panel: &Panel, y: f64, name: &str, stages: &Stages) {
    svg.text((LEFT - 10.0, y + 13.0), name, Anchor::End, NAME);
    for (n, (from, to, name)) in stages.iter().enumerate() {
        let (left, _) = panel.at((*from, 0.0));
        let (right, _) = panel.at((*to, 0.0));
        let color = if n % 2 == 0 { "#d7dce2" } else { "#eef0f3" };
        svg.cell([left, y, right - left, LANE - 8.0], color);
        let has_room = right - left > 7.0 * name.chars().count() as f64 + 4.0;
        if has_room {
            let middle = (f64::midpoint(left, right), y + 13.0);
            svg.text(middle, name, Anchor::Middle, INSIDE);
        }
    }
}

/// Segments in lines in which none overlaps another, as indices into `asked`.
fn lines(map: &TemporalMap) -> Vec<Vec<usize>> {
    let mut lines: Vec<Vec<usize>> = Vec::new();
    for (index, segment) in map.asked.iter().enumerate() {
        let is_free = |line: &Vec<usize>| {
            line.iter().all(|&other| {
                let other = map.asked[other];
                segment.start >= other.start + other.len
                    || other.start >= segment.start + segment.len
            })
        };
        match lines.iter().position(is_free) {
            Some(free) => lines[free].push(index),
            None if lines.len() < MOST_LINES => lines.push(vec![index]),
            None => {}
        }
    }
    lines
}

fn draw_asked(svg: &mut Svg, panel: &Panel, y: f64, map: &TemporalMap) {
    svg.text((LEFT - 10.0, y + 10.0), "Asked about", Anchor::End, NAME);
    if map.asked.is_empty() {
        svg.text(
            (LEFT, y + 10.0),
            "nothing in this episode",
            Anchor::Start,
            NAME,
        );
    }
    for (n, line) in lines(map).iter().enumerate() {
        for &index in line {
            let segment = map.asked[index];
            let (left, _) = panel.at((f64::from(segment.start), 0.0));
            let (right, _) = panel.at((f64::from(segment.start + segment.len), 0.0));
            let top = y + LINE * n as f64 + 2.0;
            svg.rect([left, top, right - left - 1.0, LINE - 4.0], ASKED, 1.0);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::figure::Source;
    use crate::temporal_map::AskedSegment;

    fn map() -> TemporalMap {
        let asked = |session, start| AskedSegment {
            session,
            start,
            len: 10,
        };
        TemporalMap {
            task: "go-fetch-return".into(),
            method: "stair".into(),
            seed: 2,
            run_step: 54_000,
            episode: 81,
            len: 40,
            steps: vec![0, 10, 20, 30],
            distance: vec![
                vec![0.0, 0.5, 2.0, 2.0],
                vec![0.5, 0.0, 2.0, 2.0],
                vec![2.0, 2.0, 0.0, 0.5],
                vec![2.0, 2.0, 0.5, 0.0],
            ],
            starts: vec![0, 2],
            stages: vec![0, 0, 0, 1],
            stage_names: vec!["go".into(), "fetch".into(), "return".into()],
            asked: vec![asked(1, 0), asked(1, 5), asked(2, 20)],
        }
    }

    fn draw(map: &TemporalMap) -> Result<String, FigureError> {
        let sources = [Source {
            name: "run".into(),
            text: serde_json::to_string(map).unwrap(),
        }];
        let request = Request {
            sources: &sources,
            ..Request::default()
        };
        crate::figure::make(&ENTRY, &request)
    }

    #[test]
    fn stages_lie_over_the_map_and_true_ones_beside_them_where_they_are_known() {
        let svg = draw(&map()).unwrap();
        assert!(svg.contains("STAIR on go-fetch-return, seed 2: episode 81"));
        assert_eq!(svg.matches(SEGMENTATION).count(), 2, "two squares");
        assert!(svg.contains(">True stages<") && svg.contains(">fetch<"));
        assert!(!svg.contains(">return<"), "it was not reached");
        assert!(svg.contains("2.0 nats"));
        let unknown = TemporalMap {
            stages: Vec::new(),
            ..map()
        };
        assert!(!draw(&unknown).unwrap().contains("True stages"));
        assert_eq!(draw(&map()).unwrap(), svg, "the same bytes each time");
    }

    #[test]
    fn segments_that_overlap_lie_in_different_lines() {
        assert_eq!(lines(&map()), [vec![0, 2], vec![1]]);
        let nothing = TemporalMap {
            asked: Vec::new(),
            ..map()
        };
        assert!(draw(&nothing).unwrap().contains("nothing in this episode"));
    }

    #[test]
    fn a_map_that_does_not_hold_what_it_says_is_refused() {
        type Spoil = fn(&mut TemporalMap);
        let spoil: [Spoil; 5] = [
            |m| m.distance[2].truncate(1),
            |m| m.steps.clear(),
            |m| m.starts = vec![0, 9],
            |m| m.stages = vec![1],
            |m| m.len = 3,
        ];
        for spoil in spoil {
            let mut bad = map();
            spoil(&mut bad);
            let told = draw(&bad).unwrap_err().to_string();
            assert!(told.contains("map of episode 81"), "{told}");
        }
    }
}
