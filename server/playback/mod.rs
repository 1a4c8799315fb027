//! Playback: a session's recordings as times and pictures for the researcher's page, and any recording past a policy.
//! The page gets nothing else of a recording: its focal power comes with the timeline, by the timeline's rules.

mod error;
mod player;
mod projector;
pub mod stepping;

pub use error::PlaybackError;
pub use player::{Player, RecordingCourse, SessionRecordings};
