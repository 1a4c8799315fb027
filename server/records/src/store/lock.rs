//! The lock on a data folder: one server, or one command that changes it, at a time.

use std::fs::{File, OpenOptions, TryLockError};
use std::io::{Error, Read, Write};
use std::path::Path;

use super::StoreError;

/// Name of the file that is locked.
pub(super) const LOCK: &str = "parfocal.lock";

/// The lock of this process on a data folder, until it is dropped.
#[derive(Debug)]
pub(super) struct FolderLock(File);

impl FolderLock {
    /// Locks `folder`.
    ///
    /// # Errors
    /// If another process holds the lock, or its file cannot be opened or written.
    pub(super) fn of(folder: &Path) -> Result<Self, StoreError> {
        let failed = |error: Error| StoreError::folder(folder, &error);
        let path = folder.join(LOCK);
        let mut file =
            OpenOptions::new().read(true).write(true).create(true).truncate(false).open(path).map_err(failed)?;

        match file.try_lock() {
            Ok(()) => {}
            Err(TryLockError::WouldBlock) => {
                let mut holder = String::new();
                let _ = file.read_to_string(&mut holder);
                return Err(StoreError::InUse { folder: folder.to_owned(), process: holder.trim().to_owned() });
            }
            Err(TryLockError::Error(error)) => return Err(failed(error)),
        }

        // The process id is only for the message above. The kernel holds the lock.
        file.set_len(0).and_then(|()| writeln!(file, "{}", std::process::id())).map_err(failed)?;
        Ok(Self(file))
    }
}

impl Drop for FolderLock {
    fn drop(&mut self) {
        // To close the file is not enough: a child process has a copy of it from its fork until its program begins, and
        // the lock would last until then.
        let _ = self.0.unlock();
    }
}
