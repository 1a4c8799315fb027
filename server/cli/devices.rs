//! Keeps a record of when camera and lens began and ceased to work, or to work as they should.

use std::sync::Arc;

use tokio::sync::watch;

use crate::clock::Clock;
use crate::control::ControlStatus;
use crate::store::{DeviceEvent, Store};

/// Records every change until the loop ends, beginning with how the devices were found.
pub async fn record(store: Store, clock: Arc<dyn Clock>, mut status: watch::Receiver<Arc<ControlStatus>>) {
    let mut last = [None; 2];
    loop {
        let now = Arc::clone(&status.borrow_and_update());
        let devices = [
            ("camera", (now.camera.working, false), &now.camera.message),
            ("lens", (now.lens.working, now.lens.caution), &now.lens.message),
        ];
        for (last, (device, state, message)) in last.iter_mut().zip(devices) {
            if last.replace(state) == Some(state) {
                continue;
            }
            tracing::info!("{device}: {message}");
            let (wall, at) = (clock.wall(), clock.now());
            let (working, _) = state;
            let event = DeviceEvent { wall, at, device: device.to_owned(), working, message: message.to_string() };
            if let Err(error) = store.device_event(&event).await {
                tracing::error!(%error, "a device's state could not be recorded");
            }
        }
        if status.changed().await.is_err() {
            return;
        }
    }
}
