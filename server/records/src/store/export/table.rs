//! Tables. Each has a struct for its rows, whose fields say what their columns mean. CSV, JSON and the data dictionary
//! are made from these structs.

use jiff::Timestamp;
use serde::Serialize;
use serde_json::{Map, Value, json};

use parfocal_base::PolicyName;
use parfocal_base::ids::{DeviceId, IdempotencyKey, SegmentId, SessionId};
use parfocal_trial::phase::SessionStatus;
use parfocal_trial::role::Role;

/// Type of a column, by its Frictionless name.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Type {
    /// Text.
    String,
    /// Whole number.
    Integer,
    /// Number.
    Number,
    /// `true` or `false`.
    Boolean,
    /// RFC 3339 in UTC.
    Datetime,
}

/// A column.
#[derive(Debug, Clone, Copy)]
pub struct Column {
    /// Name.
    pub name: &'static str,
    /// Type.
    pub kind: Type,
    /// Unit; empty if it has none.
    pub unit: &'static str,
    /// What it means.
    pub description: &'static str,
    /// Whether a row may have no value for it.
    pub may_be_empty: bool,
    /// Whether and how the chain hashes it.
    pub proof: Proof,
}

/// Whether and how the chain hashes a column.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Proof {
    /// Not at all: it follows from other columns or from other records.
    None,
    /// Openly: no export withholds it.
    Open,
    /// With a salt: it can be withheld or erased.
    Sealed,
}

/// The format of exports that this version writes. A change of the tables or their columns gives it another number.
pub const FORMAT: u64 = 1;

/// A table without its rows.
#[derive(Debug, Clone, Copy)]
pub struct Table {
    /// Name; its file is `NAME.csv`.
    pub name: &'static str,
    /// What the rows are.
    pub description: &'static str,
    /// Its columns, in order.
    pub columns: &'static [Column],
    /// Columns that together identify a row.
    pub key: &'static [&'static str],
}

/// A row of a table. The macro `table!` makes the struct and implements this trait.
pub trait Row {
    /// The table that the row belongs to.
    const TABLE: Table;

    /// A cell for each column, in order; null if there is no value.
    fn cells(&self) -> Vec<Value>;

    /// Writes the row into a CSV file. `cell` is a buffer for one cell, reused from row to row. Returns about how many
    /// bytes were written.
    ///
    /// # Errors
    /// If `csv` cannot be written.
    fn write_csv(&self, csv: &mut csv::Writer<Vec<u8>>, cell: &mut Vec<u8>) -> Result<usize, csv::Error>;
}

/// A type that a field of a row may have.
pub trait Cell: Serialize {
    /// The type of its column.
    const KIND: Type;

    /// Whether it may have no value.
    const MAY_BE_EMPTY: bool = false;

    /// The cell; null if there is no value.
    fn value(&self) -> Value {
        json!(self)
    }

    /// Adds the cell to `csv` as the CSV files have it: nothing if there is no value.
    fn write_csv(&self, csv: &mut Vec<u8>) {
        csv.extend_from_slice(in_csv(Self::KIND, &self.value()).as_bytes());
    }
}

macro_rules! cells {
    ($($kind:ident: $($cell:ty),+;)+) => {
        $($(
            impl Cell for $cell {
                const KIND: Type = Type::$kind;
            }
        )+)+
    };
}

cells! {
    String: &'static str, SessionId, SegmentId, DeviceId, IdempotencyKey, PolicyName, Role, SessionStatus;
    Datetime: Timestamp;
}

/// Types of cells in tables with a row for each frame. There are millions of such cells, so they are written without an
/// intermediate value.
macro_rules! plain_cells {
    ($($kind:ident: $($cell:ty),+;)+) => {
        $($(
            impl Cell for $cell {
                const KIND: Type = Type::$kind;

                fn write_csv(&self, csv: &mut Vec<u8>) {
                    // Writing into memory does not fail.
                    let _ = serde_json::to_writer(csv, self);
                }
            }
        )+)+
    };
}

plain_cells! {
    Integer: i64, u32, u64, usize;
    Boolean: bool;
}

impl Cell for f64 {
    const KIND: Type = Type::Number;

