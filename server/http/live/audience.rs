//! The audience at the other end of a live stream.

use std::sync::Arc;

use serde::Serialize;
use tokio::sync::watch;

use crate::control::ControlStatus;
use crate::http::App;
use crate::live::EncodedFrame;

/// The audience decides what may be sent: one implementation a role, each with types of its own.
pub trait Audience: Send + Sync + 'static {
    /// What goes with each picture.
    type Header: Serialize + Send;
    /// The session under way.
    type Session: Serialize + Send + Sync + 'static;
    /// The state of the devices.
    type Status: Serialize + PartialEq + Send;

    /// Whether a recording of the view keeps what this page gets.
    const LEADS: bool;

    /// What goes with `frame`, which is `age_ms` old.
    fn header(frame: &EncodedFrame, age_ms: f64, app: &App) -> Self::Header;
    /// Where the session is followed.
    fn sessions(app: &App) -> watch::Receiver<Option<Arc<Self::Session>>>;
    /// The state of the devices.
    fn status(status: &ControlStatus, app: &App) -> Self::Status;
}
