//! The words that answer a question, and what they mean.

use domain::answer::{Answer, StageJudgement, Which};
use domain::query::Question;

use crate::error::StoreError;
use crate::query::word;

/// The word of an answer, parsed for the question it answers.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Pressed {
    /// To "which is better?".
    Preference(Answer),
    /// To "same stage?".
    SameStage(StageJudgement),
}

impl Pressed {
    /// The word for a question.
    ///
    /// # Errors
    /// [`StoreError::WrongQuestion`] names the words that the question takes.
    pub fn parse(asked: Question, text: &str) -> Result<Self, StoreError> {
        use serde::de::value::{Error, StrDeserializer};
        use serde::{Deserialize as _, de::IntoDeserializer as _};
        let word: StrDeserializer<'_, Error> = text.into_deserializer();
        let (parsed, question, takes) = match asked {
            Question::Preference => (
                Answer::deserialize(word).map(Self::Preference),
                "preference",
                "left, right, equal or skip",
            ),
            Question::SameStage => (
                StageJudgement::deserialize(word).map(Self::SameStage),
                "same_stage",
                "same, different or skip",
            ),
        };
        parsed.map_err(|_| StoreError::WrongQuestion {
            pressed: text.to_owned(),
            question,
            takes,
        })
    }

    /// The word itself.
    pub fn word(self) -> &'static str {
        match self {
            Self::Preference(Answer::Left) => "left",
            Self::Preference(Answer::Right) => "right",
            Self::Preference(Answer::Equal) => "equal",
            Self::SameStage(StageJudgement::Same) => "same",
            Self::SameStage(StageJudgement::Different) => "different",
            Self::Preference(Answer::Skip) | Self::SameStage(StageJudgement::Skip) => "skip",
        }
    }

    /// What the word means, whatever the sides: `first`, `second`, or the word itself. A skip
    /// carries no information, so it never means a segment.
    pub(crate) fn meaning(self, left_is: Which) -> &'static str {
        match self {
            Self::Preference(Answer::Left) => word(left_is),
            Self::Preference(Answer::Right) => word(left_is.other()),
            other => other.word(),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn sides_swapped_the_meaning_stays() {
        let meaning = |answer, left_is| Pressed::Preference(answer).meaning(left_is);
        for (pressed, opposite) in [(Answer::Left, Answer::Right), (Answer::Right, Answer::Left)] {
            let of_first = meaning(pressed, Which::First);
            assert_eq!(of_first, meaning(opposite, Which::Second));
        }
        assert_eq!(meaning(Answer::Left, Which::First), "first");
        assert_eq!(meaning(Answer::Left, Which::Second), "second");
    }

    #[test]
    fn a_word_that_prefers_no_segment_means_itself() {
        for left_is in [Which::First, Which::Second] {
            assert_eq!(Pressed::Preference(Answer::Equal).meaning(left_is), "equal");
            assert_eq!(Pressed::Preference(Answer::Skip).meaning(left_is), "skip");
            let same = Pressed::SameStage(StageJudgement::Same);
            assert_eq!(same.meaning(left_is), "same");
        }
    }
}
