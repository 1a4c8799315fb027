//! Events: everything that happens to a session, in order. They are the only source of truth: the session's state is
//! computed from them.

use jiff::Timestamp;
use serde::{Deserialize, Serialize};

use super::account::AccountName;
use super::pointing::{Choice, Touch};
use super::role::Role;
use super::tablet::PictureSize;
use parfocal_base::clock::Moment;
use parfocal_base::ids::SegmentId;
use parfocal_base::{FocalPower, PatchPlace};

/// Something that happened to a session.
#[derive(Debug, Clone, PartialEq)]
pub struct Event {
    /// Number of the event in its session: from 1, without gaps.
    pub number: u32,
    /// Role that caused the event.
    pub by: Role,
    /// Personal account of the person who caused the event, if signed in.
    pub account: Option<AccountName>,
    /// Time by the monotonic clock of the server's run.
    pub at: Moment,
    /// Time by the server's wall clock.
    pub wall: Timestamp,
    /// What happened, with its details.
    pub kind: EventKind,
}

/// What happened. `inspected_ms`: time inspected in the segment so far, without pauses, in milliseconds.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(tag = "kind", rename_all = "kebab-case")]
pub enum EventKind {
    /// The session was made, and its order was drawn.
    Created,
    /// The first notice was shown.
    Started,
    /// The notice was tapped; inspection began.
    SegmentStarted {
        /// Segment that started.
        segment: SegmentId,
    },
    /// Inspection ended. At the time limit it is the system that ends it.
    SegmentFinished {
        /// Segment that finished.
        segment: SegmentId,
        /// Total time inspected, milliseconds.
        inspected_ms: u64,
    },
    /// The questions after a segment, or the closing questions, were done.
    QuestionsFinished {
        /// Segment that the questions are about; none for the closing questions.
        segment: Option<SegmentId>,
    },
    /// The session was paused.
    Paused {
        /// Reason for the pause; may be empty.
        reason: String,
        /// Time inspected so far, milliseconds.
        inspected_ms: u64,
    },
    /// The reason for an earlier event was given.
    ReasonGiven {
        /// Number of that event.
        about: u32,
        /// Its reason.
        reason: String,
    },
    /// The operator moved the lens by hand, while the session was paused or after an abort. If the lens moves on within
    /// a second, only its first and its last place are recorded.
    FocusedByHand {
        /// Where the lens was sent.
        focal_power: FocalPower,
        /// Where the lens was before; the segment continues from there. None if it was moved by hand before.
        #[serde(default, skip_serializing_if = "Option::is_none")]
        left_at: Option<FocalPower>,
    },
    /// No tablet shows the surgeon's page any longer.
    TabletAway {
        /// Whether a tablet has the page open, but behind something else or with its screen off.
        hidden: bool,
    },
    /// A tablet shows the surgeon's page again.
    TabletBack,
    /// What the surgeon saw for a while: until the size of the picture changed, or the inspection ended or paused.
    PicturesSeen(Seen),
    /// Somebody chose what is to be in focus: the patch went to the place that was touched.
    PatchPlaced {
        /// Segment that was inspected.
        segment: SegmentId,
        /// Number of the frame that was on screen.
        frame: u64,
        /// Where it was touched: mosaic cells from the picture's left edge.
        x: f64,
        /// Where it was touched: mosaic cells from the picture's top edge.
        y: f64,
        /// The patch's place in the bright circle.
        place: PatchPlace,
    },
    /// The patch went back to the centre of the bright circle.
    PatchCentred {
        /// Segment that was inspected.
        segment: SegmentId,
        /// Number of the frame that was on screen.
        frame: u64,
    },
    /// The focus was held where it was, while the inspection goes on.
    FocusHeld {
        /// Segment that was inspected.
        segment: SegmentId,
    },
    /// The focus is no longer held. A pause and the end of the segment release it too.
    FocusReleased {
        /// Segment that was inspected.
        segment: SegmentId,
    },
    /// The session was resumed.
    Resumed,
    /// The server stopped during the session and was started again. The session is paused where it was.
    ServerRestarted {
        /// Known time inspected, milliseconds: up to a second less than the true time.
        inspected_ms: u64,
    },
    /// The session ran to its end, with all required answers.
    Completed,
    /// The session was ended early.
    Aborted {
        /// Reason for the abort.
        reason: String,
        /// Time inspected in the current segment, milliseconds.
        inspected_ms: u64,
    },
    /// The participant withdrew. Exports leave out the session's data.
    Withdrawn {
        /// Reason for the withdrawal.
        reason: String,
    },
    /// The policies that ran were revealed.
    Unblinded {
        /// Reason for the unblinding.
        reason: String,
        /// Whether it was an emergency: the session was still under way, or its study was still blinded.
        emergency: bool,
    },
}

