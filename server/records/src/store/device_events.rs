//! Events of camera and lens: written as they happen, and read for the log of a session.

use sqlx::Row;
use sqlx::sqlite::SqliteRow;

use super::export::DeviceRow;
use super::export_rows::RowOfSession;
use super::insert::Insert;
use super::values::stamp;
use super::{DeviceEvent, Reader, Stamp, Store, StoreError, chain};
use parfocal_base::boxed;
use parfocal_base::ids::SessionId;

impl Store {
    /// Records that a device started or stopped working.
    ///
    /// # Errors
    /// If the disk or database fails.
    #[boxed]
    pub async fn device_event(&self, event: &DeviceEvent) -> Result<(), StoreError> {
        self.write(async |connection| {
            let number = Insert::into("device_events")
                .set("device", &event.device)
                .set("working", event.working)
                .set("message", &event.message)
                .recorded(self.inner.run, Stamp { wall: event.wall, at: event.at })
                .execute(connection)
                .await?;

            chain::append(connection, "device", &number.to_string(), &event.wall.to_string()).await?;
            Ok(())
        })
        .await
    }
}

impl Reader {
    /// The events of camera and lens in `session`, each with its run. They go from the start of every run that served
    /// the session to the end of the session, so they include the state in which it began.
    ///
    /// # Errors
    /// If the database fails.
    pub async fn device_events(&self, session: SessionId) -> Result<Vec<(i64, DeviceEvent)>, StoreError> {
        let event = |row: &SqliteRow| {
            let Stamp { wall, at } = stamp(row)?;
            let device = row.try_get("device")?;
            let working = row.try_get("working")?;
            let message = row.try_get("message")?;
            Ok((row.try_get("run")?, DeviceEvent { wall, at, device, working, message }))
        };
        self.rows(DeviceRow::SQL, &session, event).await
    }
}
