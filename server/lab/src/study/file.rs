//! A study's file as values.

use std::path::Path;

use domain::query::Question;
use toml::de::DeTable;

use super::known_pair::{Frame, KnownPair};
use super::section::{Mistake, Mistakes, Placed, Section, Text, hint};
use super::source::Source;

/// What a study is, as its file says.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct StudyFile {
    /// For people.
    pub title: String,
    /// Names of tasks, in the order in which labelers meet them.
    pub tasks: Vec<String>,
    /// What is asked about every pair.
    pub question: Question,
    /// Pairs of each task that each labeler answers, repeats and checks not counted.
    pub labels_per_task: u32,
    /// Steps of a segment, `H`.
    pub segment_len: u32,
    /// Labelers who answer each pair; no more can be invited.
    pub labelers_per_item: u32,
    /// Pairs of each task that are asked once more with their sides swapped.
    pub repeats_per_task: u32,
    /// Of every draw: segments, pairs, order, sides.
    pub seed: u32,
    /// What labelers agree to before they begin.
    pub consent: String,
    /// What labelers read on top of each task's own guidance; may be empty.
    pub guidance: String,
    /// Where the segments come from.
    pub source: Source,
    /// Answered first, with a word on each answer; never counted.
    pub practice: Vec<KnownPair>,
    /// Look like any other pair; their answers are known and never counted.
    pub checks: Vec<KnownPair>,
}

impl StudyFile {
    /// Reads the text of a file called `name` that lies in `folder`.
    ///
    /// # Errors
    /// All mistakes by line, each with the nearest right name where one is near.
    pub fn parse(name: &str, text: &str, folder: &Path) -> Result<Self, Mistakes> {
        let text = Text::new(text);
        let refuse = |list: Vec<Mistake>| Mistakes {
            name: name.to_owned(),
            list,
        };
        let table = DeTable::parse(text.text).map_err(|error| {
            let line = text.line_of(error.span().map_or(0, |span| span.start));
            let message = format!(
                "this is no TOML ({}); words stand in quotation marks",
                error.message()
            );
            refuse(vec![Mistake { line, message }])
        })?;
        let study = Self::read(Section::new(&text, table.get_ref(), 1), folder);
        match (text.into_mistakes(), study) {
            (mistakes, Some(study)) if mistakes.is_empty() => Ok(study),
            (mistakes, _) => Err(refuse(mistakes)),
        }
    }

    fn read(mut section: Section<'_>, folder: &Path) -> Option<Self> {
        let title = section.words("title").value;
        let questions = [
            ("preference", Question::Preference),
            ("same_stage", Question::SameStage),
        ];
        let question = section.choice("question", &questions);
        let tasks = read_tasks(&mut section);
        let labels = section.number("labels_per_task", 1..=10_000, None);
        let segment_len = read_segment_len(&mut section, &tasks);
        let labelers_per_item = section.number("labelers_per_item", 1..=10_000, Some(1));
        let repeats = section.number("repeats_per_task", 0..=10_000, Some(0));
        if repeats.value > labels.value {
            let message = format!(
                "`repeats_per_task` is {}, more than the {} pairs of a task",
                repeats.value, labels.value
            );
            section.note(repeats.line, message);
        }
        let seed = section.number("seed", 0..=u32::MAX, Some(1)).value;
        let consent = section.words("consent").value;
        let guidance = section.text_or("guidance", "").value;
        let source = section
            .table("source")
            .map(|table| Source::read(table, &tasks, folder));
        if let Some(Source::Expert {
            start_before,
            n_episodes,
        }) = source
        {
            check_segments(
                &section,
                &tasks,
                &labels,
                (start_before, n_episodes, segment_len),
            );
        }
        let n_methods = source.as_ref().map_or(0, |s| s.methods().len() as u32);
        if n_methods > 1 && !labels.value.is_multiple_of(n_methods) {
            let message = format!(
                "`labels_per_task` is {}, which {n_methods} methods cannot share equally",
                labels.value
            );
            section.note(labels.line, message);
        }
        let frame = Frame {
            question,
            tasks: &tasks,
            segment_len,
        };
        let mut pairs = |key, explains| -> Vec<KnownPair> {
            let tables = section.tables(key).into_iter();
            tables
                .map(|table| KnownPair::read(table, &frame, explains))
                .collect()
        };
        let (practice, checks) = (pairs("practice", true), pairs("check", false));
        section.finish();
        Some(Self {
            title,
            tasks: tasks.iter().map(|task| task.name.to_owned()).collect(),
            question: question?,
            labels_per_task: labels.value,
            segment_len,
            labelers_per_item: labelers_per_item.value,
            repeats_per_task: repeats.value,
            seed,
            consent,
            guidance,
            source: source?,
            practice,
            checks,
        })
    }

