//! What a simulated scan is taken of, and how it moves, blurs and is exposed.

use std::sync::Arc;

use parfocal_devices::simulation::patch_defocus::Spot;
use parfocal_devices::simulation::unrest::Restlessness;
use parfocal_devices::simulation::walk::Motion;
use parfocal_imaging::PATCH_SIDE;

use crate::scans::clip::{Area, Clip};
use crate::scans::recorded::RecordedScan;
use crate::scans::relief::StackScene;

/// How a scan moves, blurs and is exposed.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ScanSettings {
    /// How the optimal focal power moves, in focal power a frame.
    pub focus: Motion,
    /// How the crop moves, in pixels a frame.
    pub crop: Motion,
    /// Blur in pixels of standard deviation a unit of focal power, drawn per scan from this range.
    pub blur: (f64, f64),
    /// Shape of the blur.
    pub spot: Spot,
    /// Standard deviation of the noise, in gray levels.
    pub noise: f64,
    /// Hand tremor: each frame is blurred further, by this many pixels (standard deviation) times a normal draw.
    pub tremor: f64,
    /// Unsteady contrast (light, smoke, wet glints): each frame's contrast is scaled by the exponential of this times a
    /// normal draw.
    pub flicker: f64,
    /// Contrast and brightness: gray becomes `gain * gray + offset`.
    pub exposure: (f64, f64),
    /// Share of the light that comes from something in view that moves by itself, as fluids,
    /// instruments and reflections do.
    pub veil: f64,
    /// Standard deviation, in gray levels, of the sensor's fixed pattern.
    pub pattern: f64,
    /// How restless the scene is; `None` if it is not.
    pub unrest: Option<Restlessness>,
    /// Whether something without detail sometimes covers the view: a glove, an instrument, glare.
    pub covered: bool,
}

impl ScanSettings {
    /// The reference benchmark's scans: over still pictures, on which the crop moves as fast as crop
    /// and scene together do in footage. `docs/notebook.md` says how they were calibrated.
    pub fn reference() -> Self {
        Self { crop: Motion { speed: 5.0, memory: 30.0 }, ..Self::default() }
    }

    /// The settings that fit `scene`: the default over a video, the reference's over anything that is still.
    pub fn fitting(scene: &Scene) -> Self {
        match scene {
            Scene::Flat(clip) if clip.len() > 1 => Self::default(),
            _ => Self::reference(),
        }
    }
}

impl Default for ScanSettings {
    /// Scans over footage, which is unsteady enough by itself.
    fn default() -> Self {
        Self {
            focus: Motion { speed: 0.012, memory: 60.0 },
            crop: Motion { speed: 1.0, memory: 30.0 },
            blur: (2.0, 8.0),
            spot: Spot::Gaussian,
            noise: 0.0,
            tremor: 0.0,
            flicker: 0.0,
            exposure: (1.0, 0.0),
            veil: 0.0,
            pattern: 0.0,
            unrest: None,
            covered: false,
        }
    }
}

/// What a scan is taken of.
#[derive(Debug, Clone)]
pub enum Scene {
    /// Sharp pictures, with everything at one distance.
    Flat(Arc<Clip>),
    /// A focal stack, whose places may lie at different distances.
    Stack(Arc<StackScene>),
    /// A recorded scan, played forwards and backwards. Of the settings, only exposure, flicker, noise, pattern and
    /// cover apply.
    Recorded(Arc<RecordedScan>),
}

impl Scene {
    /// Number of its pictures in time; `None` if it is still.
    pub(super) fn frames(&self) -> Option<usize> {
        match self {
            Self::Flat(clip) => Some(clip.len()).filter(|frames| *frames > 1),
            Self::Stack(_) => None,
            Self::Recorded(scan) => Some(scan.poses().len()),
        }
    }

    /// Where a patch's corner may lie along each axis.
    pub(super) fn room(&self) -> [(f64, f64); 2] {
        let (left, top, right, bottom) = match self {
            Self::Flat(clip) => {
                let Area { left, top, right, bottom } = clip.area();
                (left, top, right, bottom)
            }
            Self::Stack(stack) => {
                let (width, height) = stack.planes.size();
                (0, 0, width, height)
            }
            // The recording itself moves, so the crop stays.
            Self::Recorded(_) => (0, 0, PATCH_SIDE, PATCH_SIDE),
        };
        [(left, right), (top, bottom)].map(|(low, high)| (low as f64, (high - PATCH_SIDE) as f64))
    }
}
