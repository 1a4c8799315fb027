//! Export: a session as a folder of CSV and JSON with a description of every column and checksums. Blinded unless asked
//! otherwise after unblinding; the blinded files are the same in both kinds.

mod blinded;
mod description;
mod folder;
mod table;
mod unblinded;
pub mod verify;
mod verify_allocation;

use std::io::{Cursor, Write};
use std::path::{Path, PathBuf};

use serde::Serialize;

pub use self::description::ALL as TABLES;
pub use self::table::{Column, Table, Type};

use self::blinded::Blinded;
use self::folder::Folder;
use self::unblinded::Unblinded;
use super::{Reader, StoreError};
use crate::ids::SessionId;

/// What was exported.
#[derive(Debug, Clone, PartialEq, Eq, Serialize)]
pub struct Summary {
    /// The session.
    pub session: SessionId,
    /// The folder.
    pub folder: PathBuf,
    /// Whether policies are in it.
    pub unblinded: bool,
    /// Whether the session is practice.
    pub practice: bool,
    /// Its files.
    pub files: Vec<String>,
}

/// Why nothing was exported.
#[derive(Debug, thiserror::Error)]
pub enum ExportError {
    /// There is no such session.
    #[error("there is no session {session}; there are: {known}")]
    NoSession {
        /// The session asked for.
        session: SessionId,
        /// The sessions there are.
        known: String,
    },
    /// Policies were asked for before unblinding.
    #[error("session {0} has not been unblinded: unblind it on the researcher's page first, or export it blinded")]
    StillBlinded(SessionId),
    /// The folder to write holds something.
    #[error("{} is there already and not empty; name a new folder", .0.display())]
    Exists(PathBuf),
    /// A file could not be written.
    #[error("cannot write {}: {error}", .path.display())]
    Unwritable {
        /// Which.
        path: PathBuf,
        /// Why.
        error: std::io::Error,
    },
    /// The database failed.
    #[error("{0}")]
    Store(#[from] StoreError),
}

/// Exports `session` into the folder `out`, which must be new or empty. The folder appears whole or not at all.
///
/// # Errors
/// When there is no such session, it is asked for unblinded before it was, or `out` cannot be written.
pub async fn export(reader: &Reader, session: SessionId, out: &Path, unblinded: bool) -> Result<Summary, ExportError> {
    // A session may be under way: what is said meanwhile is in all of the files or in none.
    let snapshot = reader.snapshot().await?;
    let outcome = write(&snapshot, session, out, unblinded).await;
    snapshot.close().await;
    outcome
}

async fn write(reader: &Reader, session: SessionId, out: &Path, unblinded: bool) -> Result<Summary, ExportError> {
    let Some(stored) = reader.session(session).await? else {
        return Err(ExportError::NoSession { session, known: known_sessions(reader).await? });
    };
    // `None` unless the session was unblinded: whoever has no `Unblinded` can write no policy.
    let telling = if unblinded { Some(Unblinded::of(reader, &stored).await?) } else { None };
    let telling = match telling {
        Some(None) => return Err(ExportError::StillBlinded(session)),
        Some(Some(telling)) => Some(telling),
        None => None,
    };
    let blinded = Blinded::of(reader, stored).await?;
    let mut folder = Folder::beside(out)?;
    blinded.write(reader, &mut folder).await?;
    if let Some(telling) = &telling {
        telling.write(reader, &mut folder).await?;
    }
    folder.describe(&blinded.package(telling.is_some()))?;
    let files = folder.finish(out)?;
    Ok(Summary { session, folder: out.to_owned(), unblinded, practice: blinded.practice(), files })
}

/// The same folder as one ZIP file, in memory; its files stand in a folder named after the session.
///
/// # Errors
/// As [`export`].
pub async fn export_zip(reader: &Reader, session: SessionId, unblinded: bool) -> Result<Vec<u8>, ExportError> {
    let unwritable = |error| ExportError::Unwritable { path: std::env::temp_dir(), error };
    let temporary = tempfile::tempdir().map_err(unwritable)?;
    let out = temporary.path().join("export");
    let summary = export(reader, session, &out, unblinded).await?;
    zip(&summary).map_err(|error| ExportError::Unwritable { path: out, error })
}

fn zip(summary: &Summary) -> std::io::Result<Vec<u8>> {
    let mut archive = zip::ZipWriter::new(Cursor::new(Vec::new()));
    let options = zip::write::SimpleFileOptions::default().compression_method(zip::CompressionMethod::Deflated);
    for file in &summary.files {
        archive.start_file(format!("{}/{file}", folder_name(summary.session, summary.unblinded)), options)?;
        archive.write_all(&std::fs::read(summary.folder.join(file))?)?;
    }
    Ok(archive.finish()?.into_inner())
}

/// Name for an export of `session`, without an ending.
#[must_use]
pub fn folder_name(session: SessionId, unblinded: bool) -> String {
    format!("parfocal-{session}{}", if unblinded { "-unblinded" } else { "" })
}

async fn known_sessions(reader: &Reader) -> Result<String, StoreError> {
    const MOST: usize = 10;
    let lines = reader.sessions(true).await?;
    let mut known: Vec<String> = lines.iter().take(MOST).map(|line| line.session.to_string()).collect();
    if lines.len() > MOST {
        known.push(format!("{} more", lines.len() - MOST));
    }
    Ok(if known.is_empty() { "none yet".to_owned() } else { known.join(", ") })
}
