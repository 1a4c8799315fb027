//! The rows of an export that come straight from the database.

use futures_util::TryStreamExt;
use jiff::Timestamp;
use sqlx::Row as _;
use sqlx::sqlite::SqliteRow;

use super::chain::entry;
use super::export::stored::StoredRow;
use super::export::{
    AccessRow, ActorRow, ChainRow, ChainSaltRow, ConsentRow, CorrectionRow, DeviceRow, ErasureRow, ExportError, Folder,
    PolicyStepRow, RunRow, StudyEventRow, TelemetryRow, VoicePieceRow, WeightsRow, WithdrawalRow,
};
use super::values::parsed;
use super::{Reader, StoreError};
use parfocal_base::ids::SessionId;

/// A row of a session.
pub(super) trait RowOfSession: StoredRow {
    /// Selects the rows of a session, the only parameter.
    const SQL: &'static str;
}

/// The starts of the server that recorded something of the session.
impl RowOfSession for RunRow {
    const SQL: &'static str =
        "SELECT run, wall, monotonic_ns, version, camera, lens, calibration, blur FROM runs WHERE run IN (
                 SELECT run FROM sessions WHERE session = ?1 UNION SELECT run FROM events WHERE session = ?1
                 UNION SELECT run FROM comments WHERE session = ?1 UNION SELECT run FROM answers WHERE session = ?1
                 UNION SELECT frame_run FROM comments WHERE session = ?1
                 UNION SELECT run FROM corrections WHERE session = ?1
                 UNION SELECT run FROM consents WHERE session = ?1 UNION SELECT run FROM erasures WHERE session = ?1
                 UNION SELECT run FROM voice_pieces WHERE session = ?1)
             ORDER BY run";
}

/// The events of camera and lens, from the start of every run that served the session to the end of the session, so
/// that the state in which it began is among them.
impl RowOfSession for DeviceRow {
    const SQL: &'static str = "SELECT number, run, wall, monotonic_ns, device, working, message FROM device_events AS d
         WHERE run IN (SELECT run FROM events WHERE session = ?1) AND NOT EXISTS (
             SELECT 1 FROM events AS e WHERE e.session = ?1 AND e.kind IN ('completed', 'aborted')
                 AND (e.run, e.monotonic_ns) < (d.run, d.monotonic_ns))
         ORDER BY number";
}

impl RowOfSession for AccessRow {
    const SQL: &'static str = "SELECT * FROM accesses WHERE session = ? ORDER BY number";
}

impl RowOfSession for CorrectionRow {
    const SQL: &'static str = "SELECT *, (SELECT wall FROM erasures
             WHERE subject = 'correction' AND record = CAST(c.number AS TEXT)) AS erased
         FROM corrections AS c WHERE session = ? ORDER BY number";
}

impl RowOfSession for ConsentRow {
    const SQL: &'static str = "SELECT * FROM consents WHERE session = ? ORDER BY number";
}

impl RowOfSession for ErasureRow {
    const SQL: &'static str = "SELECT * FROM erasures WHERE session = ? ORDER BY number";
}

/// The withdrawn sessions of the session's protocol.
impl RowOfSession for WithdrawalRow {
    const SQL: &'static str = "SELECT s.session, s.protocol, s.place, e.wall, e.role
         FROM (SELECT session, protocol, protocol_sha256,
                 row_number() OVER (PARTITION BY protocol_sha256 ORDER BY rowid) AS place FROM sessions) AS s
             JOIN events AS e ON e.session = s.session AND e.kind = 'withdrawn'
         WHERE s.protocol_sha256 = (SELECT protocol_sha256 FROM sessions WHERE session = ?)
         ORDER BY s.place";
}

/// The accounts behind the records of the session.
impl RowOfSession for ActorRow {
    const SQL: &'static str = "SELECT * FROM actors WHERE session = ? ORDER BY number";
}

/// The pieces of all recordings, in the order they were kept, without their sound.
impl RowOfSession for VoicePieceRow {
    const SQL: &'static str =
        "SELECT number, session, comment, piece, media_type, through_ms, ended, bytes, sha256, wall,
             run, monotonic_ns
         FROM voice_pieces WHERE session = ? ORDER BY number";
}

/// Holds caused by the policy are left out, because they would reveal it: only learned policies take time to start and
/// to compute.
impl RowOfSession for TelemetryRow {
    const SQL: &'static str = concat!(
        "SELECT g.setting, t.run, t.frame, t.exposed_ns, t.asked, t.measured, ",
        held_openly!(),
        " AS held, t.optimal, t.picture_width, t.patch_x, t.patch_y
         FROM segments AS g JOIN telemetry AS t ON t.segment = g.number
         WHERE g.session = ? ORDER BY g.setting, t.number"
    );
}

