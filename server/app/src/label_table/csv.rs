//! RFC 4180 with a header line; a value that does not exist is empty.

use csv::{ReaderBuilder, Terminator, WriterBuilder};
use serde_json::Value;
use store::Label;

use super::{TableError, Writer, Written, cells, parse, row, unreadable};

pub(super) struct CsvWriter(csv::Writer<Written>);

impl CsvWriter {
    pub(super) fn new(written: Written) -> Result<Self, TableError> {
        let mut writer = WriterBuilder::new()
            .terminator(Terminator::CRLF)
            .from_writer(written);
        let names = Label::COLUMNS.iter().map(|(name, _)| *name);
        writer.write_record(names).map_err(unreadable)?;
        Ok(Self(writer))
    }
}

impl Writer for CsvWriter {
    fn rows(&mut self, labels: &[Label]) -> Result<(), TableError> {
        for label in labels {
            let cells = cells(label)?.into_iter().map(|cell| match cell {
                Value::Null => String::new(),
                Value::String(text) => text,
                other => other.to_string(),
            });
            self.0.write_record(cells).map_err(unreadable)?;
        }
        self.0.flush().map_err(unreadable)
    }

    fn finish(mut self: Box<Self>) -> Result<(), TableError> {
        self.0.flush().map_err(unreadable)
    }
}

pub(super) fn read(bytes: &[u8]) -> Result<Vec<Label>, TableError> {
    let mut reader = ReaderBuilder::new().from_reader(bytes);
    let names = reader.headers().map_err(unreadable)?.clone();
    let place = |name: &str| {
        let found = names.iter().position(|known| known == name);
        found.ok_or_else(|| TableError::Unreadable(format!("there is no column {name}")))
    };
    let mut columns = Vec::new();
    for (name, kind) in Label::COLUMNS {
        columns.push((place(name)?, *kind));
    }
    let mut labels = Vec::new();
    for (number, record) in (1..).zip(reader.records()) {
        let record = record.map_err(unreadable)?;
        let cells = columns.iter();
        let cells = cells.map(|(at, kind)| parse(record.get(*at).unwrap_or_default(), *kind));
        let label = cells.collect::<Result<_, _>>().and_then(row);
        labels.push(label.map_err(|e| TableError::Unreadable(format!("row {number}: {e}")))?);
    }
    Ok(labels)
}
