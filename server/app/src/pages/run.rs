//! `/runs/{id}`: how one run does, and the buttons that steer it.

use askama::Template;
use axum::extract::State;
use axum::response::{Redirect, Response};
use lab::words::thousands;
use store::{AnsweredPair, DemonstrationRow, EventRow, LabelsOf, RunId};

use super::home::method_name;
use super::labels::answer_words;
use super::{percent, show, time_of_day, title};
use crate::api::clips::address;
use crate::api::runs::{self, RunView};
use crate::extract::Run;
use crate::live::{DAMAGED_CHECKPOINT, DAMAGED_HISTORY, HTTP, HUMAN};
use crate::problem::Problem;
use crate::state::AppState;

pub mod map;

/// Pairs on the page that labelers' pages passed over.
pub(super) const N_PASSED_OVER: u32 = 12;
/// Answered pairs on the page.
const N_PAIRS: u32 = 6;

#[derive(Template)]
#[template(path = "run.html")]
#[expect(
    clippy::struct_excessive_bools,
    reason = "a page says many things or leaves them out"
)]
struct RunPage {
    /// The run's number.
    run: String,
    /// The task as people read it.
    task_title: &'static str,
    /// `STAIR, quick, seed 1, people answer`
    method_words: String,
    /// Whether people answer, rather than a program or a script.
    is_for_people: bool,
    /// Kind of state, for colour and for which buttons there are.
    state: String,
    /// What it is doing.
    message: String,
    /// `since 14:02:11`; `at 14:02:11` where the run is over.
    since: String,
    /// Whether a person can answer it now.
    can_label: bool,
    /// What comes next.
    next: String,
    /// Environment steps, now and in all.
    step: u64,
    total_steps: u64,
    steps_done: String,
    /// Answers, used and at most.
    labels: u32,
    budget: u32,
    labels_used: String,
    /// Of the last trial: `35 %`.
    success: String,
    /// `7 of 9`, of the stage questions that were answered.
    same_stage: String,
    /// What the researcher should know about, in words.
    broken: Vec<String>,
    has_broken: bool,
    /// Changes when any of it does.
    broken_version: String,
    /// The first and the newest episode of the policy.
    first: Shown,
    latest: Shown,
    has_demonstration: bool,
    /// Changes when the two do.
    demonstrations_version: String,
    curves: &'static [Curve],
    /// Whether there is a temporal map, and else why not.
    has_map: bool,
    no_map: String,
    pairs: Vec<Pair>,
    has_pairs: bool,
    /// Changes when the newest pairs do.
    pairs_version: String,
}

/// A clip with its words.
#[derive(Default)]
struct Shown {
    /// Address.
    clip: String,
    caption: String,
}

/// A panel that `run.js` draws into.
struct Curve {
    /// Name in `run.js`.
    id: &'static str,
    title: &'static str,
    /// What it shows and how to read it.
    says: &'static str,
    /// Instead of an empty panel.
    before: &'static str,
}

/// An answered pair.
struct Pair {
    /// Addresses of the clips as they were shown.
    left: String,
    right: String,
    is_left: bool,
    is_right: bool,
    /// What was answered, in words.
    answer: &'static str,
    /// `round 2, 14:02:11`
    who: String,
}

