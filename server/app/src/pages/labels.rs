//! `/labels`: every stored answer with the clips that were shown, to filter and to look at again.

use askama::Template;
use axum::extract::State;
use axum::response::Response;
use lab::words::thousands;
use store::{FoundLabel, Label, LabelFilter, LabelsFrom, RunRow, StoreError, StudyRow};

use super::home::method_name;
use super::{show, time_of_day, title};
use crate::api::clips::address;
use crate::extract::Query;
use crate::live::{HTTP, HUMAN};
use crate::problem::Problem;
use crate::state::AppState;
use asked::{ANSWERS, Asked, FLAGS, QUESTIONS, Words, given};

pub mod asked;
mod moment;

/// Answers on a page: each may take the memory of two clips.
const N_LABELS: u32 = 24;

#[derive(Template)]
#[template(path = "labels.html")]
struct LabelsPage<'a> {
    /// The filters that are set, by their names in the address.
    kept: Vec<(&'static str, &'a str)>,
    numbers: Vec<Field>,
    selects: Vec<Select>,
    times: Vec<Field>,
    /// `132 answers`
    count: String,
    /// The run and the study that the filters name, where they are there.
    named: Vec<Named>,
    /// Newest first.
    cards: Vec<Card>,
    /// Instead of them, where there is none.
    nothing: String,
    /// What the address of the newer ones ends with, and of the older ones.
    newer: Option<String>,
    older: Option<String>,
}

/// Something to type.
struct Field {
    /// In the address.
    name: &'static str,
    /// For people.
    label: &'static str,
    value: String,
}

/// Something to choose from a list.
struct Select {
    /// In the address.
    name: &'static str,
    /// For people.
    label: &'static str,
    choices: Vec<Choice>,
}

/// One line of a list.
struct Choice {
    /// In the address.
    value: String,
    /// For people.
    words: String,
    is_chosen: bool,
}

/// A run or a study, of which all answers can be exported.
struct Named {
    /// `run 3`
    words: String,
    /// Address of its page.
    page: String,
    /// Address of all its answers.
    export: String,
}

/// An answer.
struct Card {
    /// The run's number.
    run: i64,
    /// The study's number, where it is of one.
    study: Option<i64>,
    /// As people count, from 1.
    round: u32,
    /// Addresses of the clips as they were shown; `None` where there were none.
    clips: Option<Clips>,
    /// Which segment each side showed: `first`, `second`.
    left_is: &'static str,
    right_is: &'static str,
    /// Which side was pressed.
    is_left: bool,
    is_right: bool,
    /// What was pressed, in words.
    answer: &'static str,
    /// The segment that this prefers: `the first segment`.
    meaning: Option<&'static str>,
    /// Why, for a skip.
    reason: Option<String>,
    /// What sets it apart.
    marks: Vec<&'static str>,
    /// What was asked.
    question: &'static str,
    /// As people read it.
    task: &'static str,
    labeler: String,
    /// As people read it, or why it is not told.
    method: String,
    /// RFC 3339, and `2026-05-02 14:02:11 UTC`.
    stored_at: String,
    stored: String,
    /// How long the clips were looked at: `3.2 s`.
    looked: String,
}

/// Addresses of a pair's clips.
struct Clips {
    left: String,
    right: String,
}

/// `GET /labels`
///
/// # Errors
/// A filter that is no number, no time or none of its words; a store that cannot be read.
pub async fn page(
    State(app): State<AppState>,
    Query(asked): Query<Asked>,
) -> Result<Response, Problem> {
    let filter = asked.filter()?;
    let begin = asked.begin()?;
    let run = match filter.run {
        Some(id) => app.store.run(id).await?,
        None => None,
    };
    let study = match filter.study {
        Some(id) => where_there(app.store.study(id).await)?,
        None => None,
    };
    let found = app.store.filtered_labels(&filter, begin, N_LABELS).await?;
    let kept = asked.kept();
    Ok(show(&LabelsPage {
        numbers: numbers(&asked),
        selects: selects(&app, &asked).await?,
        times: times(&filter),
        count: count(found.n_in_all),
        nothing: nothing(&filter, run.as_ref(), study.as_ref(), !kept.is_empty()),
        named: named(run.as_ref(), study.as_ref()),
        cards: found.labels.into_iter().map(card).collect(),
        newer: found.newer.map(end_of_address),
        older: found.older.map(end_of_address),
        kept,
    }))
}

/// What was pressed, in words.
pub(super) fn answer_words(pressed: &str) -> &'static str {
    words_of(ANSWERS, pressed)
}

/// How people read a word of an address or a column; nothing for one of another version.
fn words_of<T>(all: Words<T>, word: &str) -> &'static str {
    let found = all.iter().find(|(known, ..)| *known == word);
    found.map_or("", |(_, _, words)| *words)
}

