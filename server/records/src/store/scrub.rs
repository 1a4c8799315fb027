//! Removes erased words from the database's files. SQLite leaves copies of them in free pages, in the free space of
//! pages, and in its log.

use sqlx::sqlite::SqliteConnection;
use sqlx::{Row, SqlitePool};

use super::StoreError;

/// Removes copies of erased words that may remain in the database's files. Does nothing if no erasure is unfinished.
/// Returns whether one was.
///
/// # Errors
/// If the disk or database fails, or another program reads the database.
pub(super) async fn scrub(trial: &SqlitePool) -> Result<bool, StoreError> {
    let mut connection = trial.acquire().await?;
    let unfinished: i64 =
        sqlx::query_scalar("SELECT count(*) FROM unfinished_erasures").fetch_one(&mut *connection).await?;
    if unfinished == 0 {
        return Ok(false);
    }

    // Pages that were split earlier may hold copies in their free space, so every page is written anew.
    sqlx::query("PRAGMA secure_delete = ON").execute(&mut *connection).await?;
    sqlx::query("VACUUM").execute(&mut *connection).await?;
    // The log still holds pages as they were before.
    fold_log(&mut connection).await?;
    sqlx::query("DELETE FROM unfinished_erasures").execute(&mut *connection).await?;
    Ok(true)
}

/// Writes the log into the file and empties it.
async fn fold_log(connection: &mut SqliteConnection) -> Result<(), StoreError> {
    let row = sqlx::query("PRAGMA wal_checkpoint(TRUNCATE)").fetch_one(connection).await?;
    let busy: i64 = row.try_get(0)?;
    if busy == 0 { Ok(()) } else { Err(StoreError::ErasureUnfinished) }
}
