use super::*;
use crate::method;
use learn::temporal::ContrastiveLoss;

fn layers(presets: &[&str], overrides: &[&str]) -> Layers {
    Layers {
        task: Some("go-fetch-return".into()),
        presets: presets.iter().map(ToString::to_string).collect(),
        overrides: overrides.iter().map(ToString::to_string).collect(),
        ..Layers::default()
    }
}

#[test]
fn every_preset_resolves_for_every_task_and_method() {
    for task in sim::tasks::tasks() {
        for method in method::METHODS {
            for presets in [vec![], vec!["quick".to_owned()]] {
                let layers = Layers {
                    task: Some(task.name.into()),
                    method: Some(method.name.into()),
                    presets,
                    ..Layers::default()
                };
                let needs_stages = (method.build)(&RunConfig::default()).needs_true_stages();
                let is_possible = !needs_stages || !(task.spec)().stages.is_empty();
                match RunConfig::resolve(&layers) {
                    Ok(_) => assert!(is_possible, "{} {}", task.name, method.name),
                    Err(error) => assert!(!is_possible, "{}: {error}", task.name),
                }
            }
        }
    }
}

#[test]
fn a_task_that_does_not_know_its_stages_cannot_tell_them() {
    let layers = Layers {
        task: Some("window-open".into()),
        method: Some("true_stage".into()),
        ..Layers::default()
    };
    let error = RunConfig::resolve(&layers).unwrap_err().to_string();
    assert!(error.contains("does not know its own"), "{error}");
}

#[test]
fn a_whole_episode_alone_makes_no_pair() {
    let whole = "queries.segment_len=100"; // of go-fetch-return
    assert!(RunConfig::resolve(&layers(&[], &[whole])).is_ok());
    for key in ["queries.newest_episodes", "queries.near_policy_episodes"] {
        let one = format!("{key}=1");
        assert!(RunConfig::resolve(&layers(&[], &[&one])).is_ok());
        let told = RunConfig::resolve(&layers(&[], &[whole, &one])).unwrap_err();
        assert!(told.to_string().contains(key), "{told}");
    }
}

/// ALGORITHMS.md 7: answers in all and in a session, steps between sessions, the first session.
#[test]
fn feedback_is_as_the_paper_gives_it_for_each_task() {
    let control = |n, every| (n, n / 10, every, 10_000);
    let meta_world = |n| (n, 50, 5_000, 10_000);
    for (task, expected) in [
        ("walker-run", control(1_000, 20_000)),
        ("cheetah-run", control(1_000, 20_000)),
        ("quadruped-walk", control(2_000, 30_000)),
        ("quadruped-run", control(2_000, 30_000)),
        ("door-open", meta_world(5_000)),
        ("sweep-into", meta_world(10_000)),
        ("window-open", meta_world(2_000)),
        ("window-close", meta_world(2_000)),
        ("door-unlock", meta_world(5_000)),
        ("faucet-open", meta_world(3_000)),
        ("push-green", meta_world(1_000)),
        ("drawer-open", meta_world(3_000)),
    ] {
        for method in ["stair", "pebble"] {
            let layers = Layers {
                task: Some(task.into()),
                method: Some(method.into()),
                ..Layers::default()
            };
            let found = RunConfig::resolve(&layers).unwrap().feedback;
            let found = (
                found.budget,
                found.queries_per_session,
                found.every,
                found.first_step,
            );
            assert_eq!(found, expected, "{task}, {method}");
        }
    }
}