    fn write_csv(&self, csv: &mut Vec<u8>) {
        // JSON has no infinity and no "not a number": the cell stays empty.
        if self.is_finite() {
            let _ = serde_json::to_writer(csv, self);
        }
    }
}

impl Cell for String {
    const KIND: Type = Type::String;

    fn write_csv(&self, csv: &mut Vec<u8>) {
        if is_formula(self) {
            csv.push(b'\'');
        }
        csv.extend_from_slice(self.as_bytes());
    }
}

impl<T: Cell> Cell for Option<T> {
    const KIND: Type = T::KIND;
    const MAY_BE_EMPTY: bool = true;

    fn write_csv(&self, csv: &mut Vec<u8>) {
        if let Some(cell) = self {
            cell.write_csv(csv);
        }
    }
}

/// What a column means.
#[derive(Debug, Clone, Copy)]
pub struct Meaning {
    unit: &'static str,
    description: &'static str,
    proof: Proof,
}

/// A column that means `description`, has no unit, and is not hashed.
pub const fn means(description: &'static str) -> Meaning {
    Meaning { unit: "", description, proof: Proof::None }
}

impl Meaning {
    /// The same in `unit`.
    #[must_use]
    pub const fn in_unit(self, unit: &'static str) -> Self {
        Self { unit, ..self }
    }

    /// The same in a column that the chain hashes openly.
    #[must_use]
    pub const fn open(self) -> Self {
        Self { proof: Proof::Open, ..self }
    }

    /// The same in a column that the chain hashes with a salt.
    #[must_use]
    pub const fn sealed(self) -> Self {
        Self { proof: Proof::Sealed, ..self }
    }

    /// The column called `name`, which has a value in every row.
    pub const fn column(self, name: &'static str, kind: Type) -> Column {
        let may_be_empty = false;
        Column { name, kind, unit: self.unit, description: self.description, may_be_empty, proof: self.proof }
    }
}

