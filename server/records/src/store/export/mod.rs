//! Export: a session as a folder of CSV and JSON with a description of every column and checksums. An export is
//! blinded, unless the policies are asked for after unblinding. The blinded files are the same in both kinds.

mod blinded;
pub(in crate::store) mod description;
mod destination;
mod error;
mod folder;
mod recordings;
mod scores;
pub(in crate::store) mod stored;
mod study;
pub(in crate::store) mod table;
mod unblinded;
pub mod verify;
mod voice;

use std::path::{Path, PathBuf};

use serde::Serialize;

pub use self::description::ALL as TABLES;
pub(super) use self::description::{
    AccessRow, ActorRow, ChainRow, ChainSaltRow, ConsentRow, CorrectionRow, DeviceRow, ErasureRow, PolicyStepRow,
    RunRow, StudyEventRow, TelemetryRow, VoicePieceRow, WeightsRow, WithdrawalRow,
};
pub use self::destination::{NewFolder, ZipStream, check_new, private_folder};
pub use self::error::ExportError;
pub use self::folder::Folder;
pub use self::table::{Cell, Meaning, Row, means, table};
pub use self::table::{Column, FORMAT, Proof, TEXTS_IN_CSV, Table, Type};

use self::blinded::Blinded;
use self::description::RecordingRow;
pub use self::folder::{SUMS, folder_name};
use self::unblinded::Unblinded;
pub use self::verify::ExportFiles;
use super::{Access, AccessLog, Head, Reader, StoreError, StoredSession};
use parfocal_base::boxed;
use parfocal_base::ids::SessionId;

/// How often an export is recorded at most, if something else is recorded at the same moment each time.
const ATTEMPTS: usize = 50;

/// What was exported.
#[derive(Debug, Clone, PartialEq, Eq, Serialize)]
pub struct Summary {
    /// The exported session.
    pub session: SessionId,
    /// Path of its folder.
    pub folder: PathBuf,
    /// Whether policies are in it.
    pub unblinded: bool,
    /// Whether the session is practice.
    pub practice: bool,
    /// Names of its files.
    pub files: Vec<String>,
    /// Head of the chain in it, `NUMBER:HASH`.
    pub head: String,
}

/// An export about to be written: a session as it was at one moment.
pub struct Export {
    session: SessionId,
    /// The database at that moment.
    snapshot: Reader,
    /// The chain's latest row at that moment: the record of this export.
    head: Head,
    blinded: Blinded,
    telling: Option<Unblinded>,
    recordings: Vec<RecordingRow>,
}

impl Export {
    /// Records that `session` is exported, and reads what is exported of it, except its telemetry.
    ///
    /// # Errors
    /// If there is no such session, its participant withdrew, or the policies are asked for before unblinding.
    #[boxed]
    pub async fn prepare(access_log: &AccessLog, session: SessionId, unblinded: bool) -> Result<Self, ExportError> {
        // A refused export is not recorded.
        may_export(access_log.reader(), session, unblinded).await?;
        // Read only once, because a long recording takes a while to open.
        let recordings = recordings::rows(access_log.folder(), session).await;

        // The chain in an export ends with the record of that export, so that nobody can cut off rows unnoticed. If
        // something else was recorded in between, the export is recorded again.
        for _ in 0..ATTEMPTS {
            let head = access_log.record(&Access::Exported { session, unblinded }).await?;
            // The session may be under way. The snapshot makes sure that a new comment is in all files or in none.
            let snapshot = access_log.reader().snapshot().await?;
            match Self::of(&snapshot, head, session, unblinded).await {
                Ok(Some(export)) => return Ok(Self { recordings, ..export }),
                Ok(None) => snapshot.close().await,
                Err(error) => {
                    snapshot.close().await;
                    return Err(error);
                }
            }
        }
        Err(ExportError::Busy)
    }

    /// The export as `snapshot` has it. `None` if a row came after `head`, or if the session is over and has telemetry
    /// that is not chained yet.
    async fn of(
        snapshot: &Reader,
        head: Head,
        session: SessionId,
        unblinded: bool,
    ) -> Result<Option<Self>, ExportError> {
        let (stored, telling) = may_export(snapshot, session, unblinded).await?;
        let blinded = Blinded::of(snapshot, stored).await?;
        if snapshot.head().await? != head || !blinded.under_way() && snapshot.has_unsealed(session).await? {
            return Ok(None);
        }
        let snapshot = snapshot.clone();
        Ok(Some(Self { session, snapshot, head, blinded, telling, recordings: Vec::new() }))
    }

    /// Writes the folder `out`, which must be new or empty. It appears whole or not at all.
    ///
    /// # Errors
    /// If `out` cannot be written or the database fails.
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
            head: self.head.to_string(),
        })
    }

    /// Sends the same files into `zip`, no faster than the download takes them, so that memory use stays small.
    ///
    /// # Errors
    /// If the download stops or the database fails. Then the ZIP file is cut off.
    pub async fn into_zip(self, zip: ZipStream) -> Result<(), ExportError> {
        let outcome = self.write(Folder::zipped(zip)).await;
        self.snapshot.close().await;
        outcome.map(|_| ())
    }

    #[boxed(?Send)]
    async fn write(&self, mut folder: Folder) -> Result<Vec<String>, ExportError> {
        self.blinded.write(&self.snapshot, &self.recordings, &mut folder).await?;
        if let Some(telling) = &self.telling {
            telling.write(&self.snapshot, &mut folder).await?;
        }
        folder.describe(&self.blinded.package(self.telling.is_some(), &self.head)).await?;
        folder.finish().await
    }
}

/// The session and, if `unblinded`, what unblinding adds, or the reason why it may not be exported.
async fn may_export(
    reader: &Reader,
    session: SessionId,
    unblinded: bool,
) -> Result<(StoredSession, Option<Unblinded>), ExportError> {
    let Some(stored) = reader.session(session).await? else {
        return Err(ExportError::NoSession { session, known: known_sessions(reader).await? });
    };
    if let Some((at, by)) = stored.withdrawn() {
        return Err(ExportError::Withdrawn { session, at, by: by.name() });
    }

    // Without an `Unblinded`, which only a session that was unblinded has, no policy can be written.
    if !unblinded {
        return Ok((stored, None));
    }
    let telling = Unblinded::of(reader, &stored).await?.ok_or(ExportError::StillBlinded(session))?;
    Ok((stored, Some(telling)))
}

/// Exports `session` into the folder `out`, which must be new or empty. The folder appears whole or
/// not at all.
///
/// # Errors
/// If there is no such session, its participant withdrew, the policies are asked for before unblinding, or `out` cannot
/// be written.
pub async fn export(
    access_log: &AccessLog,
    session: SessionId,
    out: &Path,
    unblinded: bool,
) -> Result<Summary, ExportError> {
    // An export that cannot be written is not recorded.
    check_new(out)?;
    Export::prepare(access_log, session, unblinded).await?.into_folder(out).await
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