/// ALGORITHMS.md 5 and the paper's tables of hyper-parameters.
#[test]
fn a_method_has_constants_of_its_own_for_some_tasks() {
    let resolved = |method: &str, task: &str| {
        let layers = Layers {
            task: Some(task.into()),
            method: Some(method.into()),
            ..Layers::default()
        };
        RunConfig::resolve(&layers).unwrap()
    };
    let qpa = |task| resolved("qpa", task).queries.near_policy_episodes;
    assert_eq!(
        ["window-open", "door-open", "door-unlock"].map(qpa),
        [10, 60, 30]
    );
    let rime = |task| resolved("rime", task).denoising.decay_epochs;
    assert_eq!(["window-open", "quadruped-run"].map(rime), [600, 60]);
    let mrn = |task| resolved("mrn", task).steering.every;
    let tasks = ["door-open", "walker-run", "quadruped-walk", "cheetah-run"];
    assert_eq!(tasks.map(mrn), [10_000, 1_000, 3_000, 5_000]);
    assert_eq!(mrn("go-fetch-return"), 500);
    let least = |task| resolved("rime", task).denoising.least_epochs;
    assert_eq!(["window-open", "quadruped-run"].map(least), [5, 15]);
    assert_eq!(least("go-fetch-return"), 50);
    let surf = |task| {
        let config = resolved("surf", task).semi_supervised;
        (config.passes, config.unlabeled_per_query)
    };
    assert_eq!(
        ["window-open", "cheetah-run"].map(surf),
        [(20, 10), (1_000, 100)]
    );
    let fits = |task| {
        let reward = resolved("qpa", task).reward;
        (reward.max_epochs, reward.stop_accuracy)
    };
    assert_eq!(
        ["window-open", "walker-run"].map(fits),
        [(200, 0.97), (2_000, 0.98)]
    );
}

/// The paper's tables of hyper-parameters, for Meta-World and for the control suite.
#[test]
fn the_papers_table_is_printed_value_by_value() {
    for (task, rate, every, batch) in [
        ("window-open", 1e-4, 5_000, 512),
        ("walker-run", 5e-4, 20_000, 1_024),
    ] {
        let layers = Layers {
            task: Some(task.into()),
            method: Some("rune".into()),
            presets: vec!["paper_table".into()],
            ..Layers::default()
        };
        let config = RunConfig::resolve(&layers).unwrap();
        let agent = &config.agent;
        let told = vec![
            agent.actor_learning_rate,
            agent.critic_learning_rate,
            config.reward.learning_rate,
            agent.initial_temperature,
            agent.critic_ema,
            config.bonus.decay,
        ];
        assert_eq!(told, vec![rate, rate, rate, 0.2, 0.01, 1e-3], "{task}");
        assert_eq!(
            (config.feedback.every, config.temporal.batch),
            (every, batch),
            "{task}"
        );
        assert_eq!(config.temporal.loss, ContrastiveLoss::Symmetric, "{task}");
    }
}

#[test]
fn a_later_layer_wins_and_the_saved_tree_reads_back() {
    let config = RunConfig::resolve(&layers(&["quick"], &["training.total_steps=123456"])).unwrap();
    assert_eq!(config.training.total_steps, 123_456);
    assert_eq!(
        RunConfig::parse("saved", &config.to_toml()).unwrap(),
        config
    );
}

#[test]
fn a_wrong_key_is_named_with_its_line_and_the_nearest_right_one() {
    let file = (
        "my.toml".to_owned(),
        "seed = 3\n\n[feedback]\nbugdet = 10\n".to_owned(),
    );
    let error = RunConfig::resolve(&Layers {
        file: Some(file),
        ..Layers::default()
    })
    .unwrap_err();
    let text = error.to_string();
    assert!(
        text.contains("my.toml: line 4") && text.contains("did you mean `budget`"),
        "{text}"
    );
}

#[test]
fn a_file_that_names_no_task_is_told_to_and_one_that_does_has_its_task() {
    let of = |text: &str| {
        let file = Some(("my.toml".to_owned(), text.to_owned()));
        RunConfig::resolve(&Layers {
            file,
            ..Layers::default()
        })
    };
    let told = of("seed = 3\n").unwrap_err().to_string();
    assert!(told.starts_with("my.toml: no task is named"), "{told}");
    assert_eq!(of("task = \"window-open\"\n").unwrap().task, "window-open");
}

#[test]
fn a_setting_that_names_another_task_or_method_is_not_passed_over() {
    let of = |setting: &str| {
        RunConfig::resolve(&Layers {
            method: Some("stair".into()),
            ..layers(&[], &[setting])
        })
    };
    for (setting, named) in [
        ("task=window-open", "go-fetch-return already"),
        ("method=pebble", "stair already"),
    ] {
        let told = of(setting).unwrap_err().to_string();
        assert!(told.starts_with(&format!("--set {setting}: ")), "{told}");
        assert!(told.contains(named), "{told}");
    }
    assert!(of("method=stair").is_ok());
    let whose = [
        "task=x",
        "method = 'x'",
        "seed=7",
        "agent.batch=7",
        "seed=x",
    ]
    .map(identity);
    assert_eq!(
        whose,
        [Some("task"), Some("method"), Some("seed"), None, None]
    );
}

