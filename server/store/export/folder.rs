//! The folder being written: beside its place and under another name until it is whole.

use std::fs::File;
use std::io::BufWriter;
use std::path::{Path, PathBuf};

use serde_json::{Value, json};
use sha2::{Digest, Sha256};
use tempfile::TempDir;

use super::ExportError;
use super::table::{Row, Table, csv_cell};
use crate::files::{sync_folder_of, write_through};

/// Name of the file of checksums, in the form of `sha256sum`.
pub const SUMS: &str = "SHA256SUMS";

/// A folder being written.
pub struct Folder {
    temporary: TempDir,
    files: Vec<String>,
    resources: Vec<Value>,
}

impl Folder {
    /// A folder that is to be `out`, which must be new or empty.
    pub fn beside(out: &Path) -> Result<Self, ExportError> {
        let unwritable = |error| ExportError::Unwritable { path: out.to_owned(), error };
        if out.is_dir() && std::fs::read_dir(out).map_err(unwritable)?.next().is_some() || out.is_file() {
            return Err(ExportError::Exists(out.to_owned()));
        }
        let parent = out.parent().filter(|parent| !parent.as_os_str().is_empty()).unwrap_or(Path::new("."));
        std::fs::create_dir_all(parent).map_err(unwritable)?;
        let temporary = tempfile::Builder::new().prefix(".parfocal-export-").tempdir_in(parent).map_err(unwritable)?;
        Ok(Self { temporary, files: Vec::new(), resources: Vec::new() })
    }

    /// Begins the CSV file of `table`.
    pub fn begin(&self, table: &Table) -> Result<CsvFile, ExportError> {
        let path = self.path(&table.file());
        let file = File::create(&path).map_err(|error| ExportError::Unwritable { path: path.clone(), error })?;
        let mut file = CsvFile { path, writer: csv::Writer::from_writer(BufWriter::new(file)) };
        file.record(table.header().map(str::to_owned))?;
        Ok(file)
    }

    /// Ends the CSV file of `table`.
    pub fn end(&mut self, table: &Table, file: CsvFile) -> Result<(), ExportError> {
        file.end()?;
        self.files.push(table.file());
        let (hash, bytes) = self.hash(&table.file())?;
        self.resources.push(json!({
            "name": table.name,
            "description": table.description,
            "path": table.file(),
            "profile": "tabular-data-resource",
            "format": "csv",
            "mediatype": "text/csv",
            "encoding": "utf-8",
            "bytes": bytes,
            "hash": format!("sha256:{hash}"),
            "schema": table.schema(),
        }));
        Ok(())
    }

    /// Writes `table` whole.
    pub fn table(&mut self, table: &Table, rows: &[Row]) -> Result<(), ExportError> {
        let mut file = self.begin(table)?;
        for row in rows {
            file.row(row)?;
        }
        self.end(table, file)
    }

    /// Writes `content` as file `name`.
    pub fn file(&mut self, name: &str, content: &[u8]) -> Result<(), ExportError> {
        let path = self.path(name);
        write_through(&path, content).map_err(|error| ExportError::Unwritable { path, error })?;
        self.files.push(name.to_owned());
        Ok(())
    }

    /// Writes `value` as JSON file `name`.
    pub fn json(&mut self, name: &str, value: &Value) -> Result<(), ExportError> {
        self.file(name, format!("{value:#}\n").as_bytes())
    }

    /// Writes the Frictionless description: `package` with the tables written so far.
    pub fn describe(&mut self, package: &Value) -> Result<(), ExportError> {
        let mut package = package.clone();
        package["resources"] = Value::Array(std::mem::take(&mut self.resources));
        self.json("datapackage.json", &package)
    }

    /// Writes the checksums and puts the folder in its place. Its files come back.
    pub fn finish(mut self, out: &Path) -> Result<Vec<String>, ExportError> {
        self.files.sort();
        let line = |file: &String| Ok(format!("{}  {file}\n", self.hash(file)?.0));
        let sums = self.files.iter().map(line).collect::<Result<String, ExportError>>()?;
        self.file(SUMS, sums.as_bytes())?;
        sync_folder_of(&self.path(SUMS));
        let whole = self.temporary.keep();
        std::fs::rename(&whole, out).map_err(|error| {
            // It is all that is left to do for it.
            let _ = std::fs::remove_dir_all(&whole);
            ExportError::Unwritable { path: out.to_owned(), error }
        })?;
        sync_folder_of(out);
        Ok(self.files)
    }

    fn path(&self, name: &str) -> PathBuf {
        self.temporary.path().join(name)
    }

    fn hash(&self, name: &str) -> Result<(String, usize), ExportError> {
        let path = self.path(name);
        let content = std::fs::read(&path).map_err(|error| ExportError::Unwritable { path, error })?;
        Ok((hex::encode(Sha256::digest(&content)), content.len()))
    }
}

/// A CSV file being written.
pub struct CsvFile {
    path: PathBuf,
    writer: csv::Writer<BufWriter<File>>,
}

impl CsvFile {
    /// Writes a row.
    pub fn row(&mut self, row: &Row) -> Result<(), ExportError> {
        self.record(row.iter().map(csv_cell))
    }

    /// Waits until the disk has it.
    fn end(mut self) -> Result<(), ExportError> {
        let kept = self.writer.flush().and_then(|()| File::open(&self.path)).and_then(|file| file.sync_data());
        kept.map_err(|error| ExportError::Unwritable { path: self.path, error })
    }

    fn record(&mut self, cells: impl Iterator<Item = String>) -> Result<(), ExportError> {
        let unwritable = |error: csv::Error| ExportError::Unwritable { path: self.path.clone(), error: error.into() };
        self.writer.write_record(cells.collect::<Vec<_>>()).map_err(unwritable)
    }
}
