//! Why a request was refused.

use parfocal_language::Message;

/// Why a request was refused. Nothing was changed.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
pub enum Refusal {
    /// Only another role may do this.
    #[error("{0}")]
    NotAllowed(String),
    /// The request does not fit the present state.
    #[error("{0}")]
    Conflict(String),
    /// The request is not valid.
    #[error("{0}")]
    Invalid(String),
    /// The same as one of the above; a surgeon can meet it, and reads it in the session's language.
    #[error("{1}")]
    Said(RefusalKind, Message),
}

/// The kinds of refusal that a surgeon can meet.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum RefusalKind {
    /// There is no such session, setting or question.
    Unknown,
    /// The request does not fit the present state.
    Conflict,
    /// The request is not valid.
    Invalid,
}

impl Refusal {
    /// A refusal because only `who` may do this.
    pub fn only(who: &str) -> Self {
        Self::NotAllowed(format!("only {who} can do this"))
    }

    /// The session has no such segment.
    pub const fn unknown_segment() -> Self {
        Self::Said(RefusalKind::Unknown, Message::new("refused-no-setting"))
    }

    /// The session does not ask this question about this segment.
    pub const fn unknown_question() -> Self {
        Self::Said(RefusalKind::Unknown, Message::new("refused-no-question"))
    }

    /// A refusal because of the present state, which a surgeon can meet. `id` names its message.
    pub const fn not_now(id: &'static str) -> Self {
        Self::Said(RefusalKind::Conflict, Message::new(id))
    }

    /// A refusal because of the present state. `text` describes it.
    pub fn conflict(text: &str) -> Self {
        Self::Conflict(text.to_owned())
    }
}
