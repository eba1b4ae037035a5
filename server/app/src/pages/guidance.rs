//! What labelers are told about a task, as `assets/guidance` has it, and which version it was.
//!
//! The texts are written in a small part of Markdown: paragraphs, `##` headings and `-` lists.

use std::fmt::Write as _;

use askama::filters::{Escaper as _, Html};
use sha2::{Digest as _, Sha256};

/// `(task, text)` of every file in `assets/guidance`.
const TEXTS: &[(&str, &str)] = include!(concat!(env!("OUT_DIR"), "/guidance.rs"));

/// For a task whose text is not written yet.
const ANY: &str = "Say which clip does better at the task that is named above.\n";

/// A task's guidance.
pub struct Guidance {
    /// To be put into a page as it is.
    pub html: String,
    /// Of the text, hexadecimal; stored with every answer that was given under it.
    pub sha256: String,
}

/// The guidance for a task.
pub fn guidance(task: &str) -> Guidance {
    let text = TEXTS
        .iter()
        .find(|(name, _)| *name == task)
        .map_or(ANY, |(_, text)| text);
    Guidance {
        html: to_html(text),
        sha256: format!("{:x}", Sha256::digest(text)),
    }
}

fn to_html(text: &str) -> String {
    let mut html = String::new();
    for block in text.split("\n\n").map(str::trim).filter(|b| !b.is_empty()) {
        if let Some(heading) = block.strip_prefix("## ") {
            element(&mut html, "h2", heading);
        } else if block.starts_with("- ") {
            html.push_str("<ul>");
            for item in block.lines().filter_map(|line| line.strip_prefix("- ")) {
                element(&mut html, "li", item);
            }
            html.push_str("</ul>\n");
        } else {
            element(&mut html, "p", block);
        }
    }
    html
}

fn element(html: &mut String, tag: &str, text: &str) {
    let _ = write!(html, "<{tag}>"); // writing to a string cannot fail
    let _ = Html.write_escaped_str(&mut *html, text); // the same
    let _ = writeln!(html, "</{tag}>"); // the same
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn headings_lists_and_paragraphs_become_html_and_nothing_else_does() {
        let html = to_html("Open <it>.\n\n## When\n\n- one\n- two & three\n");
        assert_eq!(
            html,
            "<p>Open &#60;it&#62;.</p>\n<h2>When</h2>\n<ul><li>one</li>\n<li>two &#38; three</li>\n</ul>\n"
        );
    }

    #[test]
    fn every_task_has_guidance_of_its_own() {
        for task in sim::tasks::tasks() {
            assert!(
                TEXTS.iter().any(|(name, _)| *name == task.name),
                "{}",
                task.name
            );
        }
    }
}
