//! Which runs may stand in one table.

use std::collections::{BTreeMap, BTreeSet};

use super::ReportError;
use crate::config::RunConfig;
use crate::experiment::grid::RunKey;
use crate::experiment::results::{Results, RunResult, first_difference};

/// Refuses what must not be compared.
pub(super) fn check(files: &[(&str, Results)], may_mix: bool) -> Result<(), ReportError> {
    let names = || {
        files
            .iter()
            .map(|(name, _)| *name)
            .collect::<Vec<_>>()
            .join(", ")
    };
    if files.iter().all(|(_, results)| results.runs.is_empty()) {
        let mut failed = files.iter().flat_map(|(_, results)| &results.failed);
        let failed = failed.next().map_or_else(String::new, |(run, reason)| {
            let n = 1 + failed.count();
            format!("; {n} failed, the first, {}: {reason}", run.name())
        });
        return Err(ReportError::Nothing {
            files: names(),
            failed,
        });
    }
    tasks(files)?;
    once(files)?;
    let runs: Vec<&RunResult> = files
        .iter()
        .flat_map(|(_, results)| &results.runs)
        .collect();
    // Settings are read anew for every pair that is held together, so of runs that differ by
    // their seed alone the first speaks for all.
    let mut speakers: Vec<&RunResult> = Vec::new();
    for run in &runs {
        if speakers.iter().any(|other| differ_by_seed(other, run)) {
            continue;
        }
        for other in &speakers {
            terms(other, run)?;
        }
        speakers.push(run);
    }
    if may_mix {
        return Ok(());
    }
    let revisions = revisions(runs.iter().copied());
    if revisions.len() > 1 {
        return Err(ReportError::MixedRevisions(counted(&revisions)));
    }
    Ok(())
}

/// How many runs are of each revision, and the first of them.
pub(super) fn revisions<'a>(
    runs: impl Iterator<Item = &'a RunResult>,
) -> BTreeMap<&'a str, (usize, String)> {
    let mut revisions: BTreeMap<&str, (usize, String)> = BTreeMap::new();
    for run in runs {
        let counted = revisions.entry(&run.end.revision);
        counted.or_insert_with(|| (0, run.key.name())).0 += 1;
    }
    revisions
}

/// `6caf6c4 (12 runs, go-fetch-return.stair.oracle.1 first), 0123abc (1 run, …)`
pub(super) fn counted(revisions: &BTreeMap<&str, (usize, String)>) -> String {
    let told = revisions.iter().map(|(revision, (n, first))| {
        let runs = if *n == 1 { "run" } else { "runs" };
        format!("{revision} ({n} {runs}, {first} first)")
    });
    told.collect::<Vec<_>>().join(", ")
}

/// Every two files have a task in common.
fn tasks(files: &[(&str, Results)]) -> Result<(), ReportError> {
    let tasks = |results: &Results| -> BTreeSet<String> {
        results
            .runs
            .iter()
            .map(|run| run.key.task.clone())
            .collect()
    };
    for (n, (second, results)) in files.iter().enumerate() {
        for (first, others) in &files[..n] {
            let (there, here) = (tasks(others), tasks(results));
            if there.is_empty() || here.is_empty() || !there.is_disjoint(&here) {
                continue;
            }
            let told = |tasks: BTreeSet<String>| tasks.into_iter().collect::<Vec<_>>().join(", ");
            return Err(ReportError::OtherTasks {
                first: (*first).to_owned(),
                first_tasks: told(there),
                second: (*second).to_owned(),
                second_tasks: told(here),
            });
        }
    }
    Ok(())
}

/// No run is in two files.
fn once(files: &[(&str, Results)]) -> Result<(), ReportError> {
    let mut seen = BTreeMap::new();
    for (file, results) in files {
        for run in &results.runs {
            if let Some(first) = seen.insert(&run.key, *file) {
                return Err(ReportError::Twice {
                    run: run.key.name(),
                    first: first.to_owned(),
                    second: (*file).to_owned(),
                });
            }
        }
    }
    Ok(())
}

/// Whether nothing that [`terms`] looks at differs.
fn differ_by_seed(first: &RunResult, second: &RunResult) -> bool {
    let group = |run: &RunResult| {
        (
            RunKey {
                seed: 0,
                ..run.key.clone()
            },
            run.end.settings.clone(),
        )
    };
    let amounts = |run: &RunResult| {
        let end = &run.end;
        let tried = (end.evaluation_episodes, end.evaluation_every);
        (end.total_steps, end.budget, tried)
    };
    group(first) == group(second) && amounts(first) == amounts(second)
}

/// Two runs of one task in one setting were trained as long, on as many answers, asked for alike,
/// and tried alike; two that differ by their seed alone had the same settings.
fn terms(first: &RunResult, second: &RunResult) -> Result<(), ReportError> {
    let (a, b) = (&first.key, &second.key);
    if (&a.task, &a.setting) != (&b.task, &b.setting) {
        return Ok(());
    }
    let differ = |what: &str, there: &dyn ToString, here: &dyn ToString| {
        Err(ReportError::OtherTerms {
            first: a.name(),
            second: b.name(),
            what: what.to_owned(),
            there: there.to_string(),
            here: here.to_string(),
        })
    };
    let (x, y) = (&first.end, &second.end);
    if x.total_steps != y.total_steps {
        return differ("steps", &x.total_steps, &y.total_steps);
    }
    let both_ask = x.budget > 0 && y.budget > 0;
    if both_ask && x.budget != y.budget {
        return differ("a budget of answers", &x.budget, &y.budget);
    }
    if x.evaluation_episodes != y.evaluation_episodes {
        return differ(
            "evaluation episodes",
            &x.evaluation_episodes,
            &y.evaluation_episodes,
        );
    }
    if x.evaluation_every != y.evaluation_every {
        return differ(
            "steps between evaluations",
            &x.evaluation_every,
            &y.evaluation_every,
        );
    }
    if x.settings == y.settings {
        return Ok(());
    }
    let is_of_one_group = (&a.method, &a.teacher) == (&b.method, &b.teacher);
    let (Some(there), Some(here)) = (first.config()?, second.config()?) else {
        return if is_of_one_group {
            differ("settings", &x.settings, &y.settings)
        } else {
            Ok(())
        };
    };
    let found = if is_of_one_group {
        first_difference(&there, &here)
    } else if both_ask {
        first_difference(&only_terms(&there), &only_terms(&here))
    } else {
        None
    };
    match found {
        Some((key, there, here)) => differ(&key, &there, &here),
        None => Ok(()),
    }
}

/// What methods have to share to be held against each other: the environment, how often they are
/// updated, when, of whom, from how many and how much is asked, and how long the segments are. All
/// else is as by default.
fn only_terms(config: &RunConfig) -> RunConfig {
    let mut terms = RunConfig {
        environment: config.environment,
        feedback: config.feedback,
        teacher: config.teacher,
        ..RunConfig::default()
    };
    terms.training.updates_per_step = config.training.updates_per_step;
    terms.queries.segment_len = config.queries.segment_len;
    let queries = &config.queries;
    terms.queries.candidates_per_query = queries.candidates_per_query;
    terms.queries.newest_episodes = queries.newest_episodes;
    terms.queries.bpref_starts = queries.bpref_starts;
    terms.queries.bpref_pairs = queries.bpref_pairs;
    terms.queries.bpref_skips = queries.bpref_skips;
    terms
}
