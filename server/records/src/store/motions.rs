//! Reads how the lens was driven in each setting of a session.

use std::sync::PoisonError;

use futures_util::TryStreamExt;

use super::motion::{LensMotion, Row, RunningFigures};
use super::{Reader, StoreError};
use parfocal_base::ids::SessionId;

impl Reader {
    /// How the lens was driven in each setting of `session` that has telemetry. It is remembered until the session has
    /// more telemetry, because reading that of a whole study takes many seconds.
    ///
    /// # Errors
    /// If the database fails.
    pub async fn motions(&self, session: SessionId) -> Result<Vec<LensMotion>, StoreError> {
        // Read before the rest: what comes meanwhile is then read again.
        let last: Option<i64> = sqlx::query_scalar(
            "SELECT max((SELECT max(t.number) FROM telemetry AS t WHERE t.segment = s.number)) FROM segments AS s
             WHERE session = ?",
        )
        .bind(session.to_string())
        .fetch_one(self.pool())
        .await?;
        let Some(last) = last else { return Ok(Vec::new()) };

        let known = self.motions.lock().unwrap_or_else(PoisonError::into_inner).get(&session).cloned();
        if let Some((_, motions)) = known.filter(|(up_to, _)| *up_to == last) {
            return Ok(motions);
        }

        let motions = self.read_motions(session).await?;
        self.motions.lock().unwrap_or_else(PoisonError::into_inner).insert(session, (last, motions.clone()));
        Ok(motions)
    }

    async fn read_motions(&self, session: SessionId) -> Result<Vec<LensMotion>, StoreError> {
        let segments: Vec<(i64, i64)> =
            sqlx::query_as("SELECT number, setting FROM segments WHERE session = ? ORDER BY setting")
                .bind(session.to_string())
                .fetch_all(self.pool())
                .await?;

        let mut motions = Vec::new();
        for (segment, setting) in segments {
            let mut rows = sqlx::query_as::<_, Row>(concat!(
                "SELECT run, exposed_ns, asked, measured, optimal, ",
                held_openly!(),
                " AS held FROM telemetry WHERE segment = ? ORDER BY number"
            ))
            .bind(segment)
            .fetch(self.pool());

            let mut watched = RunningFigures::default();
            while let Some(row) = rows.try_next().await? {
                watched.take(&row);
            }
            if watched.motion.frames > 0 {
                let setting = usize::try_from(setting).unwrap_or(0);
                motions.push(LensMotion { setting, ..watched.motion });
            }
        }
        Ok(motions)
    }
}
