//! Tables: rows of typed cells under described columns. CSV, JSON and the data dictionary come from the same.

use serde_json::{Map, Value, json};

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
    /// Unit; empty where there is none.
    pub unit: &'static str,
    /// What it means.
    pub description: &'static str,
    /// The first format of exports that has it.
    pub since: u64,
}

/// The format of exports that this version writes. The second tells what was said late and on which device; the first
/// did not name itself.
pub const FORMAT: u64 = 2;

/// A table without its rows.
#[derive(Debug, Clone, Copy)]
pub struct Table {
    /// Name; its file is `NAME.csv`.
    pub name: &'static str,
    /// What a row is.
    pub description: &'static str,
    /// Its columns, in order.
    pub columns: &'static [Column],
    /// Columns that together name a row.
    pub key: &'static [&'static str],
}

/// A row: a cell for each column, null where there is nothing.
pub type Row = Vec<Value>;

impl Type {
    /// Its Frictionless name.
    #[must_use]
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
    #[must_use]
    pub fn file(&self) -> String {
        format!("{}.csv", self.name)
    }

    /// The names of its columns.
    pub fn header(&self) -> impl Iterator<Item = &'static str> {
        self.columns.iter().map(|column| column.name)
    }

    /// The columns that it had in exports of format `format`.
    pub fn columns_of(&self, format: u64) -> impl Iterator<Item = &'static Column> {
        self.columns.iter().filter(move |column| column.since <= format)
    }

    /// Its rows as JSON objects.
    #[must_use]
    pub fn objects(&self, rows: &[Row]) -> Value {
        let object = |row: &Row| {
            let cells = self.header().map(str::to_owned).zip(row.iter().cloned());
            Value::Object(cells.collect::<Map<_, _>>())
        };
        rows.iter().map(object).collect()
    }

    /// Its Frictionless schema.
    pub fn schema(&self) -> Value {
        let fields: Vec<Value> = self.columns.iter().map(Column::field).collect();
        json!({ "fields": fields, "primaryKey": self.key, "missingValues": [""] })
    }
}

impl Column {
    fn field(&self) -> Value {
        let mut field = json!({ "name": self.name, "type": self.kind.name(), "description": self.description });
        if !self.unit.is_empty() {
            field["unit"] = self.unit.into();
        }
        field
    }
}

/// How texts stand in the CSV files, for the data dictionary.
pub const TEXTS_IN_CSV: &str = "In the CSV files a text that a spreadsheet would run as a formula, one that begins with =, +, -, @, \
    their full-width forms, a tab or a line break, has an apostrophe before it; so has one that begins with apostrophes and goes on like \
    that. Take away one apostrophe to read it. session.json has every text as it is.";

/// What a spreadsheet takes for the beginning of a formula, in itself or once it has dropped it (OWASP, "CSV Injection").
const FORMULA: [char; 11] = ['=', '+', '-', '@', '＝', '＋', '－', '＠', '\t', '\r', '\n'];

impl Column {
    /// `cell` as the CSV files have it.
    #[must_use]
    pub fn csv(&self, cell: &Value) -> String {
        match cell {
            Value::String(text) if self.kind == Type::String && is_formula(text) => format!("'{text}"),
            other => plain(other),
        }
    }

    /// Whether a CSV file that has `csv` in this column tells of `cell`. Earlier versions left texts as they were.
    #[must_use]
    pub fn tells(&self, csv: &str, cell: &Value) -> bool {
        csv == self.csv(cell) || csv == plain(cell)
    }
}

/// Also one behind apostrophes: otherwise nobody could tell which of them were said.
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
        Column { name: "text", kind, unit: "", description: "", since: 1 }
    }

    #[test]
    fn a_text_that_a_spreadsheet_would_run_gets_an_apostrophe() {
        let text = column(Type::String);
        for formula in ["=1+1", "+1", "-1", "@SUM(A1)", "\t=1", "\r=1", "\n=1", "＝1+1", "'=1", "''-"] {
            assert_eq!(text.csv(&json!(formula)), format!("'{formula}"));
        }
        for harmless in ["", "sharp = good", "'quoted'", "1-2", " =1", "\"=1\""] {
            assert_eq!(text.csv(&json!(harmless)), harmless);
        }
    }

    #[test]
    fn a_number_stays_a_number() {
        assert_eq!(column(Type::Number).csv(&json!(-0.5)), "-0.5");
        assert_eq!(column(Type::Integer).csv(&json!(-3)), "-3");
        assert_eq!(column(Type::Number).csv(&Value::Null), "");
    }

    #[test]
    fn cells_of_earlier_versions_are_known() {
        let text = column(Type::String);
        assert!(text.tells("'=1+1", &json!("=1+1")) && text.tells("=1+1", &json!("=1+1")));
        assert!(!text.tells("'1+1", &json!("1+1")) && !text.tells("'=1+1", &json!("'=1+1 ")));
    }
}
