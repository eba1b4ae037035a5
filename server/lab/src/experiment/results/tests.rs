use super::*;
use crate::experiment::grid::{self, Grid, GridRun, GridText};
use crate::history::Provenance;

const METRICS: &str = "{\"kind\":\"evaluation\",\"step\":500,\"labels\":4,\"episodes\":10,\"success_rate\":0.5,\
\"return_mean\":7.5,\"return_std\":1.0,\"reward_correlation\":null}\n\
{\"kind\":\"session_offered\",\"session\":1,\"step\":600,\"n_queries\":5,\"disagreement_chosen\":0.2,\
\"disagreement_pool\":0.1,\"stage_gap_chosen\":1.0,\"stage_gap_pool\":2.0,\"same_stage_chosen\":0.8}\n";
const END: &str = "{\"kind\":\"finished\",\"step\":900,\"labels\":9,\"success_rate\":0.5,\"return_mean\":7.5,\"weights\":\"ab\"}\n";

fn key(seed: u64) -> RunKey {
    RunKey {
        task: "go-fetch-return".into(),
        method: "stair".into(),
        teacher: "oracle".into(),
        setting: "80 labels".into(),
        seed,
    }
}

fn provenance(revision: &str) -> Provenance {
    Provenance {
        revision: revision.into(),
        machine: "two cores".into(),
    }
}

fn rows(seed: u64, revision: &str) -> Vec<Row> {
    let mut history = RunHistory::default();
    history.goes_on(&provenance(revision));
    let config = RunConfig {
        seed,
        ..RunConfig::default()
    };
    let metrics = format!("{METRICS}{END}");
    rows_of_run(&key(seed), &config, &metrics, &history)
        .unwrap()
        .unwrap()
}

/// A grid's folder that goes when the test ends.
struct Place(std::path::PathBuf);

impl Place {
    fn new(name: &str) -> (Self, GridFolder) {
        let path = std::env::temp_dir().join(format!("stair-grid-{name}-{}", std::process::id()));
        let _ = std::fs::remove_dir_all(&path); // an earlier test run may have been killed
        let folder = GridFolder::at(&path);
        folder.create().unwrap();
        (Self(path), folder)
    }
}

impl Drop for Place {
    fn drop(&mut self) {
        let _ = std::fs::remove_dir_all(&self.0); // best effort: it is a temporary folder
    }
}

#[test]
fn a_run_becomes_rows_only_when_it_is_over() {
    let config = RunConfig::default();
    let open = rows_of_run(&key(1), &config, METRICS, &RunHistory::default()).unwrap();
    assert_eq!(open, None);
    let rows = rows(1, "abc");
    assert_eq!(rows.len(), 3);
    let Content::Finished(end) = &rows[2].content else {
        panic!("the end comes last")
    };
    assert_eq!((end.labels, end.revision.as_str()), (9, "abc"));
    assert_eq!(end.settings, fingerprint(&config));
}

#[test]
fn settings_that_differ_by_their_seed_alone_share_a_fingerprint() {
    let of = |seed, steps| {
        let mut config = RunConfig {
            seed,
            ..RunConfig::default()
        };
        config.training.total_steps = steps;
        fingerprint(&config)
    };
    assert_eq!(of(1, 10_000), of(2, 10_000));
    assert_ne!(of(1, 10_000), of(1, 10_001));
}

#[test]
fn rows_come_back_and_what_a_kill_left_is_cut() {
    let (_place, folder) = Place::new("cut");
    folder.add(&rows(1, "abc")).unwrap();
    let whole = std::fs::read_to_string(folder.results_path()).unwrap();
    let torn = whole.clone() + &whole.replace("\"seed\":1", "\"seed\":2")[..whole.len() - 20];
    std::fs::write(folder.results_path(), torn).unwrap();
    assert_eq!(folder.results().unwrap().runs.len(), 1);
    folder.add(&rows(3, "abc")).unwrap();
    let results = folder.results().unwrap();
    let seeds: Vec<u64> = results.runs.iter().map(|run| run.key.seed).collect();
    assert_eq!(seeds, [1, 3]);
    assert_eq!(results.runs[1].evaluations.len(), 1);
    assert_eq!(results.runs[1].sessions[0].stage_gap_pool, Some(2.0));
}

#[test]
fn a_failure_counts_until_the_run_is_finished_after_all() {
    let (_place, folder) = Place::new("failed");
    let run = GridRun {
        key: key(1),
        config: RunConfig::default(),
    };
    let reason = "out of memory";
    folder.add_failure(&run, reason, provenance("abc")).unwrap();
    let row = std::fs::read_to_string(folder.results_path()).unwrap();
    let row: Row = serde_json::from_str(&row).unwrap();
    let expected = Content::Failed {
        reason: reason.into(),
        revision: "abc".into(),
        machine: "two cores".into(),
        config: settings::table(&run.config),
    };
    assert_eq!(row.content, expected);
    assert_eq!(
        folder.results().unwrap().failed,
        [(key(1), "out of memory".to_owned())]
    );
    folder.add(&rows(1, "abc")).unwrap();
    let results = folder.results().unwrap();
    assert!(results.failed.is_empty() && results.runs.len() == 1);
}

#[test]
fn a_folder_keeps_which_variant_it_is_and_is_whole_where_none_is_told() {
    let (_place, folder) = Place::new("variant");
    assert!(!folder.is_small(), "as an earlier revision left it");
    folder.keep_file("title = \"Labels\"", true).unwrap();
    assert!(folder.is_small());
    folder.keep_file("title = \"Labels\"", false).unwrap();
    assert!(!folder.is_small());
}

