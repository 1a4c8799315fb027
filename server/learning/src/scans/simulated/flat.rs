//! The look of sharp pictures with everything at one distance: blurred, restless, with a veil over them.

use std::sync::Arc;

use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;

use super::course::Course;
use super::settings::ScanSettings;
use crate::scans::clip::{Area, Clip};
use crate::scans::reach::{corner, whole};
use parfocal_base::FocalPower;
use parfocal_devices::simulation::patch_defocus::{Defocus, Spot};
use parfocal_devices::simulation::unrest::Unrest;
use parfocal_devices::simulation::walk::Walk;
use parfocal_imaging::{PATCH_SIDE, Patch, Square, View};

/// Sharp pictures, and what happens to their light.
#[derive(Debug, Clone)]
pub struct FlatLook {
    clip: Arc<Clip>,
    /// Blur in pixels a unit of focal power.
    pub blur: f64,
    spot: Spot,
    veil: Option<Veil>,
    unrest: Option<(Unrest, ChaCha8Rng)>,
    defocus: Defocus,
}

/// Something in view that moves by itself; the light of another place of the clip stands for it.
#[derive(Debug, Clone)]
struct Veil {
    share: f32,
    place: [Walk; 2],
    random: ChaCha8Rng,
}

impl FlatLook {
    /// Veil and unrest have random streams of their own, so that turning one off does not change the other.
    pub fn new(clip: Arc<Clip>, blur: f64, room: [(f64, f64); 2], settings: &ScanSettings, seed: u64) -> Self {
        let veil = (settings.veil > 0.0).then(|| {
            let mut random = ChaCha8Rng::seed_from_u64(seed ^ 0x7665_696c);
            let place = room.map(|room| Walk::new(room, settings.crop, &mut random));
            Veil { share: settings.veil as f32, place, random }
        });
        let unrest = settings.unrest.map(|unrest| {
            let mut random = ChaCha8Rng::seed_from_u64(seed ^ 0x756e_7265_7374);
            (Unrest::new(unrest, &mut random), random)
        });
        Self { clip, blur, spot: settings.spot, veil, unrest, defocus: Defocus::default() }
    }

    /// The light of the patch.
    pub fn light(&mut self, course: &Course, focal_power: FocalPower) -> Patch {
        let sigma = self.sigma(course, focal_power);
        let mut patch = self.blurred(course.time, course.corner(), sigma);
        if let Some((share, place)) = self.veiled() {
            mix(&mut patch.0, &self.blurred(course.time, place, sigma).0, share);
        }
        patch
    }

    /// The recorded `patch` with the light of the wider patches and of what is around them, which stay within the
    /// usable part of the picture.
    pub fn light_around(&mut self, course: &Course, patch: &Patch, focal_power: FocalPower) -> View {
        let sigma = self.sigma(course, focal_power);
        let mut view = self.blurred_around(course.time, course.corner(), sigma, patch);

        if let Some((share, place)) = self.veiled() {
            let veil = self.blurred_around(course.time, place, sigma, patch);
            for (patch, veil) in view.wider.iter_mut().flatten().zip(veil.wider.iter().flatten()) {
                mix(&mut patch.0, &veil.0, share);
            }
            if let (Some(seen), Some(veil)) = (&mut view.surroundings, &veil.surroundings) {
                let mut levels = seen.levels.to_vec();
                mix(&mut levels, &veil.levels, share);
                seen.levels = levels.into();
            }
        }

        view
    }

    /// Advances to the next frame.
    pub fn advance(&mut self) {
        if let Some(Veil { place, random, .. }) = &mut self.veil {
            for walk in place {
                walk.advance(random);
            }
        }
        if let Some((unrest, random)) = &mut self.unrest {
            unrest.advance(random);
        }
    }

    /// Standard deviation of the blur, in pixels.
    fn sigma(&self, course: &Course, focal_power: FocalPower) -> f64 {
        let optimum = FocalPower::nearest(course.focus.position());
        (self.blur * focal_power.distance(optimum)).hypot(course.tremor)
    }

    /// The veil's share of the light, and which place of the clip it shows.
    fn veiled(&self) -> Option<(f32, (f64, f64))> {
        self.veil.as_ref().map(|veil| (veil.share, corner(&veil.place)))
    }

    fn blurred(&mut self, time: usize, corner: (f64, f64), sigma: f64) -> Patch {
        let picture = self.clip.at(time);
        match &self.unrest {
            None => self.defocus.patch(picture, (corner.0 as isize, corner.1 as isize), sigma, self.spot),
            Some((unrest, _)) => self
                .defocus
                .patch_of(sigma, self.spot, |_, side, out| unrest.gather(picture, corner, PATCH_SIDE, side, out)),
        }
    }

    fn blurred_around(&mut self, time: usize, corner: (f64, f64), sigma: f64, patch: &Patch) -> View {
        let Area { left, top, right, bottom } = self.clip.area();
        let (x, y) = whole(corner);
        let inside = (x.saturating_sub(left), y.saturating_sub(top));

        View::around(*patch, inside, (right - left, bottom - top), |square| {
            let square = Square { x: square.x + left, y: square.y + top, ..square };
            let Some((unrest, _)) = &self.unrest else {
                return self.defocus.square(self.clip.at(time), square, sigma, self.spot);
            };

            let place = [(square.x, corner.0), (square.y, corner.1)].map(|(pixel, at)| pixel as f64 + at.fract());
            if !Defocus::is_wide(sigma) {
                let picture = self.clip.at(time);
                return self.defocus.square_of(square.side, sigma, self.spot, |_, side, out| {
                    unrest.gather(picture, (place[0], place[1]), square.side, side, out);
                });
            }
            let coarse = self.clip.coarse_at(time);
            self.defocus.coarse_square(square.side, sigma, self.spot, |_, side, out| {
                unrest.gather_coarsely(coarse, (place[0], place[1]), square.side, side, out);
            })
        })
    }
}

/// Replaces `share` of the light `levels` by that of `veil`.
fn mix(levels: &mut [f32], veil: &[f32], share: f32) {
    for (value, veiled) in levels.iter_mut().zip(veil) {
        *value += share * (veiled - *value);
    }
}
