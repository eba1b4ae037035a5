use super::*;
use crate::config::RunConfig;
use crate::experiment::results::{Content, Row, RunRow};
use crate::message::{Evaluation, SessionOffered};

/// A run with these evaluations at every thousandth step, each after ten more answers.
struct Told {
    task: &'static str,
    method: &'static str,
    setting: &'static str,
    seed: u64,
    budget: u32,
    success: &'static [f64],
    same_stage: f64,
}

const STAIR: Told = Told {
    task: "go-fetch-return",
    method: "stair",
    setting: "",
    seed: 1,
    budget: 80,
    success: &[0.0, 0.5, 1.0],
    same_stage: 0.75,
};

impl Told {
    fn key(&self) -> RunKey {
        RunKey {
            task: self.task.into(),
            method: self.method.into(),
            teacher: "oracle".into(),
            setting: self.setting.into(),
            seed: self.seed,
        }
    }

    fn end(&self) -> RunRow {
        RunRow {
            total_steps: 3_000,
            labels: 30,
            budget: self.budget,
            evaluation_episodes: 50,
            evaluation_every: 1_000,
            has_success: true,
            weights: "ab".into(),
            settings: format!("{}-{}", self.method, self.budget),
            config: toml::Table::new(),
            revision: "abc".into(),
            machine: "two cores".into(),
            wall_s: 60.0,
        }
    }

    fn rows(&self, end: RunRow) -> String {
        let mut contents = vec![Content::Session(SessionOffered {
            step: 1_500,
            session: 1,
            n_queries: 5,
            disagreement_chosen: None,
            disagreement_pool: None,
            stage_gap_chosen: Some(1.0),
            stage_gap_pool: Some(4.0),
            same_stage_chosen: Some(self.same_stage),
        })];
        contents.extend(self.success.iter().enumerate().map(|(n, success)| {
            Content::Evaluation(Evaluation {
                step: 1_000 * (n as u64 + 1),
                labels: 10 * (n as u32 + 1),
                success_rate: *success,
                episodes: 50,
                return_mean: 7.0,
                return_std: 0.0,
                reward_correlation: None,
                returns: Vec::new(),
            })
        }));
        contents.push(Content::Finished(end));
        let line = |content| {
            let row = Row {
                key: self.key(),
                content,
            };
            serde_json::to_string(&row).unwrap() + "\n"
        };
        contents.into_iter().map(line).collect()
    }

    fn text(&self) -> String {
        self.rows(self.end())
    }

    fn run(&self) -> RunResult {
        Results::parse("rows", &self.text()).unwrap().runs.remove(0)
    }
}

/// A run whose rows also tell the episodes' returns, before the first step and after the last.
fn run_from(before: &[f64], after: &[f64]) -> RunResult {
    let mut run = STAIR.run();
    let first = Evaluation {
        step: 0,
        returns: before.to_vec(),
        ..run.evaluations[0].clone()
    };
    run.evaluations.insert(0, first);
    run.evaluations.last_mut().unwrap().returns = after.to_vec();
    run
}

fn file(name: &str, text: String) -> RowFile {
    RowFile {
        name: name.into(),
        text,
        settings: Vec::new(),
    }
}

fn three_seeds_each() -> String {
    let mut text = String::new();
    for seed in 1..=3 {
        text += &Told { seed, ..STAIR }.text();
        let success: &[f64] = if seed == 1 {
            &[0.0, 0.25, 0.5]
        } else {
            &[0.0, 0.0, 0.5]
        };
        text += &Told {
            seed,
            success,
            method: "pebble",
            same_stage: 0.25,
            ..STAIR
        }
        .text();
    }
    text
}

fn close(found: f64, expected: f64) {
    assert!((found - expected).abs() < 1e-12, "{found} for {expected}");
}

