//! What a person may type wrong: exit code 2 and one line that says what to do.

use std::net::TcpListener;
use std::path::Path;
use std::process::{Command, Stdio};

use super::server_process::{ServerProcess, stair};

/// Runs the program and returns what it says on stderr; it must end with code 2.
fn complaint(arguments: &[&str], folder: &Path) -> String {
    let mut command: Command = stair();
    let output = command
        .args(arguments)
        .current_dir(folder)
        .stderr(Stdio::piped())
        .output()
        .expect("stair");
    let told = String::from_utf8_lossy(&output.stderr).into_owned();
    assert_eq!(
        output.status.code(),
        Some(2),
        "stair {}: {told}",
        arguments.join(" ")
    );
    told
}

fn expect(arguments: &[&str], folder: &Path, words: &[&str]) {
    let told = complaint(arguments, folder);
    for word in words {
        assert!(
            told.contains(word),
            "stair {}: '{word}' is not in: {told}",
            arguments.join(" ")
        );
    }
    assert!(!told.contains("panicked"), "{told}");
}

#[test]
fn a_wrong_name_is_answered_with_the_nearest_right_one() {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let here = folder.path();
    expect(
        &["train", "windowopen"],
        here,
        &["windowopen", "window-open"],
    );
    expect(
        &["train", "window-open", "--method", "stiar"],
        here,
        &["stiar", "did you mean 'stair'"],
    );
    expect(
        &["train", "window-open", "--preset", "quik"],
        here,
        &["quik", "did you mean 'quick'"],
    );
    expect(
        &["train", "window-open", "--teacher", "orcale"],
        here,
        &["orcale", "did you mean 'oracle'"],
    );
    expect(
        &["evaluate", "window-opne", "--policy", "expert"],
        here,
        &["window-opne", "window-open"],
    );
    expect(&["env", "push-gren"], here, &["push-gren", "push-green"]);
    expect(
        &["teach", "--run", "1", "--teacher", "orcale"],
        here,
        &["orcale", "did you mean 'oracle'"],
    );
}

#[test]
fn a_setting_that_does_not_fit_is_named_with_its_line() {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let here = folder.path();
    std::fs::write(
        here.join("key.toml"),
        "seed = 3\n\n[feedback]\nbugdet = 10\n",
    )
    .expect("a file");
    std::fs::write(
        here.join("value.toml"),
        "seed = 3\n\n[feedback]\nbudget = \"ten\"\n",
    )
    .expect("a file");
    std::fs::write(here.join("broken.toml"), "seed = \n").expect("a file");
    let train = |file| ["train", "go-fetch-return", "--config", file];
    expect(
        &train("key.toml"),
        here,
        &["key.toml", "line 4", "bugdet", "did you mean `budget`"],
    );
    expect(&train("value.toml"), here, &["value.toml", "line 4", "ten"]);
    expect(&train("broken.toml"), here, &["broken.toml", "line 1"]);
    expect(&train("nowhere.toml"), here, &["nowhere.toml"]);
    expect(
        &["train", "go-fetch-return", "--set", "feedback.bugdet=3"],
        here,
        &["bugdet", "budget"],
    );
    expect(
        &["train", "go-fetch-return", "--set", "environment.n_envs=0"],
        here,
        &["environment.n_envs", "0"],
    );
}

#[test]
fn what_has_a_place_of_its_own_is_not_taken_from_another() {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let here = folder.path();
    let set = |setting| ["train", "go-fetch-return", "--set", setting];
    expect(
        &set("task=window-open"),
        here,
        &["--set task=window-open: ", "stair train TASK"],
    );
    expect(&set("method=pebble"), here, &["use --method"]);
    expect(&set("seed=9"), here, &["use --seed"]);
    std::fs::write(here.join("mine.toml"), "seed = 3\n").expect("a file");
    expect(
        &["train", "--config", "mine.toml"],
        here,
        &["mine.toml: no task is named", "task = "],
    );
    expect(
        &["train", "go-fetch-return", "--steps", "2000"],
        here,
        &["feedback.first_step", "below training.total_steps"],
    );
    assert!(!here.join("data").exists(), "nothing was begun");
}

