//! Why a connection to the driver ends.

use super::codec::WireError;
use super::link::LinkError;
use crate::lens::LensError;

/// The reason for ending a connection.
#[derive(Debug, thiserror::Error)]
pub enum Trouble {
    /// The thread was asked to end.
    #[error("closing")]
    Stopped,
    /// The device cannot be used.
    #[error(transparent)]
    Lens(#[from] LensError),
}

impl From<Trouble> for LensError {
    fn from(trouble: Trouble) -> Self {
        match trouble {
            Trouble::Stopped => Self::Gone("closed".into()),
            Trouble::Lens(error) => error,
        }
    }
}

impl From<LinkError> for Trouble {
    fn from(error: LinkError) -> Self {
        match error {
            LinkError::Stopped => Self::Stopped,
            LinkError::Wire(WireError::Device(error)) => Self::Lens(LensError::Refused(error.to_string())),
            other => Self::Lens(LensError::Gone(other.to_string())),
        }
    }
}
