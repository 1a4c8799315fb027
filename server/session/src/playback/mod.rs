//! Playback: plays a session's recordings as times, pictures and spectra for the researcher's page, and runs a policy
//! over any recording. The page gets nothing else from a recording. The focal power comes with the timeline, under its
//! rules.

mod player;
mod projector;
mod spectrum;
pub mod stepping;

pub use player::{Player, RecordingCourse, SessionRecordings};
pub use spectrum::{BandLevel, PlaceSpectrum};
