use super::*;

const SMALL_TASK: &str = r#"
title = "Labels"
presets = ["quick"]
set = ["evaluation.episodes=50"]

[axes]
tasks = ["go-fetch-return"]
methods = ["stair", "pebble"]
seeds = 2

[[also]]
methods = ["rune", "stair"]
seeds = [1, 7]
settings = ["40 labels"]

[[setting]]
name = "40 labels"
set = ["feedback.budget=40"]

[[setting]]
name = "80 labels"
set = ["feedback.budget=80"]

[small]
seeds = 1
set = ["training.total_steps=9000"]
"#;

fn read(text: &str) -> Result<Grid, GridError> {
    resolve(
        GridText {
            name: "labels.toml",
            text,
        },
        false,
    )
}

fn told(text: &str) -> String {
    read(text).unwrap_err().to_string()
}

#[test]
fn a_grid_is_every_combination_once_first_seeds_first() {
    let grid = read(SMALL_TASK).unwrap();
    // 2 settings × 2 methods × 2 seeds, and of the second grid rune 1, rune 7 and stair 7.
    assert_eq!(grid.runs.len(), 8 + 3);
    let seeds: Vec<u64> = grid.runs.iter().map(|run| run.key.seed).collect();
    assert!(seeds.is_sorted());
    let names: BTreeSet<String> = grid.runs.iter().map(|run| run.key.name()).collect();
    assert_eq!(names.len(), 11);
    assert!(
        names.contains("go-fetch-return.rune.oracle.40-labels.7"),
        "{names:?}"
    );
    for run in &grid.runs {
        let budget = if run.key.setting == "40 labels" {
            40
        } else {
            80
        };
        assert_eq!(run.config.feedback.budget, budget);
        assert_eq!(
            (run.config.seed, run.config.evaluation.episodes),
            (run.key.seed, 50)
        );
        assert_eq!(run.config.method, run.key.method);
    }
}

#[test]
fn the_small_variant_keeps_what_it_does_not_name() {
    let text = GridText {
        name: "labels.toml",
        text: SMALL_TASK,
    };
    let grid = resolve(text, true).unwrap();
    assert_eq!(grid.runs.len(), 4);
    assert!(
        grid.runs
            .iter()
            .all(|run| run.config.training.total_steps == 9_000)
    );
}

#[test]
fn an_unknown_name_is_told_with_its_line_and_the_nearest_right_one() {
    let swap = |from: &str, to: &str| told(&SMALL_TASK.replacen(from, to, 1));
    let wrong = [
        (
            "\"go-fetch-return\"",
            "\"go-fetch-retrun\"",
            "line 7",
            "did you mean 'go-fetch-return'",
        ),
        (
            "\"stair\", \"pebble\"",
            "\"stiar\"",
            "line 8",
            "did you mean 'stair'",
        ),
        ("\"quick\"", "\"quik\"", "line 3", "did you mean 'quick'"),
        (
            "episodes=50",
            "episdoes=50",
            "line 4",
            "did you mean `episodes`",
        ),
        ("budget=80", "bugdet=80", "line 22", "did you mean `budget`"),
        (
            "[\"40 labels\"]",
            "[\"40 lables\"]",
            "line 14",
            "did you mean '40 labels'",
        ),
        ("seeds = 2", "sedes = 2", "line 9", "did you mean `seeds`"),
        (
            "seeds = 2",
            "teachers = [\"orcale\"]",
            "line 9",
            "did you mean 'oracle'",
        ),
        ("budget=40", "budget=many", "line 18", "budget"),
    ];
    for (from, to, line, hint) in wrong {
        let told = swap(from, to);
        assert!(told.starts_with("labels.toml"), "{told}");
        assert!(told.contains(line) && told.contains(hint), "{to}: {told}");
    }
}

