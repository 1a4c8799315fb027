//! What unblinding adds to an export: the policies, and the seed by which anyone can rebuild the
//! order.

use serde_json::{Value, json};

use super::ExportError;
use super::description::AllocationRow;
use super::folder::Folder;
use crate::autofocus::PolicyName;
use crate::ids::SegmentId;
use crate::store::sessions::StoredSession;
use crate::store::{NewSession, Reader, StoreError};
use crate::trial::event::EventKind;

/// Why the seed is not told.
const SEED_WITHHELD: &str = "it would unblind other sessions of the same balanced set; unblind those and export again";

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
        folder.table(&self.rows()).await?;

        let mut weights = folder.begin()?;
        reader.export_weights(self.made.session, async |row| weights.row(&row).await).await?;
        weights.end().await?;

        let mut steps = folder.begin()?;
        reader.export_policy_steps(self.made.session, async |row| steps.row(&row).await).await?;
        steps.end().await?;

        let mut salts = folder.begin()?;
        reader.export_chain_salts(self.made.session, async |row| salts.row(&row).await).await?;
        salts.end().await?;

        folder.json("allocation.json", &self.json()).await
    }

    fn rows(&self) -> Vec<AllocationRow> {
        let row = |((segment, policy), setting): (&(SegmentId, PolicyName), usize)| AllocationRow {
            session: self.made.session,
            setting,
            segment: *segment,
            policy: policy.clone(),
        };
        self.made.segments.iter().zip(1..).map(row).collect()
    }

    fn json(&self) -> Value {
        let schedule: Vec<_> = self.made.segments.iter().map(|(_, policy)| policy).collect();
        json!({
            "session": self.made.session,
            "algorithm": self.made.algorithm,
            "seed": self.seed_told.then(|| self.made.seed.to_hex()),
            "seed_withheld": (!self.seed_told).then_some(SEED_WITHHELD),
            "index": self.made.set_index,
            "protocol_sha256": self.made.protocol_sha256,
            "schedule": schedule,
            "commitment": self.made.commitment,
            "unblinding_reason": self.reason,
        })
    }
}
