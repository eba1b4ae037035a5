//! The numbers of a report for people.

use domain::agreement::{Bootstrap, interquartile_mean, mean};

use super::comparable::{counted, revisions};
use super::group::{Group, groups, members};
use super::numbers::{SHARES, add, center, estimate, number, told_of};
use super::score::{
    Learned, Reached, area, gap_auc, gap_ratio, learned, oracle_agreement, reached, same_stage,
    same_stage_pool, score, symmetric_gap_auc,
};
use super::{RunResult, Runs};

/// Pairs of seeds from which on a difference may be called one. With fewer, differences of pure
/// chance have one sign in more than one case of twenty (2 · ½ⁿ), and an interval drawn from
/// them leaves 0 out then.
const LEAST_TO_BE_SURE: usize = 6;

/// The whole report as Markdown.
pub(super) fn report(runs: &Runs) -> String {
    let mut text = String::from(
        "# Report\n\nA run's score is the mean of its last ten evaluations, each of the same held-out episodes. \
         Over seeds: interquartile mean, from three seeds on with its 95 % bootstrap interval. Area: mean height of the curve. \
         Intervals over few seeds are narrower than they say: of five they hold the truth in 84 of 100 cases. \
         Reached: the first evaluation with that success, median over seeds; one that never got there comes after all that did.\n",
    );
    let groups = groups(runs);
    let mut tasks: Vec<&str> = groups.iter().map(|group| group.task.as_str()).collect();
    tasks.dedup();
    for task in tasks {
        let of_task: Vec<&Group> = groups.iter().filter(|group| group.task == task).collect();
        add(&mut text, format!("\n## {task}\n"));
        scores(&mut text, runs, &of_task);
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
        "\n| method | setting | seeds | score | by seed | area | labels (steps) to 50 % | to 80 % | to 95 % |\n\
         |---|---|---:|---|---|---|---|---|---|\n",
    );
    for group in groups {
        let members = members(runs, group);
        let of = |f: fn(&RunResult) -> f64| members.iter().map(|run| f(run)).collect::<Vec<_>>();
        let is_rate = members.iter().all(|run| run.end.has_success);
        let scores = of(|run| score(run).value);
        let by_seed: Vec<String> = scores.iter().map(|s| number(*s, is_rate)).collect();
        let fewest = members.iter().map(|run| score(run).n_evaluations).min();
        let note = match fewest {
            Some(n) if n < 10 => format!(" (last {n})"),
            _ => String::new(),
        };
        add(
            text,
            format!(
                "| {} | {} | {} | {}{note} | {} | {} |",
                group.method,
                or_dash(&group.setting),
                members.len(),
                center(&scores, is_rate),
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

/// `24 (12000), 4 of 5 seeds`; the lower of two in the middle.
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
    match there.get((when.len() - 1) / 2) {
        Some(middle) => format!("{} ({}){n}", middle.labels, middle.step),
        None => format!("never, but {} of {} seeds", there.len(), when.len()),
    }
}

/// The first method against every other in the same setting, and every method's first setting
/// against its others.
fn differences(text: &mut String, runs: &Runs, groups: &[&Group]) {
    let mut lines = String::new();
    for (first, second) in pairs(groups) {
        let (a, b) = (members(runs, first), members(runs, second));
        let paired: Vec<(&RunResult, &RunResult)> = a
            .iter()
            .filter_map(|run| {
                let other = b.iter().find(|other| other.key.seed == run.key.seed)?;
                Some((*run, *other))
            })
            .collect();
        let is_rate = a.iter().all(|run| run.end.has_success);
        let of = |f: &dyn Fn(&RunResult) -> f64| {
            let pairs: Vec<(f64, f64)> = paired.iter().map(|(a, b)| (f(a), f(b))).collect();
            difference(&pairs, is_rate)
        };
        let stage: Vec<(f64, f64)> = paired
            .iter()
            .filter_map(|(a, b)| Some((same_stage(a)?, same_stage(b)?)))
            .collect();
        let named = |group: &Group| match group.setting.as_str() {
            "" => group.method.clone(),
            setting => format!("{} ({setting})", group.method),
        };
        add(
            &mut lines,
            format!(
                "| {} − {} | {} | {} | {} | {} |\n",
                named(first),
                named(second),
                paired.len(),
                of(&|run| score(run).value),
                of(&area),
                difference(&stage, true)
            ),
        );
    }
    if !lines.is_empty() {
        text.push_str(
            "\nDifferences between runs of the same seed, mean with its 95 % bootstrap interval; bold where it excludes 0 and there are six seeds or more, as fewer agree by chance too often:\n\n\
             | difference | seeds | of scores | of areas | of pairs in one true stage |\n|---|---:|---|---|---|\n",
        );
        text.push_str(&lines);
    }
}

fn pairs<'a>(groups: &[&'a Group]) -> Vec<(&'a Group, &'a Group)> {
    // In a setting its first method against every other, then of a method its first setting
    // against every other.
    let of_setting = |a: &Group, b: &Group| a.setting == b.setting;
    let of_method = |a: &Group, b: &Group| a.method == b.method;
    let mut pairs = Vec::new();
    for are_alike in [of_setting, of_method] {
        for (n, group) in groups.iter().enumerate() {
            let first = groups.iter().position(|other| are_alike(other, group));
            pairs.extend(
                first
                    .filter(|first| *first < n)
                    .map(|first| (groups[first], *group)),
            );
        }
    }
    pairs
}

fn difference(pairs: &[(f64, f64)], is_rate: bool) -> String {
    Bootstrap::default().paired_difference(pairs).map_or_else(
        || "–".into(),
        |found| {
            let told = told_of(pairs.len(), &found, is_rate);
            let is_sure = pairs.len() >= LEAST_TO_BE_SURE && !found.interval.contains(0.0);
            if is_sure { format!("**{told}**") } else { told }
        },
    )
}

/// Whether anything was learned at all.
fn learning(text: &mut String, runs: &Runs, groups: &[&Group]) {
    let mut lines = String::new();
    for group in groups {
        let found: Vec<Learned> = members(runs, group)
            .into_iter()
            .filter_map(learned)
            .collect();
        if found.is_empty() {
            continue;
        }
        let of = |f: fn(&Learned) -> f64| mean(&found.iter().map(f).collect::<Vec<_>>());
        let by_seed: Vec<String> = found
            .iter()
            .map(|learned| {
                let told = estimate(&learned.difference, false);
                let is_sure = !learned.difference.interval.contains(0.0);
                if is_sure { format!("**{told}**") } else { told }
            })
            .collect();
        add(
            &mut lines,
            format!(
                "| {} | {} | {} | {:.0} | {:.0} | {} |\n",
                group.method,
                or_dash(&group.setting),
                found[0].n_episodes,
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

/// Methods that are there on every task that is solved or not, with as many strata as tasks.
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
            "\n## All {} tasks\n\nSeeds are drawn again within each task (stratified).\n\n\
             | method | setting | score |\n|---|---|---|\n",
            tasks.len()
        ),
    );
    for group in groups.iter().filter(|group| group.task == tasks[0]) {
        let strata: Vec<Vec<f64>> = tasks
            .iter()
            .map(|task| {
                let on_task = Group {
                    task: (*task).to_owned(),
                    ..group.clone()
                };
                members(runs, &on_task)
                    .iter()
                    .map(|run| score(run).value)
                    .collect()
            })
            .collect();
        if strata.iter().any(Vec::is_empty) {
            continue;
        }
        let found = Bootstrap::default().stratified(&strata, interquartile_mean);
        let fewest = strata.iter().map(Vec::len).min().unwrap_or(0);
        let told = found.map_or_else(|| "–".into(), |found| told_of(fewest, &found, true));
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
