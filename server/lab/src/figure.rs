//! Figures: from rows of results to SVG text. The table of figures is this folder.
//!
//! A maker is a pure function: the same rows give the same bytes.

use domain::agreement::{interquartile_mean, mean};
use serde::de::DeserializeOwned;

use crate::config::{ConfigError, unknown};

mod abstract_mdp;
mod curves;
mod plot;
mod preference_fit;
mod preference_scatter;
mod preferences;
mod query_counts;
mod rows;
mod same_stage_bars;
mod seeds;
mod stage_gaps;
mod stage_map;
mod strips;
mod temporal_map;
mod timestep_classifier;

pub use curves::points as curve_points;
pub use preferences::{PreferenceRow, Preferred};
pub use rows::{CurveRow, rows_of_run};
pub use seeds::Between;
pub(crate) use seeds::LEAST_FOR_INTERVAL;
pub(crate) use stage_gaps::{GAPS, RATIOS};
pub use strips::{Shot, StripRow};

/// A file of results, read: JSON Lines.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Source {
    /// What to call it when something is wrong with it.
    pub name: String,
    /// What it holds.
    pub text: String,
}

/// What to draw, and how.
#[derive(Debug, Clone, Copy, Default)]
pub struct Request<'a> {
    /// The results.
    pub sources: &'a [Source],
    /// The column along the horizontal axis, where the figure leaves a choice.
    pub x: Option<&'a str>,
    /// The column along the vertical axis, where the figure leaves a choice.
    pub y: Option<&'a str>,
    /// How several seeds become one line, where the figure leaves a choice.
    pub center: Option<&'a str>,
    /// What a seed counts for between two of its points, in curves.
    pub between: Between,
}

/// A line of the registry.
pub struct FigureEntry {
    /// As users type it.
    pub name: &'static str,
    /// One sentence.
    pub summary: &'static str,
    /// The rows it draws, as users read it.
    pub input: &'static str,
    /// The choices it leaves, of `x`, `y` and `center`.
    pub choices: &'static [&'static str],
    /// Draws it.
    pub make: fn(&Request) -> Result<String, FigureError>,
}

/// All figures.
pub const FIGURES: &[FigureEntry] = &[
    curves::ENTRY,
    abstract_mdp::ENTRY,
    query_counts::ENTRY,
    preference_scatter::ENTRY,
    preference_fit::ENTRY,
    same_stage_bars::ENTRY,
    stage_map::ENTRY,
    stage_gaps::ENTRY,
    stage_gaps::RATIOS_ENTRY,
    temporal_map::ENTRY,
    strips::ENTRY,
    timestep_classifier::ENTRY,
];

/// Why a figure cannot be drawn.
#[derive(Debug, thiserror::Error)]
pub enum FigureError {
    /// No such figure.
    #[error(transparent)]
    Unknown(#[from] ConfigError),
    /// A line that is not a row of this figure.
    #[error("{source_name}, line {line}: {message}")]
    BadRow {
        /// The file.
        source_name: String,
        /// From 1.
        line: usize,
        /// What is wrong.
        message: String,
    },
    /// Nothing to draw.
    #[error("{figure} has no rows to draw; each is one JSON object a line: {input}")]
    NoRows {
        /// The figure.
        figure: &'static str,
        /// What it draws.
        input: &'static str,
    },
    /// A choice with a value that it does not know.
    #[error("--{choice} is '{value}', but must be one of: {known}")]
    BadChoice {
        /// Which.
        choice: &'static str,
        /// What was asked for.
        value: String,
        /// What there is.
        known: String,
    },
    /// A choice that this figure does not leave.
    #[error("{figure} leaves no choice of --{choice}")]
    NoChoice {
        /// The figure.
        figure: &'static str,
        /// Which.
        choice: &'static str,
    },
    /// Rows that contradict one another or do not fit together.
    #[error("{0}")]
    Misfit(String),
}

/// The figure of that name.
///
/// # Errors
/// Names the nearest right one.
pub fn find(name: &str) -> Result<&'static FigureEntry, FigureError> {
    let known = FIGURES.iter().map(|f| f.name);
    let found = FIGURES.iter().find(|f| f.name == name);
    Ok(found.ok_or_else(|| unknown("figure", name, known))?)
}