#[test]
fn a_run_that_ends_before_its_first_question_is_refused_unless_it_is_to_ask_none() {
    let at_its_end = ["training.total_steps=5000", "feedback.first_step=5000"];
    let told = RunConfig::resolve(&layers(&[], &at_its_end)).unwrap_err();
    let told = told.to_string();
    assert!(told.contains("feedback.first_step is 5000"), "{told}");
    for more in ["training.total_steps=5001", "feedback.budget=0"] {
        let settings = [at_its_end[0], at_its_end[1], more];
        assert!(
            RunConfig::resolve(&layers(&[], &settings)).is_ok(),
            "{more}"
        );
    }
    let asks_nobody = Layers {
        method: Some("sac".into()),
        ..layers(&[], &at_its_end)
    };
    let mut config = RunConfig::resolve(&asks_nobody).unwrap();
    config.method = "stair".into();
    let saved = RunConfig::parse("saved", &config.to_toml());
    assert!(saved.is_ok(), "what an earlier program began can be read");
}

#[test]
fn a_wrong_name_is_answered_with_the_nearest_right_one() {
    let wrong = Layers {
        task: Some("windowopen".into()),
        ..Layers::default()
    };
    assert!(
        RunConfig::resolve(&wrong)
            .unwrap_err()
            .to_string()
            .contains("did you mean 'window-open'")
    );
    let error = RunConfig::resolve(&layers(&["quik"], &[])).unwrap_err();
    assert!(
        error.to_string().contains("did you mean 'quick'"),
        "{error}"
    );
}

#[test]
fn a_value_of_the_wrong_kind_is_told_what_to_write_instead() {
    for (bad, wanted) in [
        ("agent.discount=high", "expected a number"),
        (
            "agent.batch=1.5",
            "number `1.5`, expected a whole number, 0 or more",
        ),
        ("agent.batch=-1", "expected a whole number, 0 or more"),
        ("agent.layer_norm=1", "expected true or false"),
        ("agent.hidden=3", "expected a list, as in [256, 256]"),
        ("queries.sampler=3", "expected text in quotes"),
        ("agent=3", "expected a table of settings"),
    ] {
        let told = RunConfig::resolve(&layers(&[], &[bad])).unwrap_err();
        let told = told.to_string();
        assert!(told.starts_with(&format!("--set {bad}: ")), "{told}");
        assert!(told.ends_with(wanted), "{told}");
    }
}

#[test]
fn a_whole_number_that_is_too_large_is_told_the_largest() {
    let most_u64 = "at most 9223372036854775807"; // of TOML's
    for (bad, wanted) in [
        (
            "feedback.budget=5000000000",
            "integer `5000000000`, expected a whole number, at most 4294967295",
        ),
        ("seed=9223372036854775808", most_u64),
        ("seed=18446744073709551616", most_u64),
        ("exploration.neighbours=18446744073709551616", most_u64),
        ("agent.hidden=[9223372036854775808]", most_u64),
        (
            "seed=999999999999999999999999999999999999999999",
            "a whole number is at most 9223372036854775807",
        ),
        ("seed=-1", "expected a whole number, 0 or more"),
    ] {
        let told = RunConfig::resolve(&layers(&[], &[bad])).unwrap_err();
        let told = told.to_string();
        assert!(told.ends_with(wanted), "{told}");
        assert!(!told.contains("string") && !told.contains("128"), "{told}");
    }
    let largest = layers(&[], &["seed=9223372036854775807"]);
    let seed = RunConfig::resolve(&largest).unwrap().seed;
    assert_eq!(seed, 9_223_372_036_854_775_807);
}