#[test]
fn learning_is_the_difference_of_the_same_episodes() {
    let found = learned(&run_from(&[1.0, 2.0, 6.0], &[11.0, 12.0, 16.0])).unwrap();
    close(found.before, 3.0);
    close(found.after, 13.0);
    close(found.difference.value, 10.0);
    close(found.difference.interval.lo, 10.0); // though the episodes differ
    assert_eq!(found.n_episodes, 3);

    let unsure = learned(&run_from(&[1.0, 5.0, 3.0], &[5.0, 1.0, 4.0])).unwrap();
    assert!(unsure.difference.interval.contains(0.0));

    assert_eq!(learned(&STAIR.run()), None); // not tried before it began
    assert_eq!(learned(&run_from(&[], &[])), None); // rows of an older program
    assert_eq!(learned(&run_from(&[1.0], &[1.0, 2.0])), None);
}

#[test]
fn a_report_tells_what_was_learned_and_is_sure_where_the_interval_says_so() {
    let runs = Runs {
        runs: vec![run_from(&[1.0, 2.0, 6.0], &[11.0, 12.0, 16.0])],
        failed: Vec::new(),
    };
    let text = table::markdown(&runs);
    assert!(
        text.contains("| stair | – | 3 | 3 | 13 | **10 [10, 10]** |"),
        "{text}"
    );
}

#[test]
fn a_score_leaves_out_what_was_before_the_first_step() {
    let (with, without) = (score(&run_from(&[1.0], &[2.0])), score(&STAIR.run()));
    assert_eq!(with, without);
}

#[test]
fn a_score_is_the_mean_of_the_last_ten_evaluations() {
    const RISING: &[f64] = &[0.0, 0.0, 0.1, 0.2, 0.3, 0.4, 0.5, 0.6, 0.7, 0.8, 0.9, 1.0];
    let found = score(
        &Told {
            success: RISING,
            ..STAIR
        }
        .run(),
    );
    close(found.value, 0.55);
    assert_eq!(found.n_evaluations, 10);
    let few = score(&STAIR.run());
    close(few.value, 0.5);
    assert_eq!(few.n_evaluations, 3);
}

#[test]
fn the_area_is_that_of_trapezoids_by_the_width() {
    // 1000 × 0.25 + 1000 × 0.75 over 2000 steps
    close(area(&STAIR.run()), 0.5);
    close(
        area(
            &Told {
                success: &[0.2, 0.2, 0.8, 0.8],
                ..STAIR
            }
            .run(),
        ),
        (0.2 + 0.5 + 0.8) / 3.0,
    );
    close(
        area(
            &Told {
                success: &[0.4],
                ..STAIR
            }
            .run(),
        ),
        0.4,
    );
}

#[test]
fn a_share_of_success_is_reached_at_the_first_evaluation_with_it() {
    let run = STAIR.run();
    assert_eq!(
        reached(&run, 0.5),
        Some(Reached {
            step: 2_000,
            labels: 20
        })
    );
    assert_eq!(
        reached(&run, 0.8),
        Some(Reached {
            step: 3_000,
            labels: 30
        })
    );
    assert_eq!(
        reached(
            &Told {
                success: &[0.7],
                ..STAIR
            }
            .run(),
            0.8
        ),
        None
    );
}

#[test]
fn the_report_has_tables_curves_and_points_the_same_each_time() {
    let files = [file("rows.jsonl", three_seeds_each())];
    let artifacts = make(&files, false).unwrap();
    let names: Vec<&str> = artifacts
        .iter()
        .map(|artifact| artifact.name.as_str())
        .collect();
    assert_eq!(
        names,
        [
            "report.md",
            "scores.csv",
            "success.svg",
            "success.csv",
            "stage-gaps.svg",
            "stage-gaps.csv",
            "stage-gap-ratios.svg",
            "stage-gap-ratios.csv"
        ]
    );
    assert_eq!(make(&files, false).unwrap(), artifacts);
    let report = &artifacts[0].text;
    for told in [
        "| stair | – | 3 | 0.50 [0.50, 0.50] (last 3) | 0.50, 0.50, 0.50 | 0.50 [0.50, 0.50] | 20 (2000) | 30 (3000) | 30 (3000) |",
        "| 0.25, 0.17, 0.17 |",
        // scores differ by 0.25, 0.33, 0.33: their mean, from the lowest to the highest seed
        "| stair − pebble | 3 | 0.31 [0.25, 0.33] |",
        "0.50 [0.50, 0.50] |",
        "| stair | – | 0.75 [0.75, 0.75] | 0.25 [0.25, 0.25] |",
        "never",
    ] {
        assert!(report.contains(told), "{told} is not in:\n{report}");
    }
    assert_eq!(artifacts[1].text.lines().count(), 1 + 6);
}