/// Draws a figure: an SVG document.
///
/// # Errors
/// When a row is not one, there are none, or a choice does not exist.
pub fn make(figure: &'static FigureEntry, request: &Request) -> Result<String, FigureError> {
    let choices = [
        ("x", request.x),
        ("y", request.y),
        ("center", request.center),
    ];
    for (choice, value) in choices {
        if value.is_some() && !figure.choices.contains(&choice) {
            return Err(FigureError::NoChoice {
                figure: figure.name,
                choice,
            });
        }
    }
    (figure.make)(request)
}

/// The rows of all sources, in order; empty lines are skipped.
fn read_rows<T: DeserializeOwned>(
    figure: &'static FigureEntry,
    sources: &[Source],
) -> Result<Vec<T>, FigureError> {
    let mut rows = Vec::new();
    for source in sources {
        for (i, line) in source.text.lines().enumerate() {
            if line.trim().is_empty() || is_of_another_kind(figure, line) {
                continue;
            }
            rows.push(
                serde_json::from_str(line).map_err(|error| FigureError::BadRow {
                    source_name: source.name.clone(),
                    line: i + 1,
                    message: error.to_string(),
                })?,
            );
        }
    }
    if rows.is_empty() {
        return Err(FigureError::NoRows {
            figure: figure.name,
            input: figure.input,
        });
    }
    Ok(rows)
}

/// Rows of an experiment's results say what they are; a figure passes over those of other kinds.
fn is_of_another_kind(figure: &FigureEntry, line: &str) -> bool {
    #[derive(serde::Deserialize)]
    struct Kind {
        kind: String,
    }
    let wanted = match figure.name {
        "curves" => "evaluation",
        "stage-gaps" => "session",
        _ => return false,
    };
    serde_json::from_str::<Kind>(line).is_ok_and(|row| row.kind != wanted)
}

/// The value of a choice: the first one where nothing was asked for.
fn choose<T: Copy>(
    choice: &'static str,
    asked: Option<&str>,
    known: &[(&str, T)],
) -> Result<T, FigureError> {
    let Some(asked) = asked else {
        return Ok(known[0].1);
    };
    let found = known.iter().find(|(name, _)| *name == asked);
    found.map(|(_, value)| *value).ok_or_else(|| {
        let names: Vec<&str> = known.iter().map(|(name, _)| *name).collect();
        FigureError::BadChoice {
            choice,
            value: asked.to_owned(),
            known: names.join(", "),
        }
    })
}

/// What makes one number of several.
type Center = fn(&[f64]) -> f64;

/// How several values become one: `mean`, or `iqm`, the mean of the middle half.
fn make_center(asked: Option<&str>) -> Result<Center, FigureError> {
    let known: [(&str, Center); 2] = [("mean", mean), ("iqm", interquartile_mean)];
    choose("center", asked, &known)
}

/// How a method is written in figures, reports and pages.
pub fn shown_method(name: &str) -> String {
    const ACRONYMS: [&str; 8] = [
        "stair", "pebble", "rune", "mrn", "rime", "qpa", "surf", "sac",
    ];
    let is_acronym = |word: &str| ACRONYMS.contains(&word);
    let words = name.split(['-', '_']).map(|word| {
        if is_acronym(word) {
            word.to_uppercase()
        } else {
            word.to_owned()
        }
    });
    words.collect::<Vec<_>>().join(" ")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_mistyped_figure_is_answered_with_the_nearest_one() {
        let told = find("curvse").err().map(|e| e.to_string()).unwrap();
        assert!(told.contains("curves"), "{told}");
    }

    #[test]
    fn acronyms_in_a_methods_name_are_written_as_such() {
        assert_eq!(shown_method("stair_isr"), "STAIR isr");
        assert_eq!(shown_method("surf_whole"), "SURF whole");
        assert_eq!(shown_method("uniform"), "uniform");
    }

    #[test]
    fn choices_that_do_not_exist_are_answered_with_those_that_do() {
        let request = Request {
            y: Some("height"),
            ..Request::default()
        };
        let told = make(find("curves").unwrap(), &request).unwrap_err();
        assert!(
            told.to_string().contains("success_rate, return_mean"),
            "{told}"
        );
    }
}
