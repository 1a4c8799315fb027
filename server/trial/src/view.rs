//! Views: what each role may see of a session. [`SurgeonView`] has no field for a policy, its order, its timing, its
//! metric or its focal power, and the code that serves surgeons has access to no other view.

use std::collections::BTreeMap;

use serde::Serialize;
use utoipa::ToSchema;

use super::consent::Consent;
use super::phase::Phase;
use super::question::{AnswerValue, Question};
use super::remark::CommentContent;
use super::role::Role;
use super::session::PauseCause;
use parfocal_base::ids::{SegmentId, SessionId};
use parfocal_language::Language;

/// A session as the surgeon's browser gets it. Nothing in it depends on the policy.
#[derive(Debug, Clone, PartialEq, Serialize, ToSchema)]
#[allow(clippy::struct_excessive_bools, reason = "facts that the page shows each by itself")]
pub struct SurgeonView {
    /// Random id of the session.
    pub session: SessionId,
    /// Phase of the session.
    pub phase: Phase,
    /// Whether the session is paused in that phase (by the operator, or by a restart of the server).
    pub paused: bool,
    /// What paused the session; none if it is not paused.
    pub paused_by: Option<PauseCause>,
    /// Whether the surgeon may resume the session: not after a pause by the operator.
    pub may_resume: bool,
    /// Whether the surgeon may pause the session.
    pub may_pause: bool,
    /// Whether the event that last stopped the session or its setting (a pause, an end) is not written to disk yet.
    pub unrecorded: bool,
    /// Whether this is a practice session.
    pub practice: bool,
    /// Language of all that the surgeon reads.
    pub language: Language,
    /// The protocol's title for surgeons.
    pub title: String,
    /// Random id of the current segment; none if no segment is under way. No two segments share an id.
    pub segment: Option<SegmentId>,
    /// Number of the current setting, from 1; 0 before the first.
    pub setting: usize,
    /// Number of settings in the session.
    pub settings: usize,
    /// Seconds of inspection left in the segment when the view was sent; none outside inspection.
    pub remaining_seconds: Option<f64>,
    /// Prompt to show now, for example "How does the focus feel now?"; none if none is due.
    pub prompt: Option<String>,
    /// Comments that the surgeon can give with one tap.
    pub quick_comments: Vec<String>,
    /// Whether the surgeon may comment aloud.
    pub voice: bool,
    /// Whether the protocol lets the surgeon choose what is to be in focus.
    pub pointing: bool,
    /// Whether the protocol lets the surgeon hold the focus.
    pub holding: bool,
    /// Whether the focus is held on request.
    pub focus_held: bool,
    /// Questions to show in the phases `Questions` and `Closing`.
    pub questions: Vec<Question>,
    /// Saved answers to those questions, by question id.
    pub answers: BTreeMap<String, AnswerValue>,
    /// Number of comments saved so far in this session, without those that were taken back.
    pub comments: usize,
    /// The surgeon's own words about each setting, in the order of entry; empty outside the closing questions.
    pub said: Vec<Vec<String>>,
}

/// The current session as the operator sees it. It has no policy either, because the operator stands beside the
/// surgeon.
#[derive(Debug, Clone, PartialEq, Serialize, ToSchema)]
pub struct OperatorView {
    /// What the surgeon sees.
    #[serde(flatten)]
    pub surgeon: SurgeonView,
    /// Code of the participant.
    pub participant: String,
    /// Name of the session's study; none outside studies.
    pub study: Option<String>,
    /// Name of the protocol.
    pub protocol: String,
    /// Version of the consent text that the session requires before its start; none if no consent is required.
    pub consent_required: Option<String>,
    /// The participant's consent; none if none is recorded.
    pub consent: Option<Consent>,
    /// Whether the participant withdrew.
    pub withdrawn: bool,
    /// Whether the operator may focus by hand: while the session is paused, and after an abort.
    pub may_focus_by_hand: bool,
    /// Focal power to which the operator last moved the lens by hand in this pause or after the abort; none if nobody
    /// did. It is the operator's own, and says nothing of a policy.
    pub by_hand: Option<f64>,
    /// The latest pause that has no reason yet; none if every pause has one.
    pub reason_wanted: Option<ReasonWanted>,
    /// Why the `unrecorded` event is not on disk yet; none if that is not known.
    pub unrecorded_because: Option<String>,
    /// The latest comments, newest first.
    pub latest_comments: Vec<CommentLine>,
    /// The latest events in words, newest first.
    pub log: Vec<LogLine>,
}

/// A pause whose reason can still be given.
#[derive(Debug, Clone, PartialEq, Serialize, ToSchema)]
pub struct ReasonWanted {
    /// Number of the pause among the session's events.
    pub event: u32,
    /// Role that paused the session.
    pub by: Role,
    /// Time of the pause, by the server's wall clock.
    #[schema(value_type = String)]
    pub at: jiff::Timestamp,
}

/// A comment, as it is shown.
#[derive(Debug, Clone, PartialEq, Serialize, ToSchema)]
pub struct CommentLine {
    /// Time of the comment, by the server's wall clock.
    #[schema(value_type = String)]
    pub at: jiff::Timestamp,
    /// Number of the setting, from 1; none outside settings.
    pub setting: Option<usize>,
    /// Content of the comment.
    #[serde(flatten)]
    pub said: CommentContent,
}

/// An event in words.
#[derive(Debug, Clone, PartialEq, Serialize, ToSchema)]
pub struct LogLine {
    /// Time of the event, by the server's wall clock.
    #[schema(value_type = String)]
    pub at: jiff::Timestamp,
    /// Role that caused the event.
    pub by: Role,
    /// Account of the person who caused the event, if signed in.
    pub account: Option<String>,
    /// Description of the event.
    pub text: String,
    /// Number of the session's event that this line shows, if the event has a reason that a researcher can erase.
    pub erasable_event: Option<u32>,
}
