//! Answers as tables: the same rows and columns as CSV, JSON Lines and Parquet, written and read
//! a page at a time.

use std::io::Write;
use std::sync::{Arc, Mutex, PoisonError};

use serde_json::{Map, Value};
use store::{ColumnKind, Label, LabelsOf, Store, StoreError};

mod csv;
mod json_lines;
mod parquet;

/// Rows that are in memory at once.
const PAGE: u32 = 1_000;

/// How a table is written.
#[derive(Debug, Clone, Copy, PartialEq, Eq, clap::ValueEnum)]
pub enum TableFormat {
    /// Comma-separated, with a header line.
    Csv,
    /// One JSON object a line.
    Jsonl,
    /// Apache Parquet.
    Parquet,
}

impl TableFormat {
    const ALL: [(&str, Self); 3] = [
        ("csv", Self::Csv),
        ("jsonl", Self::Jsonl),
        ("parquet", Self::Parquet),
    ];

    /// As files end and addresses ask.
    pub fn word(self) -> &'static str {
        let found = Self::ALL.iter().find(|(_, format)| *format == self);
        found.map_or("", |(word, _)| word)
    }

    /// The format of that name.
    pub fn of(word: &str) -> Option<Self> {
        let found = Self::ALL.iter().find(|(known, _)| *known == word);
        found.map(|(_, format)| *format)
    }

    /// As HTTP names it.
    pub fn content_type(self) -> &'static str {
        match self {
            Self::Csv => "text/csv; charset=utf-8",
            Self::Jsonl => "application/x-ndjson",
            Self::Parquet => "application/vnd.apache.parquet",
        }
    }
}

/// Why a table could not be written or read.
#[derive(Debug, thiserror::Error)]
pub enum TableError {
    /// The store.
    #[error(transparent)]
    Store(#[from] StoreError),
    /// Whoever wanted the table has gone.
    #[error("nobody wants the rest of the table")]
    Unwanted,
    /// Bytes that are no such table, or a disk that refuses.
    #[error("{0}")]
    Unreadable(String),
}

/// Writes rows in one format.
trait Writer: Send {
    fn rows(&mut self, labels: &[Label]) -> Result<(), TableError>;
    /// What comes behind the last row.
    fn finish(self: Box<Self>) -> Result<(), TableError>;
}

/// Writes all answers, a page at a time; `take` is given the bytes as they come.
///
/// # Errors
/// [`TableError`]; what was taken until then is no whole table.
pub async fn write<F>(
    store: &Store,
    of: LabelsOf,
    format: TableFormat,
    mut take: impl FnMut(Vec<u8>) -> F,
) -> Result<(), TableError>
where
    F: Future<Output = Result<(), TableError>>,
{
    let written = Written::default();
    let mut writer: Box<dyn Writer> = match format {
        TableFormat::Csv => Box::new(csv::CsvWriter::new(written.clone())?),
        TableFormat::Jsonl => Box::new(json_lines::JsonWriter(written.clone())),
        TableFormat::Parquet => Box::new(parquet::ParquetWriter::new(written.clone())?),
    };
    let mut after = 0;
    loop {
        let page = store.labels(of, after, PAGE).await?;
        writer.rows(&page.labels)?;
        take(written.drain()).await?;
        let Some(next) = page.next else { break };
        after = next;
    }
    writer.finish()?;
    take(written.drain()).await
}

/// Reads a table back.
///
/// # Errors
/// [`TableError::Unreadable`] says where it does not fit.
pub fn read(bytes: &[u8], format: TableFormat) -> Result<Vec<Label>, TableError> {
    match format {
        TableFormat::Csv => csv::read(bytes),
        TableFormat::Jsonl => json_lines::read(bytes),
        TableFormat::Parquet => parquet::read(bytes),
    }
}

/// Bytes that a writer has written and nobody has taken.
#[derive(Debug, Clone, Default)]
struct Written(Arc<Mutex<Vec<u8>>>);

impl Written {
    fn drain(&self) -> Vec<u8> {
        std::mem::take(&mut *self.0.lock().unwrap_or_else(PoisonError::into_inner))
    }
}

impl Write for Written {
    fn write(&mut self, bytes: &[u8]) -> std::io::Result<usize> {
        let mut all = self.0.lock().unwrap_or_else(PoisonError::into_inner);
        all.extend_from_slice(bytes);
        Ok(bytes.len())
    }