#[test]
fn numbers_and_choices_that_are_none_are_named_with_what_they_may_be() {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let wrong: [(&str, &[&str]); 9] = [
        (
            "evaluate window-open --policy expert --noise -1",
            &["--noise is -1", "0 or more"],
        ),
        ("train window-open --labels -1", &["--labels", "0..="]),
        ("train window-open --seed -1", &["--seed", "0 or more"]),
        ("study invite 1 --days -1", &["--days", "1..=365"]),
        ("study invite 1 --labelers 0", &["--labelers", "1..="]),
        ("study answer 1 --labelers 0", &["--labelers", "1..="]),
        (
            "figure strips x.queries --top 0 --out x.png",
            &["--top", "1 or more"],
        ),
        ("serve --bind here", &["for instance 127.0.0.1:8080"]),
        ("export", &["--run", "--study"]),
    ];
    for (line, words) in wrong {
        let arguments: Vec<&str> = line.split(' ').collect();
        expect(&arguments, folder.path(), words);
    }
}

#[test]
fn what_is_in_the_way_of_results_is_told_before_the_work() {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let here = folder.path();
    for name in ["README.md", "rows.jsonl"] {
        std::fs::write(here.join(name), "no rows\n").expect("a file");
    }
    for line in [
        "render window-open --policy expert --out README.md/x.png",
        "figure curves rows.jsonl --out README.md/x.svg",
        "experiment abstract-mdp --out README.md",
        "experiment run go-fetch-return --out README.md",
        "experiment report rows.jsonl --out README.md",
        "study pack run --out README.md/x.queries",
        "export --run 1 --out README.md/x.csv",
    ] {
        let arguments: Vec<&str> = line.split(' ').collect();
        expect(&arguments, here, &["README.md is no folder", "--out"]);
    }
    let left = std::fs::read_dir(here).expect("a folder").count();
    assert_eq!(left, 2, "nothing was made");
}

#[test]
fn a_policy_or_a_run_that_is_none_is_named() {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let here = folder.path();
    expect(
        &["evaluate", "window-open", "--policy", "nowhere"],
        here,
        &["nowhere"],
    );
    expect(
        &["evaluate", "walker-run", "--policy", "expert"],
        here,
        &["walker-run", "no scripted expert", "random"],
    );
    expect(
        &["train", "--resume", "nowhere"],
        here,
        &["nowhere", "holds no run"],
    );
    std::fs::create_dir(here.join("damaged")).expect("a folder");
    std::fs::write(here.join("damaged/config.toml"), "seed = \n").expect("a file");
    expect(
        &["train", "--resume", "damaged"],
        here,
        &["damaged/config.toml: line 1"],
    );
    expect(
        &["export", "--run", "1", "--data", "nowhere"],
        here,
        &["nowhere"],
    );
}

#[test]
fn a_policy_of_another_task_a_missing_device_and_too_little_memory_are_named() {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let here = folder.path();
    let few_steps = [
        "train",
        "go-fetch-return",
        "--preset",
        "quick",
        "--steps",
        "50",
        "--labels",
        "0",
        "--set",
        "evaluation.episodes=1",
        "--out",
        "trained",
        "--json",
    ];
    let mut command: Command = stair();
    let output = command.args(few_steps).current_dir(here).output();
    assert!(output.expect("stair").status.success());
    expect(
        &["evaluate", "window-open", "--policy", "trained"],
        here,
        &["go-fetch-return", "window-open"],
    );
    expect(
        &["train", "--resume", "trained", "--device", "tpu"],
        here,
        &["tpu", "cuda"],
    );
    expect(
        &["train", "go-fetch-return", "--device", "tpu"],
        here,
        &["tpu", "cuda"],
    );
    expect(
        &["train", "go-fetch-return", "--steps", "1000000000000"],
        here,
        &["training.total_steps", "GiB"],
    );
}

