//! What labelers are told about a task, as `assets/guidance` has it, and which version it was.

use sha2::{Digest as _, Sha256};

use super::markdown::to_html;

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
    guidance_with("", task)
}

/// A study's own words, then the guidance for a task.
pub fn guidance_with(words: &str, task: &str) -> Guidance {
    let of_task = TEXTS
        .iter()
        .find(|(name, _)| *name == task)
        .map_or(ANY, |(_, text)| text);
    if words.trim().is_empty() {
        text(of_task)
    } else {
        text(&format!("{}\n\n{of_task}", words.trim()))
    }
}

/// Guidance that is somebody's own words alone.
pub fn text(words: &str) -> Guidance {
    Guidance {
        html: to_html(words),
        sha256: format!("{:x}", Sha256::digest(words)),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

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
