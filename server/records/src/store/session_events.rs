//! Writes the events of sessions.

use sqlx::sqlite::SqliteConnection;

use super::actors::name_actor;
use super::values::nanoseconds;
use super::{StoreError, chain};
use parfocal_base::ids::SessionId;
use parfocal_trial::event::Event;

/// Writes `event` of `session`, recorded in run `run`. Writing the same event again changes nothing.
pub(super) async fn insert_event(
    connection: &mut SqliteConnection,
    run: i64,
    session: SessionId,
    event: &Event,
) -> Result<(), StoreError> {
    let wall = event.wall.to_string();
    let payload = serde_json::to_string(&event.kind).map_err(|error| StoreError::Damaged(error.to_string()))?;

    // A commit that the disk reported as failed may have reached it all the same. So the same event is accepted again,
    // while another event with its number is still refused.
    let done = sqlx::query(
        "INSERT INTO events (session, number, run, wall, monotonic_ns, role, kind, payload)
         SELECT ?1, ?2, ?3, ?4, ?5, ?6, ?7, ?8 WHERE NOT EXISTS (
             SELECT 1 FROM events
             WHERE session = ?1 AND number = ?2 AND run = ?3 AND monotonic_ns = ?5 AND role = ?6 AND payload = ?8)",
    )
    .bind(session.to_string())
    .bind(event.number)
    .bind(run)
    .bind(&wall)
    .bind(nanoseconds(event.at))
    .bind(event.by.name())
    .bind(event.kind.name())
    .bind(payload)
    .execute(&mut *connection)
    .await?;

    if done.rows_affected() == 1 {
        let key = format!("{session}/{}", event.number);
        chain::append(connection, "event", &key, &wall).await?;
        name_actor(connection, event.account.as_ref(), "event", &key, Some(session), &wall).await?;
    }

    Ok(())
}