/// Defines a table and the struct of its rows. Each field has the name of its column and says what
/// the column means. A `stored row` is one that comes straight from the database.
#[macro_export]
#[doc(hidden)]
macro_rules! export_table {
    (
        name: $table:literal,
        description: $description:literal,
        key: [$($key:ident),+],
        row:
        $(#[$attribute:meta])*
        $row:ident { $($field:ident: $cell:ty = $meaning:expr,)+ }
    ) => {
        $(#[$attribute])*
        pub struct $row {
            $(pub $field: $cell,)+
        }

        impl $crate::store::export::Row for $row {
            const TABLE: $crate::store::export::Table = $crate::store::export::Table {
                name: $table,
                description: $description,
                columns: &[$(
                    $crate::store::export::Column {
                        may_be_empty: <$cell as $crate::store::export::Cell>::MAY_BE_EMPTY,
                        ..$meaning.column(stringify!($field), <$cell as $crate::store::export::Cell>::KIND)
                    },
                )+],
                key: &[$(stringify!($key),)+],
            };

            fn cells(&self) -> Vec<::serde_json::Value> {
                vec![$($crate::store::export::Cell::value(&self.$field),)+]
            }

            fn write_csv(
                &self,
                csv: &mut ::csv::Writer<Vec<u8>>,
                cell: &mut Vec<u8>,
            ) -> Result<usize, ::csv::Error> {
                let mut bytes = 0;
                $(
                    cell.clear();
                    $crate::store::export::Cell::write_csv(&self.$field, cell);
                    csv.write_field(&*cell)?;
                    bytes += cell.len() + 1;
                )+
                csv.write_record(None::<&[u8]>)?;
                Ok(bytes)
            }
        }
    };
    (
        name: $table:literal,
        description: $description:literal,
        key: [$($key:ident),+],
        stored row:
        $(#[$attribute:meta])*
        $row:ident { $($field:ident: $cell:ty = $meaning:expr,)+ }
    ) => {
        $crate::export_table! {
            name: $table,
            description: $description,
            key: [$($key),+],
            row:
            $(#[$attribute])*
            $row { $($field: $cell = $meaning,)+ }
        }

        impl $crate::store::export::stored::StoredRow for $row {
            fn read(row: &::sqlx::sqlite::SqliteRow) -> Result<Self, $crate::store::StoreError> {
                use $crate::store::export::stored::StoredCell;

                Ok(Self { $($field: StoredCell::read(row, stringify!($field))?,)+ })
            }
        }
    };
}

pub use export_table as table;

/// `rows` as JSON objects.
pub fn objects<R: Row>(rows: &[R]) -> Value {
    let object = |row: &R| {
        let names = R::TABLE.header().map(str::to_owned);
        Value::Object(names.zip(row.cells()).collect::<Map<_, _>>())
    };
    rows.iter().map(object).collect()
}

impl Type {
    /// Its Frictionless name.
    pub const fn name(self) -> &'static str {
        match self {
            Self::String => "string",
            Self::Integer => "integer",
            Self::Number => "number",
            Self::Boolean => "boolean",
            Self::Datetime => "datetime",
        }
    }

    /// Whether `cell`, as it stands in a CSV file, is of this type or empty.
    pub fn accepts(self, cell: &str) -> bool {
        cell.is_empty()
            || match self {
                Self::String => true,
                Self::Integer => cell.parse::<i128>().is_ok(),
                Self::Number => cell.parse::<f64>().is_ok_and(f64::is_finite),
                Self::Boolean => matches!(cell, "true" | "false"),
                Self::Datetime => cell.parse::<jiff::Timestamp>().is_ok(),
            }
    }
}

impl Table {
    /// The table's file.
    pub fn file(&self) -> String {
        format!("{}.csv", self.name)
    }

    /// The names of its columns.
    pub fn header(&self) -> impl Iterator<Item = &'static str> {
        self.columns.iter().map(|column| column.name)
    }

    /// Its Frictionless schema.
    pub fn schema(&self) -> Value {
        let fields: Vec<Value> = self.columns.iter().map(Column::field).collect();
        json!({ "fields": fields, "primaryKey": self.key, "missingValues": [""] })
    }
}

impl Column {
    /// Its Frictionless description.
    pub fn field(&self) -> Value {
        let mut field = json!({ "name": self.name, "type": self.kind.name(), "description": self.description });
        if !self.unit.is_empty() {
            field["unit"] = self.unit.into();
        }
        field
    }
}

/// How texts are written in the CSV files, for the data dictionary.
pub const TEXTS_IN_CSV: &str = "In the CSV files a text that a spreadsheet would run as a formula, one that \
    begins with =, +, -, @, their full-width forms, a tab or a line break, has an \
    apostrophe before it, and so has such a text behind apostrophes. Remove one \
    apostrophe to read it. session.json has every text as it is.";

/// Characters that begin a formula in a spreadsheet, or that a spreadsheet drops before it looks for one (OWASP, "CSV
/// Injection").
const FORMULA: [char; 11] = ['=', '+', '-', '@', '＝', '＋', '－', '＠', '\t', '\r', '\n'];

impl Column {
    /// `cell` as the CSV files have it.
    pub fn csv(&self, cell: &Value) -> String {
        in_csv(self.kind, cell)
    }

    /// The text of a cell of the CSV files, without an added apostrophe.
    pub fn read<'a>(&self, csv: &'a str) -> &'a str {
        match csv.strip_prefix('\'') {
            Some(text) if self.kind == Type::String && is_formula(text) => text,
            _ => csv,
        }
    }
}

/// `cell` of a column of type `kind` as the CSV files have it.
fn in_csv(kind: Type, cell: &Value) -> String {
    match cell {
        Value::String(text) if kind == Type::String && is_formula(text) => format!("'{text}"),
        other => plain(other),
    }
}

/// Also true for a formula behind apostrophes. Otherwise nobody could tell which apostrophes belong to the text.
fn is_formula(text: &str) -> bool {
    text.trim_start_matches('\'').starts_with(FORMULA)
}

