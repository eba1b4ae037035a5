use super::told::{STAIR, Told, file, run_from, three_seeds_each};
use super::*;
use crate::config::RunConfig;
use crate::experiment::results::FinishedRow;

#[test]
fn a_report_tells_what_was_learned_and_is_sure_where_the_interval_says_so() {
    let runs = Runs {
        runs: vec![run_from(&[1.0, 2.0, 6.0], &[11.0, 12.0, 16.0])],
        failed: Vec::new(),
    };
    let text = markdown::report(&runs);
    assert!(
        text.contains("| stair | – | 3 | 3 | 13 | 1: **10 [10, 10]** |"),
        "{text}"
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
        "| stair | – | 3,000 | 3 | 0.50 [0.50, 0.50] (last 3) | 0.50 | 1: 0.50, 2: 0.50, 3: 0.50 | 0.50 [0.50, 0.50] | 20 (2000) | 30 (3000) | 30 (3000) |",
        "| 1: 0.25, 2: 0.17, 3: 0.17 |",
        // scores differ by 0.25, 0.33, 0.33: their mean, from the lowest to the highest seed
        "| stair − pebble | 3 | 0.31 [0.25, 0.33] |",
        "0.50 [0.50, 0.50] |",
        "| stair | – | 0.75 [0.75, 0.75] | 0.50 [0.50, 0.50] | 0.25 [0.25, 0.25] | 0.88 [0.88, 0.88] | 0.62 [0.62, 0.62] |",
        "never",
    ] {
        assert!(report.contains(told), "{told} is not in:\n{report}");
    }
    assert_eq!(artifacts[1].text.lines().count(), 1 + 6);
}

