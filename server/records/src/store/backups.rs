//! Backups that are made while the server runs, to be downloaded.

use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::time::Duration;

use serde::Serialize;
use tempfile::TempPath;
use tokio::runtime::Handle;
use tokio::sync::oneshot;
use utoipa::ToSchema;

use super::backup::{BackupError, VerifiedCopy, verified_copy};
use super::{AccessLog, Reader, StoreError};
use crate::downloads::{Downloads, Stage};
use parfocal_base::priority;
use parfocal_trial::account::AccountName;

/// The folder within the data folder in which backups are made.
const FOLDER: &str = "backups-to-download";

/// How long a backup is kept after it was made.
const KEPT: Duration = Duration::from_mins(15);

/// Why a backup is handed out no more.
const OUTDATED: &str = "words were erased after this backup was begun; make another";

/// The one name under which backups are made.
const NAME: &str = "backup";

/// The latest backup. It belongs to the account that asked for it: no other account gets it.
#[derive(Clone)]
pub struct Backups(Downloads<AccountName, (), FinishedBackup>);

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
    pub fn new(data: &Path) -> Self {
        Self(Downloads::new(data.join(FOLDER), KEPT))
    }

    /// Begins a backup for `by`, unless one is being made. `access_log` records it.
    pub fn start(&self, access_log: AccessLog, by: AccountName) -> BackupState {
        self.0.start(NAME, by, make(access_log, self.0.folder().to_owned()));
        BackupState::Running
    }

    /// The state of the latest backup, as `by` may see it: one of somebody else only while it is being made.
    ///
    /// # Errors
    /// If the database failed.
    pub async fn state(&self, reader: &Reader, by: &AccountName) -> Result<BackupState, StoreError> {
        self.give_up_outdated(reader).await?;
        Ok(match self.0.latest(NAME) {
            Some((_, Stage::Running(()))) => BackupState::Running,
            Some((owner, Stage::Failed(reason))) if owner == *by => BackupState::Failed { reason },
            Some((owner, Stage::Ready(made))) if owner == *by => {
                BackupState::Ready { bytes: made.bytes, head: made.head }
            }
            _ => BackupState::None,
        })
    }

    /// The latest backup, if `by` asked for it and it is made.
    ///
    /// # Errors
    /// If the database failed.
    pub async fn made(&self, reader: &Reader, by: &AccountName) -> Result<Option<FinishedBackup>, StoreError> {
        self.give_up_outdated(reader).await?;
        Ok(match self.0.latest(NAME) {
            Some((owner, Stage::Ready(made))) if owner == *by => Some(made),
            _ => None,
        })
    }

    /// Removes a backup that still has words which were erased since it was begun.
    async fn give_up_outdated(&self, reader: &Reader) -> Result<(), StoreError> {
        let erasures = reader.count_erasures().await?;
        self.0.give_up(NAME, |made| made.erasures != erasures, OUTDATED);
        Ok(())
    }
}

/// Makes the backup on a thread that all others come before, since a large database takes a while to copy and to
/// verify.
async fn make(access_log: AccessLog, folder: PathBuf) -> Result<FinishedBackup, String> {
    let erasures = access_log.reader().count_erasures().await.map_err(|error| error.to_string())?;
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
    let bytes = copy.bytes;
    let head = copy.head.to_string();
    Ok(FinishedBackup { file: Arc::new(copy.into_path()), bytes, head, erasures })
}

async fn copy(access_log: &AccessLog, folder: &Path) -> Result<VerifiedCopy, BackupError> {
    std::fs::create_dir_all(folder).map_err(BackupError::file(folder))?;
    verified_copy(access_log, folder).await
}
