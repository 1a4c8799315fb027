//! The rows of an export that come straight from the database. Long tables such as telemetry come row by row, because
//! they are too large to gather first.

use futures_util::TryStreamExt;
use jiff::Timestamp;
use sqlx::sqlite::SqliteRow;
use sqlx::{FromRow, Row as _};

use super::chain::entry;
use super::export::{
    AccessRow, ActorRow, ChainRow, ChainSaltRow, ExportError, Folder, PolicyStepRow, Row, RunRow, StudyEventRow,
    TelemetryRow, WeightsRow, WithdrawalRow,
};
use super::values::{parsed, parsed_if_any};
use super::{Reader, StoreError};
use parfocal_base::ids::SessionId;

/// A row of a table that is written while it is read.
pub(super) trait LongRow: Row + for<'r> FromRow<'r, SqliteRow> {
    /// Selects the rows of a session, the only parameter.
    const SQL: &'static str;
}

/// Holds caused by the policy are left out, because they would reveal it: only learned policies take time to start and
/// to compute.
impl LongRow for TelemetryRow {
    const SQL: &'static str = concat!(
        "SELECT g.setting, t.run, t.frame, t.exposed_ns, t.asked, t.measured, ",
        held_openly!(),
        " AS held, t.optimal, t.picture_width, t.patch_x, t.patch_y
         FROM segments AS g JOIN telemetry AS t ON t.segment = g.number
         WHERE g.session = ? ORDER BY g.setting, t.number"
    );
}

/// The part of the telemetry that reveals the policy.
impl LongRow for PolicyStepRow {
    const SQL: &'static str =
        "SELECT g.setting, t.run, t.frame, p.name AS policy, t.metric, t.policy_micros, t.latency_micros, t.held
         FROM segments AS g JOIN telemetry AS t ON t.segment = g.number
              LEFT JOIN policies AS p ON p.number = t.policy
         WHERE g.session = ? ORDER BY g.setting, t.number";
}

/// The weights of the session's learned policies, run by run.
impl LongRow for WeightsRow {
    const SQL: &'static str =
        "SELECT r.run, w.key AS policy, w.value AS sha256 FROM runs AS r, json_each(r.weights) AS w
         WHERE r.run IN (SELECT run FROM events WHERE session = ?1)
             AND w.key IN (SELECT policy FROM segments WHERE session = ?1) ORDER BY r.run, w.key";
}

/// The salts that a blinded export withholds, except those of the server's starts.
impl LongRow for ChainSaltRow {
    const SQL: &'static str = "SELECT number, chain_salts.salt FROM chain_salts JOIN chain USING (number)
         WHERE chain.session = ?1 AND (chain.kind = 'telemetry' OR chain.kind = 'event' AND chain.key IN (
             SELECT session || '/' || number FROM events WHERE session = ?1 AND kind = 'unblinded'))
         ORDER BY number";
}

