//! Consents of participants, recorded by the operator.

use jiff::tz::{TimeZone, offset};

use super::{ConductError, Conductor, Shared};
use parfocal_base::boxed;
use parfocal_trial::account::Actor;
use parfocal_trial::consent::{self, NewConsent};

impl Conductor {
    /// Records a participant's consent. It is on disk when this returns. Recording the same consent again changes
    /// nothing.
    ///
    /// # Errors
    /// If `by` is not the operator, there is no such session, the consent is invalid, or the disk failed.
    pub async fn record_consent(&self, by: impl Into<Actor>, new: NewConsent) -> Result<(), ConductError> {
        let by = by.into();
        self.to_the_end(move |shared| async move { shared.record_consent(by, new).await }).await
    }
}

impl Shared {
    #[boxed]
    async fn record_consent(&self, by: Actor, new: NewConsent) -> Result<(), ConductError> {
        let mut pen = self.pen.lock().await;
        self.record_stops(&mut pen).await?;

        let known = self.live().course_of(new.session).map(|course| course.protocol.consent.clone());
        let required = match known {
            Some(required) => required,
            None => self.load(new.session).await?.protocol.consent.clone(),
        };
        let stamp = self.stamp();
        // The theatre's clock may be ahead of the server's, which often is on UTC. No day begins earlier than at
        // UTC+14.
        let today = stamp.wall.to_zoned(TimeZone::fixed(offset(14))).date();
        let consent = consent::check(by.role, &new.consent, required.as_deref(), today)?;

        let before = self.store.reader().consents(new.session).await?;
        if before.last().is_none_or(|latest| latest.consent != consent) {
            self.store.keep_consent(new.session, &consent, &by, stamp).await?;
        }

        let mut live = self.live();
        if let Some(course) = live.course_of(new.session) {
            course.keep_consent(consent);
            self.publish(&live);
        }
        Ok(())
    }
}
