//! `/`: choose a task, or go on with a run.

use std::time::Duration;

use askama::Template;
use axum::extract::State;
use axum::response::{Redirect, Response};
use lab::config::{Layers, RunConfig};
use lab::cost::time_here;
use lab::figure::shown_method;
use lab::words::thousands;
use serde::Deserialize;
use serde_json::{Map, json};

use super::{show, title};
use crate::api::runs::{self, RunRequest, RunView};
use crate::assets;
use crate::extract::Form;
use crate::live::HUMAN;
use crate::problem::Problem;
use crate::state::AppState;

/// Time that a person takes for one answer, looking once or twice.
const ANSWER: Duration = Duration::from_secs(4);

#[derive(Template)]
#[template(path = "home.html")]
struct HomePage {
    /// In the order of the registry.
    tasks: Vec<TaskCard>,
    /// The same options for every task.
    methods: Vec<Choice>,
    teachers: Vec<Choice>,
    presets: Vec<Choice>,
    /// What is under way or can be taken up, and what is over; empty lists are left out.
    groups: Vec<RunGroup>,
    has_runs: bool,
    /// Whether there are enough of them to be held against each other.
    can_compare: bool,
}

/// Runs under one heading.
struct RunGroup {
    heading: &'static str,
    /// Newest first.
    runs: Vec<RunLine>,
}

/// What a person wants to know before pressing Start.
struct TaskCard {
    /// As programs type it.
    name: &'static str,
    /// As people read it.
    title: &'static str,
    /// What the agent should learn, one sentence.
    summary: &'static str,
    /// Address of a picture.
    picture: String,
    /// `about 80 answers`
    labels: String,
    /// `about 10 minutes`
    minutes: String,
    /// Answers at most, unless chosen otherwise.
    budget: u32,
}

/// One line of a drop-down list.
struct Choice {
    /// For the server.
    value: &'static str,
    /// For people.
    words: String,
    /// Chosen unless somebody opens the list.
    is_default: bool,
}

/// A run that exists.
struct RunLine {
    id: String,
    /// The task's title.
    title: String,
    /// `STAIR, seed 1, begun `: with the time after it, tells equal runs apart.
    details: String,
    /// RFC 3339, from which a script makes the reader's own time.
    begun_at: String,
    /// `2026-05-02 14:02 UTC`.
    begun: String,
    /// Kind of state, for colour.
    state: String,
    /// State in a few words.
    message: String,
    /// `20 of 80 answers`
    labels: String,
    /// Whether people can answer it now.
    can_label: bool,
}

/// `GET /`
///
/// # Errors
/// A store that cannot be read.
pub async fn page(State(app): State<AppState>) -> Result<Response, Problem> {
    let lines = run_lines(&app).await?;
    let can_compare = lines.len() > 1;
    let groups = groups(lines);
    Ok(show(&HomePage {
        tasks: sim::tasks::tasks().iter().map(card).collect(),
        methods: methods(),
        teachers: teachers(),
        presets: presets(),
        has_runs: !groups.is_empty(),
        can_compare,
        groups,
    }))
}

/// Runs that go on before those that are finished.
fn groups(runs: Vec<RunLine>) -> Vec<RunGroup> {
    let (earlier, open): (Vec<_>, Vec<_>) =
        runs.into_iter().partition(|run| run.state == "finished");
    [("Go on with a run", open), ("Earlier runs", earlier)]
        .into_iter()
        .filter(|(_, runs)| !runs.is_empty())
        .map(|(heading, runs)| RunGroup { heading, runs })
        .collect()
}

/// What the form of a task sends; everything but the task may be left alone.
#[derive(Deserialize)]
pub struct StartForm {
    task: String,
    method: Option<String>,
    preset: Option<String>,
    teacher: Option<String>,
    /// A number, or empty.
    budget: Option<String>,
    /// A number, or empty.
    seed: Option<String>,
}

/// `POST /runs`: starts a run and goes where it is answered, or watched where a script answers.
///
/// # Errors
/// Settings that do not fit, with the nearest right name.
pub async fn start(
    State(app): State<AppState>,
    Form(form): Form<StartForm>,
) -> Result<Redirect, Problem> {
    let is_for_people = form
        .teacher
        .as_deref()
        .is_none_or(|teacher| teacher == HUMAN);
    let mut settings = Map::new();
    if let Some(budget) = number("Answers at most", form.budget.as_deref())? {
        settings.insert("feedback.budget".to_owned(), json!(budget));
    }
    let request = RunRequest {
        task: form.task,
        method: form.method,
        preset: form.preset,
        seed: number("Seed", form.seed.as_deref())?,
        teacher: form.teacher,
        settings,
        ..RunRequest::default()
    };
    let run = runs::start(&app, request).await?;
    let next = if is_for_people { "/label" } else { "" };
    Ok(Redirect::to(&format!("/runs/{run}{next}")))
}

/// A field of a form that may be left empty.
fn number(field: &str, text: Option<&str>) -> Result<Option<u64>, Problem> {
    match text.map(str::trim) {
        None | Some("") => Ok(None),
        Some(text) => text.parse().map(Some).map_err(|_| {
            Problem::unusable_settings(format!("{field} must be a whole number, not '{text}'."))
        }),
    }
}

