//! One evaluation of one run, as learning curves are made of it.

use serde::{Deserialize, Serialize};

use super::FigureError;
use crate::config::RunConfig;
use crate::message::Event;

/// A row of a file of curves.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct CurveRow {
    /// The task's name.
    pub task: String,
    /// The method's name.
    pub method: String,
    /// Of the run.
    pub seed: u64,
    /// What else differs between groups of runs; may be empty.
    #[serde(default)]
    pub setting: String,
    /// Who answered, where that is told apart from the setting; may be empty.
    #[serde(default, skip_serializing_if = "String::is_empty")]
    pub teacher: String,
    /// Environment steps taken.
    pub step: u64,
    /// Answers so far, skips not counted.
    pub labels: u32,
    /// Answers that the run might have used, where that is told.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub budget: Option<u32>,
    /// Share of evaluation episodes with success, [0, 1].
    pub success_rate: f64,
    /// Mean task return of the evaluation episodes.
    pub return_mean: f64,
    /// Wall time of the run so far, seconds, where it is known.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub wall_s: Option<f64>,
}

/// The evaluations of a run as rows, one JSON object a line.
///
/// * `metrics` – the text of the run's `metrics.jsonl`, called `name` in errors
///
/// # Errors
/// When a line is not an event.
///
/// # Panics
/// Never: a row is plain values.
pub fn rows_of_run(config: &RunConfig, name: &str, metrics: &str) -> Result<String, FigureError> {
    let mut text = String::new();
    for (i, line) in metrics.lines().enumerate() {
        let event = serde_json::from_str(line).map_err(|error| FigureError::BadRow {
            source_name: name.to_owned(),
            line: i + 1,
            message: error.to_string(),
        })?;
        let Event::Evaluation(evaluation) = event else {
            continue;
        };
        let row = CurveRow {
            task: config.task.clone(),
            method: config.method.clone(),
            seed: config.seed,
            setting: String::new(),
            teacher: String::new(),
            step: evaluation.step,
            labels: evaluation.labels,
            budget: None,
            success_rate: evaluation.success_rate,
            return_mean: evaluation.return_mean,
            wall_s: None,
        };
        text.push_str(&serde_json::to_string(&row).expect("a row is plain values"));
        text.push('\n');
    }
    Ok(text)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_evaluations_of_a_run_become_rows_and_nothing_else_does() {
        let config = RunConfig {
            task: "window-open".into(),
            method: "pebble".into(),
            seed: 3,
            ..RunConfig::default()
        };
        let metrics = "{\"kind\":\"checkpointed\",\"step\":0,\"consumed_sequence\":0}\n\
            {\"kind\":\"evaluation\",\"step\":500,\"labels\":40,\"episodes\":10,\"success_rate\":0.5,\
            \"return_mean\":7.5,\"return_std\":1.0,\"reward_correlation\":null}\n";
        let text = rows_of_run(&config, "metrics.jsonl", metrics).unwrap();
        let row: CurveRow = serde_json::from_str(&text).unwrap();
        assert_eq!(
            (row.method.as_str(), row.seed, row.step),
            ("pebble", 3, 500)
        );
        assert_eq!(
            (row.labels, row.success_rate.to_bits()),
            (40, 0.5_f64.to_bits())
        );
        let told = rows_of_run(&config, "metrics.jsonl", "{}").unwrap_err();
        assert!(
            told.to_string().starts_with("metrics.jsonl, line 1: "),
            "{told}"
        );
    }
}