/// The part of the telemetry that reveals the policy.
impl RowOfSession for PolicyStepRow {
    const SQL: &'static str =
        "SELECT g.setting, t.run, t.frame, p.name AS policy, t.metric, t.policy_micros, t.latency_micros, t.held
         FROM segments AS g JOIN telemetry AS t ON t.segment = g.number
              LEFT JOIN policies AS p ON p.number = t.policy
         WHERE g.session = ? ORDER BY g.setting, t.number";
}

/// The weights of the session's learned policies, run by run.
impl RowOfSession for WeightsRow {
    const SQL: &'static str =
        "SELECT r.run, w.key AS policy, w.value AS sha256 FROM runs AS r, json_each(r.weights) AS w
         WHERE r.run IN (SELECT run FROM events WHERE session = ?1)
             AND w.key IN (SELECT policy FROM segments WHERE session = ?1) ORDER BY r.run, w.key";
}

/// The salts that a blinded export withholds, except those of the server's starts.
impl RowOfSession for ChainSaltRow {
    const SQL: &'static str = "SELECT number, chain_salts.salt FROM chain_salts JOIN chain USING (number)
         WHERE chain.session = ?1 AND (chain.kind = 'telemetry' OR chain.kind = 'event' AND chain.key IN (
             SELECT session || '/' || number FROM events WHERE session = ?1 AND kind = 'unblinded'))
         ORDER BY number";
}

impl Reader {
    /// The rows `R` of `session`.
    pub(super) async fn export_rows<R: RowOfSession>(&self, session: SessionId) -> Result<Vec<R>, StoreError> {
        self.rows(R::SQL, &session, R::read).await
    }

    /// Writes the table with the rows `R` of `session` into `folder`, row by row: it is too large to gather first.
    pub(super) async fn export_long<R: RowOfSession>(
        &self,
        session: SessionId,
        folder: &mut Folder,
    ) -> Result<(), ExportError> {
        let mut file = folder.begin::<R>()?;
        let mut rows = sqlx::query(R::SQL).bind(session.to_string()).fetch(self.pool());
        while let Some(row) = rows.try_next().await.map_err(StoreError::from)? {
            file.row(&R::read(&row)?).await?;
        }
        file.end().await
    }

    /// The sites of study `study` that this database runs, as JSON, and when it was planned.
    pub(super) async fn export_study(&self, study: &str) -> Result<(String, Timestamp), StoreError> {
        let row = sqlx::query("SELECT sites, wall FROM studies WHERE study = ?").bind(study);
        let row = row.fetch_one(self.pool()).await?;
        Ok((row.try_get("sites")?, parsed(&row, "wall")?))
    }

    /// The events of study `study` that are about the whole study or about `session`.
    pub(super) async fn export_study_events(
        &self,
        study: &str,
        session: SessionId,
    ) -> Result<Vec<StudyEventRow>, StoreError> {
        let rows = sqlx::query(
            "SELECT *, session AS about_session FROM study_events
             WHERE study = ? AND (session IS NULL OR session = ?) ORDER BY number",
        )
        .bind(study)
        .bind(session.to_string())
        .fetch_all(self.pool())
        .await?;

        rows.iter().map(StudyEventRow::read).collect()
    }

    /// Passes every row of the chain to `take`, with all its columns.
    pub(super) async fn export_chain(
        &self,
        mut take: impl AsyncFnMut(ChainRow) -> Result<(), ExportError>,
    ) -> Result<(), ExportError> {
        let sql = "SELECT chain.*, chain_salts.salt AS sealed_salt FROM chain LEFT JOIN chain_salts USING (number)
             ORDER BY number";
        let mut rows = sqlx::query(sql).fetch(self.pool());
        while let Some(row) = rows.try_next().await.map_err(StoreError::from)? {
            take(chain_row(&row)?).await?;
        }
        Ok(())
    }
}

fn chain_row(row: &SqliteRow) -> Result<ChainRow, StoreError> {
    let entry = entry(row)?;
    Ok(ChainRow {
        number: row.try_get("number")?,
        entry: entry.hash(),
        hash: row.try_get("hash")?,
        wall: Some(entry.wall),
        kind: Some(entry.kind),
        key: Some(entry.key),
        session: Some(entry.session),
        place: entry.place,
        salt: Some(entry.salt),
        sealed: Some(entry.sealed),
        sealed_salt: row.try_get("sealed_salt")?,
        content: Some(entry.content),
    })
}
