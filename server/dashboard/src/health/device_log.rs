//! Records when camera and lens start or stop working, and when a warning about the lens comes or goes.

use std::collections::VecDeque;
use std::sync::Arc;
use std::time::Duration;

use tokio::sync::watch;

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

/// What was last recorded about a device.
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

/// Events that are not recorded yet.
#[derive(Default)]
struct Events {
    waiting: VecDeque<DeviceEvent>,
    /// When the disk last refused one, unless it has taken one since.
    refused_at: Option<Moment>,
}

impl Events {
    /// Records them in order, as far as the disk takes them.
    async fn write(&mut self, store: &Store, now: Moment) {
        if self.refused_at.is_some_and(|at| now.since(at) < RETRY) {
            return;
        }

        while let Some(event) = self.waiting.front() {
            if let Err(error) = store.device_event(event).await {
                if self.refused_at.replace(now).is_none() {
                    tracing::error!(%error, "cannot record the state of a device; it is tried again");
                }
                return;
            }
            self.waiting.pop_front();
            self.refused_at = None;
        }
    }
}

/// Records the condition in which the devices were found, and then every change until the control loop ends. A change
/// that the disk refuses is kept, and recorded as soon as the disk takes it.
pub async fn record(store: Store, clock: Arc<dyn Clock>, mut status: watch::Receiver<Arc<ControlStatus>>) {
    let mut recorded = [LastCondition::default(), LastCondition::default()];
    let mut events = Events::default();
    loop {
        let now = Arc::clone(&status.borrow_and_update());
        let devices = [
            ("camera", (now.camera.working, false), &now.camera.message),
            ("lens", (now.lens.working, now.lens.caution), &now.lens.message),
        ];

        for (recorded, (device, condition, message)) in recorded.iter_mut().zip(devices) {
            let wall = clock.wall();
            let at = clock.now();
            if !recorded.is_news(condition, at) {
                continue;
            }

            tracing::info!("{device}: {message}");
            let (working, _) = condition;
            let message = message.to_string();
            events.waiting.push_back(DeviceEvent { wall, at, device: device.to_owned(), working, message });
        }
        events.write(&store, clock.now()).await;

        if status.changed().await.is_err() {
            return;
        }
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
