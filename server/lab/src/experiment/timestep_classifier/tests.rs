use super::*;

/// Episodes of 100 steps, a small net, a second or so.
fn settings(tasks: &[&str], seed: u64) -> Settings {
    Settings {
        tasks: tasks.iter().map(|t| Played::find(t).unwrap()).collect(),
        seed,
        n_episodes: 5,
        n_threads: NonZeroUsize::new(2).unwrap(),
        classifier: TimestepConfig {
            hidden: vec![32],
            epochs: 3,
            ..TimestepConfig::default()
        },
    }
}

fn names(files: &[Artifact]) -> Vec<&str> {
    files.iter().map(|file| file.name.as_str()).collect()
}

#[test]
fn the_run_has_rows_tables_figures_and_an_episode_of_each_task() {
    let settings = settings(&["go-fetch-return"], 1);
    let files = run(&settings, &|_| ()).unwrap();
    let expected = [
        "timestep-classifier.jsonl",
        "timestep-classifier.md",
        "timestep-classifier.svg",
        "go-fetch-return.jsonl",
        "stage-map.svg",
    ];
    assert_eq!(names(&files), expected);
    let outcome: Outcome = serde_json::from_str(files[0].text.trim()).unwrap();
    let held_out = &outcome.held_out;
    assert_eq!(
        (outcome.n_fitted_episodes, outcome.n_held_out_episodes),
        (2, 3)
    );
    assert_eq!((held_out.n_steps, held_out.n_states), (100, 300));
    assert!(files[1].text.contains("| go-fetch-return | 1 | 100 |"));
    let rows: Vec<Vec<f32>> = files[3]
        .text
        .lines()
        .map(|line| serde_json::from_str(line).unwrap())
        .collect();
    assert_eq!(rows.len(), 100);
    for row in rows {
        assert_eq!(row.len(), N_SHOWN_STAGES);
        assert!((row.iter().sum::<f32>() - 1.0).abs() < 2e-3, "{row:?}");
    }
}

#[test]
fn the_same_seed_gives_the_same_bytes_on_any_number_of_threads() {
    let one = settings(&["go-fetch-return", "sweep-into"], 1);
    let alone = Settings {
        n_threads: NonZeroUsize::MIN,
        n_episodes: 2,
        ..one.clone()
    };
    let beside = Settings {
        n_episodes: 2,
        ..one
    };
    let files = run(&beside, &|_| ()).unwrap();
    assert_eq!(files, run(&alone, &|_| ()).unwrap());
    let other = Settings { seed: 2, ..beside };
    assert_ne!(files[0], run(&other, &|_| ()).unwrap()[0]);
}

#[test]
fn every_pass_of_every_task_is_told() {
    let told = std::sync::Mutex::new(Vec::new());
    run(&settings(&["go-fetch-return"], 1), &|progress| {
        told.lock().unwrap().push(progress.n_epochs);
    })
    .unwrap();
    assert_eq!(told.into_inner().unwrap(), [1, 2, 3]);
}

#[test]
fn held_out_episodes_are_none_that_the_classifier_was_fitted_to() {
    let played = Played::find("go-fetch-return").unwrap();
    let fitted = |k| Rng::new(1, Stream::EpisodeSeed, k).next_u64();
    let starts = |seed| played.play(seed).unwrap().0[..16].to_vec();
    let held_out: Vec<Vec<f32>> = (0..3).map(|k| starts(held_out_seed(1, k))).collect();
    for k in 0..2 {
        assert!(!held_out.contains(&starts(fitted(k))));
    }
}

#[test]
fn tasks_that_nobody_plays_or_knows_are_named() {
    let told = |name| Played::find(name).err().unwrap().to_string();
    let no_expert = told("walker-run");
    assert!(
        no_expert.contains("walker-run has no scripted expert") && no_expert.contains("door-open"),
        "{no_expert}"
    );
    let unknown = told("windowopen");
    assert!(unknown.contains("did you mean 'window-open'"), "{unknown}");
}
