//! The numbers of a report for people.

use domain::agreement::{Bootstrap, interquartile_mean, mean};

use super::budgets::Budgets;
use super::comparable::{counted, revisions};
use super::differences::differences;
use super::group::{Group, groups, members};
use super::numbers::{SHARES, add, center, estimate, number, told_of};
use super::score::{
    Learned, Reached, area, gap_auc, gap_ratio, learned, oracle_agreement, reached, same_stage,
    same_stage_pool, score, symmetric_gap_auc,
};
use super::{RunResult, Runs};
use crate::words::thousands;

/// The whole report as Markdown.
pub(super) fn report(runs: &Runs) -> String {
    let mut text = String::from(
        "# Report\n\nA run's score is the mean of its last ten evaluations, each of the same held-out episodes. \
         Steps: environment steps of training. \
         Over seeds: interquartile mean, from three seeds on with its 95 % bootstrap interval, and the plain mean of scores. Area: mean height of the curve. \
         Intervals over few seeds are narrower than they say: of five they hold the truth in 84 of 100 cases. \
         Reached: the first evaluation with that success, median over seeds, the later of two in the middle; \
         one that never got there comes after all that did.\n",
    );
    let groups = groups(runs);
    let left_out = Budgets::of(&runs.runs.iter().collect::<Vec<_>>()).left_out;
    let mut tasks: Vec<&str> = groups.iter().map(|group| group.task.as_str()).collect();
    tasks.dedup();
    for task in tasks {
        let of_task: Vec<&Group> = groups.iter().filter(|group| group.task == task).collect();
        add(&mut text, format!("\n## {task}\n"));
        scores(&mut text, runs, &of_task);
        left_out_by_budget(&mut text, &left_out, task);
        differences(&mut text, runs, &of_task);
        learning(&mut text, runs, &of_task);
        alignment(&mut text, runs, &of_task);
        agreement(&mut text, runs, &of_task);
    }
    over_all_tasks(&mut text, runs, &groups);
    failures(&mut text, runs);
    origin(&mut text, runs);
    text
}

fn scores(text: &mut String, runs: &Runs, groups: &[&Group]) {
    text.push_str(
        "\n| method | setting | steps | seeds | score | mean | by seed | area | labels (steps) to 50 % | to 80 % | to 95 % |\n\
         |---|---|---:|---:|---|---:|---|---|---|---|---|\n",
    );
    for group in groups {
        let members = members(runs, group);
        let of = |f: fn(&RunResult) -> f64| members.iter().map(|run| f(run)).collect::<Vec<_>>();
        let is_rate = members.iter().all(|run| run.end.has_success);
        let scores = of(|run| score(run).value);
        let of_seed = |(run, value): (&&RunResult, &f64)| {
            format!("{}: {}", run.key.seed, number(*value, is_rate))
        };
        let by_seed: Vec<String> = members.iter().zip(&scores).map(of_seed).collect();
        let steps = members.first().map_or(0, |run| run.end.total_steps); // all alike in a setting
        let fewest = members.iter().map(|run| score(run).n_evaluations).min();
        let note = match fewest {
            Some(n) if n < 10 => format!(" (last {n})"),
            _ => String::new(),
        };
        add(
            text,
            format!(
                "| {} | {} | {} | {} | {}{note} | {} | {} | {} |",
                group.method,
                or_dash(&group.setting),
                thousands(steps),
                members.len(),
                center(&scores, is_rate),
                number(mean(&scores), is_rate),
                by_seed.join(", "),
                center(&of(area), is_rate)
            ),
        );
        for share in SHARES {
            let when: Vec<Option<Reached>> =
                members.iter().map(|run| reached(run, share)).collect();
            add(
                text,
                format!(" {} |", if is_rate { told(&when) } else { "–".into() }),
            );
        }
        text.push('\n');
    }
}

/// Settings of a task that the figure by budget has no place for.
fn left_out_by_budget(text: &mut String, left_out: &[Group], task: &str) {
    let of_task = left_out.iter().filter(|group| group.task == task);
    let names: Vec<String> = of_task.map(Group::named).collect();
    if names.is_empty() {
        return;
    }
    add(
        text,
        format!(
            "\nLeft out of the figure by budget, which takes methods with several budgets and one setting for each: {}.\n",
            names.join(", ")
        ),
    );
}

