//! Checks whether the file of a database is undamaged, by SQLite's own checks.

use std::path::Path;

use super::schema::DATABASE;
use super::{Reader, StoreError};

/// How thoroughly a file is checked.
#[derive(Debug, Clone, Copy)]
pub(super) enum Thoroughness {
    /// Every page is read. An index that does not fit its table is not found.
    Quick,
    /// Every index is compared with its table too, which takes several times as long.
    Full,
}

/// Looks at the database of the data folder `folder`, whether or not a server has it open. Reads all of it once. Returns
/// its size in bytes if SQLite finds nothing wrong.
///
/// # Errors
/// If there is no database, it is damaged, a newer version made it, or it cannot be read.
pub async fn look_at_database(folder: &Path) -> Result<u64, StoreError> {
    let snapshot = Reader::open_snapshot_unchecked(&folder.join(DATABASE)).await?;
    let found = size_if_whole(&snapshot).await;
    snapshot.close().await;
    found
}

async fn size_if_whole(snapshot: &Reader) -> Result<u64, StoreError> {
    snapshot.check_file(Thoroughness::Quick).await?;
    match snapshot.check_version().await {
        // The server brings it up to date at its next start.
        Ok(()) | Err(StoreError::Outdated) => {}
        Err(error) => return Err(error),
    }

    snapshot.bytes().await
}

impl Reader {
    /// Checks that every page of the file is as SQLite wrote it.
    ///
    /// # Errors
    /// If the file is damaged, with the first problem found, or if it cannot be read.
    pub(super) async fn check_file(&self, thoroughness: Thoroughness) -> Result<(), StoreError> {
        let pragma = match thoroughness {
            Thoroughness::Quick => "PRAGMA quick_check(1)",
            Thoroughness::Full => "PRAGMA integrity_check(1)",
        };
        let answer: Option<String> = sqlx::query_scalar(pragma).fetch_optional(self.pool()).await?;
        match answer.as_deref() {
            Some("ok") => Ok(()),
            // The problem is in the last line, below a heading that names the database.
            Some(wrong) => Err(StoreError::Damaged(wrong.lines().last().unwrap_or_default().to_owned())),
            None => Err(StoreError::Damaged("SQLite's check says nothing".to_owned())),
        }
    }
}
