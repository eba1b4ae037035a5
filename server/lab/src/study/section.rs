//! Reading a table of a study's file key by key, so that every mistake is found and has a line.

use std::cell::RefCell;
use std::fmt;
use std::ops::RangeInclusive;

use domain::nearest::nearest;
use toml::Spanned;
use toml::de::{DeTable, DeValue};

/// Something in a file that does not fit.
#[derive(Debug, Clone, PartialEq, Eq, PartialOrd, Ord)]
pub struct Mistake {
    /// Line of the file, from 1.
    pub line: usize,
    /// What is wrong and what to do.
    pub message: String,
}

/// Everything in a file that does not fit, by line.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
pub struct Mistakes {
    /// The file.
    pub name: String,
    /// By line.
    pub list: Vec<Mistake>,
}

impl fmt::Display for Mistakes {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        for (n, Mistake { line, message }) in self.list.iter().enumerate() {
            let gap = if n == 0 { "" } else { "\n" };
            write!(f, "{gap}{}: line {line}: {message}", self.name)?;
        }
        Ok(())
    }
}

/// A file's text, and what was found to be wrong with it so far.
pub(super) struct Text<'t> {
    pub(super) text: &'t str,
    mistakes: RefCell<Vec<Mistake>>,
}

impl<'t> Text<'t> {
    pub(super) fn new(text: &'t str) -> Self {
        Self {
            text,
            mistakes: RefCell::default(),
        }
    }

    /// The line of a byte, from 1.
    pub(super) fn line_of(&self, byte: usize) -> usize {
        let before = self.text.get(..byte).unwrap_or(self.text);
        1 + before.matches('\n').count()
    }

    /// Notes a mistake.
    pub(super) fn note(&self, line: usize, message: String) {
        self.mistakes.borrow_mut().push(Mistake { line, message });
    }

    /// What was noted, by line.
    pub(super) fn into_mistakes(self) -> Vec<Mistake> {
        let mut mistakes = self.mistakes.into_inner();
        mistakes.sort();
        mistakes
    }
}

/// A value and the line on which it stands.
#[derive(Debug, Clone)]
pub(super) struct Placed<T> {
    pub(super) line: usize,
    pub(super) value: T,
}

/// One table of a file while it is read. A key that is missing or does not fit is noted and
/// read as its type's default; the file is refused in the end.
pub(super) struct Section<'t> {
    text: &'t Text<'t>,
    table: &'t DeTable<'t>,
    line: usize,
    asked: Vec<&'static str>,
}

impl<'t> Section<'t> {
    pub(super) fn new(text: &'t Text<'t>, table: &'t DeTable<'t>, line: usize) -> Self {
        Self {
            text,
            table,
            line,
            asked: Vec::new(),
        }
    }

    /// Line of the table's beginning.
    pub(super) fn line(&self) -> usize {
        self.line
    }

    /// Notes a mistake in this file.
    pub(super) fn note(&self, line: usize, message: String) {
        self.text.note(line, message);
    }

    fn find(&mut self, key: &'static str) -> Option<&'t Spanned<DeValue<'t>>> {
        self.asked.push(key);
        let mut entries = self.table.iter();
        entries
            .find(|(name, _)| name.get_ref().as_ref() == key)
            .map(|(_, value)| value)
    }

    fn line_of(&self, value: &Spanned<DeValue<'_>>) -> usize {
        self.text.line_of(value.span().start)
    }

    fn wrong_kind(&self, key: &str, value: &Spanned<DeValue<'_>>, wanted: &str) {
        let got = value.get_ref().type_str();
        let message = format!("`{key}` must be {wanted}, not of type {got}");
        self.note(self.line_of(value), message);
    }

    /// Text that may be left out.
    pub(super) fn text_or(&mut self, key: &'static str, default: &str) -> Placed<String> {
        let line = self.line;
        let Some(found) = self.find(key) else {
            return Placed {
                line,
                value: default.to_owned(),
            };
        };
        let value = found.get_ref().as_str().unwrap_or_else(|| {
            self.wrong_kind(key, found, "text");
            default
        });
        Placed {
            line: self.line_of(found),
            value: value.to_owned(),
        }
    }

    /// Text that must be there and say something.
    pub(super) fn words(&mut self, key: &'static str) -> Placed<String> {
        let is_there = self.table.iter().any(|(name, _)| name.get_ref() == key);
        let found = self.text_or(key, "");
        if !is_there {
            self.note(self.line, format!("`{key}` is missing"));
        } else if found.value.trim().is_empty() {
            self.note(found.line, format!("`{key}` must say something"));
        }
        found
    }

