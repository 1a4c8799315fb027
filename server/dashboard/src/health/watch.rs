//! Gathers the signs. Only the disk is asked, every few seconds and on a separate thread; everything else is known.

use std::path::Path;
use std::sync::atomic::Ordering;
use std::sync::{Arc, Mutex, PoisonError};
use std::time::Duration;

use tokio::sync::watch;
use tokio::task::spawn_blocking;
use tokio::time::{MissedTickBehavior, interval, timeout};

use super::signs::condition;
use super::{Condition, DiskSign, Problem, Signs};
use parfocal_base::clock::{Clock, Moment};
use parfocal_pipeline::control::ControlStatus;
use parfocal_recording::room;
use parfocal_records::store::Store;
use parfocal_trial::view::OperatorView;

/// Interval at which the disk is asked and lost telemetry is counted.
const EVERY: Duration = Duration::from_secs(5);
/// A disk that does not answer within this time counts as silent.
const PATIENCE: Duration = Duration::from_secs(3);
/// How long a loss of telemetry is reported.
const NEWS: Duration = Duration::from_mins(10);

/// Watches the server's health. Clone freely.
#[derive(Clone)]
pub struct HealthWatch(Arc<Shared>);

struct Shared {
    clock: Arc<dyn Clock>,
    status: watch::Receiver<Arc<ControlStatus>>,
    session: watch::Receiver<Option<Arc<OperatorView>>>,
    store: Store,
    looked: Mutex<CheckResults>,
}

/// Results of the periodic checks.
#[derive(Default)]
struct CheckResults {
    disk: DiskSign,
    /// Telemetry records lost since the start. `lost_at` is when the number last rose.
    lost: u64,
    lost_at: Option<Moment>,
}

impl HealthWatch {
    /// A watch over the loop with this `status`, the sessions and the database. It checks the disk and lost telemetry
    /// only while [`HealthWatch::run`] is awaited.
    pub fn new(
        clock: Arc<dyn Clock>,
        status: watch::Receiver<Arc<ControlStatus>>,
        session: watch::Receiver<Option<Arc<OperatorView>>>,
        store: Store,
    ) -> Self {
        Self(Arc::new(Shared { clock, status, session, store, looked: Mutex::default() }))
    }

    /// Checks the disk and lost telemetry every few seconds. Never ends.
    pub async fn run(self) {
        let mut ticks = interval(EVERY);
        ticks.set_missed_tick_behavior(MissedTickBehavior::Delay);
        // A disk that hangs blocks its thread, so it is not asked again before that thread has answered.
        let mut asked = None;

        loop {
            ticks.tick().await;
            self.0.look_for_loss();

            let folder = self.0.store.folder().to_owned();
            let mut answer = asked.take().unwrap_or_else(|| spawn_blocking(move || disk(&folder)));
            let sign = match timeout(PATIENCE, &mut answer).await {
                Ok(Ok(sign)) => sign,
                Ok(Err(_)) => DiskSign::Silent,
                Err(_) => {
                    asked = Some(answer);
                    DiskSign::Silent
                }
            };
            self.0.looked().disk = sign;
        }
    }

    /// The server's condition and its problems, the worst first. Waits for nothing.
    pub fn now(&self) -> (Condition, Vec<Problem>) {
        let problems = self.0.signs().problems();
        (condition(&problems), problems)
    }
}

impl Shared {
    fn signs(&self) -> Signs {
        let ended = self.status.has_changed().is_err();
        let status = Arc::clone(&self.status.borrow());
        let now = self.clock.now();

        let events_unrecorded = self.session.borrow().as_ref().is_some_and(|view| view.surgeon.unrecorded);
        let writes = self.store.writes();
        let (disk, lost_at) = {
            let looked = self.looked();
            (looked.disk, looked.lost_at)
        };

        Signs {
            camera_works: status.camera.working,
            lens_works: status.lens.working,
            lens_warns: status.lens.caution,
            loop_spoke_ago: (!ended).then(|| now.since(status.at)),
            write_under_way_for: writes.under_way_for(),
            writes_failing_for: writes.failing_for(),
            write_failed_ago: writes.failed_ago(),
            events_unrecorded,
            telemetry_lost: lost_at.is_some_and(|at| now.since(at) < NEWS),
            disk,
        }
    }

    fn look_for_loss(&self) {
        let dropped = self.status.borrow().telemetry_dropped;
        let lost = dropped + self.store.telemetry_counts().lost.load(Ordering::Relaxed);

        let mut looked = self.looked();
        if lost > looked.lost {
            looked.lost = lost;
            looked.lost_at = Some(self.clock.now());
        }
    }

    fn looked(&self) -> std::sync::MutexGuard<'_, CheckResults> {
        self.looked.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

/// Asks for the free space on the disk of `folder`; blocks until the disk answers.
fn disk(folder: &Path) -> DiskSign {
    room(folder).map_or(DiskSign::Silent, |room| DiskSign::Free(room.available))
}
