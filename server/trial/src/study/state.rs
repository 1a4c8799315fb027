//! The state of a study, and the changes that it allows.

use jiff::Timestamp;
use serde::{Deserialize, Serialize};
use utoipa::ToSchema;

use super::definition::Definition;
use super::event::{StudyEvent, StudyEventKind};
use super::places::Enrolled;
use super::refusal::StudyRefusal;
use super::signature::{Channel, Signature};
use super::stage::Stage;
use crate::phase::SessionStatus;
use crate::role::Role;
use parfocal_base::PolicyName;
use parfocal_base::ids::SessionId;

/// A change to a study that a person requests.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, ToSchema)]
#[serde(tag = "change", rename_all = "kebab-case")]
#[schema(as = StudyAction)]
pub enum Change {
    /// Allow sessions to be made. The first time, the orders are drawn.
    Open {
        /// Whether to open it the first time although its plan has concerns.
        #[serde(default)]
        despite_concerns: bool,
    },
    /// Allow no more sessions to be made.
    Close,
    /// Allow no more changes to the study or its sessions.
    Lock {
        /// Whether to lock even though comments and answers that a surgeon's device still holds will then not count.
        #[serde(default)]
        despite_outstanding: bool,
    },
    /// Reveal which policies ran.
    Unblind,
    /// Record that the surgeon of a session withdrew.
    Withdraw {
        /// Session of the surgeon.
        session: SessionId,
    },
}

/// The state of a study.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct StudyState {
    /// Stage of the study.
    pub stage: Stage,
    /// Commitment to the study's orders; none before they are drawn.
    pub commitment: Option<String>,
    /// When the study was locked, by the wall clock; none if it was not.
    pub locked: Option<Timestamp>,
    /// Number of the study's events.
    pub events: u32,
}

/// Facts besides the study's own state that a change depends on.
#[derive(Debug, Clone, Copy)]
pub struct StudyCircumstances<'a> {
    /// What in the plan cannot work as it is meant.
    pub concerns: &'a [String],
    /// Definition of the study.
    pub definition: &'a Definition,
    /// Sessions of the study, in the order in which they were made.
    pub sessions: &'a [Enrolled],
    /// Session that the operator's page shows, whether or not it has ended; none if it shows none.
    pub on_screens: Option<SessionId>,
    /// Number of sessions for which a surgeon's device may still hold something that counts.
    pub outstanding: usize,
    /// Whether any account is enabled, so that somebody can sign in.
    pub has_accounts: bool,
}

impl StudyState {
    /// The state after `events`.
    #[must_use]
    pub fn after(events: &[StudyEvent]) -> Self {
        let mut state = Self { stage: Stage::Planned, commitment: None, locked: None, events: 0 };
        for event in events {
            state.apply(event);
        }
        state
    }

    fn apply(&mut self, event: &StudyEvent) {
        self.events = event.number;
        match &event.kind {
            StudyEventKind::Planned => self.stage = Stage::Planned,
            StudyEventKind::Opened { commitment } => {
                self.stage = Stage::Open;
                if let Some(commitment) = commitment {
                    self.commitment = Some(commitment.clone());
                }
            }
            StudyEventKind::Closed => self.stage = Stage::Closed,
            StudyEventKind::Locked => {
                self.stage = Stage::Locked;
                self.locked = Some(event.wall);
            }
            StudyEventKind::Unblinded => self.stage = Stage::Unblinded,
            StudyEventKind::SessionWithdrawn { .. } | StudyEventKind::SessionUnblinded { .. } => {}
        }
    }

    /// Checks whether the person with this signature may make `change`.
    ///
    /// # Errors
    /// If the change does not fit the state of the study, or the person may not make it.
    pub fn check(
        &self,
        change: Change,
        way: Channel,
        signature: &Signature,
        circumstances: StudyCircumstances<'_>,
    ) -> Result<(), StudyRefusal> {
        check_way(way)?;
        match change {
            Change::Open { despite_concerns } => self.check_open(circumstances, despite_concerns),
            Change::Close => self.check_close(),
            Change::Lock { despite_outstanding } => self.check_lock(circumstances, despite_outstanding),
            Change::Unblind => self.check_unblind(signature, circumstances.definition),
            Change::Withdraw { session } => self.check_withdrawal(session, circumstances),
        }
    }

    /// Checks whether sessions can be made.
    ///
    /// # Errors
    /// If the study is not open.
    pub const fn check_takes_sessions(&self) -> Result<(), StudyRefusal> {
        match self.stage {
            Stage::Open => Ok(()),
            stage => Err(StudyRefusal::NotOpen(stage)),
        }
    }

