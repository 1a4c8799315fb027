//! The conductor: carries a session's events from the state machine through the store to the control loop, in that
//! order, so that what happened is on disk before anyone sees it.

use std::sync::Arc;

use tokio::sync::watch;

use crate::ids::SessionId;
use crate::trial::view::{Action, NewAnswer, NewComment, OperatorView, Role, SurgeonView};

/// Runs at most one session at a time. Clone freely.
#[derive(Clone)]
pub struct Conductor {}

/// Why the conductor did not do something.
#[derive(Debug, thiserror::Error)]
pub enum ConductError {
    /// There is no such session, segment or question, or it is not the one under way.
    #[error("{0}")]
    NotFound(String),
    /// Another role does this.
    #[error("{0}")]
    Forbidden(String),
    /// It cannot be done in the session's present state; nothing was changed.
    #[error("{0}")]
    Conflict(String),
    /// What was sent makes no sense; says which part.
    #[error("{0}")]
    Invalid(String),
    /// The disk or database failed; nothing was acknowledged.
    #[error("could not be saved: {0}")]
    Storage(String),
}

impl Conductor {
    /// The session under way (or just ended, until dismissed) as the surgeon may see it; changes as it changes.
    #[must_use]
    pub fn surgeon_view(&self) -> watch::Receiver<Option<Arc<SurgeonView>>> {
        todo!()
    }

    /// The same for the operator.
    #[must_use]
    pub fn operator_view(&self) -> watch::Receiver<Option<Arc<OperatorView>>> {
        todo!()
    }

    /// Makes a session for `participant` by `protocol` and draws its allocation; it waits for [`Action::Start`].
    ///
    /// # Errors
    /// When one is under way already, or participant or protocol is unknown.
    pub async fn create(&self, _by: Role, _participant: &str, _protocol: &str) -> Result<SessionId, ConductError> {
        todo!()
    }

    /// Moves session `session` on.
    ///
    /// # Errors
    /// When `by` may not, or the session is not where the action fits.
    pub async fn act(&self, _by: Role, _session: SessionId, _action: Action) -> Result<(), ConductError> {
        todo!()
    }

    /// Keeps a comment: when this returns, it is on disk. A comment for a segment just ended is kept with that segment.
    ///
    /// # Errors
    /// When the session does not exist, the text is empty or too long, or the disk failed.
    pub async fn comment(&self, _comment: NewComment) -> Result<(), ConductError> {
        todo!()
    }

    /// Keeps an answer: when this returns, it is on disk.
    ///
    /// # Errors
    /// When the question is not asked now, the value does not fit it, or the disk failed.
    pub async fn answer(&self, _answer: NewAnswer) -> Result<(), ConductError> {
        todo!()
    }
}
