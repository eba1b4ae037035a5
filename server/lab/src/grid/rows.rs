//! What a run of an experiment left: one file of JSON Lines, first the run itself, then what it
//! said.

use serde::{Deserialize, Serialize};
use serde_json::Value;

use super::PlannedRun;
use crate::config::RunConfig;
use crate::message::{Evaluation, Event, SessionOffered};

/// A run that ended, on the first line of its file.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct RunRow {
    /// As the plan names it.
    pub run: String,
    /// Its place in the plan, which decides the order in tables.
    pub index: usize,
    /// The task's name.
    pub task: String,
    /// The method's name.
    pub method: String,
    /// The scripted teacher.
    pub teacher: String,
    /// In what it differs beside task, method and seed; may be empty.
    pub setting: String,
    /// Of every random stream.
    pub seed: u64,
    /// All settings, resolved.
    pub config: Value,
    /// Of the program.
    pub revision: String,
    /// Processor and number of cores.
    pub machine: String,
    /// How it ended.
    #[serde(flatten)]
    pub ended: Ended,
}

/// How a run ended.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(tag = "outcome", rename_all = "snake_case")]
pub enum Ended {
    /// All steps taken.
    Finished {
        /// Fingerprint of the final weights.
        weights: String,
        /// Seconds of wall time, pauses between resumptions left out.
        wall_s: f64,
    },
    /// It could not go on.
    Failed {
        /// What it said.
        reason: String,
    },
}

/// A file of results, read.
#[derive(Debug, Clone, PartialEq)]
pub struct RunResult {
    /// Its first line.
    pub row: RunRow,
    /// In order of steps.
    pub evaluations: Vec<Evaluation>,
    /// In order of sessions.
    pub sessions: Vec<SessionOffered>,
}

/// Why results cannot be read or put together.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum ResultError {
    /// A line that is none.
    #[error("{file}, line {line}: {message}")]
    BadRow {
        /// The file.
        file: String,
        /// From 1.
        line: usize,
        /// What is wrong.
        message: String,
    },
    /// Results that do not go with one another, or with the plan.
    #[error("{0}")]
    Misfit(String),
}

impl RunRow {
    /// Of a planned run that ended.
    ///
    /// # Panics
    /// Never: settings are plain values.
    pub fn new(plan: &PlannedRun, revision: &str, machine: &str, ended: Ended) -> Self {
        let config = &plan.config;
        Self {
            run: plan.name.clone(),
            index: plan.index,
            task: config.task.clone(),
            method: config.method.clone(),
            teacher: plan.teacher.clone(),
            setting: plan.setting.clone(),
            seed: config.seed,
            config: json_of(config),
            revision: revision.to_owned(),
            machine: machine.to_owned(),
            ended,
        }
    }

    /// Whether it went to its end.
    pub fn is_finished(&self) -> bool {
        matches!(self.ended, Ended::Finished { .. })
    }

    /// The first setting, dotted, in which it differs from the plan.
    pub fn first_difference(&self, plan: &PlannedRun) -> Option<String> {
        first_difference("", &self.config, &json_of(&plan.config))
    }

    /// A setting by its path, `feedback.budget`.
    pub fn setting_at(&self, path: &str) -> &Value {
        path.split('.').fold(&self.config, |at, key| &at[key])
    }
}

fn json_of(config: &RunConfig) -> Value {
    serde_json::to_value(config).expect("settings are plain values")
}

fn first_difference(path: &str, ours: &Value, theirs: &Value) -> Option<String> {
    let (Value::Object(a), Value::Object(b)) = (ours, theirs) else {
        let is_same = match (ours.as_f64(), theirs.as_f64()) {
            (Some(a), Some(b)) => a.to_bits() == b.to_bits(),
            _ => ours == theirs,
        };
        return (!is_same).then(|| path.trim_start_matches('.').to_owned());
    };
    let keys = a.keys().chain(b.keys().filter(|key| !a.contains_key(*key)));
    let mut below = keys.filter_map(|key| {
        let of = |object: &serde_json::Map<String, Value>| {
            object.get(key).cloned().unwrap_or(Value::Null)
        };
        first_difference(&format!("{path}.{key}"), &of(a), &of(b))
    });
    below.next()
}

