//! `stair tasks`: the names that the other commands take.

use std::process::ExitCode;

use domain::teacher::SCRIPTED;
use lab::config::PRESETS;
use lab::method::METHODS;
use serde_json::json;

use super::say;

/// List tasks, methods, presets and teachers
#[derive(Debug, clap::Args)]
#[command(after_help = "Examples:
  stair tasks
  stair tasks --json")]
pub struct Args {
    /// One JSON object instead of a table
    #[arg(long)]
    json: bool,
}

/// Runs the command.
///
/// # Errors
/// Standard output that cannot be written.
pub fn run(args: &Args) -> anyhow::Result<ExitCode> {
    if args.json {
        say(&format!("{}\n", as_json()))?;
    } else {
        say(&as_text())?;
    }
    Ok(ExitCode::SUCCESS)
}

/// Names that `--preset` takes, each once, with the tasks that it is for.
fn presets() -> Vec<(&'static str, Vec<&'static str>)> {
    let is_layer = |name: &str| name != "task" && METHODS.iter().all(|m| m.name != name);
    let mut presets: Vec<(&str, Vec<&str>)> = Vec::new();
    for (name, task, _) in PRESETS.iter().filter(|(name, _, _)| is_layer(name)) {
        match presets.iter_mut().find(|(known, _)| known == name) {
            Some((_, tasks)) => tasks.push(task),
            None => presets.push((name, vec![task])),
        }
    }
    presets
}

fn as_json() -> serde_json::Value {
    let tasks: Vec<_> = sim::tasks::tasks()
        .iter()
        .map(|task| {
            let spec = (task.spec)();
            json!({
                "name": task.name, "title": task.title, "summary": task.summary,
                "observation_size": spec.observation_size, "action_size": spec.action_size,
                "episode_len": spec.episode_len, "segment_len": spec.segment_len, "stages": spec.stages,
            })
        })
        .collect();
    let methods: Vec<_> = METHODS
        .iter()
        .map(|m| json!({"name": m.name, "summary": m.summary}))
        .collect();
    let presets: Vec<_> = presets()
        .iter()
        .map(|(name, tasks)| json!({"name": name, "tasks": tasks}))
        .collect();
    let teachers: Vec<_> = SCRIPTED
        .iter()
        .map(|(name, summary)| json!({"name": name, "summary": summary}))
        .collect();
    json!({"tasks": tasks, "methods": methods, "presets": presets, "teachers": teachers})
}

fn as_text() -> String {
    let mut text = String::new();
    let mut list = |heading: &str, rows: &[(String, String)]| {
        let width = rows
            .iter()
            .map(|(name, _)| name.len())
            .max()
            .unwrap_or_default();
        text.extend([heading, "\n"]);
        for (name, summary) in rows {
            text.extend([format!("  {name:width$}  {summary}\n")]);
        }
    };
    let tasks: Vec<_> = sim::tasks::tasks()
        .iter()
        .map(|t| (t.name.to_owned(), t.summary.to_owned()))
        .collect();
    let methods: Vec<_> = METHODS
        .iter()
        .map(|m| (m.name.to_owned(), m.summary.to_owned()))
        .collect();
    let presets: Vec<_> = presets()
        .iter()
        .map(|(name, tasks)| ((*name).to_owned(), format!("for {}", told(tasks))))
        .collect();
    let teachers: Vec<_> = SCRIPTED
        .iter()
        .map(|(n, s)| ((*n).to_owned(), (*s).to_owned()))
        .collect();
    list("Tasks", &tasks);
    list("\nMethods (--method)", &methods);
    list(
        "\nPresets (--preset, on top of the task's and the method's own)",
        &presets,
    );
    list("\nTeachers (--teacher)", &teachers);
    text
}

/// An empty name among those of tasks stands for all of them.
fn told(tasks: &[&str]) -> String {
    if tasks.contains(&"") {
        "all tasks".to_owned()
    } else {
        tasks.join(", ")
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_task_method_preset_and_teacher_is_listed() {
        let (text, json) = (as_text(), as_json().to_string());
        let names = sim::tasks::tasks()
            .iter()
            .map(|t| t.name)
            .chain(METHODS.iter().map(|m| m.name));
        assert!(text.contains("for all tasks"), "paper_table");
        for name in names.chain(["quick", "oracle", "mistaken"]) {
            assert!(text.contains(name) && json.contains(name), "{name}");
        }
    }
}