const CURVES: &[Curve] = &[
    Curve {
        id: "success",
        title: "Success",
        says: "Share of trial episodes that reach the goal.",
        before: "Drawn after the first trial.",
    },
    Curve {
        id: "return",
        title: "Task reward",
        says: "Points that the task itself gives in an episode. Solid: trials. Dashed: practice.",
        before: "Drawn after the first episodes.",
    },
    Curve {
        id: "accuracy",
        title: "Reward model",
        says: "How often it prefers the clip that the answers prefer.",
        before: "Drawn after the first round of answers.",
    },
    Curve {
        id: "correlation",
        title: "Learned and task reward",
        says: "How closely the two rise and fall together; at best 1.",
        before: "Drawn after the first round of answers.",
    },
    Curve {
        id: "gap",
        title: "Stage gap",
        says: "How far the two clips of a pair are apart in the task. Solid: pairs asked. Dashed: all pairs to choose from.",
        before: "Drawn from the second round, where pairs are chosen by stage.",
    },
    Curve {
        id: "disagreement",
        title: "Disagreement",
        says: "How unsure the reward model is about a pair. Solid: pairs asked. Dashed: all pairs to choose from.",
        before: "Drawn from the second round.",
    },
    Curve {
        id: "labels",
        title: "Answers",
        says: "How many answers the reward model has learned from.",
        before: "Drawn after the first round of answers.",
    },
    Curve {
        id: "speed",
        title: "Speed",
        says: "Steps of practice in a second, waiting for answers left out.",
        before: "Drawn in a moment.",
    },
];

/// `GET /runs/{id}`
///
/// # Errors
/// A run that does not exist; a store that cannot be read.
pub async fn page(State(app): State<AppState>, Run(row): Run) -> Result<Response, Problem> {
    let id = row.id;
    let run = runs::view(&app, row).await?;
    let demonstrations = app.store.demonstrations(id).await?;
    let pairs = app.store.newest_pairs(id, N_PAIRS).await?;
    let (n_same, n_judged) = app.store.same_stage_rate(id).await?;
    let success = last_success(&app, id).await?;
    let broken = broken(&app, id).await?;
    let no_map = map::missing(&run.method, run.labels);
    Ok(show(&RunPage {
        run: id.to_string(),
        task_title: title(&run.task),
        method_words: method_words(&run),
        is_for_people: run.teacher == HUMAN,
        since: format!(
            "{} {}",
            if run.state.kind == "finished" {
                "at"
            } else {
                "since"
            },
            time_of_day(&run.state.since)
        ),
        can_label: run.can_label(),
        step: run.step,
        total_steps: run.total_steps,
        steps_done: thousands(run.step),
        labels: run.labels,
        budget: run.budget,
        labels_used: format!(
            "{} of {}",
            thousands(run.labels.into()),
            thousands(run.budget.into())
        ),
        success: success.map_or_else(none_yet, percent),
        same_stage: if n_judged == 0 {
            none_yet()
        } else {
            format!("{n_same} of {n_judged}")
        },
        has_broken: !broken.is_empty(),
        broken_version: broken.join(" "),
        broken,
        has_demonstration: !demonstrations.is_empty(),
        demonstrations_version: demonstrations.len().to_string(),
        first: demonstrations
            .first()
            .map_or_else(Shown::default, |row| shown("At first", row)),
        latest: demonstrations
            .last()
            .map_or_else(Shown::default, |row| shown("Now", row)),
        curves: CURVES,
        has_map: no_map.is_none(),
        no_map: no_map.unwrap_or_default(),
        has_pairs: !pairs.is_empty(),
        pairs_version: pairs_version(&pairs),
        pairs: pairs.iter().map(pair).collect(),
        state: run.state.kind,
        message: run.state.message,
        next: run.state.next,
    }))
}

/// `POST /runs/{id}/pause`
///
/// # Errors
/// A run that is not up.
pub async fn pause(State(app): State<AppState>, Run(run): Run) -> Result<Redirect, Problem> {
    app.live.pause(run.id)?;
    Ok(back(run.id))
}

/// `POST /runs/{id}/resume`
///
/// # Errors
/// A run that is finished.
pub async fn resume(State(app): State<AppState>, Run(run): Run) -> Result<Redirect, Problem> {
    runs::check_resumable(&run)?;
    app.live.resume(run.id)?;
    Ok(back(run.id))
}

/// `POST /runs/{id}/stop`
///
/// # Errors
/// A run that is not up.
pub async fn stop(State(app): State<AppState>, Run(run): Run) -> Result<Redirect, Problem> {
    app.live.stop(run.id)?;
    Ok(back(run.id))
}

fn back(run: RunId) -> Redirect {
    Redirect::to(&format!("/runs/{run}"))
}