#[test]
fn a_port_in_use_and_a_folder_in_use_are_named() {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let here = folder.path();
    let taken = TcpListener::bind("127.0.0.1:0").expect("a port");
    let address = taken.local_addr().expect("an address").to_string();
    let (_, taken_port) = address.split_once(':').expect("address and port");
    expect(
        &["serve", "--bind", &address, "--data", "mine"],
        here,
        &["in use", taken_port],
    );

    let data = here.join("held");
    let _server = ServerProcess::start(&data);
    expect(
        &["serve", "--bind", "127.0.0.1:0", "--data", "held"],
        here,
        &["held"],
    );
}

#[test]
fn a_teacher_without_server_run_or_right_token_is_told_which() {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let here = folder.path();
    let unused = TcpListener::bind("127.0.0.1:0")
        .expect("a port")
        .local_addr()
        .expect("an address");
    let nobody = format!("http://{unused}");
    expect(
        &["teach", "--server", &nobody, "--run", "1"],
        here,
        &["cannot reach", &nobody, "stair serve"],
    );
    expect(
        &["teach", "--server", "127.0.0.1:8080", "--run", "1"],
        here,
        &["http://"],
    );

    let server = ServerProcess::start(&here.join("data"));
    let url = format!("http://{}", server.address);
    expect(
        &["teach", "--server", &url, "--run", "no-such-run"],
        here,
        &["no-such-run"],
    );
    let run = server.create_run("uniform", 1, "quick", &serde_json::json!({}));
    expect(
        &["teach", "--server", &url, "--run", &run, "--token", "wrong"],
        here,
        &["token"],
    );
}

#[test]
fn an_experiment_that_does_not_fit_is_named_with_its_line() {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let here = folder.path();
    let grid = |name: &str, methods: &str| {
        let text =
            format!("title = \"x\"\n\n[axes]\ntasks = [\"window-open\"]\nmethods = {methods}\n");
        std::fs::write(here.join(name), text).expect("a file");
    };
    grid("name.toml", "[\"stiar\"]");
    grid("empty.toml", "[]");
    let run = |file| ["experiment", "run", file];
    let on_tpu = ["experiment", "run", "go-fetch-return", "--device", "tpu"];
    expect(&on_tpu, here, &["tpu", "cpu", "cuda"]);
    assert!(!here.join("data").exists(), "nothing is written");
    expect(
        &run("name.toml"),
        here,
        &["name.toml", "line 5", "did you mean 'stair'"],
    );
    expect(
        &run("empty.toml"),
        here,
        &["empty.toml", "line 5", "nothing to run"],
    );
    grid("mine.toml", "[\"pebble\"]");
    std::fs::create_dir(here.join("theirs")).expect("a folder");
    let theirs = "title = \"y\"\n[axes]\ntasks = [\"go-fetch-return\"]\nmethods = [\"stair\"]\n";
    std::fs::write(here.join("theirs/experiment.toml"), theirs).expect("a file");
    expect(
        &["experiment", "run", "mine.toml", "--out", "theirs"],
        here,
        &[
            "holds another experiment, 'y'",
            "go-fetch-return.stair.oracle.1",
            "--out",
        ],
    );
    expect(&run("nowhere.toml"), here, &["nowhere.toml"]);
    expect(&run("mine/grid"), here, &["cannot read mine/grid"]);
    expect(
        &run("metaword"),
        here,
        &["metaword", "did you mean 'metaworld'"],
    );
    expect(&["experiment", "chek", "--out", "x"], here, &["chek"]);
    expect(&["experiment", "report", "nowhere"], here, &["nowhere"]);
    std::fs::write(here.join("rows.jsonl"), "{}\n").expect("a file");
    expect(
        &["experiment", "report", "rows.jsonl"],
        here,
        &["rows.jsonl", "line 1"],
    );
}

