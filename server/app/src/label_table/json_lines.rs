//! One JSON object a line.

use std::io::Write as _;

use store::Label;

use super::{TableError, Writer, Written, unreadable};

pub(super) struct JsonWriter(pub(super) Written);

impl Writer for JsonWriter {
    fn rows(&mut self, labels: &[Label]) -> Result<(), TableError> {
        for label in labels {
            serde_json::to_writer(&mut self.0, label).map_err(unreadable)?;
            self.0.write_all(b"\n").map_err(unreadable)?;
        }
        Ok(())
    }

    fn finish(self: Box<Self>) -> Result<(), TableError> {
        Ok(())
    }
}

pub(super) fn read(bytes: &[u8]) -> Result<Vec<Label>, TableError> {
    let lines = bytes.split(|byte| *byte == b'\n');
    let filled = (1..).zip(lines).filter(|(_, line)| !line.is_empty());
    filled
        .map(|(number, line)| {
            let wrong = |error| TableError::Unreadable(format!("line {number}: {error}"));
            serde_json::from_slice(line).map_err(wrong)
        })
        .collect()
}
