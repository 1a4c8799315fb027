//! Writes the files of an export, to a folder or into a ZIP file, with the description of the tables and the checksums.

use std::marker::PhantomData;
use std::path::Path;

use serde_json::{Value, json};
use sha2::{Digest, Sha256};

use super::ExportError;
use super::destination::{Destination, NewFolder, ZipStream};
use super::table::Row;
use parfocal_base::ids::SessionId;

/// Name of the file of checksums, in the form of `sha256sum`.
pub const SUMS: &str = "SHA256SUMS";

/// Bytes of a table that are gathered before they are passed on.
const BLOCK: usize = 64 * 1024;

/// An export being written.
pub struct Folder {
    destination: Destination,
    /// Each file's name and SHA-256.
    files: Vec<(String, String)>,
    resources: Vec<Value>,
}

impl Folder {
    /// Begins an export to the folder `out`, which must be new or empty.
    ///
    /// # Errors
    /// If the folder `out` exists already, or the temporary one cannot be made.
    pub fn beside(out: &Path) -> Result<Self, ExportError> {
        Ok(Self::to(Destination::Folder(NewFolder::beside(out)?)))
    }

    /// Begins an export into the ZIP file `zip`.
    pub fn zipped(zip: ZipStream) -> Self {
        Self::to(Destination::Zip(Box::new(zip)))
    }

    const fn to(destination: Destination) -> Self {
        Self { destination, files: Vec::new(), resources: Vec::new() }
    }

    /// Begins the CSV file of the rows `R`.
    ///
    /// # Errors
    /// If the file cannot be written.
    pub fn begin<R: Row>(&mut self) -> Result<CsvFile<'_, R>, ExportError> {
        let name = R::TABLE.file();
        self.destination.begin(&name)?;

        let mut file = CsvFile {
            folder: self,
            name,
            csv: new_block(),
            cell: Vec::new(),
            sha256: Sha256::new(),
            bytes: 0,
            gathered: 0,
            rows: PhantomData,
        };

        file.csv.write_record(R::TABLE.header()).map_err(|error| file.unwritable(error))?;
        Ok(file)
    }

    /// Writes a whole table.
    ///
    /// # Errors
    /// If the file cannot be written.
    pub async fn table<R: Row>(&mut self, rows: &[R]) -> Result<(), ExportError> {
        let mut file = self.begin()?;
        for row in rows {
            file.row(row).await?;
        }
        file.end().await
    }

    /// Writes `content` as file `name`.
    ///
    /// # Errors
    /// If the file cannot be written.
    pub async fn file(&mut self, name: &str, content: &[u8]) -> Result<(), ExportError> {
        self.destination.begin(name)?;
        self.destination.write(name, content).await?;
        self.destination.end(name)?;
        self.files.push((name.to_owned(), hex::encode(Sha256::digest(content))));
        Ok(())
    }

    /// Writes `value` as JSON file `name`.
    ///
    /// # Errors
    /// If the file cannot be written.
    pub async fn json(&mut self, name: &str, value: &Value) -> Result<(), ExportError> {
        self.file(name, format!("{value:#}\n").as_bytes()).await
    }

    /// Writes the Frictionless description: `package` with the tables written so far.
    ///
    /// # Errors
    /// If the file cannot be written.
    pub async fn describe(&mut self, package: &Value) -> Result<(), ExportError> {
        let mut package = package.clone();
        package["resources"] = Value::Array(std::mem::take(&mut self.resources));
        self.json("datapackage.json", &package).await
    }

    /// Writes the checksums and completes the export. Returns the names of its files.
    ///
    /// # Errors
    /// If the last files cannot be written, or the folder cannot be renamed.
    pub async fn finish(mut self) -> Result<Vec<String>, ExportError> {
        self.files.sort();
        let lines: Vec<String> = self.files.iter().map(|(file, sha256)| format!("{sha256}  {file}\n")).collect();
        let sums = lines.concat();
        self.file(SUMS, sums.as_bytes()).await?;
        self.destination.finish().await?;
        Ok(self.files.into_iter().map(|(file, _)| file).collect())
    }
}

/// A CSV file being written.
pub struct CsvFile<'a, R> {
    folder: &'a mut Folder,
    name: String,
    /// Rows that are not passed on yet.
    csv: csv::Writer<Vec<u8>>,
    /// Buffer for one cell.
    cell: Vec<u8>,
    /// Bytes of the cells in `csv`; with quotes, `csv` may have more.
    gathered: usize,
    sha256: Sha256,
    bytes: usize,
    /// Makes the file take only the rows of its own table.
    rows: PhantomData<fn(&R)>,
}

impl<R: Row> CsvFile<'_, R> {
    /// Writes a row.
    pub async fn row(&mut self, row: &R) -> Result<(), ExportError> {
        let written = row.write_csv(&mut self.csv, &mut self.cell);
        self.gathered += written.map_err(|error| self.unwritable(error))?;
        if self.gathered >= BLOCK {
            self.pass_on().await?;
        }
        Ok(())
    }

    /// Ends the file. Returns when all of it is passed on.
    pub async fn end(mut self) -> Result<(), ExportError> {
        self.pass_on().await?;
        self.folder.destination.end(&self.name)?;

        let table = R::TABLE;
        let sha256 = hex::encode(self.sha256.finalize());
        self.folder.resources.push(json!({
            "name": table.name,
            "description": table.description,
            "path": self.name,
            "profile": "tabular-data-resource",
            "format": "csv",
            "mediatype": "text/csv",
            "encoding": "utf-8",
            "bytes": self.bytes,
            "hash": format!("sha256:{sha256}"),
            "schema": table.schema(),
        }));
        self.folder.files.push((self.name, sha256));
        Ok(())
    }

    fn unwritable(&self, error: impl Into<std::io::Error>) -> ExportError {
        ExportError::Unwritable { path: Path::new(&self.name).to_owned(), error: error.into() }
    }

    async fn pass_on(&mut self) -> Result<(), ExportError> {
        let block = std::mem::replace(&mut self.csv, new_block()).into_inner();
        let block = block.map_err(|error| self.unwritable(error.into_error()))?;

        self.gathered = 0;
        self.sha256.update(&block);
        self.bytes += block.len();
        self.folder.destination.write(&self.name, &block).await
    }
}

fn new_block() -> csv::Writer<Vec<u8>> {
    csv::Writer::from_writer(Vec::with_capacity(BLOCK))
}

/// Name for an export of `session`, without a file extension.
pub fn folder_name(session: SessionId, unblinded: bool) -> String {
    format!("parfocal-{session}{}", if unblinded { "-unblinded" } else { "" })
}