#[test]
fn several_budgets_of_a_method_make_a_figure_of_their_own() {
    let mut text = String::new();
    for (setting, budget) in [("40 answers", 40), ("80 answers", 80)] {
        for seed in 1..=2 {
            text += &Told {
                setting,
                seed,
                budget,
                ..STAIR
            }
            .text();
        }
    }
    let artifacts = make(&[file("rows.jsonl", text)], false).unwrap();
    let points = artifacts
        .iter()
        .find(|a| a.name == "success-by-budget.csv")
        .unwrap();
    assert!(points.text.contains("seed 1,40,50\n") && points.text.contains("seed 2,80,50\n"));
    assert!(
        artifacts[0]
            .text
            .contains("stair (40 answers) − stair (80 answers)")
    );
}

/// Settings as their file names them, whichever run came to its end first.
#[test]
fn the_order_of_a_report_is_not_that_in_which_runs_ended() {
    let in_setting = |setting| Told { setting, ..STAIR }.text();
    let text = |settings: [&'static str; 2]| settings.map(in_setting).concat();
    let report = |text: String| {
        let settings = vec!["every step".to_owned(), "every 10".to_owned()];
        let file = RowFile {
            settings,
            ..file("rows.jsonl", text)
        };
        make(&[file], false).unwrap()
    };
    let first = report(text(["every 10", "every step"]));
    assert_eq!(first, report(text(["every step", "every 10"])));
    assert!(
        first[0]
            .text
            .contains("stair (every step) − stair (every 10)")
    );
}

#[test]
fn differences_are_between_methods_in_a_setting_and_between_settings_of_a_method() {
    let told = |method, setting| {
        Told {
            method,
            setting,
            ..STAIR
        }
        .text()
    };
    let text =
        told("stair", "unchanged") + &told("pebble", "unchanged") + &told("stair", "gap alone");
    let file = RowFile {
        settings: vec!["unchanged".into(), "gap alone".into()],
        ..file("rows.jsonl", text)
    };
    let report = &make(&[file], false).unwrap()[0].text;
    for difference in [
        "stair (unchanged) − pebble (unchanged)",
        "stair (unchanged) − stair (gap alone)",
    ] {
        assert!(
            report.contains(difference),
            "{difference} is not in:\n{report}"
        );
    }
    assert!(!report.contains("− pebble (gap alone)"));
}

#[test]
fn settings_that_differ_are_told_by_name_and_those_that_came_later_are_as_by_default() {
    let with = |seed, budget, change: &dyn Fn(&mut toml::Table)| {
        let told = Told { seed, ..STAIR };
        let mut config: toml::Table = toml::from_str(&RunConfig::default().to_toml()).unwrap();
        change(&mut config);
        told.rows(RunRow {
            settings: format!("of seed {seed}"),
            budget,
            config,
            ..told.end()
        })
    };
    let agent = |config: &mut toml::Table, key: &str, value: Option<i64>| {
        let agent = config["agent"].as_table_mut().unwrap();
        match value {
            None => agent.remove(key),
            Some(value) => agent.insert(key.into(), value.into()),
        };
    };
    let as_is = with(1, 80, &|_| {});
    let older = with(2, 80, &|config| agent(config, "layer_norm", None));
    make(&[file("a", as_is.clone() + &older)], false).unwrap();
    let other = with(2, 80, &|config| agent(config, "batch", Some(77)));
    let error = make(&[file("a", as_is + &other)], false).unwrap_err();
    let told = error.to_string();
    assert!(
        told.contains("agent.batch") && told.contains("77"),
        "{told}"
    );
}

#[test]
fn three_seeds_alike_are_not_called_a_difference() {
    let report = &make(&[file("rows.jsonl", three_seeds_each())], false).unwrap()[0].text;
    assert!(
        report.contains("| stair − pebble | 3 | 0.31 [0.25, 0.33] |"),
        "{report}"
    );
    let mut six = String::new();
    for seed in 1..=6 {
        six += &Told { seed, ..STAIR }.text();
        let method = "pebble";
        let success = &[0.0, 0.0, 0.5];
        six += &Told {
            method,
            seed,
            success,
            ..STAIR
        }
        .text();
    }
    let report = &make(&[file("rows.jsonl", six)], false).unwrap()[0].text;
    assert!(
        report.contains("| stair − pebble | 6 | **0.33 [0.33, 0.33]** |"),
        "{report}"
    );
}

#[test]
fn tasks_are_drawn_together_by_strata() {
    let text = three_seeds_each() + &three_seeds_each().replace("go-fetch-return", "window-open");
    let report = &make(&[file("rows.jsonl", text)], false).unwrap()[0].text;
    assert!(
        report.contains("## All 2 tasks") && report.contains("| stair | – | 0.50 [0.50, 0.50] |"),
        "{report}"
    );
}

#[test]
fn runs_that_cannot_be_compared_are_named_with_what_differs() {
    let told = |files: &[RowFile]| make(files, false).unwrap_err().to_string();
    let other_budget = Told {
        method: "pebble",
        budget: 96,
        ..STAIR
    }
    .text();
    let error = told(&[file("a", STAIR.text() + &other_budget)]);
    assert!(
        error.contains("budget") && error.contains("80") && error.contains("96"),
        "{error}"
    );
    assert!(error.contains("go-fetch-return.pebble.oracle.1"), "{error}");

    let other_task = Told {
        task: "window-open",
        ..STAIR
    }
    .text();
    let error = told(&[file("a", STAIR.text()), file("b", other_task)]);
    assert!(
        error.contains("different tasks") && error.contains("window-open"),
        "{error}"
    );

    let longer = Told { seed: 2, ..STAIR };
    let longer = longer.rows(RunRow {
        total_steps: 9_000,
        ..longer.end()
    });
    let error = told(&[file("a", STAIR.text() + &longer)]);
    assert!(
        error.contains("steps 3000") && error.contains("9000"),
        "{error}"
    );

    let error = told(&[file("a", STAIR.text()), file("b", STAIR.text())]);
    assert!(error.contains("is in a and in b"), "{error}");
    assert!(told(&[file("a", String::new())]).contains("no finished run"));
}

#[test]
fn an_upper_bound_that_asks_nothing_may_stand_beside_any_budget() {
    let bound = Told {
        method: "sac",
        budget: 0,
        ..STAIR
    }
    .text();
    make(&[file("a", STAIR.text() + &bound)], false).unwrap();
}

#[test]
fn rows_of_another_revision_are_named() {
    let other = Told { seed: 2, ..STAIR };
    let other = other.rows(RunRow {
        revision: "def".into(),
        ..other.end()
    });
    let files = [file("a", STAIR.text() + &other)];
    let error = make(&files, false).unwrap_err().to_string();
    assert!(
        error.contains("abc (1 run") && error.contains("def (1 run") && error.contains("--mixed"),
        "{error}"
    );
    let report = &make(&files, true).unwrap()[0].text;
    assert!(
        report.contains("stand side by side") && report.contains("go-fetch-return.stair.oracle.2")
    );
}
