//! The state of a study, and the changes that it allows.

use jiff::Timestamp;
use serde::{Deserialize, Serialize};
use utoipa::ToSchema;

use super::definition::Definition;
use super::event::{StudyEvent, StudyEventKind};
use super::places::Enrolled;
use super::signature::{Channel, Signature};
use super::stage::Stage;
use crate::phase::SessionStatus;
use crate::protocol::named_policy;
use crate::refusal::Refusal;
use crate::role::Role;
use parfocal_base::PolicyName;
use parfocal_base::ids::SessionId;

/// No account is enabled, so nobody could act in the study.
const NO_ACCOUNTS: &str = "in a study everybody but the surgeon acts under a personal account, and nobody has one: make \
                           accounts first, with `parfocal account add NAME --role lead`";

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
    /// If the change does not fit the state of the study, the person may not make it, or the reason names a policy that
    /// an unblinded session has made known.
    pub fn check(
        &self,
        change: Change,
        way: Channel,
        signature: &Signature,
        circumstances: StudyCircumstances<'_>,
    ) -> Result<(), Refusal> {
        check_way(way)?;
        if circumstances.sessions.iter().any(|session| session.unblinded) {
            check_names_no_policy("reason", &signature.reason, policies(circumstances.definition))?;
        }

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
    pub fn check_takes_sessions(&self) -> Result<(), Refusal> {
        match self.stage {
            Stage::Open => Ok(()),
            stage => Err(Refusal::Conflict(format!(
                "the study is {}; sessions can be made only while it is open",
                stage.name()
            ))),
        }
    }

    fn check_open(&self, circumstances: StudyCircumstances<'_>, despite_concerns: bool) -> Result<(), Refusal> {
        let StudyCircumstances { has_accounts, concerns, .. } = circumstances;
        match self.stage {
            Stage::Planned | Stage::Closed if !has_accounts => Err(Refusal::conflict(NO_ACCOUNTS)),
            Stage::Planned if !concerns.is_empty() && !despite_concerns => {
                let concerns = concerns.join(" ");
                Err(Refusal::Conflict(format!(
                    "{concerns} Plan a new study, or confirm it (despite_concerns; as a command, --despite-concerns)"
                )))
            }
            Stage::Planned | Stage::Closed => Ok(()),
            Stage::Open => Err(Refusal::conflict("the study is open already")),
            Stage::Locked | Stage::Unblinded => Err(locked()),
        }
    }

    fn check_close(&self) -> Result<(), Refusal> {
        match self.stage {
            Stage::Open => Ok(()),
            Stage::Planned => Err(Refusal::conflict("the study has not been opened yet")),
            Stage::Closed => Err(Refusal::conflict("the study is closed already")),
            Stage::Locked | Stage::Unblinded => Err(locked()),
        }
    }

    fn check_lock(&self, circumstances: StudyCircumstances<'_>, despite_outstanding: bool) -> Result<(), Refusal> {
        match self.stage {
            Stage::Closed => {}
            Stage::Planned | Stage::Open => {
                let stage = self.stage.name();
                return Err(Refusal::Conflict(format!("the study is {stage}; close it first, then lock it")));
            }
            Stage::Locked | Stage::Unblinded => return Err(locked()),
        }

        let StudyCircumstances { sessions, on_screens, outstanding, .. } = circumstances;
        let goes_on =
            |session: &&Enrolled| session.status == SessionStatus::UnderWay || on_screens == Some(session.session);
        if let Some(session) = sessions.iter().find(goes_on) {
            return Err(under_way(&session.participant));
        }

        if outstanding > 0 && !despite_outstanding {
            return Err(Refusal::Conflict(format!(
                "for {outstanding} of its sessions, a surgeon's device may still hold comments or answers, which would \
                 then not count; wait, or confirm it (despite_outstanding; as a command, --despite-outstanding)"
            )));
        }
        Ok(())
    }

    fn check_unblind(&self, signature: &Signature, definition: &Definition) -> Result<(), Refusal> {
        match self.stage {
            Stage::Locked => {}
            Stage::Unblinded => return Err(Refusal::conflict("the study is unblinded already")),
            Stage::Planned | Stage::Open | Stage::Closed => {
                return Err(Refusal::Conflict(format!(
                    "the study is {}; a whole study can be unblinded only after it was locked",
                    self.stage.name()
                )));
            }
        }

        if !definition.may_unblind.contains(&signature.person) {
            return Err(Refusal::NotAllowed(format!(
                "'{}' is not among those who may unblind this study: {}",
                signature.person,
                definition.may_unblind.join("; ")
            )));
        }
        check_names_no_policy("reason", &signature.reason, policies(definition))
    }

    fn check_withdrawal(&self, session: SessionId, circumstances: StudyCircumstances<'_>) -> Result<(), Refusal> {
        let StudyCircumstances { sessions, on_screens, .. } = circumstances;
        let enrolled = sessions.iter().find(|enrolled| enrolled.session == session);
        let enrolled = enrolled.ok_or_else(|| Refusal::conflict("the study has no such session; reload the page"))?;
        let participant = &enrolled.participant;

        if matches!(self.stage, Stage::Locked | Stage::Unblinded) {
            return Err(locked());
        }
        if enrolled.status == SessionStatus::UnderWay || on_screens == Some(session) {
            return Err(under_way(participant));
        }
        if enrolled.withdrawn {
            return Err(Refusal::Conflict(format!("the withdrawal of {participant} is recorded already")));
        }
        Ok(())
    }
}

fn locked() -> Refusal {
    Refusal::conflict("the study is locked: nothing of it can be changed any more")
}

/// The refusal because the session of `participant` has not ended, or is still on the operator's page.
fn under_way(participant: &str) -> Refusal {
    Refusal::Conflict(format!(
        "the session of {participant} has not ended, or is still on the operator's page; close it there first"
    ))
}

/// Checks whether a study may be changed by `way`.
///
/// # Errors
/// If `way` is a role other than the researcher.
pub fn check_way(way: Channel) -> Result<(), Refusal> {
    match way {
        Channel::CommandLine | Channel::Role(Role::Researcher) => Ok(()),
        Channel::Role(_) => Err(Refusal::NotAllowed("only the researcher can change a study".to_owned())),
    }
}

/// The policies that the study compares.
fn policies(definition: &Definition) -> impl Iterator<Item = &PolicyName> {
    definition.protocols.iter().flat_map(|protocol| &protocol.policies)
}

/// Checks that `words`, a "reason" or a "note" as `what` says, name none of `policies`, because every export shows
/// them: the reason for an unblinding, and what is written after one.
///
/// # Errors
/// If they name one of the policies.
pub fn check_names_no_policy<'a>(
    what: &str,
    words: &str,
    policies: impl IntoIterator<Item = &'a PolicyName>,
) -> Result<(), Refusal> {
    match named_policy(words, policies) {
        Some(policy) => Err(Refusal::Invalid(format!(
            "the {what} names the policy '{policy}', and every export shows the {what}; remove the name"
        ))),
        None => Ok(()),
    }
}
