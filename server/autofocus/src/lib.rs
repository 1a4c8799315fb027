//! Autofocus: focus metrics, and the policies that decide where the lens goes. Uses no camera, lens or database.

pub mod belief;
mod bisection;
pub mod exec;
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

pub use bisection::Bisection;
pub use fixed::Fixed;
pub use hill_climber::HillClimber;
pub use metrics::{mgm, mlr};
pub use registry::{PolicyEntry, PolicyError, Registry};

use std::sync::Arc;

use parfocal_base::{BlurRate, FocalPower};
use parfocal_imaging::View;

/// Step of the paper's policies in focal power.
pub const STEP: f64 = 0.05;

/// Decides, frame by frame, to which focal power the lens should go next.
pub trait Policy: Send {
    /// Which part of a frame this policy uses. Constant for an instance; wider patches need not be made for it.
    fn field_of_view(&self) -> FieldOfView;

    /// Decides for one frame. The decision is not trusted: the control loop checks it.
    fn step(&mut self, seen: &Observation<'_>) -> Decision;

    /// Gives the policy, before its first step, the blur rate of the optics. Most policies ignore it.
    fn learn_of(&mut self, _blur: BlurRate) {}

    /// Why the last step gave no focal power, if the policy knows: one that runs in another process does.
    fn fault(&self) -> Option<Fault> {
        None
    }
}

/// Why a policy in another process gave no focal power.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
pub enum Fault {
    /// It took too long.
    #[error("it did not answer in time")]
    Late,
    /// It has ended, or cannot be reached.
    #[error("{0}")]
    Ended(String),
    /// It sent something that is not an answer.
    #[error("it sent {0}")]
    Nonsense(String),
}

/// How much of a frame a policy uses.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum FieldOfView {
    /// Only the patch, like the paper's policies.
    Patch,
    /// The patch and the wider patches around it. For them the control loop develops sixteen times as many pixels.
    Wide,
    /// As [`FieldOfView::Wide`], and these pixels themselves.
    Surroundings,
}

/// What a policy sees of a frame.
#[derive(Debug, Clone, Copy)]
pub struct Observation<'a> {
    /// The patch, and the wider patches if the policy's field of view has them.
    pub view: &'a View,
    /// Focal power at which the frame was exposed.
    pub focal_power: FocalPower,
}

/// What a policy decides for a frame.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Decision {
    /// Focal power to go to. A plain number, because the control loop checks it.
    pub target: f64,
    /// The focus metric that the policy computed, if it has one.
    pub metric: Option<f64>,
    /// Probability distribution of the optimum over equally spaced focal powers from 0 to 1, if the policy has a
    /// belief.
    pub belief: Option<Arc<[f32]>>,
}
