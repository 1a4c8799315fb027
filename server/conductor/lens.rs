//! Who focuses outside sessions. This is the only way from people to the lens.

use super::{ConductError, Conductor, Shared};
use crate::autofocus::{PolicyError, PolicyName};
use crate::control::{Command, Drive};
use crate::lens::FocalPower;
use crate::trial::action::Focus;
use crate::trial::permission::{self, CurrentSession, Request};
use crate::trial::role::Role;

impl Conductor {
    /// Lets a policy focus, or puts the lens at a focal power, as `focus` says.
    ///
    /// # Errors
    /// When `by` may not, a session is not closed yet, the focal power is invalid, or the policy is
    /// unknown or cannot run.
    pub fn focus(&self, by: Role, focus: &Focus) -> Result<(), ConductError> {
        // A policy may have to load, so this comes before the lock, which must be there for whoever
        // stops the lens.
        let drive = self.shared.drive_for(focus);

        // Held until the loop is told: a session that is made in the meantime tells the loop after
        // this.
        let live = self.shared.live();
        permission::check(by, Request::MoveLens, CurrentSession::of(live.shown_phase()))?;
        self.shared.control.send(Command::Drive { drive: drive?, segment: None });
        Ok(())
    }
}

impl Shared {
    /// Refuses here what the loop could only refuse without an answer.
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