#[test]
fn results_that_do_not_go_together_are_named() {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let here = folder.path();
    let shipped = concat!(
        env!("CARGO_MANIFEST_DIR"),
        "/../../assets/results/go-fetch-return-world-axes/80-answers/results.jsonl"
    );
    let rows = std::fs::read_to_string(shipped).expect("rows that come with the program");
    let of_a_kind = |keep: &dyn Fn(&serde_json::Value) -> bool,
                     change: &dyn Fn(&mut serde_json::Value)| {
        let rows = rows.lines().filter_map(|line| {
            let mut row: serde_json::Value = serde_json::from_str(line).expect("a row");
            let is_kept = row["method"] == "stair" && keep(&row);
            change(&mut row);
            is_kept.then(|| row.to_string() + "\n")
        });
        rows.collect::<String>()
    };
    let first = of_a_kind(&|row| row["seed"] == 1, &|_| ());
    std::fs::write(here.join("first.jsonl"), &first).expect("a file");
    let report = |other: &str, says: &[&str]| {
        std::fs::write(here.join("other.jsonl"), other).expect("a file");
        let arguments = [
            "experiment",
            "report",
            "first.jsonl",
            "other.jsonl",
            "--out",
            "report",
        ];
        expect(&arguments, here, says);
        assert!(!here.join("report").exists(), "nothing is written");
    };
    let second =
        |change: &dyn Fn(&mut serde_json::Value)| of_a_kind(&|row| row["seed"] == 2, change);
    report(
        &second(&|row| row["task"] = "window-open".into()),
        &["different tasks", "window-open"],
    );
    let of_finished = |row: &mut serde_json::Value, key: &str, value: serde_json::Value| {
        if row["kind"] == "finished" {
            row[key] = value;
        }
    };
    report(
        &second(&|row| of_finished(row, "budget", 96.into())),
        &["budget", "80", "96"],
    );
    report(
        &second(&|row| of_finished(row, "revision", "0123abc".into())),
        &["0123abc (1 run", "--mixed"],
    );
}

#[test]
fn a_reader_that_has_seen_enough_is_no_error() {
    for arguments in [
        &["tasks"][..],
        &["experiment", "list"],
        &["experiment", "check", "metaworld"],
    ] {
        let mut program = stair()
            .args(arguments)
            .stdout(Stdio::piped())
            .spawn()
            .expect("stair");
        drop(program.stdout.take());
        let status = program.wait().expect("it ends");
        assert!(status.success(), "{arguments:?}: {status}");
    }
}

#[test]
fn an_expert_that_nobody_wrote_and_a_task_that_is_none_are_named() {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let here = folder.path();
    let watch = |task| {
        let of = ["experiment", "timestep-classifier", "--task"];
        [of.as_slice(), &["go-fetch-return", task, "--out", "out"]].concat()
    };
    expect(
        &watch("walker-run"),
        here,
        &["walker-run", "no scripted expert", "door-open"],
    );
    expect(
        &watch("windowopen"),
        here,
        &["windowopen", "did you mean 'window-open'"],
    );
    assert!(!here.join("out").exists(), "nothing was begun");
    std::fs::write(here.join("out"), "a file").expect("a file");
    expect(&watch("door-open"), here, &["cannot make the folder out"]);
    expect(
        &["experiment", "timestep-clasifier", "--out", "elsewhere"],
        here,
        &["did you mean 'timestep-classifier'"],
    );
    let few = [watch("door-open"), vec!["--episodes", "1"]].concat();
    expect(&few, here, &["--episodes", "2..=20000"]);
}

#[test]
fn nobody_who_reads_on_ends_it_without_a_word() {
    let (reader, writer) = std::io::pipe().expect("a pipe");
    drop(reader);
    let output = stair()
        .arg("openapi")
        .stdout(writer)
        .stderr(Stdio::piped())
        .spawn()
        .and_then(std::process::Child::wait_with_output)
        .expect("stair");
    assert_eq!(String::from_utf8_lossy(&output.stderr), "");
    assert_eq!(output.status.code(), Some(141));
}
