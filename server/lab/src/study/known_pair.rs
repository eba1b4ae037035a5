//! Pairs whose right answer is known: for practice, and to see whether labelers look.

use domain::query::Question;

use super::section::{Section, hint};

/// A pair with its right answer.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct KnownPair {
    /// The task's name.
    pub task: String,
    /// σ₀.
    pub first: Shot,
    /// σ₁.
    pub second: Shot,
    /// What a labeler who looks says.
    pub expects: Expected,
    /// Why, for the labeler to read after the answer; empty for checks.
    pub because: String,
}

/// A window of an episode that can be played again.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Shot {
    /// Who acts.
    pub player: Player,
    /// Of the episode.
    pub seed: u32,
    /// First step, from 0.
    pub start: u32,
}

/// Who acts in a [`Shot`].
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Player {
    /// The task's scripted expert.
    Expert,
    /// Uniformly drawn actions.
    Random,
}

/// The right answer, whatever the sides.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Expected {
    /// σ₀ is better.
    First,
    /// σ₁ is better.
    Second,
    /// Indistinguishable.
    Equal,
    /// Both show one stage.
    Same,
    /// They show different stages.
    Different,
}

/// What a pair of the file must fit.
pub(super) struct Frame<'a> {
    pub(super) question: Option<Question>,
    pub(super) tasks: &'a [&'static sim::tasks::Task],
    pub(super) segment_len: u32,
}

impl Expected {
    const PREFERENCE: &[(&str, Self)] = &[
        ("first", Self::First),
        ("second", Self::Second),
        ("equal", Self::Equal),
    ];
    const SAME_STAGE: &[(&str, Self)] = &[("same", Self::Same), ("different", Self::Different)];

    /// As files and answers have it.
    pub fn word(self) -> &'static str {
        let mut all = Self::PREFERENCE.iter().chain(Self::SAME_STAGE);
        all.find(|(_, known)| *known == self)
            .map_or("", |(word, _)| word)
    }
}

impl KnownPair {
    /// One `[[practice]]` or `[[check]]`; what does not fit is noted.
    pub(super) fn read(mut section: Section<'_>, frame: &Frame<'_>, explains: bool) -> Self {
        let task = section.words("task");
        let known: Vec<&str> = frame.tasks.iter().map(|task| task.name).collect();
        let found = frame.tasks.iter().find(|known| known.name == task.value);
        if found.is_none() && !task.value.is_empty() {
            let message = format!("'{}' is no task of this study", task.value);
            section.note(task.line, message + &hint(&task.value, &known));
        }
        let mut shot = |key| read_shot(&mut section, key, found.copied(), frame.segment_len);
        let (first, second) = (shot("first"), shot("second"));
        let choices = match frame.question {
            Some(Question::SameStage) => Expected::SAME_STAGE,
            _ => Expected::PREFERENCE,
        };
        let expects = section.choice("expects", choices);
        let because = if explains {
            section.words("because").value
        } else {
            String::new()
        };
        section.finish();
        Self {
            task: task.value,
            first,
            second,
            expects: expects.unwrap_or(Expected::Equal),
            because,
        }
    }
}

fn read_shot(
    section: &mut Section<'_>,
    key: &'static str,
    task: Option<&'static sim::tasks::Task>,
    segment_len: u32,
) -> Shot {
    let players = [("expert", Player::Expert), ("random", Player::Random)];
    let Some(mut shot) = section.table(key) else {
        return Shot {
            player: Player::Random,
            seed: 0,
            start: 0,
        };
    };
    let player = shot.choice("policy", &players).unwrap_or(Player::Random);
    let seed = shot.number("seed", 0..=u32::MAX, Some(1)).value;
    let start = shot.number("start", 0..=100_000, None);
    if let Some(task) = task {
        let len = (task.spec)().episode_len;
        if start.value + segment_len > len {
            let name = task.name;
            let message = format!(
                "a segment of {segment_len} steps from step {} on does not fit into an episode of {name} ({len} steps)",
                start.value
            );
            shot.note(start.line, message);
        }
        if player == Player::Expert && task.expert.is_none() {
            let message = format!(
                "{} has no scripted expert; write policy = \"random\"",
                task.name
            );
            shot.note(shot.line(), message);
        }
    }
    shot.finish();
    Shot {
        player,
        seed,
        start: start.value,
    }
}