/// `24 (12000), 4 of 5 seeds`; the later of two in the middle.
fn told(when: &[Option<Reached>]) -> String {
    let mut there: Vec<Reached> = when.iter().flatten().copied().collect();
    if there.is_empty() {
        return "never".into();
    }
    there.sort_by_key(|reached| reached.step);
    let n = if there.len() < when.len() {
        format!(", {} of {} seeds", there.len(), when.len())
    } else {
        String::new()
    };
    match there.get(when.len() / 2) {
        Some(middle) => format!("{} ({}){n}", middle.labels, middle.step),
        None => format!("never, but {} of {} seeds", there.len(), when.len()),
    }
}

/// Whether anything was learned at all.
fn learning(text: &mut String, runs: &Runs, groups: &[&Group]) {
    let mut lines = String::new();
    for group in groups {
        let found: Vec<(u64, Learned)> = members(runs, group)
            .into_iter()
            .filter_map(|run| Some((run.key.seed, learned(run)?)))
            .collect();
        if found.is_empty() {
            continue;
        }
        let of = |f: fn(&Learned) -> f64| {
            let values = found.iter().map(|(_, learned)| f(learned));
            mean(&values.collect::<Vec<_>>())
        };
        let by_seed: Vec<String> = found
            .iter()
            .map(|(seed, learned)| {
                let told = estimate(&learned.difference, false);
                let is_sure = !learned.difference.interval.contains(0.0);
                if is_sure {
                    format!("{seed}: **{told}**")
                } else {
                    format!("{seed}: {told}")
                }
            })
            .collect();
        add(
            &mut lines,
            format!(
                "| {} | {} | {} | {:.0} | {:.0} | {} |\n",
                group.method,
                or_dash(&group.setting),
                found[0].1.n_episodes,
                of(|learned| learned.before),
                of(|learned| learned.after),
                by_seed.join("; ")
            ),
        );
    }
    if !lines.is_empty() {
        text.push_str(
            "\nTask returns of the same held-out episodes before the first step and after the last, mean over seeds; \
             their difference by seed, with the 95 % bootstrap interval over episodes, bold where it excludes 0:\n\n\
             | method | setting | episodes | before | after | difference |\n|---|---|---:|---:|---:|---|\n",
        );
        text.push_str(&lines);
    }
}

/// How far chosen pairs and candidates lie within a stage, and what the stage gap knows of it.
fn alignment(text: &mut String, runs: &Runs, groups: &[&Group]) {
    let mut lines = String::new();
    for group in groups {
        let members = members(runs, group);
        let of = |f: fn(&RunResult) -> Option<f64>| -> Vec<f64> {
            members.iter().filter_map(|run| f(run)).collect()
        };
        let columns = [
            same_stage,
            same_stage_pool,
            gap_ratio,
            gap_auc,
            symmetric_gap_auc,
        ]
        .map(of);
        if columns.iter().all(Vec::is_empty) {
            continue;
        }
        add(
            &mut lines,
            format!(
                "| {} | {} | {} |\n",
                group.method,
                or_dash(&group.setting),
                columns.map(|values| center(&values, true)).join(" | ")
            ),
        );
    }
    if !lines.is_empty() {
        text.push_str(
            "\nMean over the sessions of a run in which its method chose. The last columns are the probability that of two \
             candidates, one in one true stage and one not, the former has the smaller stage gap, as the method measures it and as the mean of both directions: at ½ the gap says nothing of stages.\n\n\
             | method | setting | chosen pairs in one true stage | candidates in one | stage gap, chosen by candidates | stages told by the gap | by both directions |\n\
             |---|---|---|---|---|---|---|\n",
        );
        text.push_str(&lines);
    }
}

