//! A joined table as a Parquet file: texts in UTF-8, times in microseconds UTC, null for an empty cell of the CSV.

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
use parfocal_records::store::export::{Column, Type};

/// Number of rows in a row group.
const GROUP: usize = 16_384;

/// A Parquet file being written.
pub struct ParquetFile {
    path: PathBuf,
    writer: SerializedFileWriter<File>,
    columns: Vec<ColumnCells>,
    /// Number of rows gathered for the next row group.
    rows: usize,
}

/// The cells of a column, gathered for the next row group.
struct ColumnCells {
    column: Column,
    values: Values,
    /// Definition level of each row: 1, or 0 if the cell is empty.
    levels: Vec<i16>,
}

/// Cells that are not empty, in Parquet's types.
enum Values {
    Texts(Vec<ByteArray>),
    /// Whole numbers, and times in microseconds.
    Integers(Vec<i64>),
    Numbers(Vec<f64>),
    Booleans(Vec<bool>),
}

impl ParquetFile {
    /// A file at `path` for the rows of `table`.
    pub fn create(path: &Path, table: &JoinedTable) -> Result<Self, PackageError> {
        let fields = table.columns().map(|column| field(column).map(Arc::new)).collect::<Result<_, _>>();
        let fields = fields.map_err(PackageError::unwritable(path))?;
        let schema = Schema::group_type_builder(table.table.name).with_fields(fields).build();
        let schema = schema.map_err(PackageError::unwritable(path))?;

        let properties = WriterProperties::builder().set_compression(Compression::SNAPPY).build();
        let file = File::create(path).map_err(PackageError::unwritable(path))?;
        let writer = SerializedFileWriter::new(file, Arc::new(schema), Arc::new(properties));
        let writer = writer.map_err(PackageError::unwritable(path))?;

        let columns = table.columns().copied().map(ColumnCells::new).collect();
        Ok(Self { path: path.to_owned(), writer, columns, rows: 0 })
    }

    /// Adds a row of cells as they are in the CSV files.
    pub fn row(&mut self, cells: &[&str]) -> Result<(), PackageError> {
        for (gathered, cell) in self.columns.iter_mut().zip(cells) {
            gathered.take(cell).map_err(PackageError::unwritable(&self.path))?;
        }

        self.rows += 1;
        if self.rows >= GROUP {
            self.pass_on()?;
        }
        Ok(())
    }

    /// Finishes the file, and waits until it is on disk.
    pub fn end(mut self) -> Result<(), PackageError> {
        if self.rows > 0 {
            self.pass_on()?;
        }
        let file = self.writer.into_inner().map_err(PackageError::unwritable(&self.path))?;
        file.sync_data().map_err(PackageError::unwritable(&self.path))
    }

    fn pass_on(&mut self) -> Result<(), PackageError> {
        let path = self.path.clone();
        self.rows = 0;
        self.group().map_err(PackageError::unwritable(path))
    }

    /// Writes the gathered rows as a row group.
    fn group(&mut self) -> Result<(), ParquetError> {
        let mut group = self.writer.next_row_group()?;
        for gathered in &mut self.columns {
            let Some(mut writer) = group.next_column()? else {
                return Err(ParquetError::General("there are more columns than the schema has".to_owned()));
            };
            gathered.write(&mut writer)?;
            writer.close()?;
        }
        group.close()?;
        Ok(())
    }
}

impl ColumnCells {
    fn new(column: Column) -> Self {
        let values = match column.kind {
            Type::String => Values::Texts(Vec::new()),
            Type::Integer | Type::Datetime => Values::Integers(Vec::new()),
            Type::Number => Values::Numbers(Vec::new()),
            Type::Boolean => Values::Booleans(Vec::new()),
        };
        Self { column, values, levels: Vec::new() }
    }

    /// Takes the next cell. An empty one has a definition level of 0 and no value.
    fn take(&mut self, cell: &str) -> Result<(), ParquetError> {
        if cell.is_empty() {
            self.levels.push(0);
            return Ok(());
        }

        let name = self.column.name;
        let nonsense = || ParquetError::General(format!("'{cell}' is not a valid {name}"));
        match &mut self.values {
            Values::Texts(values) => {
                let text = self.column.read(cell);
                // Consecutive rows often have the same text; keep it only once.
                let again = values.last().filter(|last| last.data() == text.as_bytes()).cloned();
                values.push(again.unwrap_or_else(|| ByteArray::from(text)));
            }
            Values::Integers(values) if self.column.kind == Type::Datetime => {
                let time = cell.parse::<Timestamp>().map_err(|_| nonsense())?;
                values.push(time.as_microsecond());
            }
            Values::Integers(values) => match cell.parse() {
                Ok(number) => values.push(number),
                // Only a faulty page sends a number beyond Parquet's, such as that of a frame. The CSV file has it.
                Err(_) if cell.parse::<u64>().is_ok() => {
                    self.levels.push(0);
                    return Ok(());
                }
                Err(_) => return Err(nonsense()),
            },
            Values::Numbers(values) => values.push(cell.parse().map_err(|_| nonsense())?),
            Values::Booleans(values) => values.push(cell.parse().map_err(|_| nonsense())?),
        }
        self.levels.push(1);
        Ok(())
    }

    /// Writes the gathered cells, and starts over.
    fn write(&mut self, writer: &mut SerializedColumnWriter<'_>) -> Result<(), ParquetError> {
        let levels = Some(self.levels.as_slice());
        match &mut self.values {
            Values::Texts(values) => write::<ByteArrayType>(writer, values, levels),
            Values::Integers(values) => write::<Int64Type>(writer, values, levels),
            Values::Numbers(values) => write::<DoubleType>(writer, values, levels),
            Values::Booleans(values) => write::<BoolType>(writer, values, levels),
        }?;
        self.levels.clear();
        Ok(())
    }
}

/// Writes the values of a column of a row group, and clears them.
fn write<D: DataType>(
    writer: &mut SerializedColumnWriter<'_>,
    values: &mut Vec<D::T>,
    levels: Option<&[i16]>,
) -> Result<(), ParquetError> {
    writer.typed::<D>().write_batch(values, levels, None)?;
    values.clear();
    Ok(())
}

/// A column of the schema. All columns are optional, because the tables leave unknown cells empty.
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
