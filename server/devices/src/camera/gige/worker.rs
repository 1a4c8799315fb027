//! The camera's thread: streams, and looks for a camera that is lost or not there yet.

use std::time::Duration;

use super::device::{Device, Setup};
use super::session::Session;
use super::shared::Shared;

/// Time between two attempts to find a camera that is lost or not there yet.
const RETRY: Duration = Duration::from_millis(300);

/// Streams from `device` until asked to stop. If the camera is lost, or not there yet, opens it again. Every picture must
/// be of `size`, for which everything else was set up.
pub fn run(shared: &Shared, setup: &Setup, device: Option<Device>, size: (usize, usize)) {
    let mut number = 0;
    let mut changes = Vec::new();
    let mut connected = device;

    while !shared.stopping() {
        let trouble = match connected.take().map_or_else(|| Device::open(setup), Ok) {
            Ok(device) if (device.width, device.height) != size => format!(
                "the camera's picture is {}x{}, but the server was started for {}x{}: start it again while the camera \
                 is on, or give width and height",
                device.width, device.height, size.0, size.1
            ),
            Ok(device) => {
                shared.found(&device);
                Session::new(shared, device, &mut number, &mut changes).stream()
            }
            Err(error) => error.to_string(),
        };

        shared.controls.offer(Vec::new());
        shared.set_condition(Err(trouble.into()));
        if shared.stop_within(RETRY) {
            return;
        }
    }
}
