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
pub mod shipped;
pub mod spectrum;
mod tiles;
pub mod tracking;
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

    /// Takes in one frame while something else moves the lens, which was then asked for `asked`. Returns the belief about
    /// the optimum (see [`Decision::belief`]); `None` if the policy has none. Call it in place of [`Policy::step`].
    fn look_on(&mut self, _seen: &Observation<'_>, _asked: FocalPower) -> Option<Arc<[f32]>> {
        None
    }

    /// The patch has jumped to another place: what this policy remembers of the old one is no longer comparable. From
    /// the next step on it decides as a new instance would that begins at that focal power. What it knows of the optics
    /// stays. A policy without a memory of frames has nothing to do.
    fn forget(&mut self) {}

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

#[cfg(test)]
mod tests {
    use super::*;
    use parfocal_devices::simulation::blur::gaussian_blur;
    use parfocal_devices::simulation::texture::texture;
    use parfocal_imaging::{GrayImage, PATCH_SIDE, Patch};

    /// What is seen of `picture` with the patch's corner at `(x, y)`.
    pub fn view(picture: &GrayImage, (x, y): (usize, usize)) -> View {
        let level = |x: usize, y: usize| picture.data[y * picture.width + x];
        let patch = Patch(std::array::from_fn(|i| level(x + i % PATCH_SIDE, y + i / PATCH_SIDE)));
        View::around(patch, (x, y), (picture.width, picture.height), |square| {
            (0..square.side * square.side)
                .map(|i| level(square.x + i % square.side, square.y + i / square.side))
                .collect()
        })
    }

    /// The decisions of `policy` on a still scene, from focal power 0.5 on, with the patch at `place`.
    fn decisions(policy: &mut dyn Policy, seed: u64, place: (usize, usize)) -> Vec<Decision> {
        let picture = texture(seed, 256);
        let mut focal_power = FocalPower::MIDDLE;
        let step = |_| {
            let blurred = gaussian_blur(&picture, 6.0 * (focal_power.get() - 0.7).abs());
            let decision = policy.step(&Observation { view: &view(&blurred, place), focal_power });
            focal_power = FocalPower::nearest(decision.target);
            decision
        };
        (0..12).map(step).collect()
    }

    #[test]
    fn no_policy_compares_the_patch_with_that_of_another_place() {
        let registry = Registry::standard();
        for entry in registry.entries().into_iter().filter(|entry| entry.available) {
            let mut jumped = registry.build(&entry.name).unwrap();
            decisions(&mut *jumped, 3, (40, 60));
            jumped.forget();

            let mut new = registry.build(&entry.name).unwrap();
            let expected = decisions(&mut *new, 8, (120, 90));
            assert_eq!(decisions(&mut *jumped, 8, (120, 90)), expected, "{}", entry.name);
        }
    }
}
