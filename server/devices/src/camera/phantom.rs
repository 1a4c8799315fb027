//! The phantom as a live camera.

use std::time::Duration;

use super::playback::{Playback, PlayedScene};
use super::pool::MosaicPool;
use super::{Camera, CameraSettings, FrameImage};
use crate::simulation::phantom::{Hand, Phantom, Pose, SENSOR_HEIGHT, SENSOR_WIDTH, Tile};
use parfocal_base::FocalPower;
use parfocal_imaging::FrameError;

/// Brightness of the white tile, as a share of full scale.
const WHITE: f32 = 0.8;
/// Place of the camera in the clamp: over the middle of the brain, in focus at the middle of the range.
const CLAMPED: Pose = Pose { place: [0.0; 2], roll: 0.0, tilt: [0.0; 2], focus: 0.5 };
/// Frames after which a camera in a clamp keeps its exposure, so that sharpness changes with focus alone.
const EXPOSURE_FOUND: u64 = 20;

/// The phantom's camera that `spec` names; `None` if it names none. To draw the brain takes about a fifth of a second.
pub fn open(spec: &str, settings: CameraSettings) -> Option<impl Camera + use<>> {
    let seed = settings.seed;
    let brain = |mount| Motif::Brain { phantom: Box::new(Phantom::new(seed)), mount };
    let motif = match spec {
        "phantom" => brain(Mount::Hand(Box::new(Hand::new(seed)))),
        "phantom:still" => brain(Mount::Clamp),
        "phantom:white" => Motif::Tile(Box::new(Tile::new(seed, WHITE))),
        "phantom:dark" => Motif::Tile(Box::new(Tile::new(seed, 0.0))),
        _ => return None,
    };

    let scene = PhantomScene { motif, pool: MosaicPool::new(SENSOR_WIDTH, SENSOR_HEIGHT) };
    Some(Playback::new("brain phantom (simulated)".to_owned(), scene, settings))
}

/// What the phantom's camera looks at.
struct PhantomScene {
    motif: Motif,
    pool: MosaicPool,
}

/// What is before the camera.
enum Motif {
    Brain {
        phantom: Box<Phantom>,
        mount: Mount,
    },
    /// A white tile under even light, or the lens cap.
    Tile(Box<Tile>),
}

/// What holds the camera.
enum Mount {
    Hand(Box<Hand>),
    Clamp,
}

impl PlayedScene for PhantomScene {
    type Error = FrameError;

    fn look(
        &mut self,
        number: u64,
        time: Duration,
        focal_power: FocalPower,
    ) -> Result<(FrameImage, Option<FocalPower>), FrameError> {
        let mut samples = self.pool.blank();
        let optimal = match &mut self.motif {
            Motif::Brain { phantom, mount } => {
                let (pose, adjusts) = match mount {
                    Mount::Hand(hand) => (hand.pose_at(time), true),
                    Mount::Clamp => (CLAMPED, number <= EXPOSURE_FOUND),
                };

                phantom.expose(&pose, focal_power, &mut samples);
                if adjusts {
                    phantom.adjust_exposure(&samples);
                }
                Some(phantom.optimal(&pose))
            }
            Motif::Tile(flat) => {
                flat.expose(&mut samples);
                None
            }
        };

        Ok((FrameImage::Mosaic(self.pool.frame(samples)?), optimal))
    }

    fn mosaic_size(&self) -> Option<(usize, usize)> {
        Some((SENSOR_WIDTH, SENSOR_HEIGHT))
    }
}