/// `None` for what is not there.
fn where_there<T>(found: Result<T, StoreError>) -> Result<Option<T>, StoreError> {
    match found {
        Ok(found) => Ok(Some(found)),
        Err(StoreError::Missing { .. }) => Ok(None),
        Err(error) => Err(error),
    }
}

fn end_of_address(from: LabelsFrom) -> String {
    match from {
        LabelsFrom::Newest => String::new(),
        LabelsFrom::Below(place) => format!("before={place}"),
    }
}

fn count(n: u64) -> String {
    match n {
        0 => "No answers".to_owned(),
        1 => "1 answer".to_owned(),
        n => format!("{} answers", thousands(n)),
    }
}

fn nothing(
    filter: &LabelFilter,
    run: Option<&RunRow>,
    study: Option<&StudyRow>,
    is_filtered: bool,
) -> String {
    let is_taught_inside = |run: &RunRow| !matches!(run.teacher.as_str(), HUMAN | HTTP);
    match (filter.run, filter.study) {
        (Some(id), _) if run.is_none() => format!("There is no run {id}."),
        (_, Some(id)) if study.is_none() => format!("There is no study {id}."),
        _ if run.is_some_and(is_taught_inside) => {
            "A script answers this run from inside; its answers are not kept one by one.".to_owned()
        }
        _ if is_filtered => "No answer fits all of these filters.".to_owned(),
        _ => "No answers yet. They appear here as soon as somebody answers.".to_owned(),
    }
}

fn named(run: Option<&RunRow>, study: Option<&StudyRow>) -> Vec<Named> {
    let one = |kind: &str, kinds: &str, id: i64| Named {
        words: format!("{kind} {id}"),
        page: format!("/{kinds}/{id}"),
        export: format!("/api/v1/{kinds}/{id}/labels"),
    };
    let run = run.map(|run| one("run", "runs", run.id.0));
    let study = study.map(|study| one("study", "studies", study.id.0));
    run.into_iter().chain(study).collect()
}

fn numbers(asked: &Asked) -> Vec<Field> {
    let field = |name, label, text: &str| Field {
        name,
        label,
        value: given(text).unwrap_or_default().to_owned(),
    };
    vec![
        field("run", "Run", &asked.run),
        field("study", "Study", &asked.study),
        field("round", "Round", &asked.round),
    ]
}

fn times(filter: &LabelFilter) -> Vec<Field> {
    let field = |name, label, ms: Option<i64>| Field {
        name,
        label,
        value: ms.map(moment::field).unwrap_or_default(),
    };
    vec![
        field("from", "Stored from, UTC", filter.from_ms),
        field("to", "Stored before, UTC", filter.before_ms),
    ]
}

async fn selects(app: &AppState, asked: &Asked) -> Result<Vec<Select>, Problem> {
    let there = app.store.label_choices().await?;
    let as_typed = |name: &str| name.to_owned();
    let as_title = |task: &str| title(task).to_owned();
    Ok(vec![
        stored("task", "Task", there.tasks, &asked.task, as_title),
        stored(
            "labeler",
            "Labeler",
            there.labelers,
            &asked.labeler,
            as_typed,
        ),
        stored(
            "method",
            "Method",
            there.methods,
            &asked.method,
            method_name,
        ),
        known("question", "Question", QUESTIONS, &asked.question),
        known("answer", "Answer", ANSWERS, &asked.answer),
        known("flag", "Flag", FLAGS, &asked.flag),
    ])
}

/// A list of names that the store has, and of the one that is asked about, which it may not have.
fn stored(
    name: &'static str,
    label: &'static str,
    mut there: Vec<String>,
    asked: &str,
    words: impl Fn(&str) -> String,
) -> Select {
    let asked = given(asked).unwrap_or_default();
    if !asked.is_empty() && !there.iter().any(|value| value == asked) {
        there.push(asked.to_owned());
    }
    let choices = there.into_iter().map(|value| Choice {
        words: words(&value),
        is_chosen: value == asked,
        value,
    });
    Select {
        name,
        label,
        choices: choices.collect(),
    }
}

/// A list of words that do not depend on what is stored.
fn known<T>(name: &'static str, label: &'static str, all: Words<T>, asked: &str) -> Select {
    let asked = given(asked);
    let choices = all.iter().map(|(value, _, words)| Choice {
        value: (*value).to_owned(),
        words: (*words).to_owned(),
        is_chosen: asked == Some(*value),
    });
    Select {
        name,
        label,
        choices: choices.collect(),
    }
}

