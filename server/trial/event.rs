//! Events: everything that happens to a session, in order. They are the one truth; its state
//! follows from them.

use jiff::Timestamp;
use serde::{Deserialize, Serialize};

use super::account::AccountName;
use super::role::Role;
use crate::clock::Moment;
use crate::ids::SegmentId;

/// Something that happened.
#[derive(Debug, Clone, PartialEq)]
pub struct Event {
    /// Counts up from 1 in the session, without gaps.
    pub number: u32,
    /// Who.
    pub by: Role,
    /// The personal account under which it was done, where somebody was signed in.
    pub account: Option<AccountName>,
    /// When, by the monotonic clock of the server's run.
    pub at: Moment,
    /// When, by the server's wall clock.
    pub wall: Timestamp,
    /// What.
    pub kind: EventKind,
}

/// What happened. `inspected_ms`: time inspected in the segment so far, without pauses,
/// milliseconds.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
#[serde(tag = "kind", rename_all = "kebab-case")]
pub enum EventKind {
    /// The session was made and its order drawn.
    Created,
    /// The first notice was shown.
    Started,
    /// The notice was tapped; inspection began.
    SegmentStarted {
        /// The segment.
        segment: SegmentId,
    },
    /// Inspection ended: by whoever the event names, the system at the time limit.
    SegmentFinished {
        /// The segment.
        segment: SegmentId,
        /// Time inspected.
        inspected_ms: u64,
    },
    /// The questions after a segment, or (none) at the end, were done with.
    QuestionsFinished {
        /// The segment.
        segment: Option<SegmentId>,
    },
    /// Everything was held.
    Paused {
        /// Why.
        reason: String,
        /// Time inspected.
        inspected_ms: u64,
    },
    /// It went on.
    Resumed,
    /// The server ended during the session and came back: it is paused where it was.
    ServerRestarted {
        /// Time inspected as far as is known: up to a second less than it was.
        inspected_ms: u64,
    },
    /// The last answer was in.
    Completed,
    /// Ended early.
    Aborted {
        /// Why.
        reason: String,
        /// Time inspected in the segment under way.
        inspected_ms: u64,
    },
    /// The participant withdrew: its data stay out of exports.
    Withdrawn {
        /// Why.
        reason: String,
    },
    /// It was told which policies ran.
    Unblinded {
        /// Why.
        reason: String,
        /// Whether the session was still under way.
        emergency: bool,
    },
}

