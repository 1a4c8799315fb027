//! Records when camera and lens start or stop working, and when a warning about the lens comes or goes.

use std::sync::Arc;
use std::time::Duration;

use tokio::sync::{mpsc, watch};
use tokio::time::sleep;

use parfocal_base::clock::{Clock, Moment};
use parfocal_pipeline::control::ControlStatus;
use parfocal_records::store::{DeviceEvent, Store};

/// A device that failed counts as working again once it has worked for this long, so that a device that comes and goes
/// does not fill the log.
const SETTLED: Duration = Duration::from_secs(1);

/// What the disk refused is tried again after this time.
const RETRY: Duration = Duration::from_secs(1);

/// Whether a device works, and whether there is a warning about it.
type Condition = (bool, bool);

/// What was last noticed of a device.
#[derive(Default)]
struct LastCondition {
    last: Option<Condition>,
    well_since: Option<Moment>,
}

impl LastCondition {
    /// Whether `condition`, seen at `now`, has to be recorded.
    fn is_news(&mut self, condition: Condition, now: Moment) -> bool {
        if self.last == Some(condition) {
            self.well_since = None;
            return false;
        }

        let recovering = condition.0 && self.last.is_some_and(|(worked, _)| !worked);
        if recovering && now.since(*self.well_since.get_or_insert(now)) < SETTLED {
            return false;
        }

        *self = Self { last: Some(condition), well_since: None };
        true
    }
}

/// Records the condition in which the devices were found, and then every change until the control loop ends. A change
/// that the disk refuses is kept, and recorded as soon as the disk takes it.
pub async fn record(store: Store, clock: Arc<dyn Clock>, status: watch::Receiver<Arc<ControlStatus>>) {
    let (events, waiting) = mpsc::unbounded_channel();
    // Two loops, because a disk may hang for a while, and what happens meanwhile must be noticed.
    tokio::join!(notice(clock, status, events), write(&store, waiting));
}

/// Makes an event of each change, until the control loop ends.
async fn notice(
    clock: Arc<dyn Clock>,
    mut status: watch::Receiver<Arc<ControlStatus>>,
    events: mpsc::UnboundedSender<DeviceEvent>,
) {
    let mut noticed = [LastCondition::default(), LastCondition::default()];
    loop {
        let now = Arc::clone(&status.borrow_and_update());
        let devices = [
            ("camera", (now.camera.working, false), &now.camera.message),
            ("lens", (now.lens.working, now.lens.caution), &now.lens.message),
        ];

        for (noticed, (device, condition, message)) in noticed.iter_mut().zip(devices) {
            let wall = clock.wall();
            let at = clock.now();
            if !noticed.is_news(condition, at) {
                continue;
            }

            tracing::info!("{device}: {message}");
            let (working, _) = condition;
            let message = message.to_string();
            // The receiver lives as long as this loop.
            let _ = events.send(DeviceEvent { wall, at, device: device.to_owned(), working, message });
        }

        if status.changed().await.is_err() {
            return;
        }
    }
}

/// Records events in order, until there will be no more. While the disk refuses one, tries it again; the last time when
/// the control loop has ended.
async fn write(store: &Store, mut waiting: mpsc::UnboundedReceiver<DeviceEvent>) {
    let mut is_refused = false;
    while let Some(event) = waiting.recv().await {
        while let Err(error) = store.device_event(&event).await {
            if !is_refused {
                tracing::error!(%error, "cannot record the state of a device; it is tried again");
            }
            if waiting.is_closed() {
                return;
            }
            is_refused = true;
            sleep(RETRY).await;
        }
        is_refused = false;
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_failure_is_news_at_once_and_recovery_once_it_lasts() {
        let at = |millis: u64| Moment::from_nanos(millis * 1_000_000);
        let mut recorded = LastCondition::default();
        assert!(recorded.is_news((true, false), at(0)), "as it was found");
        assert!(!recorded.is_news((true, false), at(100)));
        assert!(recorded.is_news((false, false), at(200)));
        assert!(!recorded.is_news((true, false), at(300)));
        assert!(!recorded.is_news((false, false), at(400)), "it comes and goes");
        assert!(!recorded.is_news((true, false), at(500)));
        assert!(!recorded.is_news((true, false), at(1499)));
        assert!(recorded.is_news((true, false), at(1500)), "well for a second");
        assert!(recorded.is_news((true, true), at(1600)), "a warning is news at once");
    }
}
