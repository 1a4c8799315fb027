//! Backups that are made while the server runs, to be downloaded: one at a time, in the background. A backup is kept for
//! a while, so that an interrupted download can be repeated, and then removed.

use std::path::{Path, PathBuf};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::time::Duration;

use serde::Serialize;
use tempfile::TempPath;
use tokio::runtime::Handle;
use tokio::sync::oneshot;
use utoipa::ToSchema;

use super::backup::{BackupError, VerifiedCopy, verified_copy};
use super::{AccessLog, Reader, StoreError};
use parfocal_base::priority;
use parfocal_recording::room;
use parfocal_trial::account::AccountName;

/// The folder within the data folder in which backups are made.
const FOLDER: &str = "backups-to-download";

/// How long a backup is kept after it was made.
const KEPT: Duration = Duration::from_mins(15);

/// Why a backup is handed out no more.
const OUTDATED: &str = "words were erased after this backup was begun; make another";

/// The latest backup.
#[derive(Clone)]
pub struct Backups {
    folder: PathBuf,
    latest: Arc<Mutex<Option<LatestBackup>>>,
}

struct LatestBackup {
    /// Account that requested the backup. No other account gets it.
    by: AccountName,
    stage: Stage,
    /// Distinguishes it from other backups of this server.
    number: u64,
}

#[derive(Clone)]
enum Stage {
    Running,
    Failed(String),
    Ready(FinishedBackup),
}

/// A verified backup. Its file is removed when the last clone is dropped.
#[derive(Clone)]
pub struct FinishedBackup {
    /// The file.
    pub file: Arc<TempPath>,
    /// Its size in bytes.
    pub bytes: u64,
    /// Head of its chain, `NUMBER:HASH`.
    pub head: String,
    /// Number of erasures before it was begun.
    erasures: i64,
}

/// The state of the latest backup.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, ToSchema)]
#[serde(tag = "state", rename_all = "lowercase")]
pub enum BackupState {
    /// There is no backup to download.
    None,
    /// A backup is being made.
    Running,
    /// The backup can be downloaded.
    Ready {
        /// Size in bytes.
        bytes: u64,
        /// Head of the backup's chain: number and the beginning of the hash.
        head: String,
    },
    /// The backup failed, and its file is removed.
    Failed {
        /// Reason for the failure, for people.
        reason: String,
    },
}

impl Backups {
    /// Starts without a backup. Removes what an earlier server left in the data folder `data`.
    #[must_use]
    pub fn new(data: &Path) -> Self {
        let folder = data.join(FOLDER);
        match std::fs::remove_dir_all(&folder) {
            Err(error) if error.kind() != std::io::ErrorKind::NotFound => {
                tracing::warn!("{} is left from earlier backups and cannot be removed: {error}", folder.display());
            }
            _ => {}
        }
        Self { folder, latest: Arc::default() }
    }

    /// Begins a backup for `by`, unless one is being made. `recorder` records it.
    #[must_use]
    pub fn start(&self, access_log: AccessLog, by: AccountName) -> BackupState {
        let mut latest = self.lock();
        if latest.as_ref().is_some_and(|latest| matches!(latest.stage, Stage::Running)) {
            return BackupState::Running;
        }

        let number = latest.as_ref().map_or(0, |latest| latest.number) + 1;
        let before = latest.replace(LatestBackup { by, stage: Stage::Running, number });
        drop(latest);
        forget(before);

        let backups = self.clone();
        tokio::spawn(async move { backups.run(access_log, number).await });
        BackupState::Running
    }

    /// The state of the latest backup, as `by` may see it: one of somebody else only while it is being made.
    ///
    /// # Errors
    /// If the database failed.
    pub async fn state(&self, reader: &Reader, by: &AccountName) -> Result<BackupState, StoreError> {
        self.give_up_outdated(reader).await?;
        let latest = self.lock();
        Ok(match latest.as_ref() {
            Some(LatestBackup { stage: Stage::Running, .. }) => BackupState::Running,
            Some(latest) if latest.by == *by => match &latest.stage {
                Stage::Running => BackupState::Running,
                Stage::Failed(reason) => BackupState::Failed { reason: reason.clone() },
                Stage::Ready(made) => BackupState::Ready { bytes: made.bytes, head: made.head.clone() },
            },
            _ => BackupState::None,
        })
    }

