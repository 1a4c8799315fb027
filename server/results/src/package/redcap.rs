//! Files for REDCap: a data dictionary (Project Setup, Data Dictionary) and a file for its data import. A record is a
//! session. Tables with several rows per session are repeating instruments.

use std::collections::BTreeMap;

use jiff::Timestamp;

use super::error::PackageError;
use super::join::rows;
use super::source::PackageSource;
use super::table::{JoinedTable, label};
use parfocal_records::store::export::{Column, Type};

/// Name of the field that identifies a record: REDCap's own default.
const RECORD: &str = "record_id";

/// The columns of a data dictionary, by REDCap's names.
const DICTIONARY: [&str; 18] = [
    "Variable / Field Name",
    "Form Name",
    "Section Header",
    "Field Type",
    "Field Label",
    "Choices, Calculations, OR Slider Labels",
    "Field Note",
    "Text Validation Type OR Show Slider Number",
    "Text Validation Min",
    "Text Validation Max",
    "Identifier?",
    "Branching Logic (Show field only if...)",
    "Required Field?",
    "Custom Alignment",
    "Question Number (surveys only)",
    "Matrix Group Name",
    "Matrix Ranking?",
    "Field Annotation",
];

/// The table with one row per session, which is not a repeating instrument.
const ONCE: &str = "sessions";

/// The tables that become instruments: actions, comments and answers. Tables that prove integrity stay in the package.
const INSTRUMENTS: [&str; 7] = [ONCE, "segments", "comments", "answers", "scores", "corrections", "allocation"];

/// Columns whose texts can be long.
const NOTES: [&str; 7] = ["text", "value", "given_value", "question_text", "reason", "old_value", "new_value"];

/// The members of `tables` that become instruments, the table of sessions first.
pub fn instruments(tables: &[JoinedTable]) -> Vec<&JoinedTable> {
    INSTRUMENTS.iter().filter_map(|name| tables.iter().find(|table| table.table.name == *name)).collect()
}

/// The data dictionary for `instruments`, as CSV.
pub fn dictionary(instruments: &[&JoinedTable]) -> Result<Vec<u8>, csv::Error> {
    let mut csv = csv::Writer::from_writer(Vec::new());
    csv.write_record(DICTIONARY)?;

    let mut line = |name: &str, form: &str, kind: &str, label: &str, validation: &str, note: &str| {
        let mut cells = [""; DICTIONARY.len()];
        cells[0] = name;
        cells[1] = form;
        cells[3] = kind;
        cells[4] = label;
        cells[6] = note;
        cells[7] = validation;
        csv.write_record(cells)
    };

    line(RECORD, ONCE, "text", "Session's random id", "", "")?;
    for table in instruments {
        for column in fields(table) {
            let (kind, validation) = field(column);
            line(&variable(table, column), table.table.name, kind, &label(column), validation, column.unit)?;
        }
    }
    csv.into_inner().map_err(|error| csv::Error::from(std::io::Error::other(error.to_string())))
}

/// The file for REDCap's data import, as CSV.
pub fn import(instruments: &[&JoinedTable], sources: &[PackageSource]) -> Result<Vec<u8>, PackageError> {
    let unwritable = || PackageError::unwritable::<csv::Error>("redcap/import.csv");
    let mut csv = csv::Writer::from_writer(Vec::new());

    let mut header =
        vec![RECORD.to_owned(), "redcap_repeat_instrument".to_owned(), "redcap_repeat_instance".to_owned()];
    for table in instruments {
        header.extend(fields(table).map(|column| variable(table, column)));
    }
    csv.write_record(&header).map_err(unwritable())?;

    let mut first = 3;
    for table in instruments {
        let mut instances: BTreeMap<String, usize> = BTreeMap::new();
        let session = table.columns().position(|column| column.name == "session").unwrap_or_default();
        rows(table, sources, |cells| {
            let mut line = vec![String::new(); header.len()];
            cells[session].clone_into(&mut line[0]);
            if table.table.name != ONCE {
                let instance = instances.entry(cells[session].to_owned()).or_default();
                *instance += 1;
                table.table.name.clone_into(&mut line[1]);
                line[2] = instance.to_string();
            }

            let own = table.columns().zip(cells).filter(|(column, _)| column.name != "session");
            for (place, (column, cell)) in (first..).zip(own) {
                line[place] = value(column, cell);
            }
            csv.write_record(&line).map_err(unwritable())
        })?;
        first += fields(table).count();
    }

    csv.into_inner().map_err(PackageError::unwritable("redcap/import.csv"))
}

/// The columns that become fields, without the session, which is the record itself.
fn fields(table: &JoinedTable) -> impl Iterator<Item = &Column> {
    table.columns().filter(|column| column.name != "session")
}

/// The name of a column's variable. REDCap needs names that are unique in the whole project, in lower case.
fn variable(table: &JoinedTable, column: &Column) -> String {
    format!("{}_{}", table.table.name, column.name)
}

/// Type of a field, and REDCap's validation of it.
fn field(column: &Column) -> (&'static str, &'static str) {
    match column.kind {
        Type::String if NOTES.contains(&column.name) => ("notes", ""),
        Type::String => ("text", ""),
        Type::Integer => ("text", "integer"),
        Type::Number => ("text", "number"),
        Type::Boolean => ("truefalse", ""),
        Type::Datetime => ("text", "datetime_seconds_ymd"),
    }
}

/// A cell as REDCap imports it. Times lose their fractions of a second, which REDCap does not keep.
fn value(column: &Column, cell: &str) -> String {
    match (column.kind, cell) {
        (_, "") => String::new(),
        (Type::Boolean, cell) => if cell == "true" { "1" } else { "0" }.to_owned(),
        (Type::Datetime, cell) => match cell.parse::<Timestamp>() {
            Ok(time) => time.strftime("%Y-%m-%d %H:%M:%S").to_string(),
            Err(_) => String::new(),
        },
        (Type::String, cell) => column.read(cell).to_owned(),
        (Type::Integer | Type::Number, cell) => cell.to_owned(),
    }
}