#[test]
fn what_is_an_axis_is_no_setting() {
    for (set, axis) in [
        ("method=pebble", "methods"),
        ("task=window-open", "tasks"),
        ("seed=77", "seeds"),
    ] {
        let told = told(&SMALL_TASK.replace("evaluation.episodes=50", set));
        assert!(told.contains("line 4"), "{told}");
        assert!(
            told.contains(&format!("name {axis} under [axes]")),
            "{told}"
        );
    }
}

#[test]
fn a_setting_is_told_as_the_file_has_it_and_one_of_none_as_such() {
    let told_set = told(&SMALL_TASK.replace("evaluation.episodes", "agent.bach"));
    assert!(
        told_set.contains("line 4: set agent.bach=50: "),
        "{told_set}"
    );
    let (head, _) = SMALL_TASK.split_once("[[setting]]").unwrap();
    let told_none = told(head);
    assert!(
        told_none.contains("line 14") && told_none.ends_with("the file has no [[setting]]"),
        "{told_none}"
    );
}

#[test]
fn a_value_out_of_range_is_told_with_its_line() {
    let told = told(&SMALL_TASK.replace("evaluation.episodes=50", "evaluation.episodes=0"));
    assert!(
        told.contains("line 4") && told.contains("from 1 to 10000"),
        "{told}"
    );
}

#[test]
fn an_empty_product_is_refused() {
    for (from, to, axis) in [
        ("[\"go-fetch-return\"]", "[]", "tasks"),
        ("[\"stair\", \"pebble\"]", "[]", "methods"),
        ("seeds = 2", "seeds = 0", "seeds"),
        ("seeds = 2", "seeds = []", "seeds"),
        ("[\"40 labels\"]", "[]", "settings"),
    ] {
        let told = told(&SMALL_TASK.replacen(from, to, 1));
        assert!(
            told.contains("nothing to run") && told.contains(axis),
            "{told}"
        );
    }
}

#[test]
fn settings_with_one_name_and_far_too_many_runs_are_refused() {
    let told_twice = told(&SMALL_TASK.replace("\"80 labels\"\n", "\"40 labels\"\n"));
    assert!(told_twice.contains("twice"), "{told_twice}");
    let told_alike = told(&SMALL_TASK.replace("\"80 labels\"\n", "\"40-labels\"\n"));
    assert!(
        told_alike.contains("'40 labels' and '40-labels' would share"),
        "{told_alike}"
    );
    let told_many = told(&SMALL_TASK.replacen("seeds = 2", "seeds = 4000000000", 1));
    assert!(told_many.contains("more than"), "{told_many}");
}

#[test]
fn every_shipped_grid_resolves_and_has_a_small_variant_of_the_same_kind() {
    for entry in SHIPPED {
        let text = entry.source();
        let whole = resolve(text, false).unwrap_or_else(|e| panic!("{e}"));
        let small = resolve(text, true).unwrap_or_else(|e| panic!("{e}"));
        let of_small = |name: fn(&RunKey) -> String| {
            let names: BTreeSet<String> = small.runs.iter().map(|run| name(&run.key)).collect();
            names.len()
        };
        let sizes = [
            of_small(|key| key.task.clone()),
            of_small(|key| key.method.clone()),
            of_small(|key| key.seed.to_string()),
        ];
        assert_eq!(sizes, [1, 2, 2], "{}: tasks, methods, seeds", entry.name);
        let has_success = |grid: &Grid| {
            let specs = grid
                .runs
                .iter()
                .map(|run| find_task(&run.key.task).unwrap());
            specs.map(|task| (task.spec)().has_success).next()
        };
        // Success or return: the same axis in the same figure.
        assert_eq!(has_success(&small), has_success(&whole), "{}", entry.name);
        assert!(
            small.runs.len() < whole.runs.len() && !whole.about.is_empty(),
            "{}",
            entry.name
        );
        for run in whole.runs.iter().chain(&small.runs) {
            assert_eq!(run.config.evaluation.episodes, 50, "{}", entry.name);
            let evaluations = run.config.training.total_steps / run.config.evaluation.every;
            assert!(evaluations >= 10, "{}: {}", entry.name, run.key.name());
        }
    }
}
