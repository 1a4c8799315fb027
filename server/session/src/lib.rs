//! A trial's session while it runs, and its recordings afterwards.
//!
//! [`conductor`] orders everything that happens in a session: the rules decide, the disk takes the events, and only
//! then everyone else hears of them. [`reports`] tells what pages show of sessions and studies. [`recorder`] records
//! what the operator or a protocol asks for. [`playback`] plays recordings, as pictures for the researcher's page or
//! past a policy.

pub mod conductor;
pub mod playback;
pub mod recorder;
pub mod reports;
