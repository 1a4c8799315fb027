//! Sessions whose participants withdrew, with the place of each among the sessions of its protocol.

use jiff::Timestamp;
use sqlx::Row;
use sqlx::sqlite::SqliteRow;

use super::values::parsed;
use super::{Reader, StoreError};
use parfocal_base::ids::SessionId;

/// A withdrawn session.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Withdrawal {
    /// Id of the session.
    pub session: SessionId,
    /// Its protocol's name.
    pub protocol: String,
    /// Its place among the sessions of its protocol, in the order in which they were made, from 1.
    pub place: i64,
    /// When it was withdrawn, by the server's wall clock.
    pub wall: Timestamp,
    /// Role that recorded the withdrawal.
    pub role: String,
}

impl Reader {
    /// The withdrawn sessions of the protocol of `session`.
    ///
    /// # Errors
    /// If the database fails.
    pub async fn withdrawals(&self, session: SessionId) -> Result<Vec<Withdrawal>, StoreError> {
        let sql = "SELECT s.session, s.protocol, s.place, e.wall, e.role
             FROM (SELECT session, protocol, protocol_sha256,
                     row_number() OVER (PARTITION BY protocol_sha256 ORDER BY rowid) AS place FROM sessions) AS s
                 JOIN events AS e ON e.session = s.session AND e.kind = 'withdrawn'
             WHERE s.protocol_sha256 = (SELECT protocol_sha256 FROM sessions WHERE session = ?)
             ORDER BY s.place";
        self.rows(sql, &session, withdrawal).await
    }
}

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

fn withdrawal(row: &SqliteRow) -> Result<Withdrawal, StoreError> {
    Ok(Withdrawal {
        session: parsed(row, "session")?,
        protocol: row.try_get("protocol")?,
        place: row.try_get("place")?,
        wall: parsed(row, "wall")?,
        role: row.try_get("role")?,
    })
}
