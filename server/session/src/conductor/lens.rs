//! What drives the lens outside sessions. This is the only way from people to the lens.

use super::course::Course;
use super::{ConductError, Conductor, Shared};
use parfocal_autofocus::PolicyError;
use parfocal_base::FocalPower;
use parfocal_base::PolicyName;
use parfocal_base::ids::SessionId;
use parfocal_pipeline::control::{Command, Drive};
use parfocal_trial::account::Actor;
use parfocal_trial::action::Focus;
use parfocal_trial::permission::{self, CurrentSession, Request};

impl Conductor {
    /// Makes a policy drive the lens, or moves the lens to a focal power, as `focus` says. In a session that is paused
    /// or was aborted, the lens can be moved to a focal power, which is recorded.
    ///
    /// # Errors
    /// If `by` may not do this, a session is not closed yet, the focal power is invalid, or the policy is unknown or
    /// cannot run.
    pub async fn focus(&self, by: impl Into<Actor>, focus: &Focus) -> Result<(), ConductError> {
        let by = by.into();
        if let Focus::FocalPower(to) = focus
            && let Some(session) = self.session_focused_by_hand()
        {
            let to = power(*to)?;
            return self.to_the_end(move |shared| async move { shared.focus_by_hand(&by, session, to).await }).await;
        }

        // Loading a policy may take time, so do it before taking the lock, which must be free for anyone who stops the
        // lens.
        let drive = self.shared.drive_for(focus);

        // Hold the lock until the command is sent. A session that is made in the meantime then sends its command after
        // this one.
        let live = self.shared.live();
        permission::check(by.role, Request::MoveLens, CurrentSession::of(live.shown_phase()))?;
        self.shared.control.send(Command::Drive { drive: drive?, segment: None });
        Ok(())
    }

    /// The session on the screens, if it is paused or was aborted.
    fn session_focused_by_hand(&self) -> Option<SessionId> {
        let live = self.shared.live();
        live.shown().filter(|course| course.state.may_be_focused_by_hand()).map(Course::session)
    }
}

fn power(value: f64) -> Result<FocalPower, ConductError> {
    FocalPower::new(value).map_err(|error| ConductError::Invalid(error.to_string()))
}

impl Shared {
    /// Rejects here what the control loop could only reject without an answer.
    fn drive_for(&self, focus: &Focus) -> Result<Drive, ConductError> {
        match focus {
            Focus::FocalPower(value) => Ok(Drive::Manual(power(*value)?)),
            Focus::Policy(name) => {
                let name = PolicyName::new(name);
                match self.registry.check(&name) {
                    Ok(()) => Ok(Drive::Policy { name, start: None }),
                    Err(error @ PolicyError::Unknown { .. }) => Err(ConductError::NotFound(error.to_string())),
                    Err(error) => Err(ConductError::Conflict(error.to_string())),
                }
            }
        }
    }
}
