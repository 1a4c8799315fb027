//! Reads the chain.

use sqlx::Row;
use sqlx::sqlite::SqliteRow;

use super::append::head;
use super::form::{Entry, Head};
use super::telemetry::unsealed;
use crate::store::{Reader, StoreError};
use parfocal_base::ids::SessionId;

/// The entry of the chain's row `row`.
pub fn entry(row: &SqliteRow) -> Result<Entry, StoreError> {
    let session: Option<String> = row.try_get("session")?;
    Ok(Entry {
        wall: row.try_get("wall")?,
        kind: row.try_get("kind")?,
        key: row.try_get("key")?,
        session: session.unwrap_or_default(),
        place: row.try_get("place")?,
        salt: row.try_get("salt")?,
        sealed: row.try_get("sealed")?,
        content: row.try_get("content")?,
    })
}

impl Reader {
    /// The latest row of the chain.
    ///
    /// # Errors
    /// If the database fails.
    pub async fn head(&self) -> Result<Head, StoreError> {
        head(&mut *self.pool().acquire().await?).await
    }

    /// The hashes of the chain's rows, in order.
    pub(in crate::store) async fn hashes(&self) -> Result<Vec<String>, StoreError> {
        Ok(sqlx::query_scalar("SELECT hash FROM chain ORDER BY number").fetch_all(self.pool()).await?)
    }

    /// Whether `session` has steps of telemetry that are not chained yet.
    pub(in crate::store) async fn has_unsealed(&self, session: SessionId) -> Result<bool, StoreError> {
        let mut connection = self.pool().acquire().await?;
        Ok(!unsealed(&mut connection, &session.to_string()).await?.is_empty())
    }
}
