//! What unblinding adds to an export: the policies, and the seed by which anyone can rebuild the order.

use serde_json::{Value, json};

use super::ExportError;
use super::description::{ALLOCATION, POLICY_STEPS, WEIGHTS};
use super::folder::Folder;
use super::table::Row;
use crate::store::sessions::StoredSession;
use crate::store::{NewSession, Reader, StoreError};
use crate::trial::event::EventKind;

/// A session's allocation. There is one only for a session that was unblinded.
pub struct Unblinded {
    made: NewSession,
    reason: String,
    /// Whether the seed may be told: not while it would unblind another session of its set.
    seed_told: bool,
}

impl Unblinded {
    /// The allocation of `stored`, or `None` if it was not unblinded.
    pub async fn of(reader: &Reader, stored: &StoredSession) -> Result<Option<Self>, StoreError> {
        let reason = stored.events.iter().find_map(|(_, event)| match &event.kind {
            EventKind::Unblinded { reason, .. } => Some(reason.clone()),
            _ => None,
        });
        let Some(reason) = reason else { return Ok(None) };
        let seed_told = reader.balanced_set(stored.made.seed).await?.may_tell_seed();
        Ok(Some(Self { made: stored.made.clone(), reason, seed_told }))
    }

    /// Writes its files.
    pub async fn write(&self, reader: &Reader, folder: &mut Folder) -> Result<(), ExportError> {
        folder.table(&ALLOCATION, &self.rows()).await?;

        let mut file = folder.begin(&WEIGHTS)?;
        reader.export_weights(self.made.session, async |row| file.row(&row).await).await?;
        file.end().await?;

        let mut file = folder.begin(&POLICY_STEPS)?;
        reader.export_policy_steps(self.made.session, async |row| file.row(&row).await).await?;
        file.end().await?;

        folder.json("allocation.json", &self.json()).await
    }

    fn rows(&self) -> Vec<Row> {
        let session = self.made.session.to_string();
        let row = |((segment, policy), setting): (&(_, _), u32)| {
            vec![json!(session), json!(setting), json!(segment), json!(policy)]
        };
        self.made.segments.iter().zip(1..).map(row).collect()
    }

    fn json(&self) -> Value {
        let schedule: Vec<_> = self.made.segments.iter().map(|(_, policy)| policy).collect();
        json!({
            "session": self.made.session,
            "algorithm": self.made.algorithm,
            "seed": self.seed_told.then(|| self.made.seed.to_hex()),
            "seed_withheld": (!self.seed_told).then_some("it would unblind other sessions of the same balanced set; unblind those and export again"),
            "index": self.made.set_index,
            "protocol_sha256": self.made.protocol_sha256,
            "schedule": schedule,
            "commitment": self.made.commitment,
            "unblinding_reason": self.reason,
        })
    }
}
