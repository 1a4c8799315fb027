//! What happens to a study, in order: its state follows from it. Each event names a person and a reason.

use jiff::Timestamp;

use super::signature::{Signature, Way};
use crate::ids::SessionId;

/// Something that happened to a study.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct StudyEvent {
    /// Counts up from 1 in the study, without gaps.
    pub number: u32,
    /// By which way.
    pub way: Way,
    /// Who and why.
    pub signature: Signature,
    /// When, by the wall clock. The order of events is that of their numbers, whatever the clock did.
    pub wall: Timestamp,
    /// What.
    pub kind: StudyEventKind,
}

/// What happened.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum StudyEventKind {
    /// The study was planned.
    Planned,
    /// It was opened. The first opening makes the commitment to its orders known.
    Opened {
        /// The commitment; none when it was opened again.
        commitment: Option<String>,
    },
    /// It was closed.
    Closed,
    /// It was locked.
    Locked,
    /// All of it was unblinded.
    Unblinded,
    /// The surgeon of a session withdrew.
    SessionWithdrawn {
        /// The session.
        session: SessionId,
    },
    /// One session was unblinded in an emergency.
    SessionUnblinded {
        /// The session.
        session: SessionId,
    },
}

impl StudyEventKind {
    /// Name of the kind, as in the database and in exports.
    #[must_use]
    pub const fn name(&self) -> &'static str {
        match self {
            Self::Planned => "planned",
            Self::Opened { .. } => "opened",
            Self::Closed => "closed",
            Self::Locked => "locked",
            Self::Unblinded => "unblinded",
            Self::SessionWithdrawn { .. } => "session-withdrawn",
            Self::SessionUnblinded { .. } => "session-unblinded",
        }
    }

    /// The kind called `name` with what else its record has; none where that does not fit.
    #[must_use]
    pub fn of(name: &str, session: Option<SessionId>, commitment: Option<String>) -> Option<Self> {
        Some(match (name, session) {
            ("planned", None) => Self::Planned,
            ("opened", None) => Self::Opened { commitment },
            ("closed", None) => Self::Closed,
            ("locked", None) => Self::Locked,
            ("unblinded", None) => Self::Unblinded,
            ("session-withdrawn", Some(session)) => Self::SessionWithdrawn { session },
            ("session-unblinded", Some(session)) => Self::SessionUnblinded { session },
            _ => return None,
        })
    }

    /// The session that it is about.
    #[must_use]
    pub const fn session(&self) -> Option<SessionId> {
        match self {
            Self::SessionWithdrawn { session } | Self::SessionUnblinded { session } => Some(*session),
            _ => None,
        }
    }

    /// The commitment that it makes known.
    #[must_use]
    pub fn commitment(&self) -> Option<&str> {
        match self {
            Self::Opened { commitment } => commitment.as_deref(),
            _ => None,
        }
    }

    /// What happened, in words; `participant` tells the code of a session's participant.
    #[must_use]
    pub fn in_words(&self, participant: impl Fn(SessionId) -> String) -> String {
        match self {
            Self::Planned => "Study planned".to_owned(),
            Self::Opened { commitment: Some(_) } => "Orders drawn; study opened".to_owned(),
            Self::Opened { commitment: None } => "Study opened again".to_owned(),
            Self::Closed => "Study closed".to_owned(),
            Self::Locked => "Study locked".to_owned(),
            Self::Unblinded => "Study unblinded".to_owned(),
            Self::SessionWithdrawn { session } => format!("{} withdrew", participant(*session)),
            Self::SessionUnblinded { session } => {
                format!("Emergency unblinding of the session of {}", participant(*session))
            }
        }
    }
}