    fn flush(&mut self) -> std::io::Result<()> {
        Ok(())
    }
}

/// The cells of a row, in the order of the columns.
fn cells(label: &Label) -> Result<Vec<Value>, TableError> {
    let row = serde_json::to_value(label).map_err(unreadable)?;
    let Value::Object(mut row) = row else {
        return Ok(Vec::new());
    };
    let columns = Label::COLUMNS.iter();
    Ok(columns
        .map(|(name, _)| row.remove(*name).unwrap_or_default())
        .collect())
}

/// A row from its cells, in the order of the columns.
fn row(cells: Vec<Value>) -> Result<Label, TableError> {
    let names = Label::COLUMNS.iter().map(|(name, _)| (*name).to_owned());
    let row: Map<String, Value> = names.zip(cells).collect();
    serde_json::from_value(Value::Object(row)).map_err(unreadable)
}

fn unreadable(error: impl std::fmt::Display) -> TableError {
    TableError::Unreadable(error.to_string())
}

/// A cell's text as a value of its column; empty text is no value.
fn parse(text: &str, kind: ColumnKind) -> Result<Value, TableError> {
    let wrong = |what| TableError::Unreadable(format!("'{text}' is not {what}"));
    if text.is_empty() {
        return Ok(Value::Null);
    }
    Ok(match kind {
        ColumnKind::Text => Value::from(text),
        ColumnKind::Integer => {
            Value::from(text.parse::<i64>().map_err(|_| wrong("a whole number"))?)
        }
        ColumnKind::Number => Value::from(text.parse::<f64>().map_err(|_| wrong("a number"))?),
        ColumnKind::Truth => Value::from(text.parse::<bool>().map_err(|_| wrong("true or false"))?),
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Rows with everything that a format could spoil: commas, quotes, line ends, nothing at
    /// all, numbers that have no short decimal.
    fn labels() -> Vec<Label> {
        let row = serde_json::json!({
            "answer_id": "a1", "run_id": 3, "task": "door-open", "method": null, "seed": -1, "question": "preference",
            "sequence": 9_007_199_254_740_993_i64, "query_id": 4, "session": 0, "position": 7, "labeler": "Ada, \"the\" first\nlabeler",
            "pressed": "skip", "meaning": "skip", "left_is": "first", "reason": "ärger; 1,5", "supersedes": null, "is_current": true,
            "first_episode": 1, "first_start": 2, "first_clip": null, "second_episode": 3, "second_start": 4, "second_clip": "ff",
            "segment_len": 50, "disagreement": f64::from(0.1_f32), "stage_gap": 1e-300, "guidance_sha256": null, "visible_ms": null,
            "hidden_ms": 0, "loops": 1.5, "seeks": 2, "speed": 0.333_333_333_333_333_3, "dropped_frames": 0, "input": "key",
            "stored_at": "2026-01-02T03:04:05.678Z", "study_id": 1, "item_id": 2, "role": "counted", "expects": null,
        });
        let first: Label = serde_json::from_value(row).expect("a label");
        let second = Label {
            answer_id: "a2".into(),
            method: Some("stair".into()),
            reason: None,
            is_current: false,
            study_id: None,
            ..first.clone()
        };
        vec![first, second]
    }

    fn written(format: TableFormat, labels: &[Label]) -> Vec<u8> {
        let written = Written::default();
        let mut writer: Box<dyn Writer> = match format {
            TableFormat::Csv => Box::new(csv::CsvWriter::new(written.clone()).unwrap()),
            TableFormat::Jsonl => Box::new(json_lines::JsonWriter(written.clone())),
            TableFormat::Parquet => Box::new(parquet::ParquetWriter::new(written.clone()).unwrap()),
        };
        for page in labels.chunks(1) {
            writer.rows(page).unwrap();
        }
        writer.finish().unwrap();
        written.drain()
    }

    #[test]
    fn what_is_written_is_read_back_the_same_in_every_format() {
        for (name, format) in TableFormat::ALL {
            let bytes = written(format, &labels());
            assert_eq!(read(&bytes, format).unwrap(), labels(), "{name}");
            let none = written(format, &[]);
            assert_eq!(read(&none, format).unwrap(), [], "{name}");
        }
    }

    #[test]
    fn a_table_that_does_not_fit_is_refused_with_the_place() {
        let csv = written(TableFormat::Csv, &labels());
        let text = String::from_utf8(csv).unwrap();
        let told = |text: &str| {
            read(text.as_bytes(), TableFormat::Csv)
                .unwrap_err()
                .to_string()
        };
        assert!(told(&text.replace("run_id", "ran_id")).contains("run_id"));
        let told = told(&text.replace("a2,3,", "a2,three,"));
        assert!(
            told.contains("row 2") && told.contains("'three' is not a whole number"),
            "{told}"
        );
        let jsonl = read(b"{\"answer_id\": 1}\n", TableFormat::Jsonl).unwrap_err();
        assert!(jsonl.to_string().contains("line 1"), "{jsonl}");
        assert!(read(b"PAR1 or not", TableFormat::Parquet).is_err());
    }
}
