//! What each role may see of a session. [`SurgeonView`] has no field for a policy, its order, its
//! timing, its metric or its focal power, and the code that serves surgeons sees no other view.

use std::collections::BTreeMap;

use serde::Serialize;
use utoipa::ToSchema;

use super::consent::Consent;
use super::phase::Phase;
use super::question::{AnswerValue, Question};
use super::remark::Said;
use super::role::Role;
use crate::ids::{SegmentId, SessionId};

/// A session as the surgeon's browser gets it. Everything in it is the same whatever the policy.
#[derive(Debug, Clone, PartialEq, Serialize, ToSchema)]
#[allow(clippy::struct_excessive_bools, reason = "facts that the page shows each by itself")]
pub struct SurgeonView {
    /// The session; random.
    pub session: SessionId,
    /// Where it stands.
    pub phase: Phase,
    /// Whether it is paused in that phase (by the operator, or by a restart of the server).
    pub paused: bool,
    /// Whether the surgeon may let it go on: after a restart of the server, not after a pause by the operator.
    pub may_resume: bool,
    /// Whether what stopped the session or its setting last (a pause, an end) is not on the disk yet.
    pub unrecorded: bool,
    /// Whether this is practice.
    pub practice: bool,
    /// The protocol's title for surgeons.
    pub title: String,
    /// The segment in progress: random, never shared by two segments.
    pub segment: Option<SegmentId>,
    /// Setting in progress, from 1; 0 before the first.
    pub setting: usize,
    /// Settings in all.
    pub settings: usize,
    /// Seconds of inspection left in the segment at the time of sending.
    pub remaining_seconds: Option<f64>,
    /// The prompt to show now, if one is due ("How does the focus feel now?").
    pub prompt: Option<String>,
    /// One-tap comments.
    pub quick_comments: Vec<String>,
    /// Whether the surgeon may comment aloud.
    pub voice: bool,
    /// The questions to show in `Questions` and `Closing`.
    pub questions: Vec<Question>,
    /// Answers already kept for those questions, by question id.
    pub answers: BTreeMap<String, AnswerValue>,
    /// Comments kept so far in this session.
    pub comments: usize,
}

/// The session under way as the operator sees it. No policy either: the operator stands beside the surgeon.
#[derive(Debug, Clone, PartialEq, Serialize, ToSchema)]
pub struct OperatorView {
    /// What the surgeon sees.
    #[serde(flatten)]
    pub surgeon: SurgeonView,
    /// Participant's code.
    pub participant: String,
    /// The study that it belongs to; none outside any study.
    pub study: Option<String>,
    /// Protocol's name.
    pub protocol: String,
    /// The version of the consent text without which the session does not start; none where none is required.
    pub consent_required: Option<String>,
    /// What the participant consented to, if that is recorded.
    pub consent: Option<Consent>,
    /// Whether the participant withdrew.
    pub withdrawn: bool,
    /// Why the disk has not taken what is `unrecorded`, as far as it has said.
    pub unrecorded_because: Option<String>,
    /// The latest comments, newest first.
    pub latest_comments: Vec<CommentLine>,
    /// The latest events in words, newest first.
    pub log: Vec<LogLine>,
}

/// A comment for reading.
#[derive(Debug, Clone, PartialEq, Serialize, ToSchema)]
pub struct CommentLine {
    /// When, by the server's wall clock.
    #[schema(value_type = String)]
    pub at: jiff::Timestamp,
    /// Setting, from 1.
    pub setting: Option<usize>,
    /// What was said.
    #[serde(flatten)]
    pub said: Said,
}

/// An event in words.
#[derive(Debug, Clone, PartialEq, Serialize, ToSchema)]
pub struct LogLine {
    /// When, by the server's wall clock.
    #[schema(value_type = String)]
    pub at: jiff::Timestamp,
    /// Who.
    pub by: Role,
    /// The account of whoever it was, where the person was signed in.
    pub account: Option<String>,
    /// What happened.
    pub text: String,
    /// The number of the session's event that it tells, where the event has a reason that a researcher can erase.
    pub erasable_event: Option<u32>,
}
