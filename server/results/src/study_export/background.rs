//! Exports of studies while the server runs. Each study has one export at a time. It is made in the background, kept
//! for a while so that an interrupted download can be repeated, and then removed.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::time::Duration;

use serde::Serialize;
use tempfile::TempDir;
use utoipa::ToSchema;

use super::error::StudyExportError;
use super::making::{Progress, export_study, sessions_of};
use parfocal_base::ids::SessionId;
use parfocal_records::store::{AccessLog, Reader, StoreError};
use parfocal_trial::account::AccountName;

/// The folder within the data folder in which exports are made.
const FOLDER: &str = "study-exports";

/// How long an export is kept after it has finished or failed.
const KEPT: Duration = Duration::from_hours(1);

/// The reason that people see when a finished export is discarded.
const OUTDATED: &str = "a surgeon has withdrawn or words were erased after this export was begun; export again";

/// The latest export of each study.
#[derive(Clone)]
pub struct StudyExports {
    folder: PathBuf,
    latest: Arc<Mutex<BTreeMap<String, LatestExport>>>,
}

/// The latest export of a study.
struct LatestExport {
    unblinded: bool,
    stage: Stage,
    /// Number of the export, which distinguishes it from the one before.
    number: u64,
}

enum Stage {
    Running(Progress),
    Failed(String),
    Ready(FinishedExport),
}

/// A finished export. Its folder is removed when the last clone is dropped.
#[derive(Clone)]
pub struct FinishedExport {
    /// Whether the export contains the policies.
    pub unblinded: bool,
    /// Folder of the package.
    pub folder: PathBuf,
    /// The sessions in the export.
    pub sessions: Vec<SessionId>,
    /// The account of the person who started it; `None` if nobody was signed in.
    pub by: Option<AccountName>,
    /// Number of withdrawals and erasures in the study when the export began.
    taken_back: i64,
    /// Temporary folder around the package; dropping it removes the files.
    _room: Arc<TempDir>,
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
        progress: Progress,
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
    #[must_use]
    pub fn new(data: &Path) -> Self {
        let folder = data.join(FOLDER);
        match std::fs::remove_dir_all(&folder) {
            Err(error) if error.kind() != std::io::ErrorKind::NotFound => {
                tracing::warn!("{} is left from earlier exports and cannot be removed: {error}", folder.display());
            }
            _ => {}
        }
        Self { folder, latest: Arc::default() }
    }

    /// The state of the latest export of `study`.
    ///
    /// # Errors
    /// If the database failed.
    pub async fn state(&self, reader: &Reader, study: &str) -> Result<StudyExportState, StoreError> {
        self.give_up_outdated(reader, study).await?;
        Ok(self.lock().get(study).map_or(StudyExportState::None, LatestExport::state))
    }

    /// The latest export of `study`, if it is finished.
    ///
    /// # Errors
    /// If the database failed.
    pub async fn made(&self, reader: &Reader, study: &str) -> Result<Option<FinishedExport>, StoreError> {
        self.give_up_outdated(reader, study).await?;
        Ok(self.lock().get(study).and_then(LatestExport::made))
    }

    /// Discards the finished export of `study` if a surgeon has withdrawn or words were erased since it was begun,
    /// because it still contains them.
    async fn give_up_outdated(&self, reader: &Reader, study: &str) -> Result<(), StoreError> {
        let taken_back = reader.taken_back(study).await?;
        let mut exports = self.lock();
        let Some(latest) = exports.get_mut(study) else { return Ok(()) };
        if latest.made().is_none_or(|made| made.taken_back == taken_back) {
            return Ok(());
        }

        let given_up = LatestExport { stage: Stage::Failed(OUTDATED.to_owned()), ..*latest };
        let before = std::mem::replace(latest, given_up);
        drop(exports);
        forget(Some(before));
        Ok(())
    }