/// The file of a grid on the small task, and what it stands for.
fn grid_of(title: &str, axes: &str) -> (String, Grid) {
    let text = format!("title = \"{title}\"\n[axes]\ntasks = [\"go-fetch-return\"]\n{axes}\n");
    let source = GridText {
        name: "grid.toml",
        text: &text,
    };
    let grid = grid::resolve(source, false).unwrap();
    (text, grid)
}

#[test]
fn a_folder_of_another_experiment_is_named_and_an_edited_file_goes_on() {
    let (_place, folder) = Place::new("other");
    let (text, grid) = grid_of("Two methods", "methods = [\"stair\", \"pebble\"]");
    folder.check_experiment(&grid).unwrap(); // of none yet
    folder.keep_file(&text, false).unwrap();
    for (title, axes) in [
        (
            "Two methods",
            "methods = [\"stair\", \"pebble\"]\nseeds = [7, 8]",
        ),
        ("Two methods", "methods = [\"stair\"]"),
        ("Three", "methods = [\"stair\", \"pebble\", \"uniform\"]"),
    ] {
        let edited = grid_of(title, axes).1;
        folder.check_experiment(&edited).unwrap();
    }
    for (title, axes, missing) in [
        ("One method", "methods = [\"stair\"]", "pebble.oracle.1"),
        ("Two methods", "methods = [\"uniform\"]", "stair.oracle.1"),
    ] {
        let other = grid_of(title, axes).1;
        let told = folder.check_experiment(&other).unwrap_err().to_string();
        for word in ["'Two methods'", title, missing, "--out"] {
            assert!(told.contains(word), "'{word}' is not in: {told}");
        }
    }
}

#[test]
fn a_line_that_is_no_row_and_a_run_that_is_there_twice_are_named() {
    let text: String = rows(1, "abc")
        .iter()
        .map(|row| serde_json::to_string(row).unwrap() + "\n")
        .collect();
    let told = Results::parse("r.jsonl", &format!("{text}{{}}\n{text}")).unwrap_err();
    assert!(told.to_string().starts_with("r.jsonl: line 4"), "{told}");
    let told = Results::parse("r.jsonl", &format!("{text}{text}")).unwrap_err();
    assert!(
        told.to_string().contains("line 6") && told.to_string().contains("twice"),
        "{told}"
    );
}

#[test]
fn other_settings_under_the_same_name_and_rows_of_another_revision_are_named() {
    let (_place, folder) = Place::new("misfit");
    let config = RunConfig::default();
    folder.keep_settings(&config).unwrap();
    folder.add(&rows(1, "abc")).unwrap();
    let results = folder.results().unwrap();
    let mut runs = [GridRun {
        key: key(1),
        config,
    }];
    folder.check(&runs, &results, Some("abc")).unwrap();
    let told = folder
        .check(&runs, &results, Some("def"))
        .unwrap_err()
        .to_string();
    assert!(
        told.contains("abc") && told.contains("def") && told.contains("--mixed"),
        "{told}"
    );
    folder.check(&runs, &results, None).unwrap();
    runs[0].config.feedback.budget = 7;
    let told = folder.check(&runs, &results, None).unwrap_err().to_string();
    assert!(
        told.contains("feedback.budget = 2000") && told.contains("says 7"),
        "{told}"
    );
}

#[test]
fn a_row_holds_its_settings_and_those_that_came_later_count_as_by_default() {
    let (_place, folder) = Place::new("settings");
    folder.add(&rows(1, "abc")).unwrap();
    let mut results = folder.results().unwrap();
    let config = RunConfig {
        seed: 1,
        ..RunConfig::default()
    };
    assert_eq!(results.runs[0].config().unwrap(), Some(config.clone()));

    let end = &mut results.runs[0].end;
    let temporal = end.config["temporal"].as_table_mut().unwrap();
    temporal.remove("update_every").unwrap();
    end.settings = "of before there was update_every".into();
    let mut runs = [GridRun {
        key: key(1),
        config,
    }];
    folder.check(&runs, &results, None).unwrap();
    runs[0].config.temporal.update_every = 77;
    let told = folder.check(&runs, &results, None).unwrap_err().to_string();
    assert!(
        told.contains("temporal.update_every = ") && told.contains("says 77"),
        "{told}"
    );
}

#[test]
fn a_run_that_another_revision_began_is_named() {
    let (_place, folder) = Place::new("begun");
    let config = RunConfig::default();
    let path = folder.run_path(&key(1));
    std::fs::create_dir_all(&path).unwrap();
    std::fs::write(path.join("config.toml"), config.to_toml()).unwrap();
    let history = r#"{"revisions": ["abc"], "machines": ["two cores"], "wall_s": 1.0}"#;
    std::fs::write(path.join("history.json"), history).unwrap();
    let runs = [GridRun {
        key: key(1),
        config,
    }];
    let results = Results::default();
    folder.check(&runs, &results, Some("abc")).unwrap();
    let told = folder.check(&runs, &results, Some("def"));
    let told = told.unwrap_err().to_string();
    assert!(told.contains("abc") && told.contains("def"), "{told}");
    folder.check(&runs, &results, None).unwrap();
}

#[test]
fn a_kill_inside_a_character_cuts_no_more_than_its_line() {
    let (_place, folder) = Place::new("character");
    folder.add(&rows(1, "abc")).unwrap();
    let mut bytes = std::fs::read(folder.results_path()).unwrap();
    bytes.extend_from_slice(&"{\"reason\":\"−".as_bytes()[..13]);
    std::fs::write(folder.results_path(), bytes).unwrap();
    assert_eq!(folder.results().unwrap().runs.len(), 1);
}
