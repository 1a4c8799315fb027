//! What a surgeon's page gets on `/live`. These types have no field for a policy, its focal power,
//! metric or timing, and their form is the same for every policy.

use std::sync::Arc;

use jiff::Timestamp;
use serde::Serialize;
use tokio::sync::watch;
use utoipa::ToSchema;

use super::audience::{Audience, Journey};
use crate::http::App;
use parfocal_base::PatchPlace;
use parfocal_base::step::Hold;
use parfocal_imaging::PatchArea;
use parfocal_pipeline::control::ControlStatus;
use parfocal_pipeline::live::{DepthMap, DepthMaps, EncodedFrame, Picture};
use parfocal_trial::view::SurgeonView;

/// A surgeon's page.
pub(super) struct ForSurgeon;

/// What is sent with each picture.
#[derive(Debug, Clone, PartialEq, Serialize, ToSchema)]
pub(super) struct SurgeonFrame {
    /// Number of the frame.
    frame: u64,
    /// Number of the server's run in which the frame was counted.
    run: i64,
    /// Milliseconds from the end of the exposure to sending; in whole hundreds for those who must not know the policy.
    age: f64,
    /// Milliseconds that the latest pictures took from sending to this page, in whole tens: half of the round trip and
    /// the time to carry a picture.
    travel: f64,
    /// Width of the picture in pixels.
    width: usize,
    /// Height of the picture in pixels.
    height: usize,
    /// Pixels of the picture along each side of a mosaic cell: 1, 2 or 4.
    per_cell: usize,
    /// Whether the link is too slow for the size of pictures that the screen can show.
    reduced: bool,
    /// Whether the colours are estimated from bands that hold no red.
    estimated: bool,
    /// The patch that is brought into focus, in cells.
    #[schema(value_type = Object)]
    patch: PatchArea,
    /// The bright circle, in cells, if one is detected.
    area: Option<Circle>,
    /// Whether somebody has chosen what is to be in focus, so that the patch is not at the centre.
    pointed: bool,
    /// How often somebody has chosen since the server started. When this grows, the patch was placed.
    choices: u64,
}

/// A circle in mosaic cells.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, ToSchema)]
pub(super) struct Circle {
    x: f64,
    y: f64,
    radius: f64,
}

impl SurgeonFrame {
    /// What is sent with `picture` on its `journey`.
    pub(super) fn new(picture: &Picture, journey: Journey, app: &App) -> Self {
        Self {
            frame: picture.number,
            run: app.store.run(),
            age: journey.age_ms,
            travel: journey.travel_ms,
            width: picture.width,
            height: picture.height,
            per_cell: picture.per_cell,
            reduced: journey.reduced,
            estimated: picture.estimated,
            patch: picture.patch,
            area: picture.content_area.map(|area| Circle { x: area.x, y: area.y, radius: area.radius }),
            pointed: picture.aim.place != PatchPlace::CENTRE,
            choices: picture.aim.choices,
        }
    }
}

/// The state of the devices, as far as a surgeon needs to know it.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, ToSchema)]
pub(super) struct SurgeonStatus {
    /// Whether the pictures come from a simulated camera.
    camera_simulated: bool,
    /// Whether the lens is simulated.
    lens_simulated: bool,
    /// What is wrong, if anything; the same for every policy.
    notice: Option<SurgeonNotice>,
    /// When the server's certificate expires. The page cannot reach the server after that.
    #[schema(value_type = Option<String>)]
    certificate_until: Option<Timestamp>,
}

/// What is wrong with the devices, as far as a surgeon needs to know it. The page has the words.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, ToSchema)]
#[serde(rename_all = "kebab-case")]
enum SurgeonNotice {
    /// The camera is not delivering pictures.
    CameraFailed,
    /// The lens does not answer, so the focus is held.
    LensFailed,
}

impl SurgeonStatus {
    /// Reports devices that fail, whatever policy runs. A policy that fails is reported only to the operator: a notice
    /// that comes with only one policy would tell it from the others.
    fn new(status: &ControlStatus, certificate_until: Option<Timestamp>) -> Self {
        let notice = match status.held {
            Some(Hold::CameraFailed) => Some(SurgeonNotice::CameraFailed),
            Some(Hold::LensFailed) => Some(SurgeonNotice::LensFailed),
            _ => None,
        };

        Self {
            camera_simulated: status.camera.simulated,
            lens_simulated: status.lens.simulated,
            notice,
            certificate_until,
        }
    }
}

/// The same journey with the picture's age in whole hundreds of milliseconds. The exact age includes the policy's own
/// time, from hundredths of a millisecond to some milliseconds on a busy machine, and would tell policies apart. A page
/// needs to know only whether the picture is older than half a second.
pub(super) fn coarse(journey: Journey) -> Journey {
    Journey { age_ms: (journey.age_ms / 100.0).floor() * 100.0, ..journey }
}

impl Audience for ForSurgeon {
    type Header = SurgeonFrame;
    type Session = SurgeonView;
    type Status = SurgeonStatus;

    const LEADS: bool = true;

    fn depth_maps(_: &App) -> Option<DepthMaps> {
        None
    }

    fn header(frame: &EncodedFrame, journey: Journey, _: Option<Arc<DepthMap>>, app: &App) -> SurgeonFrame {
        SurgeonFrame::new(&frame.picture, coarse(journey), app)
    }

    fn sessions(app: &App) -> watch::Receiver<Option<Arc<SurgeonView>>> {
        app.surgeon_view.clone()
    }

    fn status(status: &ControlStatus, app: &App) -> SurgeonStatus {
        SurgeonStatus::new(status, app.address.certificate_until())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_age_does_not_show_how_long_a_policy_took() {
        let told = |age_ms| coarse(Journey { age_ms, travel_ms: 10.0, reduced: false }).age_ms;
        assert!([3.1, 9.9, 24.0].into_iter().all(|age| told(age) == 0.0));
        assert!((told(612.4) - 600.0).abs() < 1e-9);
    }
}
