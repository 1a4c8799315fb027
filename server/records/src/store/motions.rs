//! Reads how the lens was driven in each setting of a session.

use std::sync::PoisonError;

use futures_util::TryStreamExt;

use super::motion::{LensMotion, Row, RunningFigures};
use super::{Reader, StoreError};
use parfocal_base::ids::SessionId;

impl Reader {
    /// The same as [`Reader::motions`] for a session whose telemetry is complete. It is read once and then remembered,
    /// because reading that of a whole study takes many seconds.
    ///
    /// # Errors
    /// If the database fails.
    pub async fn motions_of_ended(&self, session: SessionId) -> Result<Vec<LensMotion>, StoreError> {
        let remembered = self.ended.lock().unwrap_or_else(PoisonError::into_inner).get(&session).cloned();
        if let Some(motions) = remembered {
            return Ok(motions);
        }

        let motions = self.motions(session).await?;
        self.ended.lock().unwrap_or_else(PoisonError::into_inner).insert(session, motions.clone());
        Ok(motions)
    }

    /// How the lens was driven in each setting of `session` that has telemetry.
    ///
    /// # Errors
    /// If the database fails.
    pub async fn motions(&self, session: SessionId) -> Result<Vec<LensMotion>, StoreError> {
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
