//! Autofocus: focus metrics and the policies that decide which way to turn the lens. Knows no camera, lens or database.

pub mod belief;
mod fixed;
mod hill_climber;
pub mod learned;
mod metrics;
pub mod networks;
mod registration;
mod registry;
pub mod scripted;
mod sharpness_memory;
pub mod shipped;
pub mod spectrum;
pub mod weights;

pub use fixed::Fixed;
pub use hill_climber::HillClimber;
pub use metrics::{mgm, mlr};
pub use registry::{PolicyEntry, PolicyError, PolicyName, Registry};

use std::sync::Arc;

use crate::imaging::View;
use crate::lens::FocalPower;

/// Step of the paper's policies in focal power.
pub const STEP: f64 = 0.05;
/// Errors of focal power below this are in focus, as in the paper.
pub const IN_FOCUS: f64 = 0.1;

/// Decides, frame by frame, which focal power to ask for next.
pub trait Policy: Send {
    /// What of a frame this policy uses; constant for an instance. Nothing wider need be shown to it.
    fn field_of_view(&self) -> FieldOfView;

    /// One step. What comes back is not trusted: the control loop checks it.
    fn step(&mut self, seen: &Observation<'_>) -> Decision;

    /// Tells the policy, before its first step, how fast the optic blurs. Most have no use for that.
    fn learn_of(&mut self, _blur: BlurRate) {}
}

/// How fast an optic blurs: pixels of blur (standard deviation) in the picture for a change of focal
/// power by 1. `parfocal scan info` measures it.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct BlurRate(f64);

impl BlurRate {
    /// Least and most that an optic can have.
    pub const RANGE: std::ops::RangeInclusive<f64> = 0.1..=200.0;

    /// `pixels` a unit of focal power; `None` outside [`BlurRate::RANGE`].
    #[must_use]
    pub fn new(pixels: f64) -> Option<Self> {
        Self::RANGE.contains(&pixels).then_some(Self(pixels))
    }

    /// Pixels a unit of focal power.
    #[must_use]
    pub const fn get(self) -> f64 {
        self.0
    }
}

impl std::str::FromStr for BlurRate {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, Self::Err> {
        let pixels = text.parse().map_err(|_| format!("'{text}' is no number of pixels"))?;
        Self::new(pixels).ok_or_else(|| format!("must be from {} to {} pixels", Self::RANGE.start(), Self::RANGE.end()))
    }
}

/// How much of a frame a policy uses.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum FieldOfView {
    /// The patch alone, as the paper's policies do.
    Patch,
    /// The patch and the wider patches around it, which cost the control loop sixteen times the pixels.
    Wide,
}

/// What a policy sees: one view, and the focal power that it was exposed at.
#[derive(Debug, Clone, Copy)]
pub struct Observation<'a> {
    /// The patch, and the wider patches if the policy's field of view has them.
    pub view: &'a View,
    /// Focal power that it was exposed at.
    pub focal_power: FocalPower,
}

/// What a policy answers.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Decision {
    /// Focal power to go to; checked by the control loop, so a plain number.
    pub target: f64,
    /// The focus metric that the policy computed, if it has one.
    pub metric: Option<f64>,
    /// Probability of each of equally wide slices of 0..=1 to hold the optimum, if the policy has a belief.
    pub belief: Option<Arc<[f32]>>,
}
