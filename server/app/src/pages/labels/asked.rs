//! What stands in the address of the page of answers: filters, in words of the store's columns.

use axum::http::StatusCode;
use domain::answer::{Answer, StageJudgement};
use domain::query::Question;
use serde::Deserialize;
use store::{LabelFilter, LabelFlag, LabelsFrom, Pressed, RunId, StudyId};

use super::moment;
use crate::problem::Problem;

/// `?run=3&labeler=Ada&flag=skipped`: what is left out or left empty, as forms send it, is not
/// asked about.
#[derive(Debug, Default, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct Asked {
    /// The run's number.
    pub(super) run: String,
    /// The study's number.
    pub(super) study: String,
    /// The labeler's name.
    pub(super) labeler: String,
    /// The task's name.
    pub(super) task: String,
    /// The method's name.
    pub(super) method: String,
    /// One of [`QUESTIONS`].
    pub(super) question: String,
    /// One of [`ANSWERS`].
    pub(super) answer: String,
    /// One of [`FLAGS`].
    pub(super) flag: String,
    /// As people count, from 1.
    pub(super) round: String,
    /// Stored then or later, UTC.
    from: String,
    /// Stored before then, UTC.
    to: String,
    /// Where the page begins: below this place in the order of storing.
    before: String,
}

/// Words in an address, what each stands for, and how people read it.
pub(super) type Words<T> = &'static [(&'static str, T, &'static str)];

/// What can be pressed.
pub(super) const ANSWERS: Words<Pressed> = &[
    ("left", Pressed::Preference(Answer::Left), "left is better"),
    (
        "right",
        Pressed::Preference(Answer::Right),
        "right is better",
    ),
    (
        "equal",
        Pressed::Preference(Answer::Equal),
        "about the same",
    ),
    (
        "same",
        Pressed::SameStage(StageJudgement::Same),
        "same stage",
    ),
    (
        "different",
        Pressed::SameStage(StageJudgement::Different),
        "different stages",
    ),
    ("skip", Pressed::Preference(Answer::Skip), "passed over"),
];

/// What can be asked.
pub(super) const QUESTIONS: Words<Question> = &[
    ("preference", Question::Preference, "which is better?"),
    ("same_stage", Question::SameStage, "same stage?"),
];

/// What sets an answer apart.
pub(super) const FLAGS: Words<LabelFlag> = &[
    ("changed", LabelFlag::Changed, "changed"),
    ("skipped", LabelFlag::Skipped, "passed over"),
    (
        "passed_over",
        LabelFlag::PassedOver,
        "passed over, nobody pressed",
    ),
    ("practice", LabelFlag::Practice, "practice"),
    ("check", LabelFlag::Check, "check"),
    ("repeat", LabelFlag::Repeat, "repeat"),
];

impl Asked {
    /// The filters that are set, by their names in the address.
    pub(super) fn kept(&self) -> Vec<(&'static str, &str)> {
        let all = [
            ("run", &self.run),
            ("study", &self.study),
            ("labeler", &self.labeler),
            ("task", &self.task),
            ("method", &self.method),
            ("question", &self.question),
            ("answer", &self.answer),
            ("flag", &self.flag),
            ("round", &self.round),
            ("from", &self.from),
            ("to", &self.to),
        ];
        let kept = all.into_iter();
        kept.filter_map(|(name, text)| Some((name, given(text)?)))
            .collect()
    }

    /// The filters as the store takes them.
    ///
    /// # Errors
    /// What is no number, no time, or none of the words.
    pub(super) fn filter(&self) -> Result<LabelFilter, Problem> {
        let name = |text: &str| given(text).map(str::to_owned);
        // No run has so many rounds that their number would not fit.
        let session = |round: i64| u32::try_from(round - 1).unwrap_or(u32::MAX);
        Ok(LabelFilter {
            run: number("run", &self.run)?.map(RunId),
            study: number("study", &self.study)?.map(StudyId),
            labeler: name(&self.labeler),
            task: name(&self.task),
            method: name(&self.method),
            question: choice("question", &self.question, QUESTIONS)?,
            pressed: choice("answer", &self.answer, ANSWERS)?,
            flag: choice("flag", &self.flag, FLAGS)?,
            session: number("round", &self.round)?.map(session),
            from_ms: time("from", &self.from)?,
            before_ms: time("to", &self.to)?,
        })
    }

