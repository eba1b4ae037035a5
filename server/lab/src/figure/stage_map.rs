//! How likely each state of a trajectory belongs to each stage, and the best way through.

use domain::stage::{StageProbabilities, best_segmentation};

use super::plot::{Labels, Panel, Pen, Scale, Sheet, Svg, shade};
use super::{FigureEntry, FigureError, Request, read_rows};

pub(super) const ENTRY: FigureEntry = FigureEntry {
    name: "stage-map",
    summary: "probability of each stage at each step of a trajectory, with its best segmentation",
    input: "a list of probabilities a step, one for each stage; a file is a trajectory",
    choices: &[],
    make,
};

/// Shades from paper to full, dark where likely.
const N_SHADES: u8 = 32;

const NOTE: &str =
    "Darker: more likely, from 0 to 1. Line: the best segmentation; F: mean probability along it.";

fn make(request: &Request) -> Result<String, FigureError> {
    let mut tables = Vec::new();
    for source in request.sources {
        let rows: Vec<Vec<f32>> = read_rows(&ENTRY, std::slice::from_ref(source))?;
        let n_stages = rows[0].len();
        if let Some(step) = rows.iter().position(|row| row.len() != n_stages) {
            return Err(FigureError::Misfit(format!(
                "{}: step {step} has {} stages, but step 0 has {n_stages}",
                source.name,
                rows[step].len()
            )));
        }
        let table = StageProbabilities::new(rows.concat(), n_stages);
        let table = table.map_err(|e| FigureError::Misfit(format!("{}: {e}", source.name)))?;
        tables.push((source.name.as_str(), table));
    }
    if tables.is_empty() {
        return Err(FigureError::NoRows {
            figure: ENTRY.name,
            input: ENTRY.input,
        });
    }
    let sheet = Sheet::new(tables.len(), 2, (440.0, 220.0), Vec::new()).noted(NOTE);
    let mut svg = sheet.start();
    for (n, (name, table)) in tables.iter().enumerate() {
        let panel = Panel {
            frame: sheet.frame(n),
            x: Scale::exact(0.0, table.n_states() as f64),
            y: Scale::counted(0.5, table.n_stages() as f64 + 0.5, 6),
        };
        draw_map(&mut svg, &panel, name, table);
    }
    Ok(svg.finish("Probability of each stage at each step, with the best segmentation"))
}

fn draw_map(svg: &mut Svg, panel: &Panel, name: &str, table: &StageProbabilities) {
    let found = best_segmentation(table);
    let short = name.rsplit('/').next().unwrap_or(name);
    let short = short.split('.').next().unwrap_or(short);
    let title = format!("{short}: F = {:.3}", found.value);
    let labels = Labels {
        title: &title,
        x: "Step",
        y: "Stage",
    };
    panel.draw_axes(svg, labels);
    for stage in 0..table.n_stages() {
        draw_stage(svg, panel, table, stage);
    }
    let mut way = Vec::new();
    for (stage, &start) in found.starts.iter().enumerate() {
        let end = found.starts.get(stage + 1).copied();
        let end = end.unwrap_or_else(|| table.n_states());
        way.extend([start, end].map(|step| (step as f64, stage as f64 + 1.0)));
    }
    panel.line(svg, &way, Pen::solid("#ffffff", 4.6));
    panel.line(svg, &way, Pen::solid("#d55e00", 2.2));
}

/// Neighbours of one shade are one rectangle.
fn draw_stage(svg: &mut Svg, panel: &Panel, table: &StageProbabilities, stage: usize) {
    let level = |step: usize| (table.row(step)[stage] * f32::from(N_SHADES)).round() as u8;
    let (bottom, top) = (stage as f64 + 0.5, stage as f64 + 1.5);
    let mut start = 0;
    while start < table.n_states() {
        let here = level(start);
        let end = (start..table.n_states())
            .find(|&step| level(step) != here)
            .unwrap_or_else(|| table.n_states());
        if here > 0 {
            let (left, upper) = panel.at((start as f64, top));
            let (right, lower) = panel.at((end as f64, bottom));
            let share = f64::from(here) / f64::from(N_SHADES);
            svg.cell([left, upper, right - left, lower - upper], &shade(share));
        }
        start = end;
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::figure::Source;

    fn draw(text: &str) -> Result<String, FigureError> {
        let sources = [Source {
            name: "runs/grasp.jsonl".into(),
            text: text.into(),
        }];
        let request = Request {
            sources: &sources,
            ..Request::default()
        };
        crate::figure::make(&ENTRY, &request)
    }

    #[test]
    fn the_title_names_the_file_and_the_value_of_its_segmentation() {
        let svg = draw("[0.9,0.1]\n[0.8,0.2]\n[0.1,0.9]\n").unwrap();
        assert!(svg.contains("grasp: F = 0.867"), "{svg}");
    }

    #[test]
    fn rows_that_are_no_probabilities_are_named_with_their_file() {
        let told = draw("[0.9,0.1]\n[0.8]\n").unwrap_err().to_string();
        assert!(
            told.contains("runs/grasp.jsonl: step 1 has 1 stages"),
            "{told}"
        );
        let told = draw("[0.9,1.5]\n").unwrap_err().to_string();
        assert!(told.contains("stage 1 at step 0 is 1.5"), "{told}");
    }
}
