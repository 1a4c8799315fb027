//! Simulated focal-time scans: a crop walks over sharp pictures, the optimal focal power walks too, and what is seen at
//! another focal power is blurred in proportion to the distance (Budd et al., MICCAI 2023).
#![allow(
    clippy::cast_possible_truncation,
    clippy::cast_possible_wrap,
    clippy::cast_precision_loss,
    reason = "pixel arithmetic on small numbers"
)]

use std::sync::Arc;

use multiversion::multiversion;
use rand::{Rng, RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;

use super::clip::{Area, Clip};
use super::cover::Cover;
use super::defocus::{Defocus, Spot};
use super::unrest::{Restlessness, Unrest};
use crate::camera::walk::{Motion, Walk, standard_normal};
use crate::imaging::{PATCH_SIDE, Patch};
use crate::lens::FocalPower;

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
    /// Unsteady contrast (light, smoke, wet glints): each frame's is scaled by the exponential of this times a normal draw.
    pub flicker: f64,
    /// Contrast and brightness: gray becomes `gain * gray + offset`.
    pub exposure: (f64, f64),
    /// Share of the light that comes from something in view that moves by itself, as fluids, instruments and reflections do.
    pub veil: f64,
    /// Standard deviation, in gray levels, of a pattern that stays with the sensor.
    pub pattern: f64,
    /// How restless the scene is, if it is.
    pub unrest: Option<Restlessness>,
    /// Whether now and then something without detail covers the view: a glove, an instrument, glare.
    pub covered: bool,
}

impl ScanSettings {
    /// The reference benchmark's scans: over still pictures, on which the crop moves as fast as crop and scene together do
    /// in footage. `docs/results.md` tells how they were calibrated.
    #[must_use]
    pub fn reference() -> Self {
        Self { crop: Motion { speed: 5.0, memory: 30.0 }, ..Self::default() }
    }