    /// Where the page begins.
    ///
    /// # Errors
    /// What is no number.
    pub(super) fn begin(&self) -> Result<LabelsFrom, Problem> {
        let place = number("before", &self.before)?;
        Ok(place.map_or(LabelsFrom::Newest, LabelsFrom::Below))
    }
}

/// What a field holds, if anything.
pub(super) fn given(text: &str) -> Option<&str> {
    Some(text.trim()).filter(|text| !text.is_empty())
}

fn number(field: &str, text: &str) -> Result<Option<i64>, Problem> {
    let parse = |text: &str| text.parse::<i64>().ok().filter(|number| *number > 0);
    read(field, text, "a whole number, 1 or more", parse)
}

fn time(field: &str, text: &str) -> Result<Option<i64>, Problem> {
    let wanted = "a time, UTC, as 2026-05-02T14:02 or 2026-05-02";
    read(field, text, wanted, moment::parse)
}

fn choice<T: Copy + 'static>(field: &str, text: &str, all: Words<T>) -> Result<Option<T>, Problem> {
    let words: Vec<&str> = all.iter().map(|(word, ..)| *word).collect();
    let wanted = format!("one of {}", words.join(", "));
    read(field, text, &wanted, |text| {
        let found = all.iter().find(|(word, ..)| *word == text);
        found.map(|(_, value, _)| *value)
    })
}

/// What a field holds as what it stands for; `wanted` says what belongs there.
fn read<T>(
    field: &str,
    text: &str,
    wanted: &str,
    parse: impl Fn(&str) -> Option<T>,
) -> Result<Option<T>, Problem> {
    let Some(text) = given(text) else {
        return Ok(None);
    };
    parse(text).map(Some).ok_or_else(|| {
        let detail = format!("`{field}` must be {wanted}; it is '{text}'.");
        Problem::bad_request(StatusCode::UNPROCESSABLE_ENTITY, detail)
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn fields_that_are_empty_or_blank_ask_about_nothing() {
        let asked = Asked {
            run: String::new(),
            labeler: "  ".into(),
            ..Asked::default()
        };
        assert_eq!(asked.filter().expect("a filter"), LabelFilter::default());
        assert!(asked.kept().is_empty());
        assert_eq!(asked.begin().expect("a place"), LabelsFrom::Newest);
    }

    #[test]
    fn rounds_are_counted_from_one_and_words_stand_for_what_the_store_knows() {
        let asked = Asked {
            round: " 3 ".into(),
            answer: "skip".into(),
            flag: "passed_over".into(),
            from: "1970-01-01T00:01".into(),
            ..Asked::default()
        };
        let filter = asked.filter().expect("a filter");
        assert_eq!(filter.session, Some(2));
        assert_eq!(filter.pressed.map(Pressed::word), Some("skip"));
        assert_eq!(filter.flag, Some(LabelFlag::PassedOver));
        assert_eq!(filter.from_ms, Some(60_000));
        assert_eq!(asked.kept()[2], ("round", "3"));
    }

    #[test]
    fn every_word_of_an_answer_is_the_one_that_is_stored() {
        for (word, pressed, _) in ANSWERS {
            assert_eq!(pressed.word(), *word);
        }
    }

    #[test]
    fn what_does_not_fit_is_told_with_what_belongs_there() {
        let run = Asked {
            run: "three".into(),
            ..Asked::default()
        };
        let flag = Asked {
            flag: "skiped".into(),
            ..Asked::default()
        };
        for (asked, told) in [
            (
                run,
                "`run` must be a whole number, 1 or more; it is 'three'.",
            ),
            (
                flag,
                "`flag` must be one of changed, skipped, passed_over, practice, check, repeat; it is 'skiped'.",
            ),
        ] {
            let refused = asked.filter().expect_err(told);
            assert_eq!((refused.status, refused.detail.as_str()), (422, told));
        }
    }
}
