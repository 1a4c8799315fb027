//! A study's events, in order. The study's state is computed from them. Each event names a person and a reason.

use jiff::Timestamp;

use super::signature::{Channel, Signature};
use parfocal_base::ids::SessionId;

/// Something that happened to a study.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct StudyEvent {
    /// Number of the event in its study: from 1, without gaps.
    pub number: u32,
    /// How it was done: on a page, or with a command.
    pub way: Channel,
    /// Person who did it, and the reason.
    pub signature: Signature,
    /// Time by the wall clock. The order of events is that of their numbers, whatever the clock did.
    pub wall: Timestamp,
    /// What happened, with its details.
    pub kind: StudyEventKind,
}

/// What happened to a study.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum StudyEventKind {
    /// The study was planned.
    Planned,
    /// The study was opened. The first opening publishes the commitment to the orders.
    Opened {
        /// Commitment to the orders; none if the study was opened again.
        commitment: Option<String>,
    },
    /// The study was closed.
    Closed,
    /// The study was locked.
    Locked,
    /// The whole study was unblinded.
    Unblinded,
    /// The surgeon of a session withdrew.
    SessionWithdrawn {
        /// Session whose surgeon withdrew.
        session: SessionId,
    },
    /// One session was unblinded in an emergency.
    SessionUnblinded {
        /// Session that was unblinded.
        session: SessionId,
    },
}

impl StudyEventKind {
    /// The kind's name, as in the database and in exports.
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

    /// The kind with this name, with the other fields of its record. None if they do not fit together.
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

    /// The session that the event is about, if any.
    pub const fn session(&self) -> Option<SessionId> {
        match self {
            Self::SessionWithdrawn { session } | Self::SessionUnblinded { session } => Some(*session),
            _ => None,
        }
    }

    /// The commitment that the event publishes, if any.
    pub fn commitment(&self) -> Option<&str> {
        match self {
            Self::Opened { commitment } => commitment.as_deref(),
            _ => None,
        }
    }

    /// A description in words. `participant` returns the code of a session's participant.
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
