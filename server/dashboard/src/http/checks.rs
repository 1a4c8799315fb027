//! The operator's card that says whether everything is ready for a trial: the checks of `parfocal doctor` on the
//! machine, and what the running server knows about its devices and the surgeon's tablet.

use std::path::PathBuf;
use std::sync::Arc;

use axum::Json;
use axum::extract::State;
use jiff::Timestamp;
use jiff::tz::TimeZone;
use serde::Serialize;
use tokio::sync::OwnedMutexGuard;
use tokio::task::spawn_blocking;
use utoipa::ToSchema;

use super::equipment::Equipment;
use super::error::Error;
use super::roles::Operator;
use super::{App, AppState};
use crate::doctor::{self, Finding};
use parfocal_base::clock::Clock;
use parfocal_records::store::look_at_database;

/// Results of all checks.
#[derive(Debug, Serialize, ToSchema)]
pub(super) struct Checks {
    /// When the checks were made, by the server's wall clock.
    #[schema(value_type = String)]
    at: Timestamp,
    /// One result for each thing that was checked.
    findings: Vec<Finding>,
}

/// Whether everything is ready for a trial.
///
/// Checks the machine and the database again.
/// Devices are not asked, because the focus loop holds them: the server reports what it already knows.
#[utoipa::path(get, path = "/api/operator/checks", tag = "operator", responses((status = 200, body = Checks)))]
pub(super) async fn checks(_: Operator, State(app): State<AppState>) -> Result<Json<Checks>, Error> {
    let look = Arc::clone(&app.equipment.look).lock_owned().await;
    // A task of its own, because this handler is dropped when its browser gives up or the disk hangs.
    let folder = app.store.folder().to_owned();
    let looking = tokio::spawn(look_at_machine(folder, Arc::clone(&app.clock), app.address.loopback_only(), look));
    let mut findings = looking.await.map_err(|_| Error::Internal)??;
    let now = app.clock.wall();
    let local = app.address.authority().is_some();
    findings.extend(app.address.certificate_until().map(|until| doctor::certificate(until, local, now)));
    findings.extend(devices(&app));
    Ok(Json(Checks { at: now, findings }))
}

/// Checks the machine, and the database in the data folder `folder`, while nobody else does. `local`: no other machine
/// can connect to the server.
async fn look_at_machine(
    folder: PathBuf,
    clock: Arc<dyn Clock>,
    local: bool,
    _look: OwnedMutexGuard<()>,
) -> Result<Vec<Finding>, Error> {
    let database = doctor::database(&folder, look_at_database(&folder).await);
    let machine = spawn_blocking(move || doctor::machine(&folder, clock.as_ref(), local));
    let mut findings = machine.await.map_err(|_| Error::Internal)?;
    findings.extend(database);
    Ok(findings)
}

fn devices(app: &App) -> Vec<Finding> {
    let status = Arc::clone(&app.control.status.borrow());
    let Equipment { calibration, mosaics, .. } = &app.equipment;
    let now = app.clock.wall().to_zoned(TimeZone::system());

    let mut findings = vec![
        doctor::camera_in_use(&status.camera),
        doctor::lens_in_use(&status.lens),
        doctor::calibration(calibration, *mosaics, status.camera.simulated, now.date()),
    ];
    findings.extend(doctor::tablets(&app.tablets.open()));
    findings.extend(doctor::tried(&app.tablet_trials.all(), &now));
    findings
}
