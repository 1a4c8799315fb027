//! The phantom as a live camera.

use std::sync::Arc;
use std::time::Duration;

use super::pace::Pace;
use super::pool::MosaicPool;
use super::{Camera, CameraError, CameraHealth, CameraSettings, Frame, FrameImage, Truth};
use crate::simulation::phantom::{Hand, Phantom, Pose, SENSOR_HEIGHT, SENSOR_WIDTH, Tile};
use parfocal_base::clock::Moment;

/// What the phantom's camera looks at, and how it is held.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum PhantomScene {
    /// The brain, and the camera in a hand.
    Hand,
    /// The brain, and the camera in a clamp.
    Clamp,
    /// A white tile under even light.
    WhiteTile,
    /// The lens cap.
    Cap,
}

impl PhantomScene {
    /// The scene that `name` stands for in `phantom:name`.
    #[must_use]
    pub fn named(name: &str) -> Option<Self> {
        match name {
            "still" => Some(Self::Clamp),
            "white" => Some(Self::WhiteTile),
            "dark" => Some(Self::Cap),
            _ => None,
        }
    }
}

/// Brightness of the white tile, as a share of full scale.
const WHITE: f32 = 0.8;
/// Place of the camera in the clamp: over the middle of the brain, in focus at the middle of the range.
const CLAMPED: Pose = Pose { place: [0.0; 2], roll: 0.0, tilt: [0.0; 2], focus: 0.5 };
/// Frames after which a camera in a clamp keeps its exposure, so that sharpness changes with focus alone.
const EXPOSURE_FOUND: u64 = 20;

/// The phantom, seen live through a lens. The exposure takes place while the picture is being computed:
/// it is centred on the computation's start, when the lens is looked through, and ends when the frame is
/// handed over.
pub struct PhantomCamera {
    motif: Motif,
    settings: CameraSettings,
    pace: Pace,
    pool: MosaicPool,
    start: Moment,
}

/// What is before the camera.
enum Motif {
    Brain { phantom: Box<Phantom>, mount: Mount },
    Tile(Box<Tile>),
}

/// What holds the camera.
enum Mount {
    Hand(Box<Hand>),
    Clamp,
}

impl PhantomCamera {
    /// The phantom of the settings' seed, with the camera in a hand.
    #[must_use]
    pub fn new(settings: CameraSettings) -> Self {
        Self::looking(PhantomScene::Hand, settings)
    }

    /// The phantom of the settings' seed, with the scene `before`. To draw the brain takes about a fifth of a second.
    #[must_use]
    pub fn looking(before: PhantomScene, settings: CameraSettings) -> Self {
        let seed = settings.seed;
        let brain = |mount| Motif::Brain { phantom: Box::new(Phantom::new(seed)), mount };
        let motif = match before {
            PhantomScene::Hand => brain(Mount::Hand(Box::new(Hand::new(seed)))),
            PhantomScene::Clamp => brain(Mount::Clamp),
            PhantomScene::WhiteTile => Motif::Tile(Box::new(Tile::new(seed, WHITE))),
            PhantomScene::Cap => Motif::Tile(Box::new(Tile::new(seed, 0.0))),
        };

        let start = settings.clock.now();
        Self {
            motif,
            pace: Pace::new(settings.fps, start),
            pool: MosaicPool::new(SENSOR_WIDTH, SENSOR_HEIGHT),
            start,
            settings,
        }
    }

    /// Takes exposure `number`, looking through the lens at `looked`. Returns the truth about it, if it
    /// shows the brain.
    fn expose(&mut self, number: u64, looked: Moment, samples: &mut [u16]) -> Option<Truth> {
        let (phantom, mount) = match &mut self.motif {
            Motif::Brain { phantom, mount } => (phantom, mount),
            Motif::Tile(tile) => {
                tile.expose(samples);
                return None;
            }
        };

        let exposed = self.settings.optics.focal_power_at(looked);
        let (pose, adjusts) = match mount {
            Mount::Hand(hand) => (hand.pose_at(looked.since(self.start)), true),
            Mount::Clamp => (CLAMPED, number <= EXPOSURE_FOUND),
        };

        phantom.expose(&pose, exposed, samples);
        if adjusts {
            phantom.adjust_exposure(samples);
        }

        Some(Truth { optimal: phantom.optimal(&pose), exposed })
    }
}

impl Camera for PhantomCamera {
    fn next_frame(&mut self, timeout: Duration) -> Result<Frame, CameraError> {
        let number = self.pace.wait(&*self.settings.clock, timeout)?;
        let looked = self.settings.clock.now();

        let mut samples = self.pool.blank();
        let truth = self.expose(number, looked, &mut samples);
        let image = self.pool.frame(samples)?;

        let exposed_at = self.settings.clock.now();
        self.pace.delivered(exposed_at);

        Ok(Frame {
            number,
            exposed_at,
            exposure: exposed_at.since(looked) * 2,
            image: FrameImage::Mosaic(image),
            truth,
        })
    }

    fn mosaic_size(&self) -> Option<(usize, usize)> {
        Some((SENSOR_WIDTH, SENSOR_HEIGHT))
    }

    fn computes(&self) -> bool {
        true
    }

    fn health(&self) -> CameraHealth {
        CameraHealth {
            name: Arc::from("brain phantom (simulated)"),
            simulated: true,
            working: true,
            message: self.pace.message(),
            fps: self.pace.rate(self.settings.clock.now()),
            lost: self.pace.lost(),
        }
    }
}
