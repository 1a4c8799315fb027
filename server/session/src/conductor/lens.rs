//! What drives the lens outside sessions. This is the only way from people to the lens.

use super::{ConductError, Conductor, Shared};
use parfocal_autofocus::PolicyError;
use parfocal_base::FocalPower;
use parfocal_base::PolicyName;
use parfocal_pipeline::control::{Command, Drive};
use parfocal_trial::action::Focus;
use parfocal_trial::permission::{self, CurrentSession, Request};
use parfocal_trial::role::Role;

impl Conductor {
    /// Makes a policy drive the lens, or moves the lens to a focal power, as `focus` says.
    ///
    /// # Errors
    /// If `by` may not do this, a session is not closed yet, the focal power is invalid, or the policy is unknown or
    /// cannot run.
    pub fn focus(&self, by: Role, focus: &Focus) -> Result<(), ConductError> {
        // Loading a policy may take time, so do it before taking the lock, which must be free for anyone who stops the
        // lens.
        let drive = self.shared.drive_for(focus);

        // Hold the lock until the command is sent. A session that is made in the meantime then sends its command after
        // this one.
        let live = self.shared.live();
        permission::check(by, Request::MoveLens, CurrentSession::of(live.shown_phase()))?;
        self.shared.control.send(Command::Drive { drive: drive?, segment: None });
        Ok(())
    }
}

impl Shared {
    /// Rejects here what the control loop could only reject without an answer.
    fn drive_for(&self, focus: &Focus) -> Result<Drive, ConductError> {
        match focus {
            Focus::FocalPower(value) => {
                let power = FocalPower::new(*value).map_err(|error| ConductError::Invalid(error.to_string()))?;
                Ok(Drive::Manual(power))
            }
            Focus::Policy(name) => {
                let name = PolicyName::new(name);
                match self.registry.build(&name) {
                    Ok(_) => Ok(Drive::Policy { name, start: None }),
                    Err(error @ PolicyError::Unknown { .. }) => Err(ConductError::NotFound(error.to_string())),
                    Err(error) => Err(ConductError::Conflict(error.to_string())),
                }
            }
        }
    }
}