    fn check_open(&self, circumstances: StudyCircumstances<'_>, despite_concerns: bool) -> Result<(), StudyRefusal> {
        let StudyCircumstances { has_accounts, concerns, .. } = circumstances;
        match self.stage {
            Stage::Planned | Stage::Closed if !has_accounts => Err(StudyRefusal::NoAccounts),
            Stage::Planned if !concerns.is_empty() && !despite_concerns => {
                Err(StudyRefusal::Concerns { concerns: concerns.join(" ") })
            }
            Stage::Planned | Stage::Closed => Ok(()),
            Stage::Open => Err(StudyRefusal::AlreadyOpen),
            Stage::Locked | Stage::Unblinded => Err(StudyRefusal::Locked),
        }
    }

    const fn check_close(&self) -> Result<(), StudyRefusal> {
        match self.stage {
            Stage::Open => Ok(()),
            Stage::Planned => Err(StudyRefusal::NotOpenedYet),
            Stage::Closed => Err(StudyRefusal::AlreadyClosed),
            Stage::Locked | Stage::Unblinded => Err(StudyRefusal::Locked),
        }
    }

    fn check_lock(&self, circumstances: StudyCircumstances<'_>, despite_outstanding: bool) -> Result<(), StudyRefusal> {
        match self.stage {
            Stage::Closed => {}
            Stage::Planned | Stage::Open => return Err(StudyRefusal::NotClosed(self.stage)),
            Stage::Locked | Stage::Unblinded => return Err(StudyRefusal::Locked),
        }

        let StudyCircumstances { sessions, on_screens, outstanding, .. } = circumstances;
        let goes_on =
            |session: &&Enrolled| session.status == SessionStatus::UnderWay || on_screens == Some(session.session);
        if let Some(session) = sessions.iter().find(goes_on) {
            return Err(StudyRefusal::SessionUnderWay { participant: session.participant.clone() });
        }

        if outstanding > 0 && !despite_outstanding {
            return Err(StudyRefusal::Outstanding { sessions: outstanding });
        }
        Ok(())
    }

    fn check_unblind(&self, signature: &Signature, definition: &Definition) -> Result<(), StudyRefusal> {
        match self.stage {
            Stage::Locked => {}
            Stage::Unblinded => return Err(StudyRefusal::AlreadyUnblinded),
            Stage::Planned | Stage::Open | Stage::Closed => return Err(StudyRefusal::NotLocked(self.stage)),
        }

        if !definition.may_unblind.contains(&signature.person) {
            let may = definition.may_unblind.clone();
            return Err(StudyRefusal::MayNotUnblind { person: signature.person.clone(), may });
        }
        let policies = definition.protocols.iter().flat_map(|protocol| &protocol.policies);
        check_unblinding_reason(&signature.reason, policies)
    }

    fn check_withdrawal(&self, session: SessionId, circumstances: StudyCircumstances<'_>) -> Result<(), StudyRefusal> {
        let StudyCircumstances { sessions, on_screens, .. } = circumstances;
        let enrolled = sessions.iter().find(|enrolled| enrolled.session == session);
        let enrolled = enrolled.ok_or(StudyRefusal::UnknownSession)?;
        let participant = enrolled.participant.clone();

        if matches!(self.stage, Stage::Locked | Stage::Unblinded) {
            return Err(StudyRefusal::Locked);
        }
        if enrolled.status == SessionStatus::UnderWay || on_screens == Some(session) {
            return Err(StudyRefusal::SessionUnderWay { participant });
        }
        if enrolled.withdrawn {
            return Err(StudyRefusal::AlreadyWithdrawn { participant });
        }
        Ok(())
    }
}

/// Checks whether a study may be changed by `way`.
///
/// # Errors
/// If `way` is a role other than the researcher.
pub fn check_way(way: Channel) -> Result<(), StudyRefusal> {
    match way {
        Channel::CommandLine | Channel::Role(Role::Researcher) => Ok(()),
        Channel::Role(_) => Err(StudyRefusal::NotTheResearcher),
    }
}

/// Checks that the reason for an unblinding names none of `policies`, because every export shows the reason. A name
/// without a dash ("fixed") is also an ordinary word, which the reason may use.
///
/// # Errors
/// If the reason names one of the policies.
pub fn check_unblinding_reason<'a>(
    reason: &str,
    policies: impl IntoIterator<Item = &'a PolicyName>,
) -> Result<(), StudyRefusal> {
    let reason = reason.to_lowercase();
    let mut names = policies.into_iter().map(PolicyName::as_str).filter(|name| name.contains('-'));
    match names.find(|name| reason.contains(name)) {
        Some(policy) => Err(StudyRefusal::ReasonNamesPolicy { policy: policy.to_owned() }),
        None => Ok(()),
    }
}
