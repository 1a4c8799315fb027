//! Balanced sets: sessions whose orders were drawn together, from one seed.

use sqlx::Row;
use sqlx::sqlite::SqliteRow;

use super::sessions::{index, seed};
use super::{Reader, StoreError};
use crate::ids::SessionId;
use crate::trial::allocation::{Algorithm, Seed};

/// A session of a set that shares a seed.
#[derive(Debug, Clone, Copy)]
pub struct SetMember {
    /// The seed.
    pub seed: Seed,
    /// Index in the set.
    pub index: usize,
    /// Whether it was aborted.
    pub aborted: bool,
    /// Whether it was unblinded.
    pub unblinded: bool,
}

impl Reader {
    /// The sessions that share the seed of the latest session by the protocol with this hash and algorithm.
    ///
    /// # Errors
    /// When the database failed.
    pub async fn latest_set(&self, protocol_sha256: &str, algorithm: Algorithm) -> Result<Vec<SetMember>, StoreError> {
        let rows = sqlx::query(
            "SELECT seed, set_index,
                 EXISTS (SELECT 1 FROM events WHERE events.session = s.session AND kind = 'aborted') AS aborted,
                 EXISTS (SELECT 1 FROM events WHERE events.session = s.session AND kind = 'unblinded') AS unblinded
             FROM sessions AS s WHERE protocol_sha256 = ?1 AND algorithm = ?2 AND seed = (
                 SELECT seed FROM sessions WHERE protocol_sha256 = ?1 AND algorithm = ?2 ORDER BY rowid DESC LIMIT 1)",
        )
        .bind(protocol_sha256)
        .bind(algorithm.name())
        .fetch_all(self.pool())
        .await?;
        let member = |row: &SqliteRow| {
            let (aborted, unblinded) = (row.try_get("aborted")?, row.try_get("unblinded")?);
            Ok(SetMember { seed: seed(row)?, index: index(row)?, aborted, unblinded })
        };
        rows.iter().map(member).collect()
    }

    /// Participant and wall time of the session that has the same place in its set as `session`, and so the same order, if it is
    /// neither aborted nor unblinded.
    ///
    /// # Errors
    /// When the database failed.
    pub async fn blinded_twin(&self, session: SessionId) -> Result<Option<(String, String)>, StoreError> {
        let twin = sqlx::query_as(
            "SELECT other.participant, (SELECT wall FROM events WHERE events.session = other.session ORDER BY number LIMIT 1)
                 FROM sessions AS s JOIN sessions AS other
                 ON other.seed = s.seed AND other.set_index = s.set_index AND other.session != s.session
             WHERE s.session = ? AND NOT EXISTS (
                 SELECT 1 FROM events WHERE events.session = other.session AND kind IN ('aborted', 'unblinded'))",
        )
        .bind(session.to_string())
        .fetch_optional(self.pool())
        .await?;
        Ok(twin)
    }

    /// Whether every session that shares `seed` was unblinded, so that the seed gives nothing away.
    ///
    /// # Errors
    /// When the database failed.
    pub async fn set_unblinded(&self, seed: Seed) -> Result<bool, StoreError> {
        let blinded: i64 = sqlx::query_scalar(
            "SELECT count(*) FROM sessions AS s WHERE seed = ? AND NOT EXISTS (
                 SELECT 1 FROM events WHERE events.session = s.session AND kind = 'unblinded')",
        )
        .bind(seed.to_hex())
        .fetch_one(self.pool())
        .await?;
        Ok(blinded == 0)
    }
}
