//! What an experiment came to: curves, stage gaps and tables, from files of results.
//!
//! A report is a pure function: the same results give the same bytes.

use domain::agreement::{Bootstrap, Estimate, interquartile_mean};

use crate::figure::{self, CurveRow, FigureError, Request, SessionRow, Source};
use crate::grid::{Axis, ResultError, RunResult};

mod score;
mod table;

pub use score::Score;

/// How results are put together.
#[derive(Debug, Clone, Copy, Default)]
pub struct ReportSettings {
    /// What runs along the horizontal axis of curves.
    pub x: Axis,
    /// Whether rows of several revisions may stand beside one another.
    pub may_mix_revisions: bool,
    /// Whether methods may have run on different tasks, settings or seeds.
    pub may_be_partial: bool,
}

/// A file of a report.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct ReportFile {
    /// Its name, without a folder.
    pub name: &'static str,
    /// What it holds.
    pub text: String,
}

/// Why there is no report.
#[derive(Debug, thiserror::Error)]
pub enum ReportError {
    /// Results that are none, or do not go together.
    #[error(transparent)]
    Result(#[from] ResultError),
    /// Something that cannot be drawn.
    #[error(transparent)]
    Figure(#[from] FigureError),
}

/// Runs that are compared with one another: one task in one setting.
#[derive(Debug, Clone, PartialEq)]
pub struct Comparison<'a> {
    /// The task's name.
    pub task: &'a str,
    /// In what its runs differ from those of other comparisons; may be empty.
    pub setting: &'a str,
    /// In the order of the methods' registry.
    pub methods: Vec<MethodScores<'a>>,
}

/// A method's runs in a comparison.
#[derive(Debug, Clone, PartialEq)]
pub struct MethodScores<'a> {
    /// The method's name.
    pub method: &'a str,
    /// By seed.
    pub runs: Vec<(u64, Score)>,
    /// Interquartile mean of the runs' success, with its interval.
    pub success: Option<Estimate>,
    /// The same of their return.
    pub task_return: Option<Estimate>,
    /// Mean of (first method − this one) in success over the seeds that both have.
    pub behind_first: Option<Estimate>,
}

/// Results that go together.
pub struct Report {
    results: Vec<RunResult>,
    failed: Vec<RunResult>,
    settings: ReportSettings,
}

impl Report {
    /// Takes results in; failed runs are set aside and told.
    ///
    /// # Errors
    /// [`ResultError::Misfit`] where no run finished; where revisions, budgets, lengths or
    /// evaluations of runs that are compared differ; where methods ran on different tasks,
    /// settings or seeds.
    pub fn new(results: Vec<RunResult>, settings: ReportSettings) -> Result<Self, ResultError> {
        let (results, failed): (Vec<_>, Vec<_>) = results
            .into_iter()
            .partition(|result| result.row.is_finished());
        if results.is_empty() {
            let why = match failed.first() {
                Some(_) => "every run failed",
                None => "there are no results",
            };
            return Err(ResultError::Misfit(format!("nothing to report: {why}")));
        }
        let mut report = Self {
            results,
            failed,
            settings,
        };
        report.results.sort_by_key(|result| result.row.index);
        report.check_revisions()?;
        report.check_comparable()?;
        report.check_complete()?;
        Ok(report)
    }

    fn check_revisions(&self) -> Result<(), ResultError> {
        let first = &self.results[0].row;
        let other = self
            .results
            .iter()
            .find(|r| r.row.revision != first.revision);
        match other {
            Some(other) if !self.settings.may_mix_revisions => Err(ResultError::Misfit(format!(
                "{} is of revision {}, but {} of {}; run the older ones again, or say \
                     --mix-revisions to put them together all the same",
                first.run, first.revision, other.row.run, other.row.revision
            ))),
            _ => Ok(()),
        }
    }