/// What the surgeon saw for a while, all of it of one size.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
pub struct Seen {
    /// Segment that was inspected.
    pub segment: SegmentId,
    /// Size of the pictures.
    #[serde(flatten)]
    pub size: PictureSize,
    /// Number of pictures drawn.
    pub pictures: u64,
    /// For how long, milliseconds.
    pub over_ms: u64,
}

impl EventKind {
    /// The kind's name, as in the database and in exports.
    pub const fn name(&self) -> &'static str {
        match self {
            Self::Created => "created",
            Self::Started => "started",
            Self::SegmentStarted { .. } => "segment-started",
            Self::SegmentFinished { .. } => "segment-finished",
            Self::QuestionsFinished { .. } => "questions-finished",
            Self::Paused { .. } => "paused",
            Self::ReasonGiven { .. } => "reason-given",
            Self::FocusedByHand { .. } => "focused-by-hand",
            Self::TabletAway { .. } => "tablet-away",
            Self::TabletBack => "tablet-back",
            Self::PicturesSeen(_) => "pictures-seen",
            Self::PatchPlaced { .. } => "patch-placed",
            Self::PatchCentred { .. } => "patch-centred",
            Self::FocusHeld { .. } => "focus-held",
            Self::FocusReleased { .. } => "focus-released",
            Self::Resumed => "resumed",
            Self::ServerRestarted { .. } => "server-restarted",
            Self::Completed => "completed",
            Self::Aborted { .. } => "aborted",
            Self::Withdrawn { .. } => "withdrawn",
            Self::Unblinded { .. } => "unblinded",
        }
    }

    /// The segment that the event is about, if any.
    pub const fn segment(&self) -> Option<SegmentId> {
        match self {
            Self::SegmentStarted { segment }
            | Self::SegmentFinished { segment, .. }
            | Self::PicturesSeen(Seen { segment, .. })
            | Self::PatchPlaced { segment, .. }
            | Self::PatchCentred { segment, .. }
            | Self::FocusHeld { segment }
            | Self::FocusReleased { segment } => Some(*segment),
            Self::QuestionsFinished { segment } => *segment,
            _ => None,
        }
    }

    /// Time inspected in the segment up to the event, milliseconds; none if the event does not record it.
    pub const fn inspected_ms(&self) -> Option<u64> {
        match self {
            Self::SegmentFinished { inspected_ms, .. }
            | Self::Paused { inspected_ms, .. }
            | Self::ServerRestarted { inspected_ms }
            | Self::Aborted { inspected_ms, .. } => Some(*inspected_ms),
            _ => None,
        }
    }

    /// The reason that was given, which may be empty. None for events that have no reason.
    pub fn reason(&self) -> Option<&str> {
        match self {
            Self::Paused { reason, .. }
            | Self::ReasonGiven { reason, .. }
            | Self::Aborted { reason, .. }
            | Self::Withdrawn { reason }
            | Self::Unblinded { reason, .. } => Some(reason),
            _ => None,
        }
    }

    /// Whether the reason was given for the whole study of the session, which is `in_study` or not. All sessions of the
    /// study have it then.
    pub const fn has_reason_of_study(&self, in_study: bool) -> bool {
        // Unblinding one session of a study is always an emergency.
        in_study && matches!(self, Self::Unblinded { emergency: false, .. })
    }

    /// Number of the event that this one is about, if any.
    pub const fn about(&self) -> Option<u32> {
        match self {
            Self::ReasonGiven { about, .. } => Some(*about),
            _ => None,
        }
    }

    /// Where the lens was sent by hand; none for other events.
    pub const fn focal_power(&self) -> Option<FocalPower> {
        match self {
            Self::FocusedByHand { focal_power, .. } => Some(*focal_power),
            _ => None,
        }
    }

    /// Where the lens was before it was moved by hand; none for other events, and if it was moved by hand before.
    pub const fn left_at(&self) -> Option<FocalPower> {
        match self {
            Self::FocusedByHand { left_at, .. } => *left_at,
            _ => None,
        }
    }

    /// Whether a tablet that is away has the page open, but not on screen; none for other events.
    pub const fn hidden(&self) -> Option<bool> {
        match self {
            Self::TabletAway { hidden } => Some(*hidden),
            _ => None,
        }
    }

    /// What the surgeon saw; none for other events.
    pub const fn seen(&self) -> Option<Seen> {
        match self {
            Self::PicturesSeen(seen) => Some(*seen),
            _ => None,
        }
    }

    /// The choice of what is to be in focus; none for other events.
    pub const fn choice(&self) -> Option<Choice> {
        match self {
            Self::PatchPlaced { frame, x, y, place, .. } => {
                Some(Choice { frame: *frame, at: Some(Touch { x: *x, y: *y }), place: *place })
            }
            Self::PatchCentred { frame, .. } => Some(Choice { frame: *frame, at: None, place: PatchPlace::CENTRE }),
            _ => None,
        }
    }

    /// A copy without what only the researcher may read: the reason for unblinding, which may name a policy.
    #[must_use]
    pub fn for_the_blinded(&self) -> Self {
        match self {
            Self::Unblinded { emergency, .. } => Self::Unblinded { reason: String::new(), emergency: *emergency },
            other => other.clone(),
        }
    }

    /// A description in words. `setting` returns the number of a segment, from 1.
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
            Self::ReasonGiven { about, reason } => because(&format!("Reason for event {about}"), reason),
            Self::FocusedByHand { focal_power, .. } => format!("Focused by hand to {:.3}", focal_power.get()),
            Self::TabletAway { hidden: false } => "The surgeon’s tablet is away".to_owned(),
            Self::TabletAway { hidden: true } => "The surgeon’s page is not on screen".to_owned(),
            Self::TabletBack => "The surgeon’s tablet is back".to_owned(),
            Self::PicturesSeen(Seen { segment, size, pictures, over_ms }) => {
                let rate = per_second(*pictures, *over_ms);
                let PictureSize { width, height } = size;
                format!("Setting {} seen at {width}x{height}, {rate:.1} pictures a second", setting(*segment))
            }
            Self::PatchPlaced { x, y, .. } => format!("Focus pointed at {x:.0}, {y:.0}"),
            Self::PatchCentred { .. } => "Focus pointed at the centre".to_owned(),
            Self::FocusHeld { .. } => "Focus held".to_owned(),
            Self::FocusReleased { .. } => "Focus released".to_owned(),
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

/// `what` with its reason. The reason may be empty, because none was given or because it was erased.
fn because(what: &str, reason: &str) -> String {
    if reason.is_empty() { what.to_owned() } else { format!("{what}: {reason}") }
}

/// Pictures a second; 0 for no time.
pub fn per_second(pictures: u64, over_ms: u64) -> f64 {
    if over_ms == 0 { 0.0 } else { pictures as f64 * 1000.0 / over_ms as f64 }
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
            EventKind::ReasonGiven { about: 4, reason: "🫖".to_owned() },
            EventKind::FocusedByHand { focal_power: FocalPower::MIDDLE, left_at: None },
            EventKind::TabletAway { hidden: true },
            EventKind::TabletBack,
            EventKind::PicturesSeen(Seen {
                segment,
                size: PictureSize { width: 512, height: 272 },
                pictures: 20,
                over_ms: 1000,
            }),
            EventKind::PatchPlaced { segment, frame: 7, x: 300.25, y: 90.5, place: PatchPlace::nearest(0.25, -0.5) },
            EventKind::PatchCentred { segment, frame: 9 },
            EventKind::FocusHeld { segment },
            EventKind::FocusReleased { segment },
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
