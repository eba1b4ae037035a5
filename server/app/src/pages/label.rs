//! `/runs/{id}/label`: two clips, one question, single keys.

use askama::Template;
use axum::extract::State;
use axum::http::{HeaderMap, StatusCode, header};
use axum::response::{IntoResponse as _, Redirect, Response};
use domain::query::Question;
use lab::words::thousands;
use serde::Deserialize;
use store::{LabelerId, RunRow, StudyRow};

use super::guidance::{Guidance, guidance, guidance_with, text};
use super::join::nobody_here;
use super::{show, title};
use crate::api::labelers;
use crate::extract::{Form, Query, Run, labeler};
use crate::live::parse_study;
use crate::problem::Problem;
use crate::state::AppState;

#[derive(Template)]
#[template(path = "label.html")]
struct LabelPage {
    /// The run's number.
    run: String,
    /// Who answers: their number.
    labeler: String,
    /// The task as people read it.
    task_title: &'static str,
    /// What the agent should learn, one sentence.
    aim: &'static str,
    /// What there is to tell apart when both clips are at a stage.
    stages: String,
    /// HTML.
    guidance: String,
    /// Sent along with every answer.
    guidance_sha256: String,
    /// `20 of 80 answers`
    answers: String,
    /// Answers used.
    labels: u32,
    /// Answers at most.
    budget: u32,
    /// `preference`, or `same_stage` where that is all that is asked.
    question: &'static str,
    is_study: bool,
}

#[derive(Template)]
#[template(path = "name.html")]
struct NamePage {
    /// The run's number.
    run: String,
    /// A name was just said, and the browser did not keep who said it.
    is_forgotten: bool,
}

/// `?named`: where a name that was said leads.
#[derive(Deserialize)]
pub struct Arrival {
    named: Option<String>,
}

/// What the form for the name sends.
#[derive(Deserialize)]
pub struct NameForm {
    name: String,
}

/// `GET /runs/{id}/label`; asks for a name first where this browser has none. Questions of a
/// study are for the labeler who sits there; anybody else is shown the way back in.
///
/// # Errors
/// A run that does not exist; a store that cannot be read.
pub async fn page(
    State(app): State<AppState>,
    Run(run): Run,
    Query(arrival): Query<Arrival>,
    headers: HeaderMap,
) -> Result<Response, Problem> {
    let labeler = labeler(&app, &headers).await?;
    let seat = match &labeler {
        Some(who) => app.store.seat_of(who.id).await?,
        None => None,
    };
    if let Some(study) = run.study {
        let seat = seat.filter(|(row, _, parts)| {
            row.id == study && parts.iter().any(|part| part.run == run.id)
        });
        return match (labeler, seat) {
            (Some(who), Some((study, ..))) => Ok(show(&of_study(&run, who.id, &study)?)),
            _ => Ok(nobody_here(StatusCode::NOT_FOUND)),
        };
    }
    match labeler {
        // Whoever was invited to a study says another name for anything else.
        Some(who) if seat.is_none() => Ok(show(&filled_in(&run, who.id))),
        _ => Ok(show(&NamePage {
            run: run.id.to_string(),
            is_forgotten: arrival.named.is_some(),
        })),
    }
}

/// `POST /runs/{id}/label`: the name, kept in a cookie for a year.
///
/// # Errors
/// A name of no or more than 80 letters, or one that the server keeps for itself; a run that does
/// not exist.
pub async fn sign_in(
    State(app): State<AppState>,
    Run(run): Run,
    headers: HeaderMap,
    Form(form): Form<NameForm>,
) -> Result<Response, Problem> {
    let (cookie, _) = labelers::sign_in(&app, &headers, &form.name).await?;
    let to = Redirect::to(&format!("/runs/{}/label?named", run.id));
    Ok(([(header::SET_COOKIE, cookie)], to).into_response())
}

/// The page with the study's own words above the task's.
fn of_study(run: &RunRow, who: LabelerId, study: &StudyRow) -> Result<LabelPage, Problem> {
    let file = parse_study(study).map_err(|error| Problem::unusable_study(error.to_string()))?;
    let is_about_stages = study.question == Question::SameStage;
    let words = if is_about_stages && !file.guidance.trim().is_empty() {
        text(&file.guidance) // how to tell which does better is another question
    } else {
        guidance_with(&file.guidance, &run.task)
    };
    let page = with_guidance(run, who, &words);
    Ok(LabelPage {
        question: match study.question {
            Question::Preference => "preference",
            Question::SameStage => "same_stage",
        },
        is_study: true,
        ..page
    })
}

fn filled_in(run: &RunRow, who: LabelerId) -> LabelPage {
    with_guidance(run, who, &guidance(&run.task))
}

fn with_guidance(run: &RunRow, who: LabelerId, guidance: &Guidance) -> LabelPage {
    let task = sim::tasks::task(&run.task).ok();
    LabelPage {
        run: run.id.to_string(),
        labeler: who.0.to_string(),
        task_title: title(&run.task),
        aim: task.map_or("", |task| task.summary),
        stages: task.map_or_else(String::new, stages_in_words),
        guidance: guidance.html.clone(),
        guidance_sha256: guidance.sha256.clone(),
        answers: format!(
            "{} of {} answers",
            thousands(run.n_labels.into()),
            thousands(run.budget.into())
        ),
        labels: run.n_labels,
        budget: run.budget,
        question: "preference",
        is_study: false,
    }
}

/// The stages by name where the task knows them; its aim otherwise.
fn stages_in_words(task: &sim::tasks::Task) -> String {
    let stages = (task.spec)().stages;
    if stages.is_empty() {
        task.summary.to_owned()
    } else {
        format!("The stages are {}.", stages.join(", then "))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn stages_are_named_where_the_task_knows_them() {
        let words = |name| stages_in_words(sim::tasks::task(name).expect("a task"));
        assert_eq!(
            words("go-fetch-return"),
            "The stages are go, then fetch, then return."
        );
        let aim = sim::tasks::task("window-open").expect("a task").summary;
        assert_eq!(words("window-open"), aim);
    }
}
