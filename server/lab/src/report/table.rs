//! Comparisons as tables: Markdown for people, CSV for everything else.

use std::fmt::Write as _;

use domain::agreement::Estimate;

use super::score::{LEVELS, Reached, Score};
use super::{Comparison, Report};
use crate::figure::csv_cell;

pub(super) fn markdown(title: &str, report: &Report, comparisons: &[Comparison<'_>]) -> String {
    let mut text = format!("# {title}\n\n");
    let row = &report.results[0].row;
    let revisions = crate::figure::in_order_of_appearance(
        report.results.iter().map(|r| r.row.revision.as_str()),
    );
    let machines = crate::figure::in_order_of_appearance(
        report.results.iter().map(|r| r.row.machine.as_str()),
    );
    let episodes = row.setting_at("evaluation.episodes");
    let n_runs = report.results.len();
    line(
        &mut text,
        &format!(
            "{n_runs} runs; revision {}; {}. Success of a run: mean over its last ten evaluations of \
             {episodes} held-out episodes each, mean action. Intervals: 95 %, bootstrap over seeds. \
             Difference: first method minus this one, paired by seed.\n",
            revisions.join(", "),
            machines.join(", ")
        ),
    );
    for comparison in comparisons {
        let setting = match comparison.setting {
            "" => String::new(),
            setting => format!(", {setting}"),
        };
        line(&mut text, &format!("## {}{setting}\n", comparison.task));
        line(
            &mut text,
            "| method | success (IQM) | by seed | return (IQM) | area | first at 50 / 80 / 95 %: steps (answers) | difference | stage gap, chosen / pool | in one true stage |",
        );
        line(&mut text, "|---|---|---|---|---|---|---|---|---|");
        for scores in &comparison.methods {
            let runs = &scores.runs;
            let by_seed: Vec<String> = runs
                .iter()
                .map(|(_, score)| format!("{:.2}", score.success))
                .collect();
            let mean = |of: fn(&Score) -> Option<f64>| {
                let values: Vec<f64> = runs.iter().filter_map(|(_, s)| of(s)).collect();
                match values.len() {
                    0 => "–".to_owned(),
                    n => format!("{:.2}", values.iter().sum::<f64>() / n as f64),
                }
            };
            line(
                &mut text,
                &format!(
                    "| {} | {} | {} | {} | {} | {} | {} | {} | {} |",
                    scores.method,
                    estimate(scores.success, 2),
                    by_seed.join(" "),
                    estimate(scores.task_return, 0),
                    mean(|s| Some(s.area)),
                    levels(runs),
                    estimate(scores.behind_first, 2),
                    mean(|s| s.stage_gap_ratio),
                    mean(|s| s.same_stage),
                ),
            );
        }
        text.push('\n');
    }
    if !report.failed().is_empty() {
        line(&mut text, "## Runs that failed\n");
        for failed in report.failed() {
            if let crate::grid::Ended::Failed { reason } = &failed.row.ended {
                line(&mut text, &format!("- {}: {reason}", failed.row.run));
            }
        }
    }
    text
}

/// One line a run.
pub(super) fn csv(comparisons: &[Comparison<'_>]) -> String {
    let mut text = "task,setting,method,seed,success,return,area".to_owned();
    for level in LEVELS {
        let level = 100.0 * level;
        let _ = write!(text, ",steps_to_{level:.0},labels_to_{level:.0}"); // a string takes all
    }
    text.push_str(",stage_gap_ratio,same_stage\n");
    for comparison in comparisons {
        for scores in &comparison.methods {
            for (seed, score) in &scores.runs {
                let mut cells = vec![
                    comparison.task.to_owned(),
                    csv_cell(comparison.setting),
                    scores.method.to_owned(),
                    seed.to_string(),
                    score.success.to_string(),
                    score.task_return.to_string(),
                    score.area.to_string(),
                ];
                for reached in score.reached {
                    cells.push(reached.map(|r| r.step.to_string()).unwrap_or_default());
                    cells.push(reached.map(|r| r.labels.to_string()).unwrap_or_default());
                }
                for value in [score.stage_gap_ratio, score.same_stage] {
                    cells.push(value.map(|v| v.to_string()).unwrap_or_default());
                }
                line(&mut text, &cells.join(","));
            }
        }
    }
    text
}

fn line(text: &mut String, line: &str) {
    text.push_str(line);
    text.push('\n');
}

fn estimate(found: Option<Estimate>, digits: usize) -> String {
    found.map_or_else(
        || "–".to_owned(),
        |e| {
            let (lo, hi) = (e.interval.lo, e.interval.hi);
            format!("{:.digits$} [{lo:.digits$}, {hi:.digits$}]", e.value)
        },
    )
}

/// For each level the median over seeds of when it was first reached, or in how many it was.
fn levels(runs: &[(u64, Score)]) -> String {
    let of_level = |level: usize| {
        let mut reached: Vec<Reached> = runs.iter().filter_map(|(_, s)| s.reached[level]).collect();
        reached.sort_by_key(|r| r.step);
        let n = runs.len();
        if reached.len() * 2 <= n {
            return format!("{} of {n} seeds", reached.len());
        }
        // with seeds that never reach it last, the lower median of all
        let median = reached[(n - 1) / 2];
        format!("{} ({})", median.step, median.labels)
    };
    (0..LEVELS.len())
        .map(of_level)
        .collect::<Vec<_>>()
        .join(" / ")
}
