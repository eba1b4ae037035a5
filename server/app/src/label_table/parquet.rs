//! Apache Parquet: a row group for each page, every column optional.

use std::sync::Arc;

use bytes::Bytes;
use parquet::data_type::{BoolType, ByteArray, ByteArrayType, DataType, DoubleType, Int64Type};
use parquet::file::properties::WriterProperties;
use parquet::file::reader::{FileReader as _, SerializedFileReader};
use parquet::file::writer::{SerializedFileWriter, SerializedRowGroupWriter};
use parquet::record::Field;
use parquet::schema::parser::parse_message_type;
use serde_json::Value;
use store::{ColumnKind, Label};

use super::{TableError, Writer, Written, cells, row, unreadable};

pub(super) struct ParquetWriter(SerializedFileWriter<Written>);

impl ParquetWriter {
    pub(super) fn new(written: Written) -> Result<Self, TableError> {
        let columns = Label::COLUMNS.iter().map(|(name, kind)| match kind {
            ColumnKind::Text => format!("optional binary {name} (utf8);"),
            ColumnKind::Integer => format!("optional int64 {name};"),
            ColumnKind::Number => format!("optional double {name};"),
            ColumnKind::Truth => format!("optional boolean {name};"),
        });
        let schema = format!("message label {{ {} }}", columns.collect::<String>());
        let schema = Arc::new(parse_message_type(&schema).map_err(unreadable)?);
        let properties = Arc::new(WriterProperties::builder().build());
        let writer = SerializedFileWriter::new(written, schema, properties);
        Ok(Self(writer.map_err(unreadable)?))
    }
}

impl Writer for ParquetWriter {
    fn rows(&mut self, labels: &[Label]) -> Result<(), TableError> {
        if labels.is_empty() {
            return Ok(());
        }
        let rows = labels.iter().map(cells);
        let rows: Vec<Vec<Value>> = rows.collect::<Result<_, _>>()?;
        let mut group = self.0.next_row_group().map_err(unreadable)?;
        for (place, (_, kind)) in Label::COLUMNS.iter().enumerate() {
            let column = || rows.iter().map(|cells| &cells[place]);
            match kind {
                ColumnKind::Text => put::<ByteArrayType>(
                    &mut group,
                    column().map(|cell| cell.as_str().map(ByteArray::from)),
                ),
                ColumnKind::Integer => put::<Int64Type>(&mut group, column().map(Value::as_i64)),
                ColumnKind::Number => put::<DoubleType>(&mut group, column().map(Value::as_f64)),
                ColumnKind::Truth => put::<BoolType>(&mut group, column().map(Value::as_bool)),
            }?;
        }
        group.close().map_err(unreadable)?;
        Ok(())
    }

    fn finish(self: Box<Self>) -> Result<(), TableError> {
        self.0.close().map_err(unreadable)?;
        Ok(())
    }
}

/// The next column of a row group; its definition levels say which cells hold a value.
fn put<T: DataType>(
    group: &mut SerializedRowGroupWriter<'_, Written>,
    cells: impl Iterator<Item = Option<T::T>>,
) -> Result<(), TableError> {
    let (mut values, mut levels) = (Vec::new(), Vec::new());
    for cell in cells {
        levels.push(i16::from(cell.is_some()));
        values.extend(cell);
    }
    let column = group.next_column().map_err(unreadable)?;
    let mut column =
        column.ok_or_else(|| TableError::Unreadable("a table with fewer columns".into()))?;
    let typed = column.typed::<T>();
    typed
        .write_batch(&values, Some(&levels), None)
        .map_err(unreadable)?;
    column.close().map_err(unreadable)
}

pub(super) fn read(bytes: &[u8]) -> Result<Vec<Label>, TableError> {
    let reader = SerializedFileReader::new(Bytes::copy_from_slice(bytes)).map_err(unreadable)?;
    let rows = reader.get_row_iter(None).map_err(unreadable)?;
    let mut labels = Vec::new();
    for (number, read) in (1..).zip(rows) {
        let read = read.map_err(unreadable)?;
        let cell = |name: &str| {
            let mut columns = read.get_column_iter();
            let found = columns.find(|(known, _)| *known == name);
            found.map_or(Value::Null, |(_, field)| value(field))
        };
        let cells = Label::COLUMNS.iter().map(|(name, _)| cell(name)).collect();
        let wrong = |error| TableError::Unreadable(format!("row {number}: {error}"));
        labels.push(row(cells).map_err(wrong)?);
    }
    Ok(labels)
}

fn value(field: &Field) -> Value {
    match field {
        Field::Str(text) => Value::from(text.clone()),
        Field::Long(number) => Value::from(*number),
        Field::Double(number) => Value::from(*number),
        Field::Bool(truth) => Value::from(*truth),
        _ => Value::Null,
    }
}
