//! The look of a focal stack, whose places may lie at different distances.

use std::sync::Arc;

use super::course::Course;
use crate::scans::reach::{Following, LensOverStack, Reach, whole};
use crate::scans::relief::{Distance, StackScene};
use parfocal_base::{BlurRate, FocalPower};
use parfocal_imaging::{Patch, View};

/// A focal stack, and how a lens's focal power becomes a position in it.
#[derive(Debug, Clone)]
pub struct StackLook {
    stack: Arc<StackScene>,
    optics: LensOverStack,
    following: Option<Following>,
}

impl StackLook {
    /// Draws the optics. A hand that follows knows its way ahead, so the crop of `course` advances.
    pub fn new(stack: Arc<StackScene>, course: &mut Course) -> Self {
        let optics = LensOverStack::draw(&stack, &mut course.random);
        let follows = stack.distance != Distance::Kept;
        let following = follows.then(|| Following::new(&stack, &mut course.crop, &mut course.random));
        Self { stack, optics, following }
    }

    /// The focal power at which the patch is sharpest, of those that the lens reaches.
    pub fn optimum(&self, course: &Course) -> FocalPower {
        let reach = self.reach(course);
        let sharpest = self.stack.planes.sharpest_within(whole(self.corner(course)), self.optics.ends(reach));
        FocalPower::nearest(self.optics.focal_power(reach, sharpest))
    }

    /// How fast blur grows. `None` for photographs, of which it is not known.
    pub fn blur(&self) -> Option<BlurRate> {
        (self.stack.distance == Distance::Kept).then(|| BlurRate::new(self.optics.slope.abs())).flatten()
    }

    /// The light of the patch.
    pub fn light(&self, course: &Course, focal_power: FocalPower) -> Patch {
        let (corner, position) = self.place(course, focal_power);
        self.stack.planes.patch(corner, position)
    }

    /// The light of the patch, of the wider patches, and of what is around them.
    pub fn light_around(&self, course: &Course, focal_power: FocalPower) -> View {
        let (corner, position) = self.place(course, focal_power);
        self.stack.planes.view(corner, position)
    }

    /// Advances to the next frame; `course` has advanced before.
    pub fn advance(&mut self, course: &Course) {
        if let Some(following) = &mut self.following {
            following.advance(&self.stack, course.corner());
        }
    }

    /// Where in the stack the patch lies, and the position of the focal plane.
    fn place(&self, course: &Course, focal_power: FocalPower) -> ((usize, usize), f64) {
        let (x, y) = self.corner(course);
        let position = self.optics.position(self.reach(course), focal_power.get());
        let [along, down] = self.optics.shift.map(|shift| shift * position);
        (whole((x + along, y + down)), position)
    }

    fn reach(&self, course: &Course) -> Reach {
        let anchor = self.following.as_ref().map_or(0.0, Following::anchor);
        self.optics.reach(&self.stack, course.focus.position(), anchor)
    }

    /// Where the patch's corner lies.
    fn corner(&self, course: &Course) -> (f64, f64) {
        self.following.as_ref().map_or_else(|| course.corner(), Following::corner)
    }
}
