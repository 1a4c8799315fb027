//! Reading the files of an export that is being verified. Errors name the file.

use std::path::Path;

use ::csv::StringRecord;
use serde_json::Value;

use crate::store::export::table::FORMAT;

pub fn text(folder: &Path, file: &str) -> Result<String, String> {
    std::fs::read_to_string(folder.join(file)).map_err(|error| format!("{file}: {error}"))
}

/// A JSON file of an export.
///
/// # Errors
/// A sentence that names the file, when it cannot be read.
pub fn json(folder: &Path, file: &str) -> Result<Value, String> {
    serde_json::from_str(&text(folder, file)?).map_err(|error| format!("{file}: {error}"))
}

/// A reader of a CSV file of the export.
pub fn csv(folder: &Path, file: &str) -> Result<csv::Reader<std::fs::File>, String> {
    csv::Reader::from_path(folder.join(file)).map_err(|error| format!("{file}: {error}"))
}

/// The cells of a column of a CSV file of an export.
///
/// # Errors
/// A sentence that names the file, when it cannot be read or has no such column.
pub fn cells(folder: &Path, file: &str, column: &str) -> Result<Vec<String>, String> {
    let mut cells = Vec::new();
    each_cell(folder, file, column, |cell| {
        cells.push(cell.to_owned());
        Ok(())
    })?;
    Ok(cells)
}

/// Hands each cell of a column to `take`, without gathering them: a table may have a row for each frame.
pub fn each_cell(
    folder: &Path,
    file: &str,
    column: &str,
    mut take: impl FnMut(&str) -> Result<(), String>,
) -> Result<(), String> {
    let mut reader = csv(folder, file)?;
    let headers = reader.headers().map_err(|error| format!("{file}: {error}"))?;
    let place =
        headers.iter().position(|name| name == column).ok_or_else(|| format!("{file} has no column {column}"))?;

    let mut row = StringRecord::new();
    while reader.read_record(&mut row).map_err(|error| format!("{file}: {error}"))? {
        take(row.get(place).unwrap_or_default())?;
    }
    Ok(())
}

pub fn session_cell(folder: &Path, column: &str) -> Result<String, String> {
    cells(folder, "sessions.csv", column)?.into_iter().next().ok_or_else(|| "sessions.csv has no session".to_owned())
}

/// The format of the export, which says what columns it has.
pub fn format(folder: &Path) -> Result<u64, String> {
    let format = json(folder, "datapackage.json")?["parfocal"]["format"].as_u64().unwrap_or(1);
    if format > FORMAT {
        return Err(format!("a newer version of parfocal wrote it (format {format}); verify it with that version"));
    }
    Ok(format)
}
