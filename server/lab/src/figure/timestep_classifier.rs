//! How well an expert's steps are told apart by their states: calibration, guesses that are
//! nearly right, and what bounds the multi-stage measure, by number of stages.

use domain::stage::{N_BINS, StageMeasures, TimestepReport};

use super::plot::{Entry, Labels, Panel, Pen, Scale, Sheet, Svg, series};
use super::seeds::in_order_of_appearance;
use super::{FigureEntry, FigureError, Request, read_rows};
use crate::experiment::timestep_classifier::Outcome;

pub(super) const ENTRY: FigureEntry = FigureEntry {
    name: "timestep-classifier",
    summary: "a classifier of steps: calibration, accuracy within k steps, bounds of the measure",
    input: "the timestep-classifier.jsonl of `stair experiment timestep-classifier`",
    choices: &[],
    make,
};

type Measure = fn(&StageMeasures) -> f64;

/// Lines of the panel by number of stages; the first look is that of accuracies everywhere.
const MEASURES: [(&str, Measure); 4] = [
    ("accuracy", |m| m.accuracy),
    ("F", |m| m.measure),
    ("E[m²]", |m| m.confidence_squared),
    ("accuracy²", |m| m.accuracy_squared),
];
const QUIET_LINE: Pen = Pen {
    color: "#59636e",
    width: 1.2,
    dash: "3 3",
    opacity: 1.0,
};

const NOTE: &str = "m: probability of the most likely step or stage. Bars: share of the states in a bin of m, 15 of equal \
                    width. Dashed: calibrated; a guess at random. F: exact multi-stage measure; accuracy² ≤ E[m²] ≤ F \
                    where calibrated.";

fn make(request: &Request) -> Result<String, FigureError> {
    let rows: Vec<Outcome> = read_rows(&ENTRY, request.sources)?;
    let key = MEASURES.iter().enumerate().map(|(n, (name, _))| Entry {
        look: series(n),
        name: (*name).to_owned(),
        has_line: true,
    });
    let has_seeds = in_order_of_appearance(rows.iter().map(|row| row.seed)).len() > 1;
    let sheet = Sheet::new(3 * rows.len(), 3, (250.0, 190.0), key.collect()).noted(NOTE);
    let mut svg = sheet.start();
    for (n, row) in rows.iter().enumerate() {
        let name = if has_seeds {
            format!("{}, seed {}", row.task, row.seed)
        } else {
            row.task.clone()
        };
        let frames = [0, 1, 2].map(|column| sheet.frame(3 * n + column));
        let shares = |frame, x| Panel {
            frame,
            x,
            y: Scale::exact(0.0, 1.0),
        };
        let steps = row.held_out.n_steps as f64;
        let most = row.held_out.within.last().map_or(1, |within| within.k);
        let off_by = Scale::exact(0.0, most as f64);
        let stages = Scale::magnitudes(row.held_out.stages.iter().map(|m| m.n_stages as f64));
        let calibration = shares(frames[0], Scale::exact(0.0, 1.0));
        draw_calibration(&mut svg, &calibration, &name, &row.held_out);
        draw_within(&mut svg, &shares(frames[1], off_by), steps, &row.held_out);
        draw_stages(&mut svg, &shares(frames[2], stages), &row.held_out.stages);
    }
    Ok(svg.finish("How well an expert's steps are told apart by their states"))
}

fn draw_calibration(svg: &mut Svg, panel: &Panel, name: &str, report: &TimestepReport) {
    let labels = Labels {
        title: name,
        x: "m, probability of the most likely step",
        y: "Share right",
    };
    panel.draw_axes(svg, labels);
    let bins = &report.calibration.bins;
    let width = 1.0 / N_BINS as f64;
    for bin in bins {
        let middle = ((bin.confidence / width).ceil().max(1.0) - 0.5) * width;
        let share = bin.n as f64 / report.n_states as f64;
        panel.bar(svg, (middle, share), width, QUIET_LINE.color);
    }
    panel.draw_diagonal(svg, QUIET_LINE);
    let points: Vec<_> = bins.iter().map(|b| (b.confidence, b.accuracy)).collect();
    panel.marked_line(svg, &points, series(0), (0, 1));
    panel.remark(svg, 0, &format!("ECE {:.3}", report.calibration.ece));
}

fn draw_within(svg: &mut Svg, panel: &Panel, n_steps: f64, report: &TimestepReport) {
    let labels = Labels {
        title: "Off by at most k steps",
        x: "k",
        y: "Share of states",
    };
    panel.draw_axes(svg, labels);
    // Of all pairs of steps, those at most k apart.
    let by_chance = |k: f64| ((2.0 * k + 1.0) * n_steps - k * (k + 1.0)) / n_steps.powi(2);
    let allowed = || report.within.iter().map(|within| within.k as f64);
    let chance: Vec<_> = allowed().map(|k| (k, by_chance(k))).collect();
    panel.line(svg, &chance, QUIET_LINE);
    let points: Vec<_> = allowed()
        .zip(report.within.iter().map(|within| within.accuracy))
        .collect();
    panel.marked_line(svg, &points, series(0), (0, 1));
}

fn draw_stages(svg: &mut Svg, panel: &Panel, stages: &[StageMeasures]) {
    let labels = Labels {
        title: "Steps merged into N stages",
        x: "N",
        y: "Share, probability",
    };
    panel.draw_axes(svg, labels);
    for (n, (_, of)) in MEASURES.into_iter().enumerate() {
        let points: Vec<_> = stages.iter().map(|m| (m.n_stages as f64, of(m))).collect();
        panel.marked_line(svg, &points, series(n), (0, 1));
    }
}

#[cfg(test)]
mod tests {
    use domain::stage::{StageProbabilities, TimestepTally};
    use learn::timestep::TimestepFit;

    use super::*;
    use crate::figure::Source;

    fn row(seed: u64) -> String {
        let table = StageProbabilities::new(vec![0.9, 0.1, 0.4, 0.6], 2).unwrap();
        let mut tally = TimestepTally::new(2);
        tally.add(&table);
        let outcome = Outcome {
            task: "door-open".into(),
            seed,
            n_fitted_episodes: 1,
            n_held_out_episodes: 1,
            expert_success_rate: Some(1.0),
            last_pass: TimestepFit::default(),
            held_out: tally.report().unwrap(),
        };
        serde_json::to_string(&outcome).unwrap() + "\n"
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
    fn each_row_is_a_line_of_panels_that_tells_its_seed_where_there_are_several() {
        let one = draw(row(1)).unwrap();
        assert!(
            one.contains(">door-open<") && one.contains("ECE 0.250"),
            "{one}"
        );
        let two = draw(row(1) + &row(2)).unwrap();
        assert!(two.contains("door-open, seed 2"), "{two}");
        assert_eq!(two.matches("Off by at most").count(), 2);
    }

    #[test]
    fn bars_stand_on_their_bins() {
        let svg = draw(row(1)).unwrap();
        // Bins 14 and, as 0.6 is a little more in single precision, 10 of 15, each 16.67 wide, in
        // a panel that begins at 58.
        for left in ["274.67", "208"] {
            let bar = format!("<rect x=\"{left}\"");
            assert!(svg.contains(&bar), "{bar} is not in {svg}");
        }
    }

    #[test]
    fn rows_of_another_figure_are_refused() {
        let told = draw("{\"task\":\"window-open\"}".into()).unwrap_err();
        let told = told.to_string();
        assert!(told.starts_with("rows.jsonl, line 1: "), "{told}");
    }
}