fn card(found: FoundLabel) -> Card {
    let FoundLabel { label, is_blinded } = found;
    let marks = marks(&label);
    let (first, second) = (label.first_clip, label.second_clip);
    let (left_is, right_is, left, right) = if label.left_is == "first" {
        ("first", "second", first, second)
    } else {
        ("second", "first", second, first)
    };
    let clips = left.zip(right).map(|(left, right)| Clips {
        left: address(&left),
        right: address(&right),
    });
    let looked = |ms: i64| format!("{:.1} s", ms as f64 / 1_000.0);
    Card {
        run: label.run_id,
        study: label.study_id,
        round: label.session + 1,
        clips,
        left_is,
        right_is,
        is_left: label.pressed == "left",
        is_right: label.pressed == "right",
        answer: answer_words(&label.pressed),
        meaning: match label.meaning.as_str() {
            "first" => Some("the first segment"),
            "second" => Some("the second segment"),
            _ => None,
        },
        reason: label.reason,
        marks,
        question: words_of(QUESTIONS, &label.question),
        task: title(&label.task),
        labeler: label.labeler,
        method: match label.method {
            Some(method) => method_name(&method),
            None if is_blinded => "told once the study is closed".to_owned(),
            None => "none".to_owned(),
        },
        stored: format!(
            "{} {} UTC",
            label.stored_at.get(..10).unwrap_or_default(),
            time_of_day(&label.stored_at)
        ),
        stored_at: label.stored_at,
        looked: label
            .visible_ms
            .map_or_else(|| "not known".to_owned(), looked),
    }
}

/// What sets an answer apart, in words.
fn marks(label: &Label) -> Vec<&'static str> {
    let is_passed_over = label.pressed == "skip" && label.input.is_none();
    let role = label.role.as_deref().filter(|role| *role != "counted");
    let words = [
        (!label.is_current).then_some("replaced by a later answer"),
        label
            .supersedes
            .is_some()
            .then_some("replaces an earlier answer"),
        role.map(|role| words_of(FLAGS, role)),
        is_passed_over.then_some("nobody pressed"),
    ];
    words.into_iter().flatten().collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn skipped() -> Label {
        let row = serde_json::json!({
            "answer_id": "a1", "run_id": 3, "task": "door-open", "method": null, "seed": 1, "question": "preference",
            "sequence": 9, "query_id": 4, "session": 1, "position": 7, "labeler": "Ada", "pressed": "skip",
            "meaning": "skip", "left_is": "second", "reason": "too dark", "supersedes": "a0", "is_current": true,
            "first_episode": 1, "first_start": 2, "first_clip": "f1", "second_episode": 3, "second_start": 4,
            "second_clip": "f2", "segment_len": 50, "disagreement": null, "stage_gap": null, "guidance_sha256": null,
            "visible_ms": 3_249, "hidden_ms": 0, "loops": 1.5, "seeks": 2, "speed": 1.0, "dropped_frames": 0,
            "input": null, "stored_at": "2026-01-02T03:04:05.678Z", "study_id": 1, "item_id": 2, "role": "check",
            "expects": "first",
        });
        serde_json::from_value(row).expect("a label")
    }

    #[test]
    fn a_card_shows_the_clips_on_the_sides_on_which_they_were() {
        let shown = |left_is: &str| {
            let label = Label {
                left_is: left_is.to_owned(),
                pressed: "right".to_owned(),
                meaning: "first".to_owned(),
                ..skipped()
            };
            let is_blinded = true;
            card(FoundLabel { label, is_blinded })
        };
        let swapped = shown("second");
        let clips = swapped.clips.expect("both clips");
        assert_eq!((swapped.left_is, swapped.right_is), ("second", "first"));
        assert!(clips.left.contains("f2") && clips.right.contains("f1"));
        assert!(swapped.is_right && !swapped.is_left);
        assert_eq!(swapped.answer, "right is better");
        assert_eq!(swapped.meaning, Some("the first segment"));
        assert_eq!(shown("first").left_is, "first");
    }

    #[test]
    fn a_card_says_what_sets_its_answer_apart_and_keeps_a_method_that_is_not_told() {
        let label = skipped();
        let marks = ["replaces an earlier answer", "check", "nobody pressed"];
        let told = card(FoundLabel {
            label,
            is_blinded: true,
        });
        assert_eq!(told.marks, marks);
        assert_eq!(told.reason.as_deref(), Some("too dark"));
        assert_eq!(told.method, "told once the study is closed");
        assert_eq!(told.stored, "2026-01-02 03:04:05 UTC");
        assert_eq!((told.looked.as_str(), told.round), ("3.2 s", 2));
    }

    #[test]
    fn a_name_that_is_asked_about_stays_in_its_list_though_no_answer_has_it() {
        let there = vec!["Ada".to_owned()];
        let list = stored("labeler", "Labeler", there, " Cy ", str::to_owned);
        let lines = list.choices.iter();
        let lines: Vec<_> = lines.map(|c| (c.value.as_str(), c.is_chosen)).collect();
        assert_eq!(lines, [("Ada", false), ("Cy", true)]);
    }
}
