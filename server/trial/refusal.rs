//! Why something was not done.

/// Why something was not done. Nothing was changed.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
pub enum Refusal {
    /// Another role does this.
    #[error("{0}")]
    NotAllowed(String),
    /// The session has no such segment.
    #[error("this session has no such setting; reload the page")]
    UnknownSegment,
    /// The session does not ask this question of this segment.
    #[error("this session asks no such question of this setting; reload the page")]
    UnknownQuestion,
    /// It does not fit the present state.
    #[error("{0}")]
    Conflict(String),
    /// What was sent makes no sense.
    #[error("{0}")]
    Invalid(String),
}

impl Refusal {
    /// A refusal because only `who` may do this.
    #[must_use]
    pub fn only(who: &str) -> Self {
        Self::NotAllowed(format!("only {who} can do this"))
    }

    /// A refusal because of the present state, which `text` describes.
    #[must_use]
    pub fn conflict(text: &str) -> Self {
        Self::Conflict(text.to_owned())
    }
}
