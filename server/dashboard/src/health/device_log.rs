//! Records when camera and lens start or stop working, and when a warning about the lens comes or goes.

use std::sync::Arc;
use std::time::Duration;

use tokio::sync::watch;

use parfocal_base::clock::{Clock, Moment};
use parfocal_pipeline::control::ControlStatus;
use parfocal_records::store::{DeviceEvent, Store};

/// A device that failed counts as working again once it has worked for this long, so that a device that comes and goes
/// does not fill the log.
const SETTLED: Duration = Duration::from_secs(1);

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

/// Records the condition in which the devices were found, and then every change until the control loop ends.
pub async fn record(store: Store, clock: Arc<dyn Clock>, mut status: watch::Receiver<Arc<ControlStatus>>) {
    let mut recorded = [LastCondition::default(), LastCondition::default()];
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
            let event = DeviceEvent { wall, at, device: device.to_owned(), working, message: message.to_string() };
            if let Err(error) = store.device_event(&event).await {
                tracing::error!(%error, "cannot record the state of a device");
            }
        }

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
