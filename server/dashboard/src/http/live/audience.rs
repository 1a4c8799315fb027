//! The audience of a live stream, by role.

use std::sync::Arc;

use serde::Serialize;
use tokio::sync::watch;

use crate::http::App;
use parfocal_pipeline::control::ControlStatus;
use parfocal_pipeline::live::{DepthMap, DepthMaps, EncodedFrame};

/// A picture's way to a page.
#[derive(Debug, Clone, Copy)]
pub struct Journey {
    /// How old it is when it leaves, milliseconds.
    pub age_ms: f64,
    /// How long it will take, milliseconds.
    pub travel_ms: f64,
    /// Whether the link is too slow for the size that the screen can show.
    pub reduced: bool,
}

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

    /// The depth maps, if this audience may ever see them.
    fn depth_maps(app: &App) -> Option<DepthMaps>;
    /// What is sent with `frame`, how it travels, and the depth map of that time, if the page has asked for it.
    fn header(frame: &EncodedFrame, journey: Journey, depths: Option<Arc<DepthMap>>, app: &App) -> Self::Header;
    /// Source of the session's changes.
    fn sessions(app: &App) -> watch::Receiver<Option<Arc<Self::Session>>>;
    /// The state of the devices.
    fn status(status: &ControlStatus, app: &App) -> Self::Status;
}