    /// Pairs that one labeler answers: (counted, practice, repeats and checks).
    pub fn n_pairs(&self) -> (u32, u32, u32) {
        let n_tasks = self.tasks.len() as u32;
        (
            n_tasks * self.labels_per_task,
            self.practice.len() as u32,
            n_tasks * self.repeats_per_task + self.checks.len() as u32,
        )
    }
}

fn read_tasks(section: &mut Section<'_>) -> Vec<&'static sim::tasks::Task> {
    let known: Vec<&str> = sim::tasks::tasks().iter().map(|task| task.name).collect();
    let mut tasks: Vec<&'static sim::tasks::Task> = Vec::new();
    for name in section.list("tasks") {
        match sim::tasks::task(&name.value) {
            Err(_) => {
                let message = format!("there is no task '{}'", name.value);
                section.note(name.line, message + &hint(&name.value, &known));
            }
            Ok(task) if tasks.iter().any(|other| other.name == task.name) => {
                section.note(name.line, format!("{} is there twice", task.name));
            }
            Ok(task) => tasks.push(task),
        }
    }
    tasks
}

fn read_segment_len(section: &mut Section<'_>, tasks: &[&'static sim::tasks::Task]) -> u32 {
    let len = section.number("segment_len", 2..=10_000, None);
    for task in tasks {
        let episode_len = (task.spec)().episode_len;
        if len.value > episode_len {
            let message = format!(
                "`segment_len` is {}, longer than an episode of {} ({episode_len} steps)",
                len.value, task.name
            );
            section.note(len.line, message);
        }
    }
    len.value
}