    /// What fits `clip`: the reference's over a still picture, the default over a video.
    #[must_use]
    pub fn over(clip: &Clip) -> Self {
        if clip.len() > 1 { Self::default() } else { Self::reference() }
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

/// One focal-time scan, frame by frame. Its course depends on its seed alone, never on what is looked at.
#[derive(Debug, Clone)]
pub struct Scan {
    clip: Arc<Clip>,
    settings: ScanSettings,
    sigma0: f64,
    tremor: f64,
    contrast: f64,
    time: usize,
    focus: Walk,
    crop: [Walk; 2],
    /// Where the veil lies on the clip, if there is one.
    veil: Option<[Walk; 2]>,
    /// The sensor's pattern, a gray level a pixel; empty if there is none.
    pattern: Vec<f32>,
    unrest: Option<Unrest>,
    cover: Option<Cover>,
    course: ChaCha8Rng,
    veil_course: ChaCha8Rng,
    unrest_course: ChaCha8Rng,
    noise: ChaCha8Rng,
    defocus: Defocus,
}

impl Scan {
    /// A scan over `clip` whose course is drawn from `seed`.
    #[must_use]
    pub fn new(clip: Arc<Clip>, settings: ScanSettings, seed: u64) -> Self {
        let mut course = ChaCha8Rng::seed_from_u64(seed);
        let sigma0 = course.random_range(settings.blur.0..=settings.blur.1);
        let focus = Walk::new((0.0, 1.0), settings.focus, &mut course);
        let Area { left, top, right, bottom } = clip.area();
        let room = [(left, right), (top, bottom)].map(|(low, high)| (low as f64, (high - PATCH_SIDE) as f64));
        let crop = room.map(|room| Walk::new(room, settings.crop, &mut course));
        let time = if clip.len() > 1 { course.random_range(0..2 * clip.len()) } else { 0 };
        let mut noise = ChaCha8Rng::seed_from_u64(seed ^ 0x6e6f_6973_6521);
        let mut veil_course = ChaCha8Rng::seed_from_u64(seed ^ 0x7665_696c);
        let veil = (settings.veil > 0.0).then(|| room.map(|room| Walk::new(room, settings.crop, &mut veil_course)));
        let pixels = if settings.pattern > 0.0 { PATCH_SIDE * PATCH_SIDE } else { 0 };
        let pattern = (0..pixels).map(|_| settings.pattern as f32 * cheap_normal(&mut noise)).collect();
        let mut unrest_course = ChaCha8Rng::seed_from_u64(seed ^ 0x756e_7265_7374);
        let unrest = settings.unrest.map(|unrest| Unrest::new(unrest, &mut unrest_course));
        let cover = settings.covered.then(|| Cover::new(seed ^ 0x0063_6f76_6572));
        let tremor = settings.tremor * standard_normal(&mut course);
        let contrast = (settings.flicker * standard_normal(&mut course)).exp();
        let defocus = Defocus::default();
        Self {
            clip,
            settings,
            sigma0,
            tremor,
            contrast,
            time,
            focus,
            crop,
            veil,
            pattern,
            unrest,
            cover,
            course,
            veil_course,
            unrest_course,
            noise,
            defocus,
        }
    }

    /// The optimal focal power at this frame.
    #[must_use]
    pub fn optimum(&self) -> FocalPower {
        FocalPower::nearest(self.focus.position())
    }

    /// What the camera sees at this frame through a lens at `focal_power`: whole gray levels, 0..=255.
    pub fn observe(&mut self, focal_power: FocalPower) -> Patch {
        let sigma = (self.sigma0 * focal_power.distance(self.optimum())).hypot(self.tremor);
        let mut patch = self.look(corner(&self.crop), sigma);
        if let Some(at) = self.veil.as_ref().map(corner) {
            let share = self.settings.veil as f32;
            let veil = self.look(at, sigma);
            for (value, veiled) in patch.0.iter_mut().zip(veil.0) {
                *value += share * (veiled - *value);
            }
        }
        let (gain, offset) = (self.settings.exposure.0 as f32, self.settings.exposure.1 as f32);
        let detail = self.cover.as_ref().map_or(1.0, Cover::detail);
        expose(&mut patch, gain, (detail * self.contrast) as f32, offset);
        if self.settings.noise > 0.0 {
            for value in &mut patch.0 {
                *value += self.settings.noise as f32 * cheap_normal(&mut self.noise);
            }
        }
        for (value, pattern) in patch.0.iter_mut().zip(&self.pattern) {
            *value += pattern;
        }
        digitise(&mut patch);
        patch
    }

    fn look(&mut self, corner: (f64, f64), sigma: f64) -> Patch {
        let (picture, spot) = (self.clip.at(self.time), self.settings.spot);
        match &self.unrest {
            None => self.defocus.patch(picture, (corner.0 as isize, corner.1 as isize), sigma, spot),
            Some(unrest) => {
                self.defocus.patch_of(sigma, spot, |_, side, out| unrest.gather(picture, corner, side, out))
            }
        }
    }

    /// Goes on to the next frame.
    pub fn advance(&mut self) {
        self.time += 1;
        self.focus.advance(&mut self.course);
        self.crop.iter_mut().for_each(|walk| walk.advance(&mut self.course));
        self.veil.iter_mut().flatten().for_each(|walk| walk.advance(&mut self.veil_course));
        self.unrest.iter_mut().for_each(|unrest| unrest.advance(&mut self.unrest_course));
        self.cover.iter_mut().for_each(Cover::advance);
        self.tremor = self.settings.tremor * standard_normal(&mut self.course);
        self.contrast = (self.settings.flicker * standard_normal(&mut self.course)).exp();
    }
}

fn corner(walks: &[Walk; 2]) -> (f64, f64) {
    (walks[0].position(), walks[1].position())
}

/// Scales what differs from the patch's mean by `contrast`, and all by `gain`.
#[multiversion(targets("x86_64+avx512f", "x86_64+avx2+fma"))]
fn expose(patch: &mut Patch, gain: f32, contrast: f32, offset: f32) {
    let mean = patch.0.iter().sum::<f32>() / patch.0.len() as f32;
    for value in &mut patch.0 {
        *value = gain * (mean + contrast * (*value - mean)) + offset;
    }
}

/// Whole gray levels, 0..=255.
#[multiversion(targets("x86_64+avx512f", "x86_64+avx2+fma"))]
fn digitise(patch: &mut Patch) {
    for value in &mut patch.0 {
        *value = value.clamp(0.0, 255.0).round();
    }
}

/// Nearly normal, mean 0 and variance 1: the sum of four uniform bytes, good enough for camera noise and ten times as
/// fast as an exact draw.
fn cheap_normal(rng: &mut impl Rng) -> f32 {
    let sum: i32 = rng.random::<u32>().to_le_bytes().iter().map(|&byte| i32::from(byte)).sum();
    (sum - 510) as f32 * (1.0 / 147.8)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::training::texture::texture;

    fn scan(seed: u64) -> Scan {
        Scan::new(Arc::new(Clip::still(texture(1, 256)).unwrap()), ScanSettings::default(), seed)
    }

    #[test]
    fn looking_changes_nothing_of_the_course() {
        let (mut looked_at, mut left_alone) = (scan(5), scan(5));
        for _ in 0..50 {
            looked_at.observe(FocalPower::MIN);
            looked_at.advance();
            left_alone.advance();
        }
        assert_eq!(looked_at.optimum(), left_alone.optimum());
        assert_eq!(looked_at.observe(FocalPower::MIDDLE), left_alone.observe(FocalPower::MIDDLE));
    }

    #[test]
    fn the_patch_is_sharpest_at_the_optimum() {
        let mut scan = scan(6);
        let sharp = crate::autofocus::mgm(&scan.observe(scan.optimum()));
        for step in [-0.4, -0.2, 0.2, 0.4] {
            let elsewhere = scan.optimum().moved(step);
            if elsewhere.distance(scan.optimum()) > 0.1 {
                assert!(crate::autofocus::mgm(&scan.observe(elsewhere)) < sharp);
            }
        }
    }

    #[test]
    fn cheap_noise_has_unit_variance() {
        let mut rng = ChaCha8Rng::seed_from_u64(3);
        let draws: Vec<f32> = (0..100_000).map(|_| cheap_normal(&mut rng)).collect();
        let mean = draws.iter().sum::<f32>() / 1e5;
        let variance = draws.iter().map(|v| v * v).sum::<f32>() / 1e5;
        assert!(mean.abs() < 0.02 && (variance - 1.0).abs() < 0.02, "{mean} {variance}");
    }
}