#[test]
fn digits_that_are_no_number_are_not_called_text() {
    let told = RunConfig::resolve(&layers(&[], &["seed=007"])).unwrap_err();
    let told = told.to_string();
    assert!(told.contains("leading zero"), "{told}");
    let word = RunConfig::resolve(&layers(&[], &["seed=7up"])).unwrap_err();
    assert!(word.to_string().contains("string \"7up\""), "{word}");
    let none = layers(&[], &["queries.sampler="]);
    assert_eq!(RunConfig::resolve(&none).unwrap().queries.sampler, "");
}

#[test]
fn settings_that_nobody_typed_as_options_are_called_what_they_were() {
    let wrong = layers(&[], &["feedback.bugdet=3"]);
    let told = RunConfig::resolve_from("settings", &wrong).unwrap_err();
    let told = told.to_string();
    assert!(told.starts_with("settings feedback.bugdet=3: "), "{told}");
    let told = RunConfig::resolve(&wrong).unwrap_err().to_string();
    assert!(told.starts_with("--set feedback.bugdet=3: "), "{told}");
}

#[test]
fn a_teacher_that_is_none_is_answered_with_the_nearest_who_may_answer() {
    let told = |name, others: &[&str]| find_teacher(name, others).unwrap_err().to_string();
    let scripted = told("orcale", &[]);
    assert!(scripted.contains("did you mean 'oracle'"), "{scripted}");
    let person = told("humna", &["human", "http"]);
    assert!(person.contains("did you mean 'human'"), "{person}");
    assert!(person.contains("known: human, http, oracle"), "{person}");
    assert!(find_teacher("human", &[]).is_err());
    for (name, _) in SCRIPTED {
        assert_eq!(find_teacher(name, &[]), Ok(()));
        assert!(scripted_teacher(name, 1, &TeacherSettings::default()).is_ok());
    }
    let none = scripted_teacher("nobody", 1, &TeacherSettings::default());
    assert!(matches!(
        none,
        Err(ConfigError::UnknownName {
            what: "teacher",
            ..
        })
    ));
}

#[test]
fn a_value_out_of_range_or_of_the_wrong_kind_is_refused() {
    for bad in [
        "environment.n_envs=0",
        "environment.episode_len=5",
        "environment.episode_len=100000",
        "queries.same_stage_fraction=1.5",
        "queries.sampler=disagrement",
        "queries.near_policy_episodes=0",
        "agent.actor_ema=1.5",
        "agent.final_rate=0.0",
        "reward.final_rate=0.0",
        "agent.final_entropy=0.5",
        "agent.initial_entropy=0.7",
        "teacher.mistake=1.5",
        "teacher.discount=0.0",
        "bonus.decay=1.0",
        "denoising.flip_below=0.0",
        "semi_supervised.certainty=0.2",
        "semi_supervised.passes=0",
        "seed=many",
        "seed",
        "feedback.every=0",
        "agent.hidden=[256, 0]",
        "agent.hidden=[1000000000]",
        "agent.batch=0",
        "agent.precision=f16",
        "agent.discount=1.0",
        "agent.critic_ema=0.0",
        "agent.final_critic_ema=-0.1",
        "agent.target_every=0",
        "agent.actor_learning_rate=nan",
        "reward.members=0",
        "reward.learning_rate=-1e-3",
        "reward.label_margin=0.5",
        "reward.max_epochs=0",
        "temporal.block_episodes=0",
        "temporal.update_every=0",
        "temporal.discount=1.0",
        "temporal.latent=7",
        "temporal.max_gradient_norm=0.0",
        "steering.every=0",
        "exploration.neighbours=0",
        "exploration.neighbours=1000000000000",
        "evaluation.episodes=0",
        "evaluation.episodes=4294967295",
        "queries.candidates_per_query=4294967295",
        "semi_supervised.unlabeled_per_query=4294967295",
        "semi_supervised.margin=4294967295",
        "semi_supervised.crop_spread=4294967295",
        "semi_supervised.batch_ratio=1000000000000",
        "queries.coefficients.stage=nan",
    ] {
        let error = RunConfig::resolve(&layers(&[], &[bad])).unwrap_err();
        let (key, value) = bad.split_once('=').unwrap_or((bad, bad));
        // A name out of a list is told by itself, among its neighbours.
        let word = if key == "queries.sampler" { value } else { key };
        assert!(error.to_string().contains(word), "{bad}: {error}");
    }
}
