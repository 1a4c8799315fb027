//! The rows of an export that come straight from the database, one by one: telemetry is too much to gather first.

use futures_util::TryStreamExt;
use serde_json::{Value, json};
use sqlx::Row as _;
use sqlx::sqlite::SqliteRow;

use super::{Reader, StoreError};
use crate::ids::SessionId;

impl Reader {
    /// The starts of the server that `session` has records of.
    pub(super) async fn export_runs(&self, session: SessionId) -> Result<Vec<Vec<Value>>, StoreError> {
        let rows = sqlx::query(
            "SELECT run, wall, monotonic_ns, version, camera, lens, calibration FROM runs WHERE run IN (
                 SELECT run FROM sessions WHERE session = ?1 UNION SELECT run FROM events WHERE session = ?1
                 UNION SELECT run FROM comments WHERE session = ?1 UNION SELECT run FROM answers WHERE session = ?1
                 UNION SELECT frame_run FROM comments WHERE session = ?1)
             ORDER BY run",
        )
        .bind(session.to_string())
        .fetch_all(self.pool())
        .await?;
        let row = |row: &SqliteRow| {
            Ok(vec![
                integer(row, "run")?,
                string(row, "wall")?,
                integer(row, "monotonic_ns")?,
                string(row, "version")?,
                string(row, "camera")?,
                string(row, "lens")?,
                string(row, "calibration")?,
            ])
        };
        rows.iter().map(row).collect()
    }

    /// Hands the blinded telemetry of `session` to `take`, row by row.
    pub(super) async fn export_telemetry<E: From<StoreError>>(
        &self,
        session: SessionId,
        take: impl AsyncFnMut(Vec<Value>) -> Result<(), E>,
    ) -> Result<(), E> {
        // A hold for the policy's sake is left out: only learned ones take time to start and to think.
        let sql = "SELECT g.setting, t.run, t.frame, t.exposed_ns, t.asked, t.measured,
                    coalesce(t.held IN ('paused', 'lens-failed', 'camera-failed'), FALSE) AS held, t.optimal
             FROM segments AS g JOIN telemetry AS t ON t.segment = g.number
             WHERE g.session = ? ORDER BY g.setting, t.number";
        self.hand_out(session, sql, telemetry_row, take).await
    }

    /// Hands what of the telemetry of `session` tells the policy to `take`, row by row.
    pub(super) async fn export_policy_steps<E: From<StoreError>>(
        &self,
        session: SessionId,
        take: impl AsyncFnMut(Vec<Value>) -> Result<(), E>,
    ) -> Result<(), E> {
        let sql = "SELECT g.setting, t.run, t.frame, p.name, t.metric, t.policy_micros, t.latency_micros, t.held
             FROM segments AS g JOIN telemetry AS t ON t.segment = g.number LEFT JOIN policies AS p ON p.number = t.policy
             WHERE g.session = ? ORDER BY g.setting, t.number";
        self.hand_out(session, sql, policy_row, take).await
    }

    /// Hands the weights of the learned policies of `session` to `take`, run by run.
    pub(super) async fn export_weights<E: From<StoreError>>(
        &self,
        session: SessionId,
        take: impl AsyncFnMut(Vec<Value>) -> Result<(), E>,
    ) -> Result<(), E> {
        let sql = "SELECT r.run, w.key AS policy, w.value AS sha256 FROM runs AS r, json_each(r.weights) AS w
             WHERE r.run IN (SELECT run FROM events WHERE session = ?1)
                 AND w.key IN (SELECT policy FROM segments WHERE session = ?1) ORDER BY r.run, w.key";
        let row = |row: &SqliteRow| Ok(vec![integer(row, "run")?, string(row, "policy")?, string(row, "sha256")?]);
        self.hand_out(session, sql, row, take).await
    }

    /// Hands the rows of `sql`, whose one parameter is `session`, to `take`, each as `read` reads it.
    async fn hand_out<E: From<StoreError>>(
        &self,
        session: SessionId,
        sql: &'static str,
        read: fn(&SqliteRow) -> Result<Vec<Value>, StoreError>,
        mut take: impl AsyncFnMut(Vec<Value>) -> Result<(), E>,
    ) -> Result<(), E> {
        let mut rows = sqlx::query(sql).bind(session.to_string()).fetch(self.pool());
        while let Some(row) = rows.try_next().await.map_err(StoreError::from)? {
            take(read(&row)?).await?;
        }
        Ok(())
    }
}

fn telemetry_row(row: &SqliteRow) -> Result<Vec<Value>, StoreError> {
    let held: bool = row.try_get("held")?;
    Ok(vec![
        integer(row, "setting")?,
        integer(row, "run")?,
        integer(row, "frame")?,
        integer(row, "exposed_ns")?,
        number(row, "asked")?,
        number(row, "measured")?,
        json!(held),
        number(row, "optimal")?,
    ])
}

fn policy_row(row: &SqliteRow) -> Result<Vec<Value>, StoreError> {
    Ok(vec![
        integer(row, "setting")?,
        integer(row, "run")?,
        integer(row, "frame")?,
        string(row, "name")?,
        number(row, "metric")?,
        integer(row, "policy_micros")?,
        integer(row, "latency_micros")?,
        string(row, "held")?,
    ])
}

fn integer(row: &SqliteRow, column: &str) -> Result<Value, StoreError> {
    Ok(json!(row.try_get::<Option<i64>, _>(column)?))
}

fn number(row: &SqliteRow, column: &str) -> Result<Value, StoreError> {
    Ok(json!(row.try_get::<Option<f64>, _>(column)?))
}

fn string(row: &SqliteRow, column: &str) -> Result<Value, StoreError> {
    Ok(json!(row.try_get::<Option<String>, _>(column)?))
}
