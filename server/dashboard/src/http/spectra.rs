//! Spectra at places of the live picture, for the operator outside sessions.

use std::sync::Arc;
use std::time::Duration;

use axum::Json;
use axum::extract::State;
use serde::{Deserialize, Serialize};
use tokio::sync::oneshot;
use tokio::time::timeout;
use utoipa::ToSchema;

use super::error::Error;
use super::json::JsonBody;
use super::roles::Operator;
use super::{App, AppState};
use parfocal_base::priority;
use parfocal_devices::camera::FrameImage;
use parfocal_imaging::{BadCircle, Calibration, Circle, MosaicFrame, SpectrumSum};
use parfocal_pipeline::control::ControlledFrame;
use parfocal_session::playback::PlaceSpectrum;
use parfocal_trial::permission::{self, Request};
use parfocal_trial::role::Role;

/// Most places in one request.
const MOST_PLACES: usize = 5;

/// Largest radius, in samples. A circle of the whole picture would take as long as a step of the loop.
const LARGEST_RADIUS: f64 = 256.0;

/// Longest wait for a frame.
const PATIENCE: Duration = Duration::from_secs(2);

/// Places of the live picture.
#[derive(Debug, Deserialize, ToSchema)]
pub(super) struct LivePlaces {
    /// The places.
    #[schema(min_items = 1, max_items = 5)]
    places: Vec<LivePlace>,
}

/// A circle in the camera's mosaic.
#[derive(Debug, Clone, Copy, Deserialize, ToSchema)]
struct LivePlace {
    /// Centre: samples of the mosaic from its left edge.
    x: f64,
    /// Centre: samples of the mosaic from its upper edge.
    y: f64,
    /// All cells whose middle is this near to the centre are taken, in samples. With 0, the cell there.
    #[serde(default)]
    #[schema(minimum = 0, maximum = 256)]
    radius: f64,
}

/// The spectra of one frame.
#[derive(Debug, Serialize, ToSchema)]
pub(super) struct LiveSpectra {
    /// Number of the frame.
    frame: u64,
    /// The spectrum at each place, in the order in which they were asked for.
    spectra: Vec<PlaceSpectrum>,
}

/// The spectra at places of the camera's next frame. Not while a session is under way.
#[utoipa::path(post, path = "/api/operator/spectra", tag = "operator", request_body = LivePlaces, responses(
    (status = 200, body = LiveSpectra),
    (status = 409, description = "A session is under way, the camera delivers nothing, or its pictures have no bands"),
    (status = 422, description = "No such place in the picture, too many places, or too large a circle")))]
pub(super) async fn spectra(
    _: Operator,
    State(app): State<AppState>,
    JsonBody(LivePlaces { places }): JsonBody<LivePlaces>,
) -> Result<Json<LiveSpectra>, Error> {
    check(&app)?;
    let circles = circles(&places)?;
    let frame = next_frame(&app).await?;
    let FrameImage::Mosaic(mosaic) = &frame.frame.image else {
        return Err(Error::Conflict("The camera delivers colour pictures, which have no spectra.".to_owned()));
    };

    let spectra = measure(&app, Arc::clone(mosaic), circles).await?;
    // A session may have begun meanwhile.
    check(&app)?;
    Ok(Json(LiveSpectra { frame: frame.frame.number, spectra }))
}

/// Whether spectra may be seen now.
fn check(app: &App) -> Result<(), Error> {
    Ok(permission::check(Role::Operator, Request::SeeSpectra, app.current_session())?)
}

fn circles(places: &[LivePlace]) -> Result<Vec<Circle>, Error> {
    if !(1..=MOST_PLACES).contains(&places.len()) {
        return Err(Error::Invalid(format!("Ask for 1 to {MOST_PLACES} places at once, not {}.", places.len())));
    }
    if let Some(large) = places.iter().find(|place| place.radius > LARGEST_RADIUS) {
        return Err(Error::Invalid(format!(
            "A radius must be {LARGEST_RADIUS} samples or less on the live picture, not {}.",
            large.radius
        )));
    }
    Ok(places.iter().map(|&LivePlace { x, y, radius }| Circle { x, y, radius }).collect())
}

/// The next frame that the imaging thread takes from the loop. The loop does not wait for it.
async fn next_frame(app: &App) -> Result<Arc<ControlledFrame>, Error> {
    let mut frames = app.live.frames();
    let mut next = async || {
        loop {
            frames.changed().await.ok()?;
            if let Some(frame) = frames.borrow_and_update().clone() {
                return Some(frame);
            }
        }
    };
    timeout(PATIENCE, next()).await.ok().flatten().ok_or_else(|| {
        Error::Conflict("The camera is not delivering pictures, so there is no spectrum now. Try again.".to_owned())
    })
}

/// Computes on a thread of low priority, so that loop and live view come first.
async fn measure(app: &App, mosaic: Arc<MosaicFrame>, circles: Vec<Circle>) -> Result<Vec<PlaceSpectrum>, Error> {
    let calibration = Arc::clone(&app.equipment.calibration);
    let (reply, found) = oneshot::channel();

    let _one_at_a_time = app.equipment.spectra.lock().await;
    let thread = std::thread::Builder::new().name("spectra".into());
    let started = thread.spawn(move || {
        priority::lower_further();
        let spectra: Result<_, _> = circles.iter().map(|circle| spectrum(&calibration, *circle, &mosaic)).collect();
        let _ = reply.send(spectra);
    });
    started.map_err(|_| Error::Internal)?;

    let spectra = found.await.map_err(|_| Error::Internal)?;
    spectra.map_err(|bad| Error::Invalid(bad.to_string()))
}

fn spectrum(calibration: &Calibration, circle: Circle, mosaic: &MosaicFrame) -> Result<PlaceSpectrum, BadCircle> {
    let mut sum = SpectrumSum::new(calibration, circle, (mosaic.width(), mosaic.height()))?;
    sum.add(mosaic);
    Ok(PlaceSpectrum::new(calibration, &sum.spectrum()))
}
