//! The lock on a data folder: one server, or one command that changes it, at a time.

use std::fs::{self, OpenOptions, TryLockError};
use std::io::{Error, Write};
use std::path::Path;

use parfocal_base::files::LockedFile;

use super::StoreError;

/// Name of the file that is locked.
pub(super) const LOCK: &str = "parfocal.lock";

/// The lock of this process on a data folder, until it is dropped.
#[derive(Debug)]
pub(super) struct FolderLock {
    _file: LockedFile,
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
        Ok(Self { _file: file })
    }
}