    /// One of several words.
    pub(super) fn choice<T: Copy>(
        &mut self,
        key: &'static str,
        choices: &[(&'static str, T)],
    ) -> Option<T> {
        let found = self.words(key);
        if found.value.trim().is_empty() {
            return None;
        }
        let chosen = choices.iter().find(|(word, _)| *word == found.value);
        if chosen.is_none() {
            let known: Vec<&str> = choices.iter().map(|(word, _)| *word).collect();
            let message = format!("`{key}` has no choice '{}'", found.value);
            self.note(found.line, message + &hint(&found.value, &known));
        }
        chosen.map(|(_, value)| *value)
    }

    /// A whole number that may be left out where there is a default.
    pub(super) fn number(
        &mut self,
        key: &'static str,
        within: RangeInclusive<u32>,
        default: Option<u32>,
    ) -> Placed<u32> {
        let (line, least) = (self.line, *within.start());
        let Some(found) = self.find(key) else {
            if default.is_none() {
                self.note(line, format!("`{key}` is missing"));
            }
            let value = default.unwrap_or(least);
            return Placed { line, value };
        };
        let line = self.line_of(found);
        let Some(integer) = found.get_ref().as_integer() else {
            self.wrong_kind(key, found, "a whole number");
            return Placed { line, value: least };
        };
        let parsed = i64::from_str_radix(integer.as_str(), integer.radix()).ok();
        let fitting = parsed
            .and_then(|n| u32::try_from(n).ok())
            .filter(|n| within.contains(n));
        if fitting.is_none() {
            let (lo, hi) = (within.start(), within.end());
            let message = format!("`{key}` must be between {lo} and {hi}");
            self.note(line, message);
        }
        let value = fitting.unwrap_or(least);
        Placed { line, value }
    }

    /// A list of texts that must not be empty.
    pub(super) fn list(&mut self, key: &'static str) -> Vec<Placed<String>> {
        let Some(found) = self.find(key) else {
            self.note(self.line, format!("`{key}` is missing"));
            return Vec::new();
        };
        let Some(values) = found.get_ref().as_array() else {
            self.wrong_kind(key, found, "a list");
            return Vec::new();
        };
        if values.is_empty() {
            self.note(self.line_of(found), format!("`{key}` is empty"));
        }
        let mut list = Vec::new();
        for value in values {
            match value.get_ref().as_str() {
                Some(text) => list.push(Placed {
                    line: self.line_of(value),
                    value: text.to_owned(),
                }),
                None => self.wrong_kind(key, value, "a list of texts"),
            }
        }
        list
    }

    /// A table inside this one.
    pub(super) fn table(&mut self, key: &'static str) -> Option<Self> {
        let Some(found) = self.find(key) else {
            self.note(self.line, format!("the table [{key}] is missing"));
            return None;
        };
        let section = self.section(found);
        if section.is_none() {
            self.wrong_kind(key, found, "a table");
        }
        section
    }

    /// Tables of one name, `[[key]]`; none where it is left out.
    pub(super) fn tables(&mut self, key: &'static str) -> Vec<Self> {
        let Some(found) = self.find(key) else {
            return Vec::new();
        };
        let Some(values) = found.get_ref().as_array() else {
            self.wrong_kind(key, found, "a list of tables");
            return Vec::new();
        };
        let mut tables = Vec::new();
        for value in values {
            match self.section(value) {
                Some(section) => tables.push(section),
                None => self.wrong_kind(key, value, "a list of tables"),
            }
        }
        tables
    }

    fn section(&self, value: &'t Spanned<DeValue<'t>>) -> Option<Self> {
        let table = value.get_ref().as_table()?;
        Some(Self::new(self.text, table, self.line_of(value)))
    }

    /// Notes every key that nobody asked for.
    pub(super) fn finish(self) {
        for (key, _) in self.table {
            let name = key.get_ref().as_ref();
            if !self.asked.contains(&name) {
                let line = self.text.line_of(key.span().start);
                let message = format!("there is no key `{name}`");
                self.note(line, message + &hint(name, &self.asked));
            }
        }
    }
}

/// What was probably meant, or else what there is.
pub(super) fn hint(name: &str, known: &[&str]) -> String {
    match nearest(name, known) {
        Some(meant) => format!("; did you mean '{meant}'?"),
        None => format!("; there are {}", known.join(", ")),
    }
}