/// How often teachers erred, where any did.
fn agreement(text: &mut String, runs: &Runs, groups: &[&Group]) {
    let of = |group: &&Group| -> Vec<f64> {
        let members = members(runs, group);
        members
            .iter()
            .filter_map(|run| oracle_agreement(run))
            .collect()
    };
    let shares: Vec<(&&Group, Vec<f64>)> = groups.iter().map(|group| (group, of(group))).collect();
    if shares
        .iter()
        .flat_map(|(_, of)| of)
        .all(|share| *share >= 1.0)
    {
        return;
    }
    text.push_str(
        "\nAnswers that the task reward gives too, of those that prefer one of a pair that differs in it:\n\n\
         | method | setting | share |\n|---|---|---|\n",
    );
    for (group, shares) in shares.iter().filter(|(_, shares)| !shares.is_empty()) {
        let (setting, share) = (or_dash(&group.setting), center(shares, true));
        add(
            text,
            format!("| {} | {setting} | {share} |\n", group.method),
        );
    }
}

/// Methods that are there on every task that is solved or not, with as many strata as tasks, all of
/// the same seeds.
fn over_all_tasks(text: &mut String, runs: &Runs, groups: &[Group]) {
    let solved = |run: &RunResult| run.end.has_success;
    let mut tasks: Vec<&str> = Vec::new();
    for run in runs.runs.iter().filter(|run| solved(run)) {
        if !tasks.contains(&run.key.task.as_str()) {
            tasks.push(&run.key.task);
        }
    }
    if tasks.len() < 2 {
        return;
    }
    add(
        text,
        format!(
            "\n## All {} tasks\n\nOf each method the seeds that it has on every one of these tasks, so that tasks weigh alike; \
             a dash where it has none. Seeds are drawn again within each task (stratified).\n\n\
             | method | setting | score |\n|---|---|---|\n",
            tasks.len()
        ),
    );
    for group in groups.iter().filter(|group| group.task == tasks[0]) {
        let on_tasks: Vec<Vec<&RunResult>> = tasks
            .iter()
            .map(|task| {
                let on_task = Group {
                    task: (*task).to_owned(),
                    ..group.clone()
                };
                members(runs, &on_task)
            })
            .collect();
        if on_tasks.iter().any(Vec::is_empty) {
            continue;
        }
        let strata = scores_of_common_seeds(&on_tasks);
        let n_seeds = strata.first().map_or(0, Vec::len);
        let found = Bootstrap::default().stratified(&strata, interquartile_mean);
        let told = found.map_or_else(|| "–".into(), |found| told_of(n_seeds, &found, true));
        add(
            text,
            format!(
                "| {} | {} | {told} |\n",
                group.method,
                or_dash(&group.setting)
            ),
        );
    }
}

/// Scores on each task, of the seeds that are there on all of them.
fn scores_of_common_seeds(on_tasks: &[Vec<&RunResult>]) -> Vec<Vec<f64>> {
    let is_common = |seed: u64| {
        let mut tasks = on_tasks.iter();
        tasks.all(|members| members.iter().any(|run| run.key.seed == seed))
    };
    let on_task = |members: &Vec<&RunResult>| {
        let common = members.iter().filter(|run| is_common(run.key.seed));
        common.map(|run| score(run).value).collect::<Vec<f64>>()
    };
    on_tasks.iter().map(on_task).collect()
}

fn failures(text: &mut String, runs: &Runs) {
    if runs.failed.is_empty() {
        return;
    }
    text.push_str("\n## Failed\n\n");
    for (key, reason) in &runs.failed {
        add(text, format!("- {}: {reason}\n", key.name()));
    }
}

/// Where the rows are from.
fn origin(text: &mut String, runs: &Runs) {
    let mut machines: Vec<&str> = runs
        .runs
        .iter()
        .map(|run| run.end.machine.as_str())
        .collect();
    machines.sort_unstable();
    machines.dedup();
    let wall: f64 = runs.runs.iter().map(|run| run.end.wall_s).sum();
    let revisions = revisions(runs.runs.iter());
    add(
        text,
        format!(
            "\n## Origin\n\n{} runs, {:.1} hours of them added up. Machine: {}. Revision: {}.{}\n",
            runs.runs.len(),
            wall / 3_600.0,
            machines.join("; "),
            counted(&revisions),
            if revisions.len() > 1 {
                " Rows of different revisions stand side by side; numbers may differ for that alone."
            } else {
                ""
            }
        ),
    );
}

fn or_dash(text: &str) -> &str {
    if text.is_empty() { "–" } else { text }
}
