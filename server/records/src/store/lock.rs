//! The lock on a data folder: one server, or one command that changes it, at a time.

use std::fs::{self, OpenOptions, TryLockError};
use std::io::{Error, ErrorKind, Write};
use std::os::unix::fs::MetadataExt;
use std::path::{Path, PathBuf};
use std::sync::OnceLock;

use parfocal_base::files::LockedFile;

use super::StoreError;
use super::schema::DATABASE;

/// Name of the file that is locked.
pub(super) const LOCK: &str = "parfocal.lock";

/// The lock of this process on a data folder, until it is dropped.
#[derive(Debug)]
pub(super) struct FolderLock {
    file: LockedFile,
    folder: PathBuf,
    /// Number of the database's file, once it was looked at.
    database: OnceLock<u64>,
}

impl FolderLock {
    /// Locks `folder`.
    ///
    /// # Errors
    /// If another process holds the lock, or its file cannot be opened or written.
    pub(super) fn of(folder: &Path) -> Result<Self, StoreError> {
        let failed = |error: Error| StoreError::folder(folder, &error);
        let path = folder.join(LOCK);
        let file =
            OpenOptions::new().read(true).write(true).create(true).truncate(false).open(&path).map_err(failed)?;

        let file = match LockedFile::of(file) {
            Ok(file) => file,
            Err(TryLockError::WouldBlock) => {
                let holder = fs::read_to_string(&path).unwrap_or_default();
                return Err(StoreError::InUse { folder: folder.to_owned(), process: holder.trim().to_owned() });
            }
            Err(TryLockError::Error(error)) => return Err(failed(error)),
        };

        // The process id is only for the message above. The kernel holds the lock.
        file.set_len(0).and_then(|()| writeln!(&*file, "{}", std::process::id())).map_err(failed)?;
        Ok(Self { file, folder: folder.to_owned(), database: OnceLock::new() })
    }

    /// Checks that folder and database still are where they were opened. Files that were deleted take records as
    /// before, and these are gone when the process ends. Blocks until the disk answers.
    ///
    /// # Errors
    /// If they were deleted or moved away.
    pub(super) fn check_in_place(&self) -> Result<(), StoreError> {
        let number = |name: &str| match fs::metadata(self.folder.join(name)) {
            Err(error) if error.kind() == ErrorKind::NotFound => Err(StoreError::Gone(self.folder.clone())),
            // A disk that fails otherwise shows that when it is written.
            found => Ok(found.ok().map(|file| file.ino())),
        };
        number(&format!("{DATABASE}-wal"))?;
        let Some(now) = number(DATABASE)? else { return Ok(()) };

        // If this lock's file was deleted, another server may have made folder and database anew.
        let unlocked = self.file.metadata().is_ok_and(|lock| lock.nlink() == 0);
        if *self.database.get_or_init(|| now) != now && unlocked {
            return Err(StoreError::Gone(self.folder.clone()));
        }
        Ok(())
    }
}
