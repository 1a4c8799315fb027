//! A joined table as a Parquet file: texts in UTF-8, times in microseconds UTC, nothing where the CSV has nothing.

use std::fs::File;
use std::path::{Path, PathBuf};
use std::sync::Arc;

use jiff::Timestamp;
use parquet::basic::{Compression, LogicalType, Repetition, TimeUnit, Type as Physical};
use parquet::data_type::{BoolType, ByteArray, ByteArrayType, DataType, DoubleType, Int64Type};
use parquet::errors::ParquetError;
use parquet::file::properties::WriterProperties;
use parquet::file::writer::{SerializedColumnWriter, SerializedFileWriter};
use parquet::schema::types::Type as Schema;

use super::error::PackageError;
use super::table::JoinedTable;
use crate::store::export::{Column, Type};

/// Rows that are gathered before they are written together.
const GROUP: usize = 16_384;

/// A Parquet file being written.
pub struct ParquetFile {
    path: PathBuf,
    writer: SerializedFileWriter<File>,
    columns: Vec<Column>,
    /// The cells of the rows gathered, a column at a time.
    gathered: Vec<Vec<Option<String>>>,
}

impl ParquetFile {
    /// A file at `path` for the rows of `table`.
    pub fn create(path: &Path, table: &JoinedTable) -> Result<Self, PackageError> {
        let columns: Vec<Column> = table.columns().copied().collect();
        let fields = columns.iter().map(|column| field(column).map(Arc::new)).collect::<Result<_, _>>();
        let fields = fields.map_err(PackageError::unwritable(path))?;
        let schema = Schema::group_type_builder(table.table.name).with_fields(fields).build();
        let schema = schema.map_err(PackageError::unwritable(path))?;

        let properties = WriterProperties::builder().set_compression(Compression::SNAPPY).build();
        let file = File::create(path).map_err(PackageError::unwritable(path))?;
        let writer = SerializedFileWriter::new(file, Arc::new(schema), Arc::new(properties));
        let writer = writer.map_err(PackageError::unwritable(path))?;

        let gathered = vec![Vec::new(); columns.len()];
        Ok(Self { path: path.to_owned(), writer, columns, gathered })
    }

    /// Adds a row: its cells as the CSV files have them.
    pub fn row(&mut self, cells: &[&str]) -> Result<(), PackageError> {
        for ((column, gathered), cell) in self.columns.iter().zip(&mut self.gathered).zip(cells) {
            gathered.push((!cell.is_empty()).then(|| column.read(cell)));
        }
        if self.gathered.first().is_some_and(|column| column.len() >= GROUP) {
            self.pass_on()?;
        }
        Ok(())
    }

    /// Ends the file, and waits until the disk has it.
    pub fn end(mut self) -> Result<(), PackageError> {
        if self.gathered.first().is_some_and(|column| !column.is_empty()) {
            self.pass_on()?;
        }
        let file = self.writer.into_inner().map_err(PackageError::unwritable(&self.path))?;
        file.sync_data().map_err(PackageError::unwritable(&self.path))
    }

    fn pass_on(&mut self) -> Result<(), PackageError> {
        let path = self.path.clone();
        self.group().map_err(PackageError::unwritable(path))
    }

    /// Writes the gathered rows as a row group.
    fn group(&mut self) -> Result<(), ParquetError> {
        let mut group = self.writer.next_row_group()?;
        for (column, gathered) in self.columns.iter().zip(&mut self.gathered) {
            let cells = std::mem::take(gathered);
            let Some(mut writer) = group.next_column()? else {
                return Err(ParquetError::General("there are more columns than the schema has".to_owned()));
            };
            match column.kind {
                Type::String => write::<ByteArrayType>(&mut writer, column, &cells, |cell| Some(ByteArray::from(cell))),
                Type::Integer => write::<Int64Type>(&mut writer, column, &cells, |cell| cell.parse().ok()),
                Type::Number => write::<DoubleType>(&mut writer, column, &cells, |cell| cell.parse().ok()),
                Type::Boolean => write::<BoolType>(&mut writer, column, &cells, |cell| cell.parse().ok()),
                Type::Datetime => write::<Int64Type>(&mut writer, column, &cells, |cell| {
                    cell.parse::<Timestamp>().ok().map(Timestamp::as_microsecond)
                }),
            }?;
            writer.close()?;
        }
        group.close()?;
        Ok(())
    }
}

/// A column of the schema. Each may be empty: that is how the tables tell what is not known.
fn field(column: &Column) -> Result<Schema, ParquetError> {
    let (physical, logical) = match column.kind {
        Type::String => (Physical::BYTE_ARRAY, Some(LogicalType::String)),
        Type::Integer => (Physical::INT64, None),
        Type::Number => (Physical::DOUBLE, None),
        Type::Boolean => (Physical::BOOLEAN, None),
        Type::Datetime => (Physical::INT64, Some(LogicalType::timestamp(true, TimeUnit::MICROS))),
    };
    let field = Schema::primitive_type_builder(column.name, physical);
    field.with_repetition(Repetition::OPTIONAL).with_logical_type(logical).build()
}

/// Writes a column of a row group. A definition level of 0 stands for an empty cell.
fn write<D: DataType>(
    writer: &mut SerializedColumnWriter<'_>,
    column: &Column,
    cells: &[Option<String>],
    read: impl Fn(&str) -> Option<D::T>,
) -> Result<(), ParquetError> {
    let mut values = Vec::with_capacity(cells.len());
    let mut levels = Vec::with_capacity(cells.len());
    for cell in cells {
        levels.push(i16::from(cell.is_some()));
        if let Some(cell) = cell {
            let nonsense = || ParquetError::General(format!("'{cell}' is not a valid {}", column.name));
            values.push(read(cell).ok_or_else(nonsense)?);
        }
    }
    writer.typed::<D>().write_batch(&values, Some(&levels), None)?;
    Ok(())
}
