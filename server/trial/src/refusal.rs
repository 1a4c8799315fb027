//! Why a request was refused.

/// Why a request was refused. Nothing was changed.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
pub enum Refusal {
    /// Only another role may do this.
    #[error("{0}")]
    NotAllowed(String),
    /// The session has no such segment.
    #[error("this session has no such setting; reload the page")]
    UnknownSegment,
    /// The session does not ask this question about this segment.
    #[error("this session does not ask this question about this setting; reload the page")]
    UnknownQuestion,
    /// The request does not fit the present state.
    #[error("{0}")]
    Conflict(String),
    /// The request is not valid.
    #[error("{0}")]
    Invalid(String),
}

impl Refusal {
    /// A refusal because only `who` may do this.
    #[must_use]
    pub fn only(who: &str) -> Self {
        Self::NotAllowed(format!("only {who} can do this"))
    }

    /// A refusal because of the present state. `text` describes it.
    #[must_use]
    pub fn conflict(text: &str) -> Self {
        Self::Conflict(text.to_owned())
    }
}
