//! Gathers the signs. The disk alone is asked, now and then and on a thread of its own; all else is known.

use std::path::Path;
use std::sync::atomic::Ordering;
use std::sync::{Arc, Mutex, PoisonError};
use std::time::Duration;

use tokio::sync::watch;
use tokio::task::spawn_blocking;
use tokio::time::{MissedTickBehavior, interval, timeout};

use super::signs::condition;
use super::{Condition, DiskSign, Problem, Signs};
use crate::clock::{Clock, Moment};
use crate::control::ControlStatus;
use crate::recording::room;
use crate::store::Store;
use crate::trial::view::OperatorView;

/// How often the disk is asked, and lost telemetry is looked for.
const EVERY: Duration = Duration::from_secs(5);
/// A disk that does not answer within this time is silent.
const PATIENCE: Duration = Duration::from_secs(3);
/// Telemetry that was lost this long ago is no news any more.
const NEWS: Duration = Duration::from_mins(10);

/// Watches how the server is. Clone freely.
#[derive(Clone)]
pub struct HealthWatch(Arc<Shared>);

struct Shared {
    clock: Arc<dyn Clock>,
    status: watch::Receiver<Arc<ControlStatus>>,
    session: watch::Receiver<Option<Arc<OperatorView>>>,
    store: Store,
    looked: Mutex<Looked>,
}

/// What is looked at now and then.
#[derive(Default)]
struct Looked {
    disk: DiskSign,
    /// Telemetry lost since the start, and when the latest of it was missed.
    lost: u64,
    lost_at: Option<Moment>,
}

impl HealthWatch {
    /// A watch over the loop with this `status`, the sessions and the database. Something has to await
    /// [`HealthWatch::run`] for the disk and lost telemetry to be seen.
    #[must_use]
    pub fn new(
        clock: Arc<dyn Clock>,
        status: watch::Receiver<Arc<ControlStatus>>,
        session: watch::Receiver<Option<Arc<OperatorView>>>,
        store: Store,
    ) -> Self {
        Self(Arc::new(Shared { clock, status, session, store, looked: Mutex::default() }))
    }

    /// Looks at the disk and at lost telemetry now and then. Never ends.
    pub async fn run(self) {
        let mut ticks = interval(EVERY);
        ticks.set_missed_tick_behavior(MissedTickBehavior::Delay);
        // A disk that hangs keeps its thread; it is not asked again before that one has answered.
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

    /// How the server is, and what is wrong, the worst first. Waits for nothing.
    #[must_use]
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

    fn looked(&self) -> std::sync::MutexGuard<'_, Looked> {
        self.looked.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

/// Asks the disk of `folder` for its room; may take as long as the disk does.
fn disk(folder: &Path) -> DiskSign {
    room(folder).map_or(DiskSign::Silent, |room| DiskSign::Free(room.available))
}