/// Every segment is shown once, so the experts' episodes must hold two for each pair.
fn check_segments(
    section: &Section<'_>,
    tasks: &[&'static sim::tasks::Task],
    labels: &Placed<u32>,
    (start_before, n_episodes, segment_len): (u32, u32, u32),
) {
    for task in tasks {
        let n_starts = ((task.spec)().episode_len + 1).saturating_sub(segment_len);
        let there = n_episodes * start_before.min(n_starts);
        if there < 2 * labels.value {
            let (pairs, name) = (labels.value, task.name);
            let message = format!(
                "`labels_per_task` is {pairs}, which takes {} segments, but {n_episodes} episodes of {name} hold \
                 {there} that start before step {start_before}",
                2 * pairs
            );
            section.note(labels.line, message);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::study::Expected;

    const GOOD: &str = r#"
title = "Which is better?"
tasks = ["window-open"]
question = "preference"
labels_per_task = 20
segment_len = 20
consent = "You may stop at any time."

[source]
kind = "expert"

[[practice]]
task = "window-open"
first = { policy = "random", start = 0 }
second = { policy = "expert", start = 40 }
expects = "second"
because = "Its window opens."
"#;

    fn parse(text: &str) -> Result<StudyFile, Mistakes> {
        StudyFile::parse("study.toml", text, Path::new("."))
    }

    /// The mistakes of the good file with one line changed.
    fn told(from: &str, to: &str) -> String {
        assert!(GOOD.contains(from), "{from}");
        parse(&GOOD.replace(from, to)).unwrap_err().to_string()
    }

    #[test]
    fn a_file_is_read_and_what_it_leaves_out_has_a_default() {
        let study = parse(GOOD).unwrap();
        let source = Source::Expert {
            start_before: 100,
            n_episodes: 20,
        };
        assert_eq!(study.source, source);
        assert_eq!(study.practice[0].expects, Expected::Second);
        assert_eq!((study.labelers_per_item, study.n_pairs()), (1, (20, 1, 0)));
    }

    #[test]
    fn every_mistake_of_a_file_is_named_with_its_line() {
        let text = GOOD
            .replace("labels_per_task", "lables_per_task")
            .replace("[\"window-open\"]", "[\"window-opne\", \"door-open\"]")
            .replace("\"preference\"", "\"preferance\"");
        let lines: Vec<usize> = parse(&text)
            .unwrap_err()
            .list
            .iter()
            .map(|mistake| mistake.line)
            .collect();
        assert_eq!(
            lines,
            [1, 3, 4, 5, 13],
            "missing, task, word, key, task of a pair"
        );
    }

    #[test]
    fn the_nearest_right_name_is_told() {
        for (from, to, meant) in [
            (
                "\"window-open\"]",
                "\"windw-open\"]",
                "line 3: there is no task 'windw-open'; did you mean 'window-open'?",
            ),
            (
                "kind = \"expert\"",
                "kind = \"exprt\"",
                "line 10: `kind` has no choice 'exprt'; did you mean 'expert'?",
            ),
            ("because", "becuase", "did you mean 'because'?"),
            (
                "\"random\"",
                "\"randm\"",
                "line 14: `policy` has no choice 'randm'; did you mean 'random'?",
            ),
        ] {
            let told = told(from, to);
            assert!(told.contains(meant), "{told}");
        }
    }

    #[test]
    fn what_no_study_can_be_is_refused() {
        for (from, to, said) in [
            (
                "question = \"preference\"",
                "question = preference",
                "line 4: this is no TOML (",
            ),
            (
                "labels_per_task = 20",
                "labels_per_task = 0",
                "line 5: `labels_per_task` must be between 1 and 10000",
            ),
            (
                "segment_len = 20",
                "segment_len = 501",
                "longer than an episode of window-open",
            ),
            (
                "segment_len = 20",
                "segment_len = \"20\"",
                "line 6: `segment_len` must be a whole number",
            ),
            (
                "tasks = [\"window-open\"]",
                "tasks = []",
                "line 3: `tasks` is empty",
            ),
            (
                "start = 40",
                "start = 481",
                "line 15: a segment of 20 steps from step 481 on does not fit",
            ),
            (
                "expects = \"second\"",
                "expects = \"same\"",
                "line 16: `expects` has no choice 'same'",
            ),
            (
                "consent = \"You",
                "consent = \"\" # \"You",
                "line 7: `consent` must say something",
            ),
            (
                "[source]",
                "repeats_per_task = 21\n[source]",
                "line 9: `repeats_per_task` is 21, more than the 20 pairs",
            ),
            (
                "kind = \"expert\"",
                "kind = \"queries\"",
                "line 9: `sets` is missing",
            ),
            (
                "kind = \"expert\"",
                "kind = \"expert\"\nstart_before = 3\nepisodes = 13",
                "line 5: `labels_per_task` is 20, which takes 40 segments, but 13 episodes of window-open hold 39",
            ),
            ("title = ", "title ", "line 2: "),
        ] {
            let told = told(from, to);
            assert!(told.contains(said), "{told}");
        }
    }

    #[test]
    fn a_query_set_that_does_not_exist_and_a_method_without_one_are_named() {
        let set = "kind = \"queries\"\n[[source.sets]]\ntask = \"window-open\"\nmethod = \"stiar\"\nfrom = \"nowhere.stair\"";
        let told = told("kind = \"expert\"", set);
        assert!(
            told.contains("line 13: there is no method 'stiar'; did you mean 'stair'?"),
            "{told}"
        );
        assert!(
            told.contains("line 14: the query set nowhere.stair does not exist"),
            "{told}"
        );
    }
}
