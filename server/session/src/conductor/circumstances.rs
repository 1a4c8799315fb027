//! Gathers from the database what the rules of blinding need to know.

use super::course::{Course, outstanding};
use super::{ConductError, Pen, Shared};
use parfocal_base::ids::SessionId;
use parfocal_trial::action::Action;
use parfocal_trial::allocation::Seed;
use parfocal_trial::grace::Grace;
use parfocal_trial::study::signature::Signature;
use parfocal_trial::study::stage::Stage;
use parfocal_trial::unblinding::{BlindedStudy, Circumstances};

/// The parts of a session that are needed to look up the circumstances of an action on it.
#[derive(Clone, Copy)]
pub(super) struct Subject {
    session: SessionId,
    seed: Seed,
    grace: Grace,
}

impl Subject {
    pub const fn of(course: &Course) -> Self {
        Self { session: course.session(), seed: course.made.seed, grace: course.grace }
    }
}

impl Shared {
    /// The circumstances that the rules need for `action`. `signature` is given for an emergency unblinding.
    pub(super) async fn circumstances(
        &self,
        pen: &mut Pen,
        subject: Subject,
        action: &Action,
        signature: Option<&Signature>,
    ) -> Result<Circumstances, ConductError> {
        match action {
            Action::Unblind { .. } => {}
            Action::GiveReason { .. } => {
                let study = self.blinded_study(subject.session, false).await?;
                return Ok(Circumstances { study, ..Circumstances::default() });
            }
            _ => return Ok(Circumstances::default()),
        }

        // The database must know whether the session in memory has ended, because it may belong to the same set.
        self.record_stops(pen).await?;
        let set = self.store.reader().balanced_set(subject.seed).await?;
        let now = self.run_clock.time(self.clock.now());
        let reader = self.store.reader();
        let outstanding = outstanding(reader, &self.run_clock.clocks, subject.session, subject.grace, now).await?;
        let study = self.blinded_study(subject.session, signature.is_some()).await?;
        Ok(Circumstances { set: Some(set), outstanding, study })
    }

    /// Checks that `words` about `session`, a "reason" or a "note" as `what` says, tell no policy in a blinded export.
    pub(super) async fn check_words(&self, session: SessionId, what: &str, words: &str) -> Result<(), ConductError> {
        match self.blinded_study(session, false).await? {
            Some(study) => Ok(study.check_words(what, words)?),
            None => Ok(()),
        }
    }

    /// The study of `session`, if it belongs to one that is still blinded.
    async fn blinded_study(&self, session: SessionId, signed: bool) -> Result<Option<BlindedStudy>, ConductError> {
        let reader = self.store.reader();
        let Some(enrolment) = reader.enrolment(session).await? else { return Ok(None) };
        let Some(study) = reader.study(&enrolment.study).await? else { return Ok(None) };
        if study.state().stage == Stage::Unblinded {
            return Ok(None);
        }

        let policies = study.definition.protocols.iter().flat_map(|protocol| protocol.policies.clone()).collect();
        let order_known = study.sessions.iter().any(|session| session.unblinded);
        Ok(Some(BlindedStudy { name: study.definition.name, policies, signed, order_known }))
    }
}
