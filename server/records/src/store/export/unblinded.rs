//! What unblinding adds to an export: the policies, and the seed, from which anyone can draw the order again.

use serde_json::{Value, json};

use super::ExportError;
use super::description::{AllocationRow, ChainSaltRow, PolicyStepRow, WeightsRow};
use super::folder::Folder;
use crate::store::sessions::StoredSession;
use crate::store::{NewSession, Reader, StoreError};
use parfocal_base::PolicyName;
use parfocal_base::ids::{SegmentId, SessionId};
use parfocal_trial::allocation::Order;
use parfocal_trial::event::EventKind;
use parfocal_trial::study::lists::Lists;
use parfocal_trial::study::stage::Stage;

/// Why the seed is withheld.
const SEED_WITHHELD: &str = "it would unblind other sessions of the same balanced set; unblind those and export again";

/// Why the orders of the session's study are withheld.
const STUDY_WITHHELD: &str = "they would unblind other sessions of the study; unblind all of it and export again";

/// A session's allocation. It exists only for a session that was unblinded.
pub struct Unblinded {
    made: NewSession,
    reason: String,
    /// Whether the seed may be shown. It may not while it would unblind another session of its set.
    seed_told: bool,
    /// The orders of its study.
    study: StudyOrders,
}

/// What may be shown of the orders of a session's study.
enum StudyOrders {
    /// The session is outside any study.
    Outside,
    /// Nothing: the study is blinded.
    Withheld,
    /// All of them: the statement that was committed to.
    Told(String),
}

impl StudyOrders {
    async fn of(reader: &Reader, session: SessionId) -> Result<Self, StoreError> {
        let Some(enrolment) = reader.enrolment(session).await? else { return Ok(Self::Outside) };
        let study = reader.study(&enrolment.study).await?;
        let seed = study.as_ref().and_then(|study| study.seed);
        let (Some(study), Some(seed)) = (study, seed) else {
            return Err(StoreError::Damaged(format!("the orders of study {} are not there", enrolment.study)));
        };

        if study.state().stage != Stage::Unblinded {
            return Ok(Self::Withheld);
        }
        Ok(Self::Told(Lists::draw(&study.definition, &study.sites, seed).statement()))
    }
}

impl Unblinded {
    /// The allocation of `stored`, or `None` if it was not unblinded.
    pub async fn of(reader: &Reader, stored: &StoredSession) -> Result<Option<Self>, StoreError> {
        let reason = stored.events.iter().find_map(|(_, event)| match &event.kind {
            EventKind::Unblinded { reason, .. } => Some(reason.clone()),
            _ => None,
        });

        let Some(reason) = reason else { return Ok(None) };
        let study = StudyOrders::of(reader, stored.made.session).await?;
        let seed_told = match stored.made.algorithm.order() {
            // It tells nothing beyond this order, which an aborted session and the one in its place have in common.
            Order::Shuffled => true,
            // In a study, the seed of a balanced set also reveals the orders of places that nobody has taken yet.
            Order::Balanced => {
                let study_is_blinded = matches!(study, StudyOrders::Withheld);
                !study_is_blinded && reader.balanced_set(stored.made.seed).await?.may_tell_seed()
            }
        };
        Ok(Some(Self { made: stored.made.clone(), reason, seed_told, study }))
    }

    /// Writes the files that an unblinded export has in addition.
    pub async fn write(&self, reader: &Reader, folder: &mut Folder) -> Result<(), ExportError> {
        folder.table(&self.rows()).await?;
        let session = self.made.session;
        reader.export_long::<WeightsRow>(session, folder).await?;
        reader.export_long::<PolicyStepRow>(session, folder).await?;
        reader.export_long::<ChainSaltRow>(session, folder).await?;
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
        let (statement, withheld) = match &self.study {
            StudyOrders::Outside => (None, None),
            StudyOrders::Withheld => (None, Some(STUDY_WITHHELD)),
            StudyOrders::Told(statement) => (Some(statement), None),
        };
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
            "study_statement": statement,
            "study_statement_withheld": withheld,
        })
    }
}