fn none_yet() -> String {
    "–".to_owned()
}

fn method_words(run: &RunView) -> String {
    let teacher = match run.teacher.as_str() {
        HUMAN => "people answer".to_owned(),
        HTTP => "a program answers".to_owned(),
        script => format!("the script '{script}' answers"),
    };
    let preset = if run.preset.is_empty() {
        "full size"
    } else {
        run.preset.as_str()
    };
    format!(
        "{}, {preset}, seed {}, {teacher}",
        method_name(&run.method),
        run.seed
    )
}

/// Success rate of the last trial, where there was one.
async fn last_success(app: &AppState, run: RunId) -> Result<Option<f64>, Problem> {
    let events = app.store.events_of(run, &["evaluation"]).await?;
    let last = events
        .last()
        .and_then(|event| serde_json::from_str::<serde_json::Value>(&event.data).ok());
    Ok(last.and_then(|event| event["success_rate"].as_f64()))
}

/// What the researcher should know about: no clips at the moment, pairs without clips, pairs that
/// labelers' pages could not show, answers that came too late, and what of the run's own files was
/// damaged.
async fn broken(app: &AppState, run: RunId) -> Result<Vec<String>, Problem> {
    let bad = app.store.bad_queries(run).await?;
    let kinds = [DAMAGED_CHECKPOINT, DAMAGED_HISTORY];
    let damaged = app.store.events_of(run, &kinds).await?;
    let bad = bad.iter().map(|query| {
        format!(
            "A pair of round {} cannot be shown: {}.",
            query.session + 1,
            query.trouble
        )
    });
    let passed_over = app
        .store
        .passed_over(LabelsOf::Run(run), N_PASSED_OVER)
        .await?;
    let passed_over = passed_over.iter().map(|pair| {
        format!(
            "A pair of round {} could not be shown to {} and was passed over: {}.",
            pair.session + 1,
            pair.labeler,
            pair.reason
        )
    });
    let late = late(app.store.n_late_answers(run).await?);
    let trouble = app.live.clip_trouble();
    let damaged = damaged.iter().map(damage);
    Ok(trouble
        .into_iter()
        .chain(bad)
        .chain(passed_over)
        .chain(late)
        .chain(damaged)
        .collect())
}

/// Answers that were kept aside, in words.
fn late(n: u32) -> Option<String> {
    let (answers, are) = match n {
        0 => return None,
        1 => ("1 answer".to_owned(), "is"),
        n => (format!("{} answers", thousands(n.into())), "are"),
    };
    Some(format!(
        "{answers} came too late, when somebody else had the pair or it was withdrawn: {are} kept aside, and not learned from."
    ))
}

/// An event of a damaged file, in words.
fn damage(event: &EventRow) -> String {
    let data: serde_json::Value = serde_json::from_str(&event.data).unwrap_or_default();
    let complaint = data["complaint"].as_str().unwrap_or_default();
    let what = if event.kind == DAMAGED_CHECKPOINT {
        "A damaged checkpoint was passed over"
    } else {
        "The record of the run's time and revisions was damaged"
    };
    format!("{what}: {complaint}.")
}

fn shown(when: &str, row: &DemonstrationRow) -> Shown {
    let outcome = if row.shows.success {
        "it reaches the goal"
    } else {
        "it does not reach the goal"
    };
    Shown {
        clip: address(&row.clip),
        caption: format!(
            "{when}, after {} steps, {outcome}",
            thousands(row.shows.step)
        ),
    }
}

fn pair(row: &AnsweredPair) -> Pair {
    Pair {
        left: address(&row.left),
        right: address(&row.right),
        is_left: row.answer == "left",
        is_right: row.answer == "right",
        answer: answer_words(&row.answer),
        who: format!("round {}, {}", row.session + 1, time_of_day(&row.stored_at)),
    }
}

fn pairs_version(pairs: &[AnsweredPair]) -> String {
    pairs.first().map_or_else(String::new, |newest| {
        format!("{} {}", newest.query_id, newest.stored_at)
    })
}
