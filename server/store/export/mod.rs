//! Export: a session as a folder of CSV and JSON with a description of every column and checksums.
//! Blinded unless asked otherwise after unblinding; the blinded files are the same in both kinds.

mod blinded;
mod description;
mod destination;
mod error;
mod folder;
mod table;
mod unblinded;
pub mod verify;

use std::path::{Path, PathBuf};

use serde::Serialize;

pub use self::description::ALL as TABLES;
pub(super) use self::description::{PolicyStepRow, RunRow, TelemetryRow, WeightsRow};
pub use self::destination::ZipStream;
pub use self::error::ExportError;
pub use self::table::{Column, TEXTS_IN_CSV, Table, Type};

use self::blinded::Blinded;
use self::folder::Folder;
pub use self::folder::folder_name;
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

/// An export about to be written: a session as it stands at one moment.
pub struct Export {
    session: SessionId,
    /// The database at that moment.
    snapshot: Reader,
    blinded: Blinded,
    telling: Option<Unblinded>,
}

impl Export {
    /// Reads what is exported of `session`, all but its telemetry.
    ///
    /// # Errors
    /// When there is no such session, or it is asked for unblinded before it was.
    pub async fn prepare(reader: &Reader, session: SessionId, unblinded: bool) -> Result<Self, ExportError> {
        // A session may be under way: what is said meanwhile is in all of the files or in none.
        let snapshot = reader.snapshot().await?;
        match read(&snapshot, session, unblinded).await {
            Ok((blinded, telling)) => Ok(Self { session, snapshot, blinded, telling }),
            Err(error) => {
                snapshot.close().await;
                Err(error)
            }
        }
    }

    /// Writes the folder `out`, which must be new or empty. It appears whole or not at all.
    ///
    /// # Errors
    /// When `out` cannot be written or the database fails.
    pub async fn into_folder(self, out: &Path) -> Result<Summary, ExportError> {
        let outcome = match Folder::beside(out) {
            Ok(folder) => self.write(folder).await,
            Err(error) => Err(error),
        };
        self.snapshot.close().await;

        Ok(Summary {
            session: self.session,
            folder: out.to_owned(),
            unblinded: self.telling.is_some(),
            practice: self.blinded.practice(),
            files: outcome?,
        })
    }

    /// Sends the same files into `zip`, no faster than they are taken, so that nothing gathers
    /// anywhere.
    ///
    /// # Errors
    /// When they are no longer taken or the database fails; then the ZIP file is cut off.
    pub async fn into_zip(self, zip: ZipStream) -> Result<(), ExportError> {
        let outcome = self.write(Folder::zipped(zip)).await;
        self.snapshot.close().await;
        outcome.map(|_| ())
    }

    async fn write(&self, mut folder: Folder) -> Result<Vec<String>, ExportError> {
        self.blinded.write(&self.snapshot, &mut folder).await?;
        if let Some(telling) = &self.telling {
            telling.write(&self.snapshot, &mut folder).await?;
        }
        folder.describe(&self.blinded.package(self.telling.is_some())).await?;
        folder.finish().await
    }
}

async fn read(
    reader: &Reader,
    session: SessionId,
    unblinded: bool,
) -> Result<(Blinded, Option<Unblinded>), ExportError> {
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

    Ok((Blinded::of(reader, stored).await?, telling))
}

/// Exports `session` into the folder `out`, which must be new or empty. The folder appears whole or
/// not at all.
///
/// # Errors
/// When there is no such session, it is asked for unblinded before it was, or `out` cannot be
/// written.
pub async fn export(reader: &Reader, session: SessionId, out: &Path, unblinded: bool) -> Result<Summary, ExportError> {
    Export::prepare(reader, session, unblinded).await?.into_folder(out).await
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
