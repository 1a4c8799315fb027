//! What is analysed of a study, wherever it was read: in a database, or in the exports of a package.

use jiff::Timestamp;

use super::report::{AnalysedSession, Words};
use parfocal_base::ids::{SegmentId, SessionId};
use parfocal_records::store::LensMotion;
use parfocal_trial::phase::SessionStatus;
use parfocal_trial::protocol::Protocol;
use parfocal_trial::question::AnswerValue;
use parfocal_trial::remark::CommentContent;

/// Remark on a session whose participant withdrew.
const WITHDRAWN: &str = "withdrawn";

/// A study, read and not analysed yet.
pub struct StudyRecords {
    /// Name of the study.
    pub study: String,
    /// Title of the study.
    pub title: String,
    /// SHA-256 of the study's definition.
    pub definition_sha256: String,
    /// The planned analysis, as in the definition.
    pub planned: String,
    /// Names of all sites of the definition, in its order.
    pub defined_sites: Vec<String>,
    /// Names of the sites that the records come from.
    pub sites: Vec<String>,
    /// When the study was unblinded; of several databases, when the last one was.
    pub unblinded: Timestamp,
    /// Notes on where the records come from.
    pub notes: Vec<String>,
    /// The sessions, by protocol.
    pub protocols: Vec<ProtocolRecords>,
}

/// The sessions of a protocol.
pub struct ProtocolRecords {
    /// The protocol.
    pub protocol: Protocol,
    /// Every session, in the order in which they were made, with the records of those that count. Withdrawn sessions
    /// come last.
    pub sessions: Vec<(AnalysedSession, Option<SessionRecords>)>,
}

/// The records of a session that counts.
pub struct SessionRecords {
    /// The session.
    pub session: SessionId,
    /// The surgeon's code, corrected if it was.
    pub surgeon: String,
    /// Name of the site.
    pub site: String,
    /// The session's settings in order: the segment, and the policy that ran in it.
    pub settings: Vec<(SegmentId, String)>,
    /// How the lens was driven in each setting that has telemetry.
    pub motions: Vec<LensMotion>,
    /// The comments, in order.
    pub comments: Vec<CommentRecord>,
    /// The answers that count, in order.
    pub answers: Vec<AnswerRecord>,
}

/// A comment.
pub struct CommentRecord {
    /// The segment that it is about; none outside all settings.
    pub segment: Option<SegmentId>,
    /// Its words.
    pub words: Words,
}

/// An answer that counts.
pub struct AnswerRecord {
    /// Id of the question.
    pub question: String,
    /// The segment that it is about; none for a closing question.
    pub segment: Option<SegmentId>,
    /// The value, with its correction.
    pub value: AnswerValue,
    /// Whether its words were erased.
    pub erased: bool,
}

/// The line of the report about a session that was not withdrawn. `emergency`: whether it was unblinded alone.
pub fn line(session: SessionId, site: &str, surgeon: &str, status: SessionStatus, emergency: bool) -> AnalysedSession {
    let (counts, remark) = match status {
        SessionStatus::Completed if emergency => (true, Some("counts, though it was unblinded before the study was")),
        SessionStatus::Completed => (true, None),
        SessionStatus::Aborted => (false, Some("aborted")),
        SessionStatus::UnderWay => (false, Some("not completed")),
    };
    AnalysedSession {
        session,
        surgeon: Some(surgeon.to_owned()),
        site: site.to_owned(),
        counts,
        remark: remark.map(str::to_owned),
    }
}

/// The line of the report about a withdrawn session. It contributes nothing, not even the surgeon's code.
pub fn withdrawn(session: SessionId, site: &str) -> AnalysedSession {
    AnalysedSession { session, surgeon: None, site: site.to_owned(), counts: false, remark: Some(WITHDRAWN.to_owned()) }
}

/// The words of a comment. `typed` is the transcript of a voice comment; `erased` is whether the comment
/// itself was erased.
pub fn comment_words(said: CommentContent, typed: Option<&str>, late: bool, erased: bool) -> Option<Words> {
    let is_typed = said == CommentContent::Voice && typed.is_some();
    let text = match said {
        CommentContent::Text(text) | CommentContent::Quick(text) => text,
        CommentContent::Mark => "Marked a moment".to_owned(),
        // A voice comment can be read once it is transcribed.
        CommentContent::Voice => typed.unwrap_or("Voice comment, not transcribed yet").to_owned(),
        CommentContent::Withdrawal(_) => return None,
    };
    // The sound may be erased while its transcript is kept.
    Some(Words { question: None, text, late, erased: erased && !is_typed })
}
