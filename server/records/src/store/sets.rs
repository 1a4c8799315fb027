//! Balanced sets: the sessions whose orders were drawn together, from one seed.

use sqlx::Row;
use sqlx::sqlite::SqliteRow;

use super::sessions::{index, seed};
use super::values::{parsed, status};
use super::{Reader, StoreError};
use parfocal_trial::allocation::{Algorithm, Seed};
use parfocal_trial::balanced_set::{BalancedSet, Member};

impl Reader {
    /// The balanced set of the latest session outside any study that has this protocol, by its hash, and this
    /// algorithm; `None` if there is no such session.
    ///
    /// # Errors
    /// If the database fails.
    pub async fn latest_set(
        &self,
        protocol_sha256: &str,
        algorithm: Algorithm,
    ) -> Result<Option<BalancedSet>, StoreError> {
        let latest = sqlx::query(
            "SELECT seed FROM sessions WHERE protocol_sha256 = ? AND algorithm = ?
                 AND session NOT IN (SELECT session FROM study_sessions)
             ORDER BY rowid DESC LIMIT 1",
        )
        .bind(protocol_sha256)
        .bind(algorithm.name())
        .fetch_optional(self.pool())
        .await?;

        match latest {
            Some(row) => Ok(Some(self.balanced_set(seed(&row)?).await?)),
            None => Ok(None),
        }
    }

    /// The sessions that share `seed`, in the order in which they were made.
    ///
    /// # Errors
    /// If the database fails.
    pub async fn balanced_set(&self, seed: Seed) -> Result<BalancedSet, StoreError> {
        let sql = "SELECT session, participant, wall, set_index,
                 EXISTS (SELECT 1 FROM events WHERE events.session = s.session AND kind = 'completed') AS completed,
                 EXISTS (SELECT 1 FROM events WHERE events.session = s.session AND kind = 'aborted') AS aborted,
                 EXISTS (SELECT 1 FROM events WHERE events.session = s.session AND kind = 'unblinded') AS unblinded,
                 EXISTS (SELECT 1 FROM events WHERE events.session = s.session AND kind = 'withdrawn') AS withdrawn
             FROM sessions AS s WHERE seed = ? ORDER BY rowid";
        Ok(BalancedSet { seed, members: self.rows(sql, &seed.to_hex(), member).await? })
    }
}

fn member(row: &SqliteRow) -> Result<Member, StoreError> {
    Ok(Member {
        session: parsed(row, "session")?,
        participant: row.try_get("participant")?,
        made: parsed(row, "wall")?,
        place: index(row)?,
        status: status(row)?,
        unblinded: row.try_get("unblinded")?,
        withdrawn: row.try_get("withdrawn")?,
    })
}
