//! Consents: what participants agreed to before their sessions.

use sqlx::Row;
use sqlx::sqlite::SqliteRow;

use super::actors::name_actor;
use super::insert::Insert;
use super::values::{named, parsed, stamp};
use super::{Reader, Stamp, Store, StoreError, chain};
use parfocal_base::boxed;
use parfocal_base::ids::SessionId;
use parfocal_trial::account::Actor;
use parfocal_trial::consent::{Consent, Medium};
use parfocal_trial::role::Role;

/// A consent read back.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct StoredConsent {
    /// Order of the record in the database.
    pub number: i64,
    /// Number of the run that recorded it.
    pub run: i64,
    /// Role of the person who recorded it.
    pub by: Role,
    /// When it was recorded.
    pub stamp: Stamp,
    /// What was consented to, when and how.
    pub consent: Consent,
}

impl Store {
    /// Records a consent for `session`. It is on disk when this returns.
    ///
    /// # Errors
    /// If the disk or database fails.
    #[boxed]
    pub async fn keep_consent(
        &self,
        session: SessionId,
        consent: &Consent,
        by: &Actor,
        stamp: Stamp,
    ) -> Result<(), StoreError> {
        self.write(async |connection| {
            let number = Insert::into("consents")
                .set("session", session.to_string())
                .set("text_version", &consent.text_version)
                .set("given_on", consent.given_on.to_string())
                .set("obtained_by", &consent.obtained_by)
                .set("medium", consent.medium.name())
                .set("role", by.role.name())
                .recorded(self.inner.run, stamp)
                .execute(connection)
                .await?
                .to_string();

            let wall = stamp.wall.to_string();
            chain::append(connection, "consent", &number, &wall).await?;
            name_actor(connection, by.account.as_ref(), "consent", &number, Some(session), &wall).await
        })
        .await
    }
}

impl Reader {
    /// The consents for `session`, in the order in which they were recorded. The latest counts.
    ///
    /// # Errors
    /// If the database fails or holds data that this version cannot read.
    pub async fn consents(&self, session: SessionId) -> Result<Vec<StoredConsent>, StoreError> {
        self.rows("SELECT * FROM consents WHERE session = ? ORDER BY number", &session, consent).await
    }
}

fn consent(row: &SqliteRow) -> Result<StoredConsent, StoreError> {
    Ok(StoredConsent {
        number: row.try_get("number")?,
        run: row.try_get("run")?,
        by: named(row, "role", "a consent", Role::named)?,
        stamp: stamp(row)?,
        consent: Consent {
            text_version: row.try_get("text_version")?,
            given_on: parsed(row, "given_on")?,
            obtained_by: row.try_get("obtained_by")?,
            medium: named(row, "medium", "a consent", Medium::named)?,
        },
    })
}
