//! Withdrawals of participants.

use super::{Reader, StoreError};
use parfocal_base::ids::SessionId;

impl Reader {
    /// Whether the participant of `session` has withdrawn.
    ///
    /// # Errors
    /// If the database fails.
    pub async fn is_withdrawn(&self, session: SessionId) -> Result<bool, StoreError> {
        let withdrawn = "SELECT EXISTS (SELECT 1 FROM events WHERE session = ? AND kind = 'withdrawn')";
        Ok(sqlx::query_scalar(withdrawn).bind(session.to_string()).fetch_one(self.pool()).await?)
    }

    /// Number of withdrawals and erasures in the sessions of `study`. It only grows.
    ///
    /// # Errors
    /// If the database fails.
    pub async fn taken_back(&self, study: &str) -> Result<i64, StoreError> {
        let count = "SELECT
            (SELECT count(*) FROM study_sessions JOIN events USING (session) WHERE study = ?1 AND kind = 'withdrawn')
            + (SELECT count(*) FROM study_sessions JOIN erasures USING (session) WHERE study = ?1)";
        Ok(sqlx::query_scalar(count).bind(study).fetch_one(self.pool()).await?)
    }
}