impl RunResult {
    /// The lines to keep of a run: itself, then evaluations and sessions from its metrics.
    ///
    /// # Errors
    /// When a line of the metrics is no event.
    ///
    /// # Panics
    /// Never: rows are plain values.
    pub fn write(row: &RunRow, name: &str, metrics: &str) -> Result<String, ResultError> {
        let mut text = serde_json::to_string(row).expect("a row is plain values") + "\n";
        for (i, line) in metrics.lines().enumerate() {
            let event: Event = serde_json::from_str(line).map_err(|e| bad_row(name, i, &e))?;
            if matches!(event, Event::Evaluation(_) | Event::SessionOffered(_)) {
                text.push_str(line);
                text.push('\n');
            }
        }
        Ok(text)
    }

    /// Reads what [`RunResult::write`] wrote.
    ///
    /// # Errors
    /// The first line that is not a row.
    pub fn read(name: &str, text: &str) -> Result<Self, ResultError> {
        let mut lines = text.lines().enumerate();
        let (_, first) = lines.next().ok_or_else(|| ResultError::BadRow {
            file: name.to_owned(),
            line: 1,
            message: "it is empty".into(),
        })?;
        let row = serde_json::from_str(first).map_err(|e| bad_row(name, 0, &e))?;
        let mut result = Self {
            row,
            evaluations: Vec::new(),
            sessions: Vec::new(),
        };
        for (i, line) in lines {
            match serde_json::from_str(line).map_err(|e| bad_row(name, i, &e))? {
                Event::Evaluation(evaluation) => result.evaluations.push(evaluation),
                Event::SessionOffered(session) => result.sessions.push(session),
                _ => {}
            }
        }
        Ok(result)
    }
}

fn bad_row(name: &str, index: usize, error: &serde_json::Error) -> ResultError {
    ResultError::BadRow {
        file: name.to_owned(),
        line: index + 1,
        message: error.to_string(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::grid::FileText;

    fn plan(budget: u32) -> PlannedRun {
        let text = format!(
            "title = ''\nsummary = ''\n[[grid]]\ntasks = ['go-fetch-return']\nmethods = ['stair']\n\
             set = ['feedback.budget={budget}']\n"
        );
        let file = FileText {
            name: "x",
            text: &text,
        };
        file.plan(false).unwrap().remove(0)
    }

    #[test]
    fn a_result_reads_back_and_knows_in_what_it_differs() {
        let ended = Ended::Finished {
            weights: "abc".into(),
            wall_s: 2.5,
        };
        let row = RunRow::new(&plan(40), "0123", "two cores", ended);
        let metrics = "{\"kind\":\"checkpointed\",\"step\":0,\"consumed_sequence\":0}\n\
            {\"kind\":\"evaluation\",\"step\":500,\"labels\":40,\"episodes\":10,\"success_rate\":0.5,\
            \"return_mean\":7.5,\"return_std\":1.0,\"reward_correlation\":null}\n";
        let text = RunResult::write(&row, "metrics.jsonl", metrics).unwrap();
        let result = RunResult::read("x.jsonl", &text).unwrap();
        assert_eq!(result.row, row);
        assert_eq!(result.evaluations.len(), 1);
        assert_eq!(row.first_difference(&plan(40)), None);
        let other = row.first_difference(&plan(41)).unwrap();
        assert_eq!(other, "feedback.budget");
        assert_eq!(row.setting_at("feedback.budget"), &Value::from(40));
    }

    #[test]
    fn a_broken_line_is_named() {
        let told = RunResult::read("x.jsonl", "{}\n").unwrap_err().to_string();
        assert!(told.starts_with("x.jsonl, line 1: "), "{told}");
        let told = RunResult::read("x.jsonl", "").unwrap_err().to_string();
        assert!(told.contains("empty"), "{told}");
    }
}
