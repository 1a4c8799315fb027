//! Reads the files of an export. Errors name the file.

use std::cell::RefCell;
use std::collections::BTreeMap;
use std::fs::File;
use std::path::{Path, PathBuf};
use std::rc::Rc;

use ::csv::{Reader, StringRecord};
use serde_json::Value;

use crate::store::export::description::{ALL, ChainRow, PolicyStepRow, TelemetryRow};
use crate::store::export::table::{Column, FORMAT, Row};

/// The tables with a row for each step of a policy or each record of the whole chain. They can be gigabytes, so they
/// are read row by row each time and never kept.
const LONG: [&str; 3] = [ChainRow::TABLE.name, TelemetryRow::TABLE.name, PolicyStepRow::TABLE.name];

/// The results of reading files, by file name, kept for all checks.
type ReadCache<T> = RefCell<BTreeMap<String, Result<Rc<T>, String>>>;

/// The files of an export. Its JSON files and its short tables are read once each, when they are first asked for,
/// because a dozen checks look at the same ones.
pub struct ExportFiles {
    folder: PathBuf,
    documents: ReadCache<Value>,
    tables: ReadCache<Rows>,
}

/// A table that is read once and kept.
struct Rows {
    headers: StringRecord,
    rows: Vec<StringRecord>,
}

impl ExportFiles {
    /// The files of the export in `folder`. Nothing is read yet.
    pub fn of(folder: &Path) -> Self {
        Self { folder: folder.to_owned(), documents: ReadCache::default(), tables: ReadCache::default() }
    }

    /// The folder of the export.
    pub fn folder(&self) -> &Path {
        &self.folder
    }

    /// Whether the export has `file`.
    pub fn has(&self, file: &str) -> bool {
        self.folder.join(file).exists()
    }

    /// The text of `file`.
    ///
    /// # Errors
    /// If the file cannot be read. The error names the file.
    pub fn text(&self, file: &str) -> Result<String, String> {
        std::fs::read_to_string(self.folder.join(file)).map_err(|error| format!("{file}: {error}"))
    }

    /// The content of the JSON file `file`.
    ///
    /// # Errors
    /// If the file cannot be read. The text names the file.
    pub fn json(&self, file: &str) -> Result<Rc<Value>, String> {
        once(&self.documents, file, || {
            serde_json::from_str(&self.text(file)?).map_err(|error| format!("{file}: {error}"))
        })
    }

    /// The number of the export's format.
    ///
    /// # Errors
    /// If datapackage.json cannot be read or does not state it.
    pub fn format(&self) -> Result<u64, String> {
        let format = self.json("datapackage.json")?["parfocal"]["format"].as_u64();
        format.ok_or_else(|| "datapackage.json does not state the format of the export".to_owned())
    }

    /// Refuses an export of another format, whose tables are not known here.
    pub(super) fn check_format(&self) -> Result<(), String> {
        match self.format()? {
            FORMAT => Ok(()),
            other => Err(format!("another version of parfocal wrote it (format {other}); verify it with that version")),
        }
    }

    /// The names of the columns of CSV file `file`.
    pub(super) fn headers(&self, file: &str) -> Result<StringRecord, String> {
        if is_long(file) {
            self.csv(file)?.headers().map_err(unreadable(file)).cloned()
        } else {
            Ok(self.table(file)?.headers.clone())
        }
    }

    /// Passes each row of CSV file `file` to `take`, in order, until `take` returns an error.
    ///
    /// # Errors
    /// If the file cannot be read, or `take` returned an error. The text names the file.
    pub fn each_row(
        &self,
        file: &str,
        mut take: impl FnMut(&StringRecord) -> Result<(), String>,
    ) -> Result<(), String> {
        if !is_long(file) {
            return self.table(file)?.rows.iter().try_for_each(take);
        }

        let mut reader = self.csv(file)?;
        let mut row = StringRecord::new();
        while reader.read_record(&mut row).map_err(unreadable(file))? {
            take(&row)?;
        }
        Ok(())
    }

    /// The place of `column` among the columns of CSV file `file`, from 0.
    ///
    /// # Errors
    /// If the file cannot be read or has no such column. The text names the file.
    pub fn place(&self, file: &str, column: &str) -> Result<usize, String> {
        place_among(&self.headers(file)?, file, column)
    }

    /// The cells of a column of a CSV file, as they were recorded.
    ///
    /// # Errors
    /// If the file cannot be read or has no such column. The text names the file.
    pub fn cells(&self, file: &str, column: &str) -> Result<Vec<String>, String> {
        let place = self.place(file, column)?;
        let described = described(file, column);
        let mut cells = Vec::new();
        self.each_row(file, |row| {
            let cell = row.get(place).unwrap_or_default();
            cells.push(described.map_or(cell, |column| column.read(cell)).to_owned());
            Ok(())
        })?;
        Ok(cells)
    }

    /// The session's cell in `column` of sessions.csv.
    pub(super) fn session_cell(&self, column: &str) -> Result<String, String> {
        let cells = self.cells("sessions.csv", column)?;
        cells.into_iter().next().ok_or_else(|| "sessions.csv has no session".to_owned())
    }

    fn table(&self, file: &str) -> Result<Rc<Rows>, String> {
        once(&self.tables, file, || {
            let mut reader = self.csv(file)?;
            let headers = reader.headers().map_err(unreadable(file))?.clone();
            let rows = reader.records().collect::<Result<_, _>>().map_err(unreadable(file))?;
            Ok(Rows { headers, rows })
        })
    }

    fn csv(&self, file: &str) -> Result<Reader<File>, String> {
        Reader::from_path(self.folder.join(file)).map_err(unreadable(file))
    }
}

/// The result for `file` from `kept`. If it has none yet, calls `read` and keeps the result.
fn once<T>(kept: &ReadCache<T>, file: &str, read: impl FnOnce() -> Result<T, String>) -> Result<Rc<T>, String> {
    if let Some(known) = kept.borrow().get(file) {
        return known.clone();
    }
    let found = read().map(Rc::new);
    kept.borrow_mut().insert(file.to_owned(), found.clone());
    found
}

/// The place of `column` among the `headers` of CSV file `file`, from 0.
pub(super) fn place_among(headers: &StringRecord, file: &str, column: &str) -> Result<usize, String> {
    let place = headers.iter().position(|name| name == column);
    place.ok_or_else(|| format!("{file} has no column {column}"))
}

/// The description of `column` in CSV file `file`; `None` if there is none.
fn described(file: &str, column: &str) -> Option<&'static Column> {
    let table = ALL.iter().find(|table| table.file() == file)?;
    table.columns.iter().find(|described| described.name == column)
}

/// Whether `file` has a long table, which is never kept.
pub(super) fn is_long(file: &str) -> bool {
    file.strip_suffix(".csv").is_some_and(|name| LONG.contains(&name))
}

fn unreadable(file: &str) -> impl Fn(::csv::Error) -> String {
    move |error| format!("{file}: {error}")
}
