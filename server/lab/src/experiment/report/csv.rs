//! The numbers of a report for programs.

use super::Runs;
use super::group::{groups, members};
use super::numbers::{SHARES, add};
use super::score::{
    area, gap_auc, gap_ratio, oracle_agreement, reached, same_stage, same_stage_pool, score,
    symmetric_gap_auc, symmetric_gap_ratio,
};

/// Every run in a line.
pub(super) fn scores(runs: &Runs) -> String {
    let mut text = String::from(
        "task,method,teacher,setting,seed,score,area,labels,total_steps,same_stage,same_stage_pool,gap_ratio,gap_auc,symmetric_gap_ratio,symmetric_gap_auc,oracle_agreement,\
         labels_to_50,steps_to_50,labels_to_80,steps_to_80,labels_to_95,steps_to_95,revision,settings,wall_s\n",
    );
    for group in groups(runs) {
        for run in members(runs, &group) {
            let key = &run.key;
            let optional = |value: Option<f64>| value.map_or_else(String::new, |v| v.to_string());
            add(
                &mut text,
                format!(
                    "{},{},{},\"{}\",{},{},{},{},{},{},{},{},{},{},{},{}",
                    key.task,
                    key.method,
                    key.teacher,
                    key.setting.replace('"', "\"\""),
                    key.seed,
                    score(run).value,
                    area(run),
                    run.end.labels,
                    run.end.total_steps,
                    optional(same_stage(run)),
                    optional(same_stage_pool(run)),
                    optional(gap_ratio(run)),
                    optional(gap_auc(run)),
                    optional(symmetric_gap_ratio(run)),
                    optional(symmetric_gap_auc(run)),
                    optional(oracle_agreement(run))
                ),
            );
            for share in SHARES {
                let when = reached(run, share).filter(|_| run.end.has_success);
                let told = when.map_or_else(|| ",".into(), |r| format!("{},{}", r.labels, r.step));
                add(&mut text, format!(",{told}"));
            }
            let end = &run.end;
            add(
                &mut text,
                format!(",{},{},{:.0}\n", end.revision, end.settings, end.wall_s),
            );
        }
    }
    text
}