impl EventKind {
    /// Name of the kind, as in the database and in exports.
    #[must_use]
    pub const fn name(&self) -> &'static str {
        match self {
            Self::Created => "created",
            Self::Started => "started",
            Self::SegmentStarted { .. } => "segment-started",
            Self::SegmentFinished { .. } => "segment-finished",
            Self::QuestionsFinished { .. } => "questions-finished",
            Self::Paused { .. } => "paused",
            Self::Resumed => "resumed",
            Self::ServerRestarted { .. } => "server-restarted",
            Self::Completed => "completed",
            Self::Aborted { .. } => "aborted",
            Self::Withdrawn { .. } => "withdrawn",
            Self::Unblinded { .. } => "unblinded",
        }
    }

    /// The segment that it is about.
    #[must_use]
    pub const fn segment(&self) -> Option<SegmentId> {
        match self {
            Self::SegmentStarted { segment } | Self::SegmentFinished { segment, .. } => Some(*segment),
            Self::QuestionsFinished { segment } => *segment,
            _ => None,
        }
    }

    /// Time inspected in the segment by then, milliseconds, where it says.
    #[must_use]
    pub const fn inspected_ms(&self) -> Option<u64> {
        match self {
            Self::SegmentFinished { inspected_ms, .. }
            | Self::Paused { inspected_ms, .. }
            | Self::ServerRestarted { inspected_ms }
            | Self::Aborted { inspected_ms, .. } => Some(*inspected_ms),
            _ => None,
        }
    }

    /// The reason that somebody gave; it may be empty. None for what nobody gives a reason for.
    #[must_use]
    pub fn reason(&self) -> Option<&str> {
        match self {
            Self::Paused { reason, .. }
            | Self::Aborted { reason, .. }
            | Self::Withdrawn { reason }
            | Self::Unblinded { reason, .. } => Some(reason),
            _ => None,
        }
    }

    /// The same without its reason.
    #[must_use]
    pub fn without_reason(&self) -> Self {
        let mut kind = self.clone();
        match &mut kind {
            Self::Paused { reason, .. }
            | Self::Aborted { reason, .. }
            | Self::Withdrawn { reason }
            | Self::Unblinded { reason, .. } => reason.clear(),
            _ => {}
        }
        kind
    }

    /// The same without what only the researcher may read: a reason for unblinding may name a
    /// policy.
    #[must_use]
    pub fn for_the_blinded(&self) -> Self {
        match self {
            Self::Unblinded { .. } => self.without_reason(),
            other => other.clone(),
        }
    }

    /// What happened, in words; `setting` tells the number of a segment, from 1.
    #[must_use]
    pub fn in_words(&self, setting: impl Fn(SegmentId) -> usize) -> String {
        match self {
            Self::Created => "Session made".to_owned(),
            Self::Started => "Session started".to_owned(),
            Self::SegmentStarted { segment } => format!("Setting {} started", setting(*segment)),
            Self::SegmentFinished { segment, inspected_ms } => {
                format!("Setting {} finished after {}", setting(*segment), seconds(*inspected_ms))
            }
            Self::QuestionsFinished { segment: Some(segment) } => {
                format!("Questions on setting {} done", setting(*segment))
            }
            Self::QuestionsFinished { segment: None } => "Closing questions done".to_owned(),
            Self::Paused { reason, .. } => because("Paused", reason),
            Self::Resumed => "Resumed".to_owned(),
            Self::ServerRestarted { .. } => "The server restarted; paused where it was".to_owned(),
            Self::Completed => "Session completed".to_owned(),
            Self::Aborted { reason, .. } => because("Session aborted", reason),
            Self::Withdrawn { reason } => because("Withdrawn", reason),
            Self::Unblinded { reason, .. } if reason.is_empty() => "Unblinded by the researcher".to_owned(),
            Self::Unblinded { reason, emergency: false } => format!("Unblinded: {reason}"),
            Self::Unblinded { reason, emergency: true } => format!("Unblinded in an emergency: {reason}"),
        }
    }
}

/// `what` with its reason, if there is one: it may be left out, or have been erased.
fn because(what: &str, reason: &str) -> String {
    if reason.is_empty() { what.to_owned() } else { format!("{what}: {reason}") }
}

fn seconds(milliseconds: u64) -> String {
    format!("{:.1} s", milliseconds as f64 / 1000.0)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_name_is_the_tag_in_json() {
        let segment = SegmentId(uuid::Uuid::nil());
        let kinds = [
            EventKind::Created,
            EventKind::Started,
            EventKind::SegmentStarted { segment },
            EventKind::SegmentFinished { segment, inspected_ms: 1 },
            EventKind::QuestionsFinished { segment: None },
            EventKind::Paused { reason: "🫖".to_owned(), inspected_ms: 1 },
            EventKind::Resumed,
            EventKind::ServerRestarted { inspected_ms: 1 },
            EventKind::Completed,
            EventKind::Aborted { reason: String::new(), inspected_ms: 0 },
            EventKind::Withdrawn { reason: "changed their mind".to_owned() },
            EventKind::Unblinded { reason: String::new(), emergency: true },
        ];

        for kind in kinds {
            let json = serde_json::to_value(&kind).unwrap();
            assert_eq!(json["kind"], kind.name());
            assert_eq!(serde_json::from_value::<EventKind>(json).unwrap(), kind);
        }
    }
}
