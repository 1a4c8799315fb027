//! Why a request about a study was refused.

use super::stage::Stage;
use crate::refusal::Refusal;

/// Why a request about a study was refused. Nothing was changed.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
pub enum StudyRefusal {
    /// Only the researcher may change a study.
    #[error("only the researcher can change a study")]
    NotTheResearcher,
    /// The person's name is missing or too long.
    #[error("say who you are, in 1 to {longest} characters: it is kept with the change")]
    NoPerson {
        /// Maximum number of characters.
        longest: usize,
    },
    /// The reason is missing or too long.
    #[error("give a reason, in 1 to {longest} characters: it is kept with the change")]
    NoReason {
        /// Maximum number of characters.
        longest: usize,
    },
    /// No account is enabled, so nobody could act in the study.
    #[error(
        "in a study everybody but the surgeon acts under a personal account, and nobody has one: make accounts first, \
         with `parfocal account add NAME --role lead`"
    )]
    NoAccounts,
    /// The plan cannot work as it is meant.
    #[error("{concerns} Plan a new study, or confirm it (despite_concerns)")]
    Concerns {
        /// What cannot work, in sentences.
        concerns: String,
    },
    /// The study is already open.
    #[error("the study is open already")]
    AlreadyOpen,
    /// The study cannot be closed because it was never opened.
    #[error("the study has not been opened yet")]
    NotOpenedYet,
    /// The study is already closed.
    #[error("the study is closed already")]
    AlreadyClosed,
    /// The study must be closed first.
    #[error("the study is {}; close it first, then lock it", .0.name())]
    NotClosed(Stage),
    /// The study is locked.
    #[error("the study is locked: nothing of it can be changed any more")]
    Locked,
    /// The study must be locked first.
    #[error("the study is {}; a whole study can be unblinded only after it was locked", .0.name())]
    NotLocked(Stage),
    /// The study is already unblinded.
    #[error("the study is unblinded already")]
    AlreadyUnblinded,
    /// A session has not ended, or is still on the operator's page.
    #[error("the session of {participant} has not ended, or is still on the operator's page; close it there first")]
    SessionUnderWay {
        /// Code of the session's participant.
        participant: String,
    },
    /// Comments or answers may still arrive.
    #[error(
        "for {sessions} of its sessions, a surgeon's device may still hold comments or answers, which would then not \
         count; wait, or confirm it (despite_outstanding)"
    )]
    Outstanding {
        /// Number of sessions for which they may arrive.
        sessions: usize,
    },
    /// The definition does not allow this person to unblind the study.
    #[error("'{person}' is not among those who may unblind this study: {}", .may.join("; "))]
    MayNotUnblind {
        /// Person who asked.
        person: String,
        /// People who may unblind the study.
        may: Vec<String>,
    },
    /// The reason would reveal a policy.
    #[error("the reason names the policy '{policy}', and every export shows the reason; remove the name")]
    ReasonNamesPolicy {
        /// Name of the policy in the reason.
        policy: String,
    },
    /// The study has no such session.
    #[error("the study has no such session; reload the page")]
    UnknownSession,
    /// The surgeon's withdrawal is already recorded.
    #[error("the withdrawal of {participant} is recorded already")]
    AlreadyWithdrawn {
        /// Code of the participant.
        participant: String,
    },
    /// The study takes no sessions now, because it is not open.
    #[error("the study is {}; sessions can be made only while it is open", .0.name())]
    NotOpen(Stage),
    /// The study has no such site in this database.
    #[error("the study has no site '{site}' here; there are: {}", .here.join(", "))]
    UnknownSite {
        /// Name of the requested site.
        site: String,
        /// Sites of the study in this database.
        here: Vec<String>,
    },
    /// The study does not have this protocol.
    #[error("the study has no protocol '{protocol}'; it has: {}", .known.join(", "))]
    UnknownProtocol {
        /// Name of the requested protocol.
        protocol: String,
        /// Protocols of the study.
        known: Vec<String>,
    },
    /// The participant withdrew from the study.
    #[error("{participant} withdrew from the study; choose another participant")]
    Withdrew {
        /// Code of the participant.
        participant: String,
    },
    /// The study allows only one session for each surgeon and protocol.
    #[error("{participant} has a session by this protocol, and the study allows no second one")]
    Repeated {
        /// Code of the participant.
        participant: String,
    },
    /// No place is left in the list.
    #[error("no place is left in the list of {site}: {open} of {places} were open, all are used. {advice}")]
    UsedUp {
        /// Name of the site.
        site: String,
        /// Number of places that are open by the rules.
        open: usize,
        /// Number of places in the list, spare places included.
        places: usize,
        /// Advice of the definition for this case.
        advice: String,
    },
}

impl From<StudyRefusal> for Refusal {
    fn from(refusal: StudyRefusal) -> Self {
        let text = refusal.to_string();
        match refusal {
            StudyRefusal::NotTheResearcher | StudyRefusal::MayNotUnblind { .. } => Self::NotAllowed(text),
            StudyRefusal::NoPerson { .. }
            | StudyRefusal::NoReason { .. }
            | StudyRefusal::ReasonNamesPolicy { .. }
            | StudyRefusal::UnknownSite { .. }
            | StudyRefusal::UnknownProtocol { .. } => Self::Invalid(text),
            _ => Self::Conflict(text),
        }
    }
}
