//! The whole server around a trial of [`super::fixture`]: every page, without camera and lens.

use std::path::Path;
use std::sync::Arc;

use parfocal_base::clock::Clock;
use parfocal_dashboard::health::HealthWatch;
use parfocal_dashboard::http::keys::Keys;
use parfocal_dashboard::http::{App, Equipment, Metrics, OpenTablets, ServerAddress, TabletTrials};
use parfocal_imaging::{Calibration, Developer, Reconstructor, Size};
use parfocal_pipeline::control::Eye;
use parfocal_pipeline::live;
use parfocal_records::store::Backups;
use parfocal_results::study_export::StudyExports;
use parfocal_session::playback::Player;
use parfocal_session::recorder::{RecorderParts, Recordings};
use tokio::sync::watch;

use super::fixture::Trial;

/// The pages of `trial`, whose data are in `folder`, until `shutdown` turns true. Threads that wait for pictures end
/// when the trial's `control.frames` is closed.
pub fn app(trial: &Trial, folder: &Path, address: ServerAddress, shutdown: watch::Receiver<bool>) -> Arc<App> {
    let clock: Arc<dyn Clock> = trial.clock.clone();
    let control = trial.control.clone();
    let calibration = Arc::new(Calibration::default());
    let registry = parfocal_autofocus::Registry::standard();
    let onlooking = (Eye::new(Reconstructor::default()), registry.clone());
    let (live, _) = live::start(control.clone(), &Developer::new(&calibration), Size::Full, onlooking, &clock).unwrap();
    let conductor = trial.conductor.clone();
    let recordings = folder.join("recordings");

    Arc::new(App {
        accounts: trial.accounts(),
        study_exports: StudyExports::new(folder),
        backups: Backups::new(folder),
        live: live.clone(),
        store: trial.store.clone(),
        health: HealthWatch::new(
            Arc::clone(&clock),
            control.status.clone(),
            conductor.operator_view(),
            trial.store.clone(),
        ),
        player: Player::new(trial.reports.clone(), recordings.clone()).unwrap(),
        recordings: Recordings::new(RecorderParts {
            clock: Arc::clone(&clock),
            run: trial.store.run(),
            tap: control.tap.clone(),
            status: control.status.clone(),
            controls: control.camera.clone(),
            live,
            conductor: conductor.clone(),
            folder: recordings,
            calibration: Calibration::clone(&calibration),
            size: None,
        }),
        surgeon_view: conductor.surgeon_view(),
        operator_view: conductor.operator_view(),
        conductor,
        reports: trial.reports.clone(),
        library: trial.library.clone(),
        registry,
        keys: Keys::load_or_create(folder).unwrap(),
        address,
        equipment: Equipment::new(calibration, None),
        tablets: OpenTablets::default(),
        tablet_trials: TabletTrials::default(),
        metrics: Metrics::default(),
        shutdown,
        control: control.observer(),
        clock,
    })
}