    /// The latest backup, if `by` asked for it and it is made.
    ///
    /// # Errors
    /// If the database failed.
    pub async fn made(&self, reader: &Reader, by: &AccountName) -> Result<Option<FinishedBackup>, StoreError> {
        self.give_up_outdated(reader).await?;
        Ok(match self.lock().as_ref() {
            Some(LatestBackup { stage: Stage::Ready(made), by: owner, .. }) if owner == by => Some(made.clone()),
            _ => None,
        })
    }

    /// Removes a backup that still has words which were erased since it was begun.
    async fn give_up_outdated(&self, reader: &Reader) -> Result<(), StoreError> {
        let erasures = reader.count_erasures().await?;
        let mut latest = self.lock();
        let Some(latest) = latest.as_mut() else { return Ok(()) };
        if matches!(&latest.stage, Stage::Ready(made) if made.erasures != erasures) {
            latest.stage = Stage::Failed(OUTDATED.to_owned());
        }
        Ok(())
    }

    async fn run(self, access_log: AccessLog, number: u64) {
        let stage = match self.make(access_log).await {
            Ok(made) => Stage::Ready(made),
            Err(reason) => {
                tracing::warn!("a backup to download could not be made: {reason}");
                Stage::Failed(reason)
            }
        };
        if let Some(latest) = self.lock().as_mut().filter(|latest| latest.number == number) {
            latest.stage = stage;
        }

        tokio::time::sleep(KEPT).await;
        let mut latest = self.lock();
        let outlived = latest.as_ref().is_some_and(|latest| latest.number == number);
        let outlived = if outlived { latest.take() } else { None };
        drop(latest);
        forget(outlived);
    }

    /// Makes the backup on a thread that all others come before, since a large database takes a while to copy and to
    /// verify.
    async fn make(&self, access_log: AccessLog) -> Result<FinishedBackup, String> {
        let erasures = access_log.reader().count_erasures().await.map_err(|error| error.to_string())?;
        let folder = self.folder.clone();
        let runtime = Handle::current();
        let (done, made) = oneshot::channel();

        let work = move || {
            // Threads that this one starts, such as those of database connections, inherit the lower priority.
            priority::lower_further();
            let _ = done.send(runtime.block_on(copy(&access_log, &folder)));
        };
        let thread = std::thread::Builder::new().name("backup".to_owned());
        thread.spawn(work).map_err(|error| format!("no thread could be started: {error}"))?;

        let broken = || "the backup ended before it was whole; the server's log says why".to_owned();
        let copy = made.await.map_err(|_| broken())?.map_err(|error| error.to_string())?;
        let (bytes, head) = (copy.bytes, copy.head.to_string());
        Ok(FinishedBackup { file: Arc::new(copy.into_path()), bytes, head, erasures })
    }

    fn lock(&self) -> MutexGuard<'_, Option<LatestBackup>> {
        self.latest.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

async fn copy(access_log: &AccessLog, folder: &Path) -> Result<VerifiedCopy, BackupError> {
    let unwritable = |error| BackupError::File { path: folder.to_owned(), error };
    std::fs::create_dir_all(folder).map_err(unwritable)?;
    let needed = access_log.reader().bytes().await?;
    // Comments and answers of a session need the reserve. If the free space is unknown, writing reports a full disk.
    if room(folder).is_ok_and(|room| room.spare() < needed) {
        return Err(BackupError::NoRoom { path: folder.to_owned(), needed });
    }
    verified_copy(access_log, folder).await
}

/// Removes a backup's file on a thread that may block on the disk.
fn forget(backup: Option<LatestBackup>) {
    if backup.is_some() {
        tokio::task::spawn_blocking(move || drop(backup));
    }
}