impl Reader {
    /// The starts of the server that recorded something of `session`.
    pub(super) async fn export_runs(&self, session: SessionId) -> Result<Vec<RunRow>, StoreError> {
        let sql = "SELECT run, wall, monotonic_ns, version, camera, lens, calibration, blur FROM runs WHERE run IN (
                 SELECT run FROM sessions WHERE session = ?1 UNION SELECT run FROM events WHERE session = ?1
                 UNION SELECT run FROM comments WHERE session = ?1 UNION SELECT run FROM answers WHERE session = ?1
                 UNION SELECT frame_run FROM comments WHERE session = ?1
                 UNION SELECT run FROM corrections WHERE session = ?1
                 UNION SELECT run FROM consents WHERE session = ?1 UNION SELECT run FROM erasures WHERE session = ?1
                 UNION SELECT run FROM voice_pieces WHERE session = ?1)
             ORDER BY run";
        self.rows(sql, &session, run_row).await
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
            "SELECT * FROM study_events WHERE study = ? AND (session IS NULL OR session = ?) ORDER BY number",
        )
        .bind(study)
        .bind(session.to_string())
        .fetch_all(self.pool())
        .await?;

        rows.iter().map(study_event_row).collect()
    }

    /// The accounts behind the records of `session`.
    pub(super) async fn export_actors(&self, session: SessionId) -> Result<Vec<ActorRow>, StoreError> {
        let rows = sqlx::query_as("SELECT * FROM actors WHERE session = ? ORDER BY number");
        Ok(rows.bind(session.to_string()).fetch_all(self.pool()).await?)
    }

    /// Writes the long table with the rows `R` of `session` into `folder`.
    pub(super) async fn export_long<R: LongRow>(
        &self,
        session: SessionId,
        folder: &mut Folder,
    ) -> Result<(), ExportError> {
        let mut file = folder.begin::<R>()?;
        let mut rows = sqlx::query(R::SQL).bind(session.to_string()).fetch(self.pool());
        while let Some(row) = rows.try_next().await.map_err(StoreError::from)? {
            file.row(&R::from_row(&row).map_err(StoreError::from)?).await?;
        }
        file.end().await
    }

    /// The accesses to `session`.
    pub(super) async fn export_accesses(&self, session: SessionId) -> Result<Vec<AccessRow>, StoreError> {
        self.rows("SELECT * FROM accesses WHERE session = ? ORDER BY number", &session, access_row).await
    }

    /// The withdrawn sessions of the protocol of `session`.
    pub(super) async fn export_withdrawals(&self, session: SessionId) -> Result<Vec<WithdrawalRow>, StoreError> {
        let sql = "SELECT s.session, s.protocol, s.place, e.wall, e.role
             FROM (SELECT session, protocol, protocol_sha256,
                     row_number() OVER (PARTITION BY protocol_sha256 ORDER BY rowid) AS place FROM sessions) AS s
                 JOIN events AS e ON e.session = s.session AND e.kind = 'withdrawn'
             WHERE s.protocol_sha256 = (SELECT protocol_sha256 FROM sessions WHERE session = ?)
             ORDER BY s.place";
        self.rows(sql, &session, withdrawal_row).await
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

fn run_row(row: &SqliteRow) -> Result<RunRow, StoreError> {
    Ok(RunRow {
        run: row.try_get("run")?,
        wall: parsed(row, "wall")?,
        monotonic_ns: row.try_get("monotonic_ns")?,
        version: row.try_get("version")?,
        camera: row.try_get("camera")?,
        lens: row.try_get("lens")?,
        calibration: row.try_get("calibration")?,
        blur: row.try_get("blur")?,
    })
}

fn access_row(row: &SqliteRow) -> Result<AccessRow, StoreError> {
    Ok(AccessRow {
        number: row.try_get("number")?,
        wall: parsed(row, "wall")?,
        run: row.try_get("run")?,
        monotonic_ns: row.try_get("monotonic_ns")?,
        role: row.try_get("role")?,
        kind: row.try_get("kind")?,
        session: parsed(row, "session")?,
        detail: row.try_get("detail")?,
    })
}

fn withdrawal_row(row: &SqliteRow) -> Result<WithdrawalRow, StoreError> {
    Ok(WithdrawalRow {
        session: parsed(row, "session")?,
        protocol: row.try_get("protocol")?,
        place: row.try_get("place")?,
        wall: parsed(row, "wall")?,
        role: row.try_get("role")?,
    })
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

fn study_event_row(row: &SqliteRow) -> Result<StudyEventRow, StoreError> {
    Ok(StudyEventRow {
        study: row.try_get("study")?,
        number: row.try_get("number")?,
        wall: parsed(row, "wall")?,
        run: row.try_get("run")?,
        monotonic_ns: row.try_get("monotonic_ns")?,
        role: row.try_get("role")?,
        person: row.try_get("person")?,
        kind: row.try_get("kind")?,
        about_session: parsed_if_any(row, "session")?,
        commitment: row.try_get("commitment")?,
        reason: row.try_get("reason")?,
    })
}