    /// Within one task and setting, methods must have had the same means.
    fn check_comparable(&self) -> Result<(), ResultError> {
        const SAME: [&str; 2] = ["training.total_steps", "evaluation.episodes"];
        for (task, setting) in self.pairs() {
            let mut rows = self.of_pair(task, setting).map(|result| &result.row);
            let Some(first) = rows.next() else { continue };
            let mut asks = (first.method != "sac").then_some(first);
            for row in rows {
                for path in SAME {
                    differ(first, row, path)?;
                }
                if row.method != "sac" {
                    if let Some(first) = asks {
                        differ(first, row, "feedback.budget")?;
                    }
                    asks = asks.or(Some(row));
                }
            }
        }
        Ok(())
    }

    fn check_complete(&self) -> Result<(), ResultError> {
        if self.settings.may_be_partial {
            return Ok(());
        }
        let methods = self.methods();
        for (task, setting) in self.pairs() {
            for method in &methods {
                if !self
                    .of_pair(task, setting)
                    .any(|result| result.row.method == *method)
                {
                    let setting = match setting {
                        "" => String::new(),
                        setting => format!(" ({setting})"),
                    };
                    return Err(ResultError::Misfit(format!(
                        "{method} has no finished run on {task}{setting}, where others have; \
                         finish the experiment, or say --partial to report what there is"
                    )));
                }
            }
        }
        Ok(())
    }

    /// All comparisons, by task and setting.
    pub fn comparisons(&self) -> Vec<Comparison<'_>> {
        let methods = self.methods();
        let compare = |(task, setting): (&'_ str, &'_ str)| {
            let mut compared: Vec<MethodScores<'_>> = Vec::new();
            for method in &methods {
                let of_method = self.results.iter().filter(|r| {
                    let row = &r.row;
                    (row.task.as_str(), row.setting.as_str(), row.method.as_str())
                        == (task, setting, *method)
                });
                let runs: Vec<(u64, Score)> = of_method
                    .map(|result| (result.row.seed, Score::of(result)))
                    .collect();
                if !runs.is_empty() {
                    let first = compared.first();
                    compared.push(MethodScores::new(method, runs, first));
                }
            }
            compared
        };
        let pairs = self.pairs().into_iter();
        pairs
            .map(|(task, setting)| Comparison {
                task,
                setting,
                methods: compare((task, setting)),
            })
            .collect()
    }

    /// The runs that could not go on, with what they said.
    pub fn failed(&self) -> &[RunResult] {
        &self.failed
    }

    /// Curves and stage gaps as SVG with their points as CSV, and tables as Markdown and CSV.
    ///
    /// # Errors
    /// When a run has two values at one step.
    pub fn files(&self, title: &str) -> Result<Vec<ReportFile>, FigureError> {
        let curves = [Source {
            name: "results".into(),
            text: self.curve_rows(),
        }];
        let sessions = [Source {
            name: "results".into(),
            text: self.session_rows(),
        }];
        let request = |sources, x, y| Request {
            sources,
            x,
            y,
            center: Some("iqm"),
        };
        let x = Some(self.settings.x.column());
        let success = request(&curves, x, Some("success_rate"));
        let returns = request(&curves, x, Some("return_mean"));
        let mut files = Vec::new();
        let mut add = |name, text| files.push(ReportFile { name, text });
        let entry = figure::find("curves")?;
        add("success.svg", figure::make(entry, &success)?);
        add("success.csv", figure::list(entry, &success)?);
        add("return.svg", figure::make(entry, &returns)?);
        add("return.csv", figure::list(entry, &returns)?);
        let entry = figure::find("stage-gaps")?;
        let columns = [
            ("stage_gap_chosen", "stage-gap.svg", "stage-gap.csv"),
            (
                "stage_gap_ratio",
                "stage-gap-ratio.svg",
                "stage-gap-ratio.csv",
            ),
            ("same_stage_chosen", "same-stage.svg", "same-stage.csv"),
        ];
        for (y, svg, csv) in columns {
            if self.has_sessions_with(y) {
                let request = request(&sessions, None, Some(y));
                add(svg, figure::make(entry, &request)?);
                add(csv, figure::list(entry, &request)?);
            }
        }
        let comparisons = self.comparisons();
        add("report.md", table::markdown(title, self, &comparisons));
        add("runs.csv", table::csv(&comparisons));
        Ok(files)
    }

    fn has_sessions_with(&self, column: &str) -> bool {
        let mut sessions = self.results.iter().flat_map(|r| &r.sessions);
        sessions.any(|s| match column {
            "same_stage_chosen" => s.same_stage_chosen.is_some(),
            _ => s.stage_gap_chosen.is_some() && s.stage_gap_pool.is_some_and(|gap| gap > 0.0),
        })
    }

    fn curve_rows(&self) -> String {
        let rows = self.results.iter().flat_map(|result| {
            result.evaluations.iter().map(|e| {
                json_line(&CurveRow {
                    task: result.row.task.clone(),
                    method: result.row.method.clone(),
                    seed: result.row.seed,
                    setting: result.row.setting.clone(),
                    step: e.step,
                    labels: e.labels,
                    success_rate: e.success_rate,
                    return_mean: e.return_mean,
                    wall_s: None,
                })
            })
        });
        rows.collect()
    }

    fn session_rows(&self) -> String {
        let rows = self.results.iter().flat_map(|result| {
            result.sessions.iter().map(|s| {
                json_line(&SessionRow {
                    task: result.row.task.clone(),
                    method: result.row.method.clone(),
                    seed: result.row.seed,
                    setting: result.row.setting.clone(),
                    session: s.session,
                    step: s.step,
                    stage_gap_chosen: s.stage_gap_chosen,
                    stage_gap_pool: s.stage_gap_pool,
                    same_stage_chosen: s.same_stage_chosen,
                })
            })
        });
        rows.collect()
    }

    /// Task and setting of each comparison, in order of appearance.
    fn pairs(&self) -> Vec<(&str, &str)> {
        let all = self.results.iter();
        figure::in_order_of_appearance(all.map(|r| (r.row.task.as_str(), r.row.setting.as_str())))
    }

    fn of_pair<'a>(
        &'a self,
        task: &'a str,
        setting: &'a str,
    ) -> impl Iterator<Item = &'a RunResult> {
        let is_of_pair = move |r: &&RunResult| r.row.task == task && r.row.setting == setting;
        self.results.iter().filter(is_of_pair)
    }

    /// In the registry's order.
    fn methods(&self) -> Vec<&str> {
        let all = self.results.iter().map(|r| r.row.method.as_str());
        let mut methods = figure::in_order_of_appearance(all);
        let rank = |method: &str| {
            let methods = crate::method::METHODS;
            methods.iter().position(|m| m.name == method)
        };
        methods.sort_by_key(|method| rank(method).unwrap_or(usize::MAX));
        methods
    }
}

