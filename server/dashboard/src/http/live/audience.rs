//! The audience of a live stream, by role.

use std::sync::Arc;

use serde::Serialize;
use tokio::sync::watch;

use crate::http::App;
use parfocal_pipeline::control::ControlStatus;
use parfocal_pipeline::live::EncodedFrame;

/// Decides what may be sent to an audience: each implementation has its own types.
pub trait Audience: Send + Sync + 'static {
    /// What is sent with each picture.
    type Header: Serialize + Send;
    /// The session under way, as this audience may see it.
    type Session: Serialize + Send + Sync + 'static;
    /// The state of the devices.
    type Status: Serialize + PartialEq + Send;

    /// Whether a recording of the view keeps the size of pictures that this page gets.
    const LEADS: bool;

    /// What is sent with `frame`, which is `age_ms` milliseconds old. It will arrive after about `travel_ms`,
    /// and is `reduced` if the link is too slow for the size that the screen can show.
    fn header(frame: &EncodedFrame, age_ms: f64, travel_ms: f64, reduced: bool, app: &App) -> Self::Header;
    /// Source of the session's changes.
    fn sessions(app: &App) -> watch::Receiver<Option<Arc<Self::Session>>>;
    /// The state of the devices.
    fn status(status: &ControlStatus, app: &App) -> Self::Status;
}
