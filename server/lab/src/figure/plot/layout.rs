//! Panels side by side under one key.

use super::panel::Frame;
use super::style::{INK, PAPER, SMALL, Series};
use super::svg::{Anchor, Font, Svg};

/// Margins of a panel: room for numbers and names.
const LEFT: f64 = 58.0;
const TOP: f64 = 46.0;
const RIGHT: f64 = 26.0;
const BOTTOM: f64 = 50.0;
const KEY_HEIGHT: f64 = 34.0;
const LINE_HEIGHT: f64 = 22.0;
const NOTE_HEIGHT: f64 = 15.0;

/// A figure of equal panels in rows.
#[derive(Debug, Clone)]
pub(crate) struct Sheet {
    n_columns: usize,
    n_rows: usize,
    panel: (f64, f64),
    key: Vec<Entry>,
    key_height: f64,
    /// Lines of what the reader has to know, at the bottom.
    note: Vec<String>,
}

/// One line of the key.
#[derive(Debug, Clone)]
pub(crate) struct Entry {
    /// How the series looks.
    pub look: Series,
    /// What it is.
    pub name: String,
    /// Whether it is drawn with lines, and not with markers alone.
    pub has_line: bool,
}

impl Sheet {
    /// Room for `n` panels with this area between the axes, at most `max_columns` in a row,
    /// under a key of these entries.
    pub(crate) fn new(n: usize, max_columns: usize, panel: (f64, f64), key: Vec<Entry>) -> Self {
        let n_columns = n.clamp(1, max_columns);
        let mut sheet = Self {
            n_columns,
            n_rows: n.max(1).div_ceil(n_columns),
            panel,
            key,
            key_height: 8.0,
            note: Vec::new(),
        };
        if let Some((_, line)) = sheet.places().last() {
            sheet.key_height = KEY_HEIGHT + LINE_HEIGHT * *line as f64;
        }
        sheet
    }

    /// The same with words for the reader at the bottom.
    #[must_use]
    pub(crate) fn noted(mut self, text: &str) -> Self {
        let room = self.width() - LEFT - RIGHT;
        self.note = wrapped(text, room);
        self
    }

    /// An empty sheet of the size with the key at its top and the note at its bottom.
    pub(crate) fn start(&self) -> Svg {
        let mut svg = Svg::new(self.width(), self.height(), PAPER);
        for (entry, (x, line)) in self.key.iter().zip(self.places()) {
            draw_entry(&mut svg, (x, 24.0 + LINE_HEIGHT * line as f64), entry);
        }
        for (n, line) in self.note.iter().rev().enumerate() {
            let at = (LEFT - 8.0, self.height() - 10.0 - NOTE_HEIGHT * n as f64);
            svg.text(at, line, Anchor::Start, SMALL);
        }
        svg
    }

    /// The area between the axes of the n-th panel.
    pub(crate) fn frame(&self, n: usize) -> Frame {
        let (width, height) = self.panel;
        let (column, row) = (n % self.n_columns, n / self.n_columns);
        Frame {
            x: LEFT + column as f64 * (LEFT + width + RIGHT),
            y: self.key_height + TOP + row as f64 * (TOP + height + BOTTOM),
            width,
            height,
        }
    }

    fn width(&self) -> f64 {
        self.n_columns as f64 * (LEFT + self.panel.0 + RIGHT)
    }

    fn height(&self) -> f64 {
        self.key_height
            + self.n_rows as f64 * (TOP + self.panel.1 + BOTTOM)
            + NOTE_HEIGHT * self.note.len() as f64
    }

    /// Left edge and line of each entry of the key.
    fn places(&self) -> Vec<(f64, usize)> {
        let (mut x, mut line) = (LEFT - 8.0, 0);
        let mut places = Vec::with_capacity(self.key.len());
        for entry in &self.key {
            let width = entry.indent() + 1.04 * text_width(&entry.name, 13.0) + 22.0;
            if x + width > self.width() && x > LEFT {
                (x, line) = (LEFT - 8.0, line + 1);
            }
            places.push((x, line));
            x += width;
        }
        places
    }
}

impl Entry {
    /// From its left edge to its name.
    fn indent(&self) -> f64 {
        if self.has_line { 40.0 } else { 18.0 }
    }
}

/// A short piece of the series with its name beside it.
fn draw_entry(svg: &mut Svg, (x, y): (f64, f64), entry: &Entry) {
    let font = Font {
        size: 13.0,
        color: INK,
        is_strong: false,
    };
    let middle = if entry.has_line {
        svg.polyline(&[(x, y - 4.5), (x + 32.0, y - 4.5)], entry.look.pen(2.2));
        (x + 16.0, y - 4.5)
    } else {
        (x + 6.0, y - 4.5)
    };
    entry.look.marker.draw(svg, middle, 4.4, entry.look.color);
    let at = (x + entry.indent(), y);
    svg.text(at, &entry.name, Anchor::Start, font);
}

/// Lines no wider than the room, broken between words.
fn wrapped(text: &str, room: f64) -> Vec<String> {
    let mut lines: Vec<String> = Vec::new();
    for word in text.split(' ') {
        match lines.last_mut() {
            Some(line) if text_width(&format!("{line} {word}"), SMALL.size) <= room => {
                line.push(' ');
                line.push_str(word);
            }
            _ => lines.push(word.to_owned()),
        }
    }
    lines
}

/// About how wide a text is in a sans-serif font: the readers' fonts differ.
fn text_width(text: &str, size: f64) -> f64 {
    let of = |c: char| match c {
        'i' | 'j' | 'l' | 't' | 'f' | 'r' | '.' | ',' | ':' | ' ' | '(' | ')' => 0.34,
        'm' | 'w' | 'M' | 'W' | '%' => 0.85,
        c if c.is_uppercase() => 0.64,
        _ => 0.55,
    };
    size * text.chars().map(of).sum::<f64>()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn long_notes_are_broken_between_words_and_lose_none() {
        let text = "Thin: each seed. Band: an interval over seeds, from three seeds on.";
        let lines = wrapped(text, 150.0);
        assert!(lines.len() > 2 && lines.join(" ") == text);
        assert!(
            lines
                .iter()
                .all(|line| text_width(line, SMALL.size) <= 150.0)
        );
    }

    #[test]
    fn a_key_that_is_too_wide_goes_on_in_the_next_line() {
        let entry = |n: usize| Entry {
            look: crate::figure::plot::series(n),
            name: format!("a method with a rather long name, number {n}"),
            has_line: true,
        };
        let one = Sheet::new(1, 1, (300.0, 100.0), vec![entry(0)]);
        let three = Sheet::new(1, 1, (300.0, 100.0), (0..3).map(entry).collect());
        assert!(three.height() > one.height());
        assert!(three.frame(0).y > one.frame(0).y);
    }
}