    /// Starts an export of `study`, unless one is already running, and returns the state. `recorder` records the
    /// export.
    #[must_use]
    pub fn start(&self, access_log: AccessLog, study: &str, unblinded: bool) -> StudyExportState {
        let mut latest = self.lock();
        let number = match latest.get(study) {
            Some(running) if matches!(running.stage, Stage::Running(_)) => return running.state(),
            Some(earlier) => earlier.number + 1,
            None => 1,
        };

        // Removes the previous export now, because the disk may not have room for two packages of a study.
        let started = LatestExport { unblinded, stage: Stage::Running(Progress::default()), number };
        let state = started.state();
        let before = latest.insert(study.to_owned(), started);
        drop(latest);
        forget(before);

        let job = Job { exports: self.clone(), study: study.to_owned(), unblinded, number };
        tokio::spawn(job.run(access_log));
        state
    }

    /// Removes export `number` of `study` from the list, unless a later one has replaced it.
    fn take(&self, study: &str, number: u64) -> Option<LatestExport> {
        let mut latest = self.lock();
        let same = latest.get(study).is_some_and(|latest| latest.number == number);
        if same { latest.remove(study) } else { None }
    }

    fn lock(&self) -> MutexGuard<'_, BTreeMap<String, LatestExport>> {
        self.latest.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

impl LatestExport {
    /// The export, if it is finished.
    fn made(&self) -> Option<FinishedExport> {
        match &self.stage {
            Stage::Ready(made) => Some(made.clone()),
            Stage::Running(_) | Stage::Failed(_) => None,
        }
    }

    fn state(&self) -> StudyExportState {
        let unblinded = self.unblinded;
        match &self.stage {
            Stage::Running(progress) => StudyExportState::Running { unblinded, progress: *progress },
            Stage::Failed(reason) => StudyExportState::Failed { unblinded, reason: reason.clone() },
            Stage::Ready(made) => StudyExportState::Ready { unblinded, sessions: made.sessions.len() },
        }
    }
}

/// A running export.
struct Job {
    exports: StudyExports,
    study: String,
    unblinded: bool,
    number: u64,
}

impl Job {
    async fn run(self, access_log: AccessLog) {
        let stage = match self.make(&access_log).await {
            Ok(made) => Stage::Ready(made),
            Err(error) => {
                tracing::warn!(study = %self.study, "a study could not be exported: {error}");
                Stage::Failed(error.to_string())
            }
        };
        self.stands_at(stage);
        // Dropped before the wait, so that a server that stops meanwhile can close its database.
        drop(access_log);

        tokio::time::sleep(KEPT).await;
        forget(self.exports.take(&self.study, self.number));
    }

    async fn make(&self, access_log: &AccessLog) -> Result<FinishedExport, StudyExportError> {
        let folder = &self.exports.folder;
        let unwritable = |error| StudyExportError::Unwritable { path: folder.clone(), error };
        std::fs::create_dir_all(folder).map_err(unwritable)?;
        let room = tempfile::Builder::new().prefix("export-").tempdir_in(folder).map_err(unwritable)?;
        let package = room.path().join(&self.study);
        let taken_back = access_log.reader().taken_back(&self.study).await?;
        let (sessions, _) = sessions_of(access_log.reader(), &self.study, self.unblinded).await?;

        let exports = self.exports.clone();
        let study = self.study.clone();
        let report = move |progress| {
            if let Some(latest) = exports.lock().get_mut(&study) {
                latest.stage = Stage::Running(progress);
            }
        };
        export_study(access_log, &self.study, self.unblinded, &package, Arc::new(report)).await?;

        Ok(FinishedExport {
            unblinded: self.unblinded,
            folder: package,
            sessions,
            by: access_log.account().cloned(),
            taken_back,
            _room: Arc::new(room),
        })
    }

    fn stands_at(&self, stage: Stage) {
        if let Some(latest) = self.exports.lock().get_mut(&self.study) {
            latest.stage = stage;
        }
    }
}

/// Removes an export's files on a thread that may block on the disk.
fn forget(export: Option<LatestExport>) {
    if export.is_some() {
        tokio::task::spawn_blocking(move || drop(export));
    }
}