#[test]
fn several_budgets_of_a_method_make_a_figure_of_their_own() {
    let mut text = String::new();
    for (setting, budget, n_seeds) in [("40 answers", 40, 2), ("80 answers", 80, 3)] {
        for seed in 1..=n_seeds {
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
    let drawn = artifacts
        .iter()
        .find(|a| a.name == "success-by-budget.svg")
        .unwrap();
    assert!(drawn.text.contains("Budget (labels)") && !drawn.text.contains(">Labels<"));
    assert!(drawn.text.contains("Thick: interquartile mean."));
    assert!(drawn.text.contains("STAIR (2–3 seeds)"));
    assert!(!artifacts[0].text.contains("Left out of the figure"));
    assert!(
        artifacts[0]
            .text
            .contains("stair (40 answers) − stair (80 answers)")
    );
}

/// As go-fetch-return-labels and go-fetch-return-query-rules in one report.
#[test]
fn of_settings_with_one_budget_the_figure_takes_the_one_that_other_methods_have() {
    let told = |method, setting, budget| {
        let told = Told {
            method,
            setting,
            budget,
            ..STAIR
        };
        told.text()
    };
    let mut labels = String::new();
    for method in ["stair", "pebble"] {
        labels += &told(method, "20 answers", 20);
        labels += &told(method, "40 answers", 40);
    }
    let rules = told("stair", "20 answers, both directions", 20);
    let artifacts = make(&[file("labels", labels), file("rules", rules)], false).unwrap();
    let points = artifacts
        .iter()
        .find(|a| a.name == "success-by-budget.csv")
        .unwrap();
    for line in ["stair,,seed 1,20,50\n", "stair,,seed 1,40,50\n"] {
        assert!(points.text.contains(line), "{}", points.text);
    }
    let report = &artifacts[0].text;
    assert!(
        report.contains("one setting for each: stair (20 answers, both directions).\n"),
        "{report}"
    );
}

#[test]
fn of_settings_with_one_budget_that_nobody_else_has_the_figure_takes_none() {
    let told = |setting, budget| {
        let told = Told {
            setting,
            budget,
            ..STAIR
        };
        told.text()
    };
    let two = told("20, gap alone", 20) + &told("20, both", 20) + &told("40", 40);
    let artifacts = make(&[file("rows", two.clone())], false).unwrap();
    assert!(!artifacts.iter().any(|a| a.name == "success-by-budget.svg"));
    let report = &artifacts[0].text;
    assert!(
        report.contains("each: stair (20, both), stair (20, gap alone), stair (40).\n"),
        "{report}"
    );

    let more = two + &told("80", 80);
    let artifacts = make(&[file("rows", more)], false).unwrap();
    let points = artifacts
        .iter()
        .find(|a| a.name == "success-by-budget.csv")
        .unwrap();
    assert!(points.text.contains("seed 1,80,50\n") && !points.text.contains("seed 1,20,"));
    let report = &artifacts[0].text;
    assert!(
        report.contains("each: stair (20, both), stair (20, gap alone).\n"),
        "{report}"
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
fn every_method_of_a_setting_is_held_against_pebble_once() {
    let of = |methods: &[&'static str]| {
        let told = methods
            .iter()
            .map(|&method| Told { method, ..STAIR }.text());
        let text = told.collect::<String>();
        make(&[file("rows.jsonl", text)], false)
            .unwrap()
            .remove(0)
            .text
    };
    let report = of(&["stair", "pebble", "rune", "sac"]);
    let (_, table) = report.split_once("Differences").unwrap();
    let lines = table.lines().filter(|line| line.contains(" − "));
    let named: Vec<&str> = lines.filter_map(|line| line.split(" | ").next()).collect();
    assert_eq!(
        named,
        [
            "| stair − pebble",
            "| stair − rune",
            "| stair − sac",
            "| rune − pebble",
            "| sac − pebble",
        ]
    );
    assert!(!of(&["pebble", "rune"]).contains("rune − pebble"));
    assert!(!of(&["stair", "rune", "sac"]).contains("− pebble"));
}

#[test]
fn runs_that_were_not_trained_as_long_are_marked() {
    let long = Told {
        setting: "160 answers",
        budget: 160,
        ..STAIR
    };
    let long = long.rows(FinishedRow {
        total_steps: 2_010_000,
        ..long.end()
    });
    let report = &make(&[file("rows.jsonl", STAIR.text() + &long)], false).unwrap()[0].text;
    for told in [
        "| stair | – | 3,000 | 1 |",
        "| stair | 160 answers | 2,010,000 | 1 |",
        "| stair − stair (160 answers) (3,000 against 2,010,000 steps) | 1 |",
    ] {
        assert!(report.contains(told), "{told} is not in:\n{report}");
    }
}

#[test]
fn settings_that_differ_are_told_by_name_and_those_that_came_later_are_as_by_default() {
    let with = |seed, budget, change: &dyn Fn(&mut toml::Table)| {
        let told = Told { seed, ..STAIR };
        let mut config: toml::Table = toml::from_str(&RunConfig::default().to_toml()).unwrap();
        change(&mut config);
        told.rows(FinishedRow {
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
fn methods_that_were_asked_otherwise_are_not_held_against_each_other() {
    let with = |method: &'static str, budget, change: &dyn Fn(&mut RunConfig)| {
        let told = Told { method, ..STAIR };
        let mut config = RunConfig::default();
        change(&mut config);
        told.rows(FinishedRow {
            settings: method.into(),
            budget,
            config: toml::from_str(&config.to_toml()).unwrap(),
            ..told.end()
        })
    };
    let stair = with("stair", 80, &|_| {});
    let own_network = with("pebble", 80, &|config| config.agent.batch = 77);
    make(&[file("a", stair.clone() + &own_network)], false).unwrap();
    let seldom = |config: &mut RunConfig| config.feedback.every = 7_777;
    let error = make(
        &[file("a", stair.clone() + &with("pebble", 80, &seldom))],
        false,
    );
    let told = error.unwrap_err().to_string();
    assert!(
        told.contains("feedback.every") && told.contains("7777"),
        "{told}"
    );
    make(
        &[file("a", stair.clone() + &with("sac", 0, &seldom))],
        false,
    )
    .unwrap();
    let errs = |config: &mut RunConfig| config.teacher.mistake = 0.3;
    let from_more = |config: &mut RunConfig| config.queries.candidates_per_query = 77;
    for (key, pebble) in [
        ("teacher.mistake", with("pebble", 80, &errs)),
        (
            "queries.candidates_per_query",
            with("pebble", 80, &from_more),
        ),
    ] {
        let rows = stair.clone() + &pebble;
        let told = make(&[file("a", rows)], false).unwrap_err().to_string();
        assert!(told.contains(key), "{told}");
    }
}

#[test]
fn a_share_is_reached_by_the_seed_in_the_middle_and_never_comes_last() {
    let seeds = |successes: [&'static [f64]; 3]| {
        let told = (1..).zip(successes).map(|(seed, success)| {
            let told = Told {
                seed,
                success,
                ..STAIR
            };
            told.text()
        });
        let text = told.collect::<String>();
        make(&[file("a", text)], false).unwrap().remove(0).text
    };
    let most = seeds([&[0.0, 0.6, 0.0], &[0.6, 0.0, 0.0], &[0.0; 3]]);
    assert!(most.contains("| 20 (2000), 2 of 3 seeds |"), "{most}");
    let few = seeds([&[0.6, 0.0, 0.0], &[0.0; 3], &[0.0; 3]]);
    assert!(few.contains("| never, but 1 of 3 seeds |"), "{few}");
}

#[test]
fn of_two_seeds_the_later_one_tells_when_a_share_was_reached() {
    let seeds = |second: &'static [f64]| {
        let second = Told {
            seed: 4,
            success: second,
            ..STAIR
        };
        let text = STAIR.text() + &second.text();
        make(&[file("a", text)], false).unwrap().remove(0).text
    };
    let both = seeds(&[0.6, 0.6, 0.6]);
    assert!(both.contains("| 1: 0.50, 4: 0.60 |"), "{both}");
    assert!(both.contains("| 20 (2000) |"), "{both}");
    let one = seeds(&[0.0; 3]);
    assert!(one.contains("| never, but 1 of 2 seeds |"), "{one}");
}

#[test]
fn a_run_that_failed_in_one_file_and_is_finished_in_another_is_no_failure() {
    let others = Told { seed: 2, ..STAIR };
    let failed = STAIR.failed("out of memory") + &others.failed("no card");
    let files = [file("a", failed), file("b", STAIR.text())];
    let report = &make(&files, false).unwrap()[0].text;
    assert!(
        report.contains("## Failed\n\n- go-fetch-return.stair.oracle.2: no card\n"),
        "{report}"
    );
    assert!(!report.contains("out of memory"), "{report}");
}

#[test]
fn how_often_a_teacher_erred_is_told_where_one_did() {
    let text = |oracle_agreement| {
        let told = Told {
            oracle_agreement,
            ..STAIR
        };
        make(&[file("a", told.text())], false).unwrap()
    };
    let erred = text(Some(0.9));
    assert!(erred[0].text.contains("| stair | – | 0.90 |"));
    let scores = erred.iter().find(|a| a.name == "scores.csv").unwrap();
    assert!(scores.text.contains(",oracle_agreement,") && scores.text.contains(",0.9,"));
    for never in [Some(1.0), None] {
        assert!(!text(never)[0].text.contains("the task reward gives too"));
    }
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

/// The interval leaves 0 out here, but signs by chance give as much in four of 64 cases.
#[test]
fn a_difference_is_called_one_where_signs_by_chance_seldom_give_as_much() {
    let mut text = String::new();
    for seed in 1..=6 {
        let of = |method, success: &'static [f64]| {
            let told = Told {
                method,
                seed,
                success,
                ..STAIR
            };
            told.text()
        };
        text += &of("stair", &[0.5]);
        text += &of("pebble", if seed == 6 { &[0.625] } else { &[0.25] });
    }
    let report = &make(&[file("rows.jsonl", text)], false).unwrap()[0].text;
    assert!(
        report.contains("| stair − pebble | 6 | 0.19 [0.06, 0.25] |"),
        "{report}"
    );
    assert!(report.contains("sign-flip test"), "{report}");
}

#[test]
fn tasks_weigh_alike_however_many_seeds_they_have() {
    let told = |method, task, seed, success: &'static [f64]| {
        let told = Told {
            task,
            method,
            seed,
            success,
            ..STAIR
        };
        told.text()
    };
    let mut text = String::new();
    for seed in 1..=6 {
        text += &told("stair", "go-fetch-return", seed, &[1.0]);
    }
    for seed in 1..=2 {
        text += &told("stair", "window-open", seed, &[0.0]);
    }
    text += &told("pebble", "go-fetch-return", 1, &[1.0]);
    text += &told("pebble", "window-open", 2, &[1.0]);
    let report = &make(&[file("rows.jsonl", text)], false).unwrap()[0].text;
    let (_, of_all) = report.split_once("## All 2 tasks").unwrap();
    assert!(of_all.contains("tasks weigh alike"), "{of_all}");
    assert!(of_all.contains("| stair | – | 0.50 |"), "{of_all}");
    assert!(of_all.contains("| pebble | – | – |"), "{of_all}");
}

#[test]
fn tasks_are_drawn_together_by_strata() {
    let text = three_seeds_each() + &three_seeds_each().replace("go-fetch-return", "window-open");
    let report = &make(&[file("rows.jsonl", text)], false).unwrap()[0].text;
    assert!(
        report.contains("## All 2 tasks") && report.contains("| stair | – | 0.50 [0.50, 0.50] |"),
        "{report}"
    );
    let one = STAIR.text() + &STAIR.text().replace("go-fetch-return", "window-open");
    let report = &make(&[file("rows.jsonl", one)], false).unwrap()[0].text;
    let (_, of_all) = report.split_once("## All 2 tasks").unwrap();
    assert!(
        of_all.contains("| stair | – | 0.50 |"),
        "one seed has no interval:\n{report}"
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
    let longer = longer.rows(FinishedRow {
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
    let other = other.rows(FinishedRow {
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
