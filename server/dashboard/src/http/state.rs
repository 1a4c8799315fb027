//! The parts of the server that every handler can use.

use std::sync::Arc;
use std::sync::atomic::AtomicU64;

use prometheus_client::metrics::counter::Counter;
use tokio::sync::watch;

use super::address::ServerAddress;
use super::equipment::Equipment;
use super::keys::Keys;
use super::live::OpenTablets;
use super::tablet_trials::TabletTrials;
use crate::health::HealthWatch;
use parfocal_autofocus::Registry;
use parfocal_base::clock::Clock;
use parfocal_base::ids::SessionId;
use parfocal_pipeline::control::ControlObserver;
use parfocal_pipeline::live::LiveHandle;
use parfocal_records::accounts::Accounts;
use parfocal_records::store::{AccessLog, Backups, Store};
use parfocal_results::study_export::StudyExports;
use parfocal_session::conductor::{Conductor, Library};
use parfocal_session::playback::Player;
use parfocal_session::recorder::Recordings;
use parfocal_session::reports::Reports;
use parfocal_trial::account::Actor;
use parfocal_trial::permission::{CurrentSession, may_see_focal_power};
use parfocal_trial::role::Role;
use parfocal_trial::view::{OperatorView, SurgeonView};

/// The parts of the server, made once at the start.
pub struct App {
    /// Monotonic and wall clock.
    pub clock: Arc<dyn Clock>,
    /// Read-only access to the control loop. People command the lens only through the conductor.
    pub control: ControlObserver,
    /// Source of the live pictures.
    pub live: LiveHandle,
    /// The database.
    pub store: Store,
    /// The server's health.
    pub health: HealthWatch,
    /// Conductor of the trial sessions.
    pub conductor: Conductor,
    /// Reports on sessions.
    pub reports: Reports,
    /// The available protocols.
    pub library: Library,
    /// The recorder.
    pub recordings: Recordings,
    /// Playback of recordings.
    pub player: Player,
    /// The session under way as surgeons may see it.
    pub surgeon_view: watch::Receiver<Option<Arc<SurgeonView>>>,
    /// The session under way as the operator sees it.
    pub operator_view: watch::Receiver<Option<Arc<OperatorView>>>,
    /// All policies.
    pub registry: Registry,
    /// The exports of whole studies.
    pub study_exports: StudyExports,
    /// The backups that leads download.
    pub backups: Backups,
    /// Personal accounts.
    pub accounts: Accounts,
    /// Keys of the three roles.
    pub keys: Keys,
    /// How other devices reach the server.
    pub address: ServerAddress,
    /// What the server learned about its devices when it started.
    pub equipment: Equipment,
    /// The surgeon's pages that are open.
    pub tablets: OpenTablets,
    /// What works on the tablets that were tried.
    pub tablet_trials: TabletTrials,
    /// Counters for Prometheus.
    pub metrics: Metrics,
    /// Turns true when the server must shut down; streams then close by themselves.
    pub shutdown: watch::Receiver<bool>,
}

/// Counters of the HTTP server.
#[derive(Debug, Clone, Default)]
pub struct Metrics {
    /// Frames sent to viewers.
    pub frames_sent: Counter<u64, AtomicU64>,
    /// Bytes of these frames.
    pub bytes_sent: Counter<u64, AtomicU64>,
}

/// The state that every route gets.
pub type AppState = Arc<App>;

impl App {
    /// Records what `by` looks at.
    pub fn access_log(&self, by: impl Into<Actor>) -> AccessLog {
        AccessLog::of_server(&self.store, by.into(), Arc::clone(&self.clock))
    }

    /// Waits until the telemetry and the recording of a session that has just ended are stored, unless the disk takes
    /// long. Whoever reads them before would miss their ends.
    pub(super) async fn settle(&self) {
        tokio::join!(self.recordings.settle(), self.store.settle_telemetry());
    }

    /// The session on the screens, if it belongs to a study.
    pub(super) fn study_session(&self) -> Option<SessionId> {
        let view = self.operator_view.borrow();
        view.as_ref().filter(|view| view.study.is_some()).map(|view| view.surgeon.session)
    }

    /// The session on the screens, if it belongs to a study and has not ended. The surgeon's link is then to it only.
    pub fn linked_session(&self) -> Option<SessionId> {
        self.study_session().filter(|session| self.session_goes_on(*session))
    }

    /// Whether `session` is on the screens and has not ended.
    pub fn session_goes_on(&self, session: SessionId) -> bool {
        let view = self.operator_view.borrow();
        view.as_ref().is_some_and(|view| view.surgeon.session == session && !view.surgeon.phase.has_ended())
    }

    /// Whether values that tell policies apart are now hidden from operator and researcher too.
    pub fn blinded(&self) -> bool {
        !may_see_focal_power(Role::Operator, self.current_session())
    }

    /// The state of the session on the screens.
    pub fn current_session(&self) -> CurrentSession {
        let phase = self.operator_view.borrow().as_ref().map(|view| view.surgeon.phase);
        CurrentSession::of(phase)
    }
}
