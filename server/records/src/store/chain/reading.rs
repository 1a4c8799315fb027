//! Reads the chain.

use super::append::head;
use super::form::Head;
use super::telemetry::unsealed;
use crate::store::{Reader, StoreError};
use parfocal_base::ids::SessionId;

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
