//! Health: how the running server is, for those who monitor it. It is derived from what the parts already know, so a
//! request is answered even while the disk hangs.
//!
//! It is open to everyone who reaches the server. So it says nothing about a person or a policy, and names no device:
//! its sentences are fixed.

pub mod device_log;
mod signs;
mod watch;

pub use signs::{DiskSign, Signs};
pub use watch::HealthWatch;

use serde::Serialize;
use utoipa::ToSchema;

/// The server's condition.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Serialize, ToSchema)]
#[serde(rename_all = "kebab-case")]
pub enum Condition {
    /// Nothing is wrong.
    Ok,
    /// It does its work, but something needs a person. A restart does not help.
    Degraded,
    /// It cannot do its work.
    Failing,
}

/// What can be wrong. Programs may rely on these names.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, ToSchema)]
#[serde(rename_all = "kebab-case")]
pub enum Code {
    /// The camera delivers no frames.
    CameraSilent,
    /// The lens takes no commands.
    LensGone,
    /// The lens works, but not properly.
    LensWarns,
    /// The disk of the data folder has little free space.
    DiskNearlyFull,
    /// The disk of the data folder does not report its free space.
    DiskSilent,
    /// The last write to the database failed, or a write takes long.
    DatabaseTroubled,
    /// Writes to the database have failed for a minute, or a write has been under way for minutes.
    DatabaseUnwritable,
    /// The event that stopped a session is not recorded yet.
    EventsUnrecorded,
    /// Records of the focus loop were lost within the last ten minutes.
    TelemetryLost,
    /// The focus loop does not run.
    LoopStalled,
}

/// One thing that is wrong.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, ToSchema)]
pub struct Problem {
    /// What it is, for programs.
    pub code: Code,
    /// Severity: `degraded` or `failing`.
    pub condition: Condition,
    /// What it is, in one sentence for people.
    pub message: &'static str,
}

impl Code {
    /// How bad it is.
    const fn condition(self) -> Condition {
        match self {
            Self::DatabaseUnwritable | Self::LoopStalled => Condition::Failing,
            Self::CameraSilent
            | Self::LensGone
            | Self::LensWarns
            | Self::DiskNearlyFull
            | Self::DiskSilent
            | Self::DatabaseTroubled
            | Self::EventsUnrecorded
            | Self::TelemetryLost => Condition::Degraded,
        }
    }

    const fn message(self) -> &'static str {
        match self {
            Self::CameraSilent => "No frames come from the camera. Check its cable and power.",
            Self::LensGone => "The lens takes no commands. Check its cable and power.",
            Self::LensWarns => "The lens works, but reports a condition. The operator's page says which.",
            Self::DiskNearlyFull => "The disk of the data folder has less than 1 GiB free. Make room.",
            Self::DiskSilent => {
                "The disk of the data folder does not report its free space. Check that it is connected."
            }
            Self::DatabaseTroubled => {
                "Writing to the database failed or takes long; it is tried again. Check the disk's room and cable."
            }
            Self::DatabaseUnwritable => {
                "Nothing could be written to the database for a minute or more. Check that its disk works and has free space."
            }
            Self::EventsUnrecorded => "What stopped a session is not recorded yet. It is tried again.",
            Self::TelemetryLost => {
                "Records of the focus loop were lost in the last ten minutes, because the disk was too slow or failed."
            }
            Self::LoopStalled => "The focus loop does not run. Restart the server.",
        }
    }
}

impl From<Code> for Problem {
    fn from(code: Code) -> Self {
        Self { code, condition: code.condition(), message: code.message() }
    }
}
