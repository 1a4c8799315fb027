//! Why something was not done to a study.

use super::stage::Stage;
use crate::trial::refusal::Refusal;

/// Why something was not done to a study. Nothing was changed.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
pub enum StudyRefusal {
    /// Another role does this.
    #[error("only the researcher can change a study")]
    NotTheResearcher,
    /// Nobody signed.
    #[error("say who you are, in 1 to {longest} characters: it is kept with the change")]
    NoPerson {
        /// Most characters.
        longest: usize,
    },
    /// No reason was given.
    #[error("give a reason, in 1 to {longest} characters: it is kept with the change")]
    NoReason {
        /// Most characters.
        longest: usize,
    },
    /// Nobody could act in it.
    #[error(
        "in a study everybody but the surgeon acts under a personal account, and nobody has one: make accounts first, \
         with `parfocal account add NAME --role lead`"
    )]
    NoAccounts,
    /// It is open.
    #[error("the study is open already")]
    AlreadyOpen,
    /// It cannot be closed before it was opened.
    #[error("the study has not been opened yet")]
    NotOpenedYet,
    /// It is closed.
    #[error("the study is closed already")]
    AlreadyClosed,
    /// It has to be closed first.
    #[error("the study is {}; close it first, then lock it", .0.name())]
    NotClosed(Stage),
    /// It is locked.
    #[error("the study is locked: nothing of it can be changed any more")]
    Locked,
    /// It has to be locked first.
    #[error("the study is {}; a whole study can be unblinded only after it was locked", .0.name())]
    NotLocked(Stage),
    /// It is unblinded.
    #[error("the study is unblinded already")]
    AlreadyUnblinded,
    /// A session has not ended.
    #[error("the session of {participant} has not ended, or is still on the operator's page; close it there first")]
    SessionUnderWay {
        /// Its participant.
        participant: String,
    },
    /// Something may still come in.
    #[error(
        "for {sessions} of its sessions a surgeon's device may still hold something that would then not count; \
         wait, or confirm it (despite_outstanding)"
    )]
    Outstanding {
        /// How many.
        sessions: usize,
    },
    /// The definition names others.
    #[error("'{person}' is not among those who may unblind this study: {}", .may.join("; "))]
    MayNotUnblind {
        /// Who asked.
        person: String,
        /// Who may.
        may: Vec<String>,
    },
    /// The reason would tell.
    #[error("the reason names the policy '{policy}', and every export tells the reason; write it without")]
    ReasonNamesPolicy {
        /// Which.
        policy: String,
    },
    /// It has no such session.
    #[error("the study has no such session; reload the page")]
    UnknownSession,
    /// The surgeon withdrew before.
    #[error("the withdrawal of {participant} is recorded already")]
    AlreadyWithdrawn {
        /// Whose.
        participant: String,
    },
    /// It takes no sessions now.
    #[error("the study is {}; sessions can be made only while it is open", .0.name())]
    NotOpen(Stage),
    /// It is not run at this site.
    #[error("the study has no site '{site}' here; there are: {}", .here.join(", "))]
    UnknownSite {
        /// The site asked for.
        site: String,
        /// Those of this database.
        here: Vec<String>,
    },
    /// It does not have this protocol.
    #[error("the study has no protocol '{protocol}'; it has: {}", .known.join(", "))]
    UnknownProtocol {
        /// The protocol asked for.
        protocol: String,
        /// Those of the study.
        known: Vec<String>,
    },
    /// The participant withdrew.
    #[error("{participant} withdrew from the study; choose another participant")]
    Withdrew {
        /// Who.
        participant: String,
    },
    /// The study wants one session of each surgeon.
    #[error("{participant} has a session by this protocol, and the study allows no second one")]
    Repeated {
        /// Who.
        participant: String,
    },
    /// There is no place left.
    #[error("no place is left in the list of {site}: {open} of {places} were open, all are used. {advice}")]
    UsedUp {
        /// The site.
        site: String,
        /// Places that the rules opened.
        open: usize,
        /// The length of the list.
        places: usize,
        /// What the definition says to do.
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