async fn run_lines(app: &AppState) -> Result<Vec<RunLine>, Problem> {
    let mut lines = Vec::new();
    for row in app.store.runs().await? {
        lines.push(run_line(runs::view(app, row).await?));
    }
    Ok(lines)
}

fn run_line(run: RunView) -> RunLine {
    RunLine {
        id: run.id.to_string(),
        title: title(&run.task).to_owned(),
        details: format!("{}, seed {}, begun ", method_name(&run.method), run.seed),
        begun: format!(
            "{} {} UTC",
            run.created_at.get(..10).unwrap_or_default(),
            run.created_at.get(11..16).unwrap_or_default()
        ),
        begun_at: run.created_at.clone(),
        can_label: run.can_label(),
        state: run.state.kind,
        message: run.state.message,
        labels: format!(
            "{} of {} answers",
            thousands(run.labels.into()),
            thousands(run.budget.into())
        ),
    }
}

fn card(task: &'static sim::tasks::Task) -> TaskCard {
    let layers = Layers {
        task: Some(task.name.to_owned()),
        method: Some("stair".to_owned()),
        presets: vec!["quick".to_owned()],
        ..Layers::default()
    };
    let config = RunConfig::resolve(&layers).unwrap_or_default();
    let budget = config.feedback.budget;
    TaskCard {
        name: task.name,
        title: task.title,
        summary: task.summary,
        picture: picture(task.name),
        labels: format!("about {} answers", thousands(budget.into())),
        minutes: words_for(time_here(&config, &(task.spec)()) + ANSWER * budget),
        budget,
    }
}

/// A frame of the task where there is one, a sketch otherwise.
fn picture(task: &str) -> String {
    let own = Some(format!("cards/{task}.webp")).filter(|name| assets::contains(name));
    format!("/static/{}", own.as_deref().unwrap_or("cards/any.svg"))
}

/// `about 10 minutes`, `about 2 hours`.
fn words_for(time: Duration) -> String {
    let minutes = time.as_secs().div_ceil(60);
    match minutes {
        0..=12 => format!("about {} minutes", minutes.max(2)),
        13..=50 => format!("about {} minutes", minutes.div_ceil(5) * 5),
        51..=89 => "about an hour".to_owned(),
        _ => format!("about {} hours", (minutes + 30) / 60),
    }
}

fn methods() -> Vec<Choice> {
    let choice = |method: &lab::method::MethodEntry| Choice {
        value: method.name,
        words: format!("{}: {}", method_name(method.name), choosing(method)),
        is_default: method.name == "stair",
    };
    // A task that does not know its stages cannot tell them, and most do not.
    let settings = lab::config::RunConfig::default();
    let is_for_all =
        |entry: &&lab::method::MethodEntry| !(entry.build)(&settings).needs_true_stages();
    let for_all = lab::method::METHODS.iter().filter(is_for_all);
    for_all.map(choice).collect()
}

/// How a method chooses its queries, short enough for a small phone.
fn choosing(method: &lab::method::MethodEntry) -> &'static str {
    match method.name {
        "stair" => "within a stage",
        "pebble" => "where unsure",
        "uniform" => "at random",
        "sac" => "none, sees the reward",
        _ => method.summary,
    }
}

/// As figures write it, with a capital: `stair` → `STAIR`, `uniform` → `Uniform`.
pub fn method_name(name: &str) -> String {
    let shown = shown_method(name);
    let mut letters = shown.chars();
    let first = letters.next().map(|letter| letter.to_ascii_uppercase());
    first.into_iter().chain(letters).collect()
}

fn teachers() -> Vec<Choice> {
    let all = [
        (HUMAN, "People, on these pages"),
        ("oracle", "A script that never errs"),
        ("mistaken", "A script that may err"),
    ];
    choices(&all)
}

fn presets() -> Vec<Choice> {
    choices(&[("quick", "Quick: for two cores"), ("", "As in the paper")])
}

/// The first is the default.
fn choices(all: &[(&'static str, &str)]) -> Vec<Choice> {
    let choice = |(i, (value, words)): (usize, &(&'static str, &str))| Choice {
        value,
        words: (*words).to_owned(),
        is_default: i == 0,
    };
    all.iter().enumerate().map(choice).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn times_are_told_as_people_tell_them() {
        let words = [30, 550, 1_500, 4_000, 9_000].map(|s| words_for(Duration::from_secs(s)));
        assert_eq!(
            words,
            [
                "about 2 minutes",
                "about 10 minutes",
                "about 25 minutes",
                "about an hour",
                "about 3 hours"
            ]
        );
    }

    #[test]
    fn a_finished_run_is_no_run_to_go_on_with() {
        let run = |state: &str| RunLine {
            id: String::new(),
            title: String::new(),
            details: String::new(),
            begun_at: String::new(),
            begun: String::new(),
            state: state.to_owned(),
            message: String::new(),
            labels: String::new(),
            can_label: false,
        };
        let found = groups(vec![run("finished"), run("stopped"), run("finished")]);
        let found: Vec<_> = found.iter().map(|g| (g.heading, g.runs.len())).collect();
        assert_eq!(found, [("Go on with a run", 1), ("Earlier runs", 2)]);
        assert!(groups(vec![]).is_empty());
    }

    #[test]
    fn every_task_has_a_picture() {
        for task in sim::tasks::tasks() {
            assert!(
                picture(task.name).contains(task.name),
                "{}",
                picture(task.name)
            );
        }
    }
}
