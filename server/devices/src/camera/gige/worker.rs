//! The camera's thread: streams, and reconnects a lost camera.

use std::time::Duration;

use super::device::{Device, Setup};
use super::session::Session;
use super::shared::{Shared, words};

/// Time between two attempts to find a lost camera.
const RETRY: Duration = Duration::from_millis(300);

/// Streams from `device` until told to stop. If the camera is lost, opens it again.
pub fn run(shared: &Shared, setup: &Setup, device: Device) {
    let mut number = 0;
    let mut changes = Vec::new();
    let mut connected = Some(device);

    while !shared.stopping() {
        let trouble = match connected.take().map_or_else(|| Device::open(setup), Ok) {
            Ok(device) => {
                shared.set_condition(Ok(words(&device)));
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