impl<'a> MethodScores<'a> {
    fn new(method: &'a str, runs: Vec<(u64, Score)>, first: Option<&MethodScores<'_>>) -> Self {
        let center = |of: fn(&Score) -> f64| {
            let values: Vec<f64> = runs.iter().map(|(_, score)| of(score)).collect();
            Bootstrap::default().center(&values, interquartile_mean)
        };
        let behind_first = first.and_then(|first| {
            let pairs: Vec<(f64, f64)> = runs
                .iter()
                .filter_map(|(seed, score)| {
                    let theirs = first.runs.iter().find(|(s, _)| s == seed)?;
                    Some((theirs.1.success, score.success))
                })
                .collect();
            Bootstrap::default().paired_difference(&pairs)
        });
        Self {
            method,
            success: center(|score| score.success),
            task_return: center(|score| score.task_return),
            runs,
            behind_first,
        }
    }
}

fn differ(
    first: &crate::grid::RunRow,
    other: &crate::grid::RunRow,
    path: &str,
) -> Result<(), ResultError> {
    let (a, b) = (first.setting_at(path), other.setting_at(path));
    if a == b {
        return Ok(());
    }
    Err(ResultError::Misfit(format!(
        "{} has {path} = {a}, but {} has {b}: they cannot be compared; report them apart",
        first.run, other.run
    )))
}

fn json_line<T: serde::Serialize>(row: &T) -> String {
    serde_json::to_string(row).expect("a row is plain values") + "\n"
}

#[cfg(test)]
mod tests;
