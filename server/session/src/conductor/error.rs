//! Errors of the conductor.

use parfocal_base::ids::SessionId;
use parfocal_language::Message;
use parfocal_records::store::StoreError;
use parfocal_trial::refusal::{Refusal, RefusalKind};

/// The reason why the conductor did not do something.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
pub enum ConductError {
    /// There is no such session, segment or question, or it is not the one under way.
    #[error("{0}")]
    NotFound(String),
    /// Only another role may do this.
    #[error("{0}")]
    Forbidden(String),
    /// The session's state does not allow it; nothing was changed.
    #[error("{0}")]
    Conflict(String),
    /// The request is invalid; the text says which part.
    #[error("{0}")]
    Invalid(String),
    /// The same as one of the above; a surgeon can meet it, and reads it in the session's language.
    #[error("{1}")]
    Said(RefusalKind, Message),
    /// The disk or database failed; nothing was acknowledged.
    #[error("could not be saved: {0}")]
    Storage(String),
    /// A recording cannot be read; the text says why.
    #[error("{0}")]
    Damaged(String),
    /// The session's protocol is of another version or is damaged.
    #[error(
        "session {session} was made with a protocol that this version cannot read ({reason}); \
         use the version that made it, or another folder with --data-dir"
    )]
    Unreadable {
        /// The session.
        session: SessionId,
        /// Why it cannot be read.
        reason: String,
    },
}

impl ConductError {
    /// The server ends before it has an answer.
    pub(crate) fn ending() -> Self {
        Self::Damaged("the server is ending".to_owned())
    }

    pub(crate) fn no_session() -> Self {
        Self::Said(RefusalKind::Unknown, Message::new("refused-no-session"))
    }
}

impl From<StoreError> for ConductError {
    fn from(error: StoreError) -> Self {
        Self::Storage(error.to_string())
    }
}

impl From<Refusal> for ConductError {
    fn from(refusal: Refusal) -> Self {
        let text = refusal.to_string();
        match refusal {
            Refusal::NotAllowed(_) => Self::Forbidden(text),
            Refusal::Conflict(_) => Self::Conflict(text),
            Refusal::Invalid(_) => Self::Invalid(text),
            Refusal::Said(kind, message) => Self::Said(kind, message),
        }
    }
}
