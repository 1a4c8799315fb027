//! Checks whether the file of a database is undamaged, by SQLite's own checks.

use std::path::Path;

use super::schema::DATABASE;
use super::{Reader, StoreError};

/// State of the database in a data folder.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum DatabaseState {
    /// There is no database.
    Missing,
    /// SQLite finds nothing wrong. Holds the size in bytes.
    Whole(u64),
    /// SQLite finds it damaged. Holds what is wrong.
    Damaged(String),
    /// It was made by a newer version of parfocal.
    Newer,
    /// It cannot be read. Holds the reason.
    Unreadable(String),
}

/// How thoroughly a file is checked.
#[derive(Debug, Clone, Copy)]
pub(super) enum Thoroughness {
    /// Every page is read. An index that does not fit its table is not found.
    Quick,
    /// Every index is compared with its table too, which takes several times as long.
    Full,
}

/// Looks at the database of the data folder `folder`, whether or not a server has it open. Reads all of it once.
pub async fn database_state(folder: &Path) -> DatabaseState {
    match look(&folder.join(DATABASE)).await {
        Ok(bytes) => DatabaseState::Whole(bytes),
        Err(StoreError::Missing(_)) => DatabaseState::Missing,
        Err(StoreError::Damaged(detail)) => DatabaseState::Damaged(detail),
        Err(StoreError::Newer { .. }) => DatabaseState::Newer,
        Err(error) => DatabaseState::Unreadable(error.to_string()),
    }
}

/// How many bytes the database `file` has, or an error if it is damaged or a newer version made it.
async fn look(file: &Path) -> Result<u64, StoreError> {
    let snapshot = Reader::open_snapshot_unchecked(file).await?;
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
