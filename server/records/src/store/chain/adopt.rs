//! Databases of versions without a chain. When one is opened, its records get rows in the chain, marked as adopted.

use sqlx::sqlite::SqliteConnection;

use super::append::{append_record, head};
use super::kinds::KINDS;
use super::records::{keys, one};
use super::telemetry;
use crate::store::StoreError;

/// Appends rows for all records of a database of a version without a chain, marked as adopted. Does nothing if the
/// chain has any row: a record that was added beside the chain is never adopted.
pub async fn adopt(connection: &mut SqliteConnection, wall: &str) -> Result<(), StoreError> {
    if head(connection).await?.number > 0 {
        return Ok(());
    }

    for kind in KINDS {
        for key in keys(connection, &kind).await? {
            let record = one(connection, &kind, &key).await?;
            append_record(connection, &kind, &key, &record, wall, true).await?;
        }
    }

    let sessions: Vec<String> =
        sqlx::query_scalar("SELECT session FROM sessions ORDER BY rowid").fetch_all(&mut *connection).await?;
    for session in sessions {
        telemetry::seal(connection, &session, wall, true).await?;
    }

    let adopted = head(connection).await?;
    if adopted.number > 0 {
        tracing::info!("the records of an earlier version were chained: {adopted}");
    }
    Ok(())
}