fn plain(cell: &Value) -> String {
    match cell {
        Value::Null => String::new(),
        Value::String(text) => text.clone(),
        other => other.to_string(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn column(kind: Type) -> Column {
        Column { name: "text", kind, unit: "", description: "", may_be_empty: false, proof: Proof::None }
    }

    #[test]
    fn a_text_that_a_spreadsheet_would_run_gets_an_apostrophe() {
        let text = column(Type::String);
        for formula in ["=1+1", "+1", "-1", "@SUM(A1)", "\t=1", "\r=1", "\n=1", "＝1+1", "'=1", "''-"] {
            assert_eq!(text.csv(&json!(formula)), format!("'{formula}"));
            assert_eq!(text.read(&format!("'{formula}")), formula);
        }
        for harmless in ["", "sharp = good", "'quoted'", "1-2", " =1", "\"=1\""] {
            assert_eq!(text.csv(&json!(harmless)), harmless);
            assert_eq!(text.read(harmless), harmless);
        }
    }

    table! {
        name: "marks",
        description: "Marks",
        key: [number, at],
        row:
        #[derive(Debug)]
        MarkRow {
            number: u32 = means("Order"),
            at: Option<Timestamp> = means("When").in_unit("UTC"),
            text: Option<String> = means("What"),
        }
    }

    #[test]
    fn a_row_knows_its_columns() {
        let columns: Vec<_> = MarkRow::TABLE
            .columns
            .iter()
            .map(|column| (column.name, column.kind, column.unit, column.description))
            .collect();

        let expected = [
            ("number", Type::Integer, "", "Order"),
            ("at", Type::Datetime, "UTC", "When"),
            ("text", Type::String, "", "What"),
        ];

        assert_eq!(columns, expected);
        assert_eq!(MarkRow::TABLE.key, ["number", "at"]);

        let row = MarkRow { number: 3, at: Some(Timestamp::UNIX_EPOCH), text: None };
        assert_eq!(row.cells(), [json!(3), json!("1970-01-01T00:00:00Z"), Value::Null]);
        assert_eq!(objects(&[row]), json!([{ "number": 3, "at": "1970-01-01T00:00:00Z", "text": null }]));
    }

    table! {
        name: "written",
        description: "A cell of each kind",
        key: [number],
        row:
        #[derive(Debug)]
        WrittenRow {
            number: i64 = means("Number"),
            measure: Option<f64> = means("Measure"),
            held: bool = means("Held"),
            at: Timestamp = means("When"),
            text: Option<String> = means("What"),
            kind: &'static str = means("Kind"),
        }
    }

    #[test]
    fn a_row_is_written_cell_by_cell_as_its_columns_tell() {
        let measures = [Some(0.1), Some(-0.0), Some(1e-7), Some(1e300), Some(f64::NAN), Some(f64::INFINITY), None];
        let texts = [Some("=1+1"), Some("sharp, \"good\""), Some("two\nlines"), Some("'=1"), Some(""), None, Some("é")];
        let mut csv = csv::Writer::from_writer(Vec::new());
        let mut by_column = csv::Writer::from_writer(Vec::new());
        let mut cell = Vec::new();

        for (measure, text) in measures.into_iter().zip(texts) {
            let row = WrittenRow {
                number: i64::MIN,
                measure,
                held: measure.is_some(),
                at: Timestamp::UNIX_EPOCH,
                text: text.map(str::to_owned),
                kind: "-held",
            };
            row.write_csv(&mut csv, &mut cell).unwrap();

            let cells = row.cells();
            let columns = WrittenRow::TABLE.columns.iter().zip(&cells);
            by_column.write_record(columns.map(|(column, cell)| column.csv(cell))).unwrap();
        }

        assert_eq!(csv.into_inner().unwrap(), by_column.into_inner().unwrap());
    }

    #[test]
    fn a_number_stays_a_number() {
        assert_eq!(column(Type::Number).csv(&json!(-0.5)), "-0.5");
        assert_eq!(column(Type::Integer).csv(&json!(-3)), "-3");
        assert_eq!(column(Type::Number).csv(&Value::Null), "");
    }

    #[test]
    fn a_cell_stands_for_its_text_as_it_is_written() {
        let text = column(Type::String);
        assert_eq!(text.csv(&json!("=1+1")), "'=1+1");
        assert!(text.csv(&json!("1+1")) != "'1+1" && text.csv(&json!("'=1+1 ")) != "'=1+1");
    }
}
