//! Exports of studies that are made while the server runs, to be downloaded.

use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::time::Duration;

use serde::Serialize;
use tempfile::TempDir;
use utoipa::ToSchema;

use super::error::StudyExportError;
use super::making::{ExportProgress, export_study};
use parfocal_base::ids::SessionId;
use parfocal_records::downloads::{Downloads, Stage};
use parfocal_records::store::{AccessLog, Reader, StoreError};
use parfocal_trial::account::AccountName;

/// The folder within the data folder in which exports are made.
const FOLDER: &str = "study-exports";

/// How long an export is kept after it has finished or failed.
const KEPT: Duration = Duration::from_hours(1);

/// The reason that people see when a finished export is discarded.
const OUTDATED: &str = "a surgeon has withdrawn or words were erased after this export was begun; export again";

/// The latest export of each study. What is ordered is whether it contains the policies.
#[derive(Clone)]
pub struct StudyExports(Downloads<bool, ExportProgress, FinishedExport>);

/// A finished export. Its folder is removed when the last clone is dropped.
#[derive(Clone)]
pub struct FinishedExport {
    /// Whether the export contains the policies.
    pub unblinded: bool,
    folder: PathBuf,
    /// The sessions in the export.
    pub sessions: Vec<SessionId>,
    /// The account of the person who started it; `None` if nobody was signed in.
    pub by: Option<AccountName>,
    /// Number of withdrawals and erasures in the study when the export began.
    taken_back: i64,
    /// Temporary folder around the package; dropping it removes the files.
    _room: Arc<TempDir>,
}

impl FinishedExport {
    /// Folder of the package. It is no open field: a closure that used that alone would hold the name of the folder, and
    /// not its files.
    pub fn folder(&self) -> &Path {
        &self.folder
    }
}

/// The state of a study's latest export.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, ToSchema)]
#[serde(tag = "state", rename_all = "lowercase")]
pub enum StudyExportState {
    /// There is no export, or it was removed.
    None,
    /// The export is being made.
    Running {
        /// Whether the export will contain the policies.
        unblinded: bool,
        /// Progress of the export.
        progress: ExportProgress,
    },
    /// The export can be downloaded.
    Ready {
        /// Whether the export contains the policies.
        unblinded: bool,
        /// Number of sessions in the export.
        sessions: usize,
    },
    /// The export failed, and its files are removed.
    Failed {
        /// Whether an export with the policies was requested.
        unblinded: bool,
        /// Reason for the failure, for people.
        reason: String,
    },
}

impl StudyExports {
    /// Starts without exports. Removes those that an earlier server left in the data folder `data`.
    pub fn new(data: &Path) -> Self {
        Self(Downloads::new(data.join(FOLDER), KEPT))
    }

    /// The state of the latest export of `study`.
    ///
    /// # Errors
    /// If the database failed.
    pub async fn state(&self, reader: &Reader, study: &str) -> Result<StudyExportState, StoreError> {
        self.give_up_outdated(reader, study).await?;
        Ok(self.latest(study))
    }

    fn latest(&self, study: &str) -> StudyExportState {
        let Some((unblinded, stage)) = self.0.latest(study) else { return StudyExportState::None };
        match stage {
            Stage::Running(progress) => StudyExportState::Running { unblinded, progress },
            Stage::Failed(reason) => StudyExportState::Failed { unblinded, reason },
            Stage::Ready(made) => StudyExportState::Ready { unblinded, sessions: made.sessions.len() },
        }
    }

    /// The latest export of `study`, if it is finished.
    ///
    /// # Errors
    /// If the database failed.
    pub async fn made(&self, reader: &Reader, study: &str) -> Result<Option<FinishedExport>, StoreError> {
        self.give_up_outdated(reader, study).await?;
        Ok(match self.0.latest(study) {
            Some((_, Stage::Ready(made))) => Some(made),
            _ => None,
        })
    }

    /// Discards the finished export of `study` if a surgeon has withdrawn or words were erased since it was begun,
    /// because it still contains them.
    async fn give_up_outdated(&self, reader: &Reader, study: &str) -> Result<(), StoreError> {
        let taken_back = reader.taken_back(study).await?;
        self.0.give_up(study, |made| made.taken_back != taken_back, OUTDATED);
        Ok(())
    }

    /// Starts an export of `study`, unless one is already running, and returns the state. `access_log` records the
    /// export.
    pub fn start(&self, access_log: AccessLog, study: &str, unblinded: bool) -> StudyExportState {
        let making = make(self.clone(), access_log, study.to_owned(), unblinded);
        self.0.start(study, unblinded, async { making.await.map_err(|error| error.to_string()) });
        self.latest(study)
    }
}

async fn make(
    StudyExports(downloads): StudyExports,
    access_log: AccessLog,
    study: String,
    unblinded: bool,
) -> Result<FinishedExport, StudyExportError> {
    let folder = downloads.folder().to_owned();
    let unwritable = |error| StudyExportError::unwritable(&folder, &error);
    std::fs::create_dir_all(&folder).map_err(unwritable)?;
    let room = tempfile::Builder::new().prefix("export-").tempdir_in(&folder).map_err(unwritable)?;
    let package = room.path().join(&study);
    let taken_back = access_log.reader().taken_back(&study).await?;

    let name = study.clone();
    let report = move |progress| downloads.report(&name, progress);
    let exported = export_study(&access_log, &study, unblinded, &package, Arc::new(report)).await?;

    Ok(FinishedExport {
        unblinded,
        folder: package,
        sessions: exported.sessions,
        by: access_log.account().cloned(),
        taken_back,
        _room: Arc::new(room),
    })
}
