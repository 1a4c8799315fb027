//! Simulated focal-time scans: a crop walks over sharp pictures, the optimal focal power walks too, and what is seen at
//! another focal power is blurred in proportion to the distance (Budd et al., MICCAI 2023).

use super::FocalTimeScan;
use std::sync::Arc;

use multiversion::multiversion;
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;

use super::clip::{Area, Clip};
use super::reach::{Following, Optics, Reach, corner, whole};
use super::recorded::{Interpolation, RecordedScan};
use super::relief::{Distance, StackScene};
use parfocal_base::BlurRate;
use parfocal_base::FocalPower;
use parfocal_devices::simulation::cover::Cover;
use parfocal_devices::simulation::normal::{cheap_normal, standard_normal};
use parfocal_devices::simulation::patch_defocus::{Defocus, Spot};
use parfocal_devices::simulation::unrest::{Restlessness, Unrest};
use parfocal_devices::simulation::walk::{Motion, Walk};
use parfocal_imaging::{PATCH_SIDE, Patch, Square, Surroundings, View, WIDER};

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
    #[must_use]
    pub fn reference() -> Self {
        Self { crop: Motion { speed: 5.0, memory: 30.0 }, ..Self::default() }
    }

    /// The settings that fit `scene`: the default over a video, the reference's over anything that is still.
    #[must_use]
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

/// One focal-time scan, frame by frame. Its course depends only on its seed, never on what is observed.
#[derive(Debug, Clone)]
pub struct Scan {
    scene: Scene,
    settings: ScanSettings,
    /// Blur in pixels a unit of focal power over flat scenes.
    sigma0: f64,
    /// How focal power becomes a position over focal stacks.
    optics: Option<Optics>,
    tremor: f64,
    contrast: f64,
    time: usize,
    focus: Walk,
    /// Where the crop is; over followed stacks some frames ahead.
    crop: [Walk; 2],
    following: Option<Following>,
    /// Where the veil lies on the clip, if there is one.
    veil: Option<[Walk; 2]>,
    /// The sensor's fixed pattern, in gray levels for each pixel; empty if there is none.
    pattern: Vec<f32>,
    /// The fixed pattern as the wider patches show it.
    wider_pattern: [Vec<f32>; WIDER.len()],
    unrest: Option<Unrest>,
    cover: Option<Cover>,
    course: ChaCha8Rng,
    veil_course: ChaCha8Rng,
    unrest_course: ChaCha8Rng,
    noise: ChaCha8Rng,
    /// Noise of the wider patches. It has its own stream, so that the patch's noise is the same whether the wider
    /// patches are observed or not.
    wider_noise: ChaCha8Rng,
    /// Noise of the surroundings, likewise.
    surrounding_noise: ChaCha8Rng,
    defocus: Defocus,
}

impl Scan {
    /// A scan over `clip` whose course is drawn from `seed`.
    #[must_use]
    pub fn new(clip: Arc<Clip>, settings: ScanSettings, seed: u64) -> Self {
        Self::over(Scene::Flat(clip), settings, seed)
    }

    /// A scan over `scene` whose course is drawn from `seed`. Over a focal stack, blur, spot,
    /// tremor, veil and unrest of `settings` are ignored: the stack has its own.
    #[must_use]
    pub fn over(scene: Scene, settings: ScanSettings, seed: u64) -> Self {
        let mut course = ChaCha8Rng::seed_from_u64(seed);
        let sigma0 = course.random_range(settings.blur.0..=settings.blur.1);
        let focus = Walk::new((0.0, 1.0), settings.focus, &mut course);

        let room = scene.room();
        let mut crop = room.map(|room| Walk::new(room, settings.crop, &mut course));

        let time = match &scene {
            Scene::Flat(clip) if clip.len() > 1 => course.random_range(0..2 * clip.len()),
            Scene::Recorded(scan) => course.random_range(0..2 * scan.poses().len()),
            _ => 0,
        };

        // Each part has its own random stream, so that turning one off does not change the others.
        let mut noise = ChaCha8Rng::seed_from_u64(seed ^ 0x6e6f_6973_6521);
        let mut veil_course = ChaCha8Rng::seed_from_u64(seed ^ 0x7665_696c);
        let veil = (settings.veil > 0.0).then(|| room.map(|room| Walk::new(room, settings.crop, &mut veil_course)));

        let pixels = if settings.pattern > 0.0 { PATCH_SIDE * PATCH_SIDE } else { 0 };
        let pattern = (0..pixels).map(|_| settings.pattern as f32 * cheap_normal(&mut noise)).collect();
        let mut wider_noise = ChaCha8Rng::seed_from_u64(seed ^ 0x7769_6465_7221);
        let wider_pattern = WIDER.map(|scale| {
            let strength = settings.pattern as f32 / scale.pixels() as f32;
            (0..pixels).map(|_| strength * cheap_normal(&mut wider_noise)).collect()
        });

        let mut unrest_course = ChaCha8Rng::seed_from_u64(seed ^ 0x756e_7265_7374);
        let unrest = settings.unrest.map(|unrest| Unrest::new(unrest, &mut unrest_course));
        let cover = settings.covered.then(|| Cover::new(seed ^ 0x0063_6f76_6572));

        let tremor = settings.tremor * standard_normal(&mut course);
        let contrast = (settings.flicker * standard_normal(&mut course)).exp();

        let optics = match &scene {
            Scene::Flat(_) | Scene::Recorded(_) => None,
            Scene::Stack(stack) => Some(Optics::draw(stack, &mut course)),
        };
        let following = match &scene {
            Scene::Stack(stack) if stack.distance != Distance::Kept => {
                Some(Following::new(stack, &mut crop, &mut course))
            }
            _ => None,
        };
        let defocus = Defocus::default();

        Self {
            scene,
            settings,
            sigma0,
            optics,
            tremor,
            contrast,
            time,
            focus,
            crop,
            following,
            veil,
            pattern,
            wider_pattern,
            unrest,
            cover,
            course,
            veil_course,
            unrest_course,
            noise,
            wider_noise,
            surrounding_noise: ChaCha8Rng::seed_from_u64(seed ^ 0x6172_6f75_6e64),
            defocus,
        }
    }

    /// The optimal focal power at this frame.
    #[must_use]
    pub fn optimum(&self) -> FocalPower {
        match (&self.scene, &self.optics) {
            (Scene::Stack(stack), Some(optics)) => {
                let reach = self.reach(stack, optics);
                let sharpest = stack.planes.sharpest_within(whole(self.corner()), optics.ends(reach));
                FocalPower::nearest(optics.focal_power(reach, sharpest))
            }
            (Scene::Recorded(scan), _) => scan.optimum(scan.pose_at(self.time)),
            _ => FocalPower::nearest(self.focus.position()),
        }
    }

    /// How fast blur grows. `None` for photographs, of which it is not known.
    #[must_use]
    pub fn blur(&self) -> Option<BlurRate> {
        match (&self.scene, &self.optics) {
            (Scene::Flat(_), _) => BlurRate::new(self.sigma0),
            (Scene::Stack(stack), Some(optics)) if stack.distance == Distance::Kept => {
                BlurRate::new(optics.slope.abs())
            }
            _ => None,
        }
    }

    /// What the camera sees at this frame through a lens at `focal_power`: whole gray levels, 0..=255.
    pub fn observe(&mut self, focal_power: FocalPower) -> Patch {
        let mut patch = match self.scene.clone() {
            Scene::Flat(clip) => self.look_at_flat(&clip, focal_power),
            Scene::Stack(stack) => self.look_at_stack(&stack, focal_power),
            Scene::Recorded(scan) => self.look_at_recorded(&scan, focal_power).patch,
        };

        let gain = self.settings.exposure.0 as f32;
        let offset = self.settings.exposure.1 as f32;
        let detail = self.cover.as_ref().map_or(1.0, Cover::detail);
        expose(&mut patch.0, gain, (detail * self.contrast) as f32, offset);

        if self.settings.noise > 0.0 {
            for value in &mut patch.0 {
                *value += self.settings.noise as f32 * cheap_normal(&mut self.noise);
            }
        }

        for (value, pattern) in patch.0.iter_mut().zip(&self.pattern) {
            *value += pattern;
        }

        digitise(&mut patch.0);
        patch
    }

    /// The patch of [`Scan::observe`], and the wider ones around it; without surroundings.
    pub fn view(&mut self, focal_power: FocalPower) -> View {
        View { surroundings: None, ..self.view_of_light(focal_power) }
    }

    /// As [`Scan::view`], with surroundings. They cost as much again, mostly for their noise.
    pub fn whole_view(&mut self, focal_power: FocalPower) -> View {
        let mut view = self.view_of_light(focal_power);
        if let Some(surroundings) = view.surroundings.take() {
            view.surroundings = Some(self.take_surroundings(&surroundings, &view.patch));
        }
        view
    }

    /// [`Scan::view`] with surroundings as the light has them: without exposure, noise and rounding.
    fn view_of_light(&mut self, focal_power: FocalPower) -> View {
        let patch = self.observe(focal_power);
        let around = match self.scene.clone() {
            Scene::Flat(clip) => self.look_widely(&clip, &patch, focal_power),
            Scene::Stack(stack) => {
                let (corner, position) = self.place_in_stack(&stack, focal_power);
                stack.planes.view(corner, position)
            }
            Scene::Recorded(scan) => self.look_at_recorded(&scan, focal_power),
        };

        let mut view = View { patch, ..around };
        for (index, patch) in view.wider.iter_mut().enumerate() {
            if let Some(patch) = patch {
                self.take_wider(patch, index);
            }
        }

        view
    }

    /// Turns the light of a wider patch into what the camera records, as for the patch itself. Noise and rounding
    /// matter less, because a value is the mean of many pixels.
    fn take_wider(&mut self, patch: &mut Patch, index: usize) {
        let gain = self.settings.exposure.0 as f32;
        let offset = self.settings.exposure.1 as f32;
        let detail = self.cover.as_ref().map_or(1.0, Cover::detail);
        expose(&mut patch.0, gain, (detail * self.contrast) as f32, offset);

        if self.settings.noise > 0.0 {
            let noise = self.settings.noise as f32 / WIDER[index].pixels() as f32;
            for value in &mut patch.0 {
                *value += noise * cheap_normal(&mut self.wider_noise);
            }
        }

        for (value, pattern) in patch.0.iter_mut().zip(&self.wider_pattern[index]) {
            *value += pattern;
        }

        patch.0.iter_mut().for_each(|value| *value = value.clamp(0.0, 255.0));
    }

    /// Turns the light around a patch into what the camera records, as for the patch itself, which becomes part of it.
    /// The fixed pattern is that of the patch, repeated.
    fn take_surroundings(&mut self, light: &Surroundings, patch: &Patch) -> Surroundings {
        let mut levels = light.levels.to_vec();
        let gain = self.settings.exposure.0 as f32;
        let offset = self.settings.exposure.1 as f32;
        let detail = self.cover.as_ref().map_or(1.0, Cover::detail);
        expose(&mut levels, gain, (detail * self.contrast) as f32, offset);

        if self.settings.noise > 0.0 {
            for value in &mut levels {
                *value += self.settings.noise as f32 * cheap_normal(&mut self.surrounding_noise);
            }
        }

        if !self.pattern.is_empty() {
            for (index, value) in levels.iter_mut().enumerate() {
                let x = (index % Surroundings::SIDE + PATCH_SIDE - light.patch.0 % PATCH_SIDE) % PATCH_SIDE;
                let y = (index / Surroundings::SIDE + PATCH_SIDE - light.patch.1 % PATCH_SIDE) % PATCH_SIDE;
                *value += self.pattern[y * PATCH_SIDE + x];
            }
        }

        digitise(&mut levels);
        put_patch(patch, light.patch, &mut levels);
        Surroundings { levels: levels.into(), patch: light.patch }
    }

    /// What is seen of a focal stack.
    fn look_at_stack(&self, stack: &StackScene, focal_power: FocalPower) -> Patch {
        let (corner, position) = self.place_in_stack(stack, focal_power);
        stack.planes.patch(corner, position)
    }

    /// What is seen of a recorded scan.
    fn look_at_recorded(&self, scan: &RecordedScan, focal_power: FocalPower) -> View {
        scan.see(scan.pose_at(self.time), focal_power, Interpolation::Interpolated)
    }

    /// Where in a focal stack the patch lies, and the position of the focal plane.
    fn place_in_stack(&self, stack: &StackScene, focal_power: FocalPower) -> ((usize, usize), f64) {
        let (x, y) = self.corner();
        let Some(optics) = &self.optics else { return (whole((x, y)), 0.0) };

        let position = optics.position(self.reach(stack, optics), focal_power.get());
        let [along, down] = optics.shift.map(|shift| shift * position);
        (whole((x + along, y + down)), position)
    }

    fn reach(&self, stack: &StackScene, optics: &Optics) -> Reach {
        optics.reach(stack, self.focus.position(), self.following.as_ref().map_or(0.0, Following::anchor))
    }

    /// Where the patch's corner lies.
    fn corner(&self) -> (f64, f64) {
        self.following.as_ref().map_or_else(|| corner(&self.crop), Following::corner)
    }

    /// The wider patches of a sharp picture, blurred, with the veil over it if there is one. They
    /// stay within the usable part of the picture.
    fn look_widely(&mut self, clip: &Clip, patch: &Patch, focal_power: FocalPower) -> View {
        let sigma = (self.sigma0 * focal_power.distance(self.optimum())).hypot(self.tremor);
        let mut view = self.view_of_flat(clip, patch, corner(&self.crop), sigma);

        if let Some(at) = self.veil.as_ref().map(corner) {
            let share = self.settings.veil as f32;
            let veil = self.view_of_flat(clip, patch, at, sigma);
            for (patch, veil) in view.wider.iter_mut().flatten().zip(veil.wider.iter().flatten()) {
                for (value, veiled) in patch.0.iter_mut().zip(veil.0) {
                    *value += share * (veiled - *value);
                }
            }

            if let (Some(seen), Some(veil)) = (&mut view.surroundings, &veil.surroundings) {
                let pairs = seen.levels.iter().zip(veil.levels.iter());
                seen.levels = pairs.map(|(value, veiled)| value + share * (veiled - value)).collect();
            }
        }

        view
    }

    fn view_of_flat(&mut self, clip: &Clip, patch: &Patch, corner: (f64, f64), sigma: f64) -> View {
        let Area { left, top, right, bottom } = clip.area();
        let (x, y) = whole(corner);
        let inside = (x.saturating_sub(left), y.saturating_sub(top));

        View::around(*patch, inside, (right - left, bottom - top), |square| {
            let square = Square { x: square.x + left, y: square.y + top, ..square };
            let spot = self.settings.spot;
            let Some(unrest) = &self.unrest else {
                return self.defocus.square(clip.at(self.time), square, sigma, spot);
            };

            let place = [(square.x, corner.0), (square.y, corner.1)].map(|(pixel, at)| pixel as f64 + at.fract());
            let coarse = clip.coarse_at(self.time);
            self.defocus.coarse_square(square.side, sigma, spot, |_, side, out| {
                unrest.gather_coarsely(coarse, (place[0], place[1]), square.side, side, out);
            })
        })
    }

    /// What is seen of a sharp picture, blurred, with the veil over it if there is one.
    fn look_at_flat(&mut self, clip: &Clip, focal_power: FocalPower) -> Patch {
        let sigma = (self.sigma0 * focal_power.distance(self.optimum())).hypot(self.tremor);
        let mut patch = self.look(clip, corner(&self.crop), sigma);

        if let Some(at) = self.veil.as_ref().map(corner) {
            let share = self.settings.veil as f32;
            let veil = self.look(clip, at, sigma);
            for (value, veiled) in patch.0.iter_mut().zip(veil.0) {
                *value += share * (veiled - *value);
            }
        }

        patch
    }

    fn look(&mut self, clip: &Clip, corner: (f64, f64), sigma: f64) -> Patch {
        let picture = clip.at(self.time);
        let spot = self.settings.spot;

        match &self.unrest {
            None => self.defocus.patch(picture, (corner.0 as isize, corner.1 as isize), sigma, spot),
            Some(unrest) => {
                self.defocus.patch_of(sigma, spot, |_, side, out| unrest.gather(picture, corner, side, out))
            }
        }
    }

    /// Advances to the next frame.
    pub fn advance(&mut self) {
        self.time += 1;
        self.focus.advance(&mut self.course);
        self.crop.iter_mut().for_each(|walk| walk.advance(&mut self.course));
        self.veil.iter_mut().flatten().for_each(|walk| walk.advance(&mut self.veil_course));
        self.unrest.iter_mut().for_each(|unrest| unrest.advance(&mut self.unrest_course));
        self.cover.iter_mut().for_each(Cover::advance);

        self.tremor = self.settings.tremor * standard_normal(&mut self.course);
        self.contrast = (self.settings.flicker * standard_normal(&mut self.course)).exp();

        if let (Scene::Stack(stack), Some(following)) = (&self.scene, &mut self.following) {
            following.advance(stack, corner(&self.crop));
        }
    }
}

impl Scene {
    /// Where a patch's corner may lie along each axis.
    fn room(&self) -> [(f64, f64); 2] {
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

/// Scales differences from the levels' mean by `contrast`, then everything by `gain`, and adds `offset`.
#[multiversion(targets("x86_64+avx512f", "x86_64+avx2+fma"))]
fn expose(levels: &mut [f32], gain: f32, contrast: f32, offset: f32) {
    let mean = levels.iter().sum::<f32>() / levels.len() as f32;
    for value in levels {
        *value = gain * (mean + contrast * (*value - mean)) + offset;
    }
}

/// Rounds to whole gray levels, 0..=255.
#[multiversion(targets("x86_64+avx512f", "x86_64+avx2+fma"))]
fn digitise(levels: &mut [f32]) {
    for value in levels {
        *value = value.clamp(0.0, 255.0).round();
    }
}

/// Writes `patch` into the surroundings `levels`, with its corner at `(x, y)`.
fn put_patch(patch: &Patch, (x, y): (usize, usize), levels: &mut [f32]) {
    let lines = levels.chunks_exact_mut(Surroundings::SIDE).skip(y);
    for (line, row) in lines.zip(patch.0.chunks_exact(PATCH_SIDE)) {
        line[x..x + PATCH_SIDE].copy_from_slice(row);
    }
}

impl FocalTimeScan for Scan {
    fn observe(&mut self, focal_power: FocalPower) -> View {
        self.whole_view(focal_power)
    }

    fn patch(&mut self, focal_power: FocalPower) -> Patch {
        Self::observe(self, focal_power)
    }

    fn optimum(&self) -> FocalPower {
        Self::optimum(self)
    }

    fn advance(&mut self) {
        Self::advance(self);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scans::recorded::Stack;
    use crate::scans::variety::Variety;
    use parfocal_devices::simulation::blur::gaussian_blur;
    use parfocal_devices::simulation::texture::texture;
    use parfocal_imaging::block_means;

    fn scan(seed: u64) -> Scan {
        Scan::new(Arc::new(Clip::still(texture(1, 256)).unwrap()), ScanSettings::default(), seed)
    }

    #[test]
    fn looking_changes_nothing_of_the_course() {
        let mut looked_at = scan(5);
        let mut left_alone = scan(5);

        for _ in 0..50 {
            looked_at.observe(FocalPower::MIN);
            looked_at.advance();
            left_alone.advance();
        }

        assert_eq!(looked_at.optimum(), left_alone.optimum());
        assert_eq!(looked_at.observe(FocalPower::MIDDLE), left_alone.observe(FocalPower::MIDDLE));
    }

    #[test]
    fn the_patch_is_the_same_whether_wider_ones_are_looked_at_or_not() {
        let clip = Arc::new(Clip::still(texture(1, 256)).unwrap());
        let stack = crate::scans::relief::scenes(crate::scans::pictures::Split::Training, 1).unwrap().remove(0);
        let mut rng = ChaCha8Rng::seed_from_u64(9);

        for scene in [Scene::Flat(clip), Scene::Stack(stack)] {
            for seed in 0..10 {
                let settings = Variety { share: 1.0 }.draw(&scene, &mut rng);
                let (mut one, mut other) = [(); 2].map(|()| Scan::over(scene.clone(), settings, seed)).into();
                for _ in 0..10 {
                    assert_eq!(one.view(FocalPower::MIDDLE).patch, other.observe(FocalPower::MIDDLE));
                    one.advance();
                    other.advance();
                }
            }
        }
    }

    #[test]
    fn wider_patches_show_the_same_blur_as_the_patch() {
        let picture = texture(1, 256);
        let mut scan = Scan::new(Arc::new(Clip::still(picture.clone()).unwrap()), ScanSettings::default(), 5);

        for step in [0.0, 0.2, -0.4] {
            let focal_power = scan.optimum().moved(step);
            let sigma = scan.sigma0 * focal_power.distance(scan.optimum());
            let blurred = gaussian_blur(&picture, sigma);
            let seen = scan.view(focal_power);
            for (patch, scale) in seen.wider.iter().zip(WIDER) {
                let square = Square::around(whole(corner(&scan.crop)), scale, (256, 256)).unwrap();
                let expected = block_means(&blurred.data[square.y * 256 + square.x..], 256, scale);
                let pairs = patch.as_ref().unwrap().0.iter().zip(&expected.0);
                let off = pairs.map(|(one, other)| (one - other).powi(2)).sum::<f32>() / expected.0.len() as f32;
                assert!(off.sqrt() < 0.5, "sigma {sigma}, scale {scale:?}: {}", off.sqrt());
            }
        }
    }

    #[test]
    fn over_a_stack_the_patch_is_sharpest_at_the_optimum() {
        let stack = crate::scans::relief::scenes(crate::scans::pictures::Split::Training, 1).unwrap().remove(0);
        let mut sharper = 0;
        let mut seen = 0;
        for seed in 0..20 {
            let mut scan = Scan::over(Scene::Stack(Arc::clone(&stack)), ScanSettings::reference(), seed);
            let best = scan.optimum();
            let sharp = parfocal_autofocus::mgm(&scan.observe(best));

            for step in [-0.5, 0.5] {
                let elsewhere = best.moved(step);
                if elsewhere.distance(best) > 0.3 {
                    seen += 1;
                    sharper += usize::from(parfocal_autofocus::mgm(&scan.observe(elsewhere)) < sharp);
                }
            }
        }

        assert!(seen > 10 && sharper == seen, "{sharper} of {seen}");
    }

    #[test]
    fn a_recorded_scan_is_shown_as_it_was_recorded_to_and_fro() {
        let level = |pose: u8, power: u8| Box::new([10 * pose + power; PATCH_SIDE * PATCH_SIDE]);
        let powers = crate::scans::recorded::evenly_spread(3);
        let pose = |pose| Stack::new(&powers, (0..3).map(|power| level(pose, power)).collect());
        let recorded = Arc::new(RecordedScan::new(powers.clone(), (1..4).map(pose).collect()));

        let scene = Scene::Recorded(recorded);
        let mut scan = Scan::over(scene.clone(), ScanSettings::fitting(&scene), 3);
        let mut shown = Vec::new();
        for _ in 0..8 {
            shown.push(scan.observe(FocalPower::MAX).0[0] as u8);
            scan.advance();
        }

        // Poses 1, 2, 3, 2, 1, ... at the third focal power, beginning with the pose that the seed draws.
        let whole: Vec<u8> = [12, 22, 32, 22].into_iter().cycle().take(12).collect();
        assert!(whole.windows(8).any(|part| part == shown), "{shown:?}");
    }

    /// If the sharpest depth of a patch is out of reach, the optimum is the sharpest one that the lens reaches. Mixed
    /// pictures have less noise than photographed ones, so the two may differ by up to half the distance between
    /// photographed pictures.
    #[test]
    fn over_a_followed_stack_the_optimum_is_the_sharpest_that_the_lens_reaches() {
        let stack = crate::scans::relief::scenes(crate::scans::pictures::Split::Training, 2).unwrap().remove(1);
        let spacing = 0.5;
        let followed = StackScene { distance: Distance::Following { spacing }, slopes: (5.0, 5.0), ..(*stack).clone() };
        let followed = Scene::Stack(Arc::new(followed));
        let powers = crate::scans::recorded::evenly_spread(41);
        let mut near = 0;
        let mut frames = 0;

        for seed in 0..20 {
            let mut scan = Scan::over(followed.clone(), ScanSettings::reference(), seed);
            for _ in 0..10 {
                let curve = powers.iter().map(|&power| (power, parfocal_autofocus::mgm(&scan.observe(power))));
                let (sharpest, _) = curve.max_by(|a, b| a.1.total_cmp(&b.1)).unwrap();
                frames += 1;
                near += usize::from(sharpest.distance(scan.optimum()) < 0.15);
                (0..10).for_each(|_| scan.advance());
            }
        }
        assert!(near * 10 > frames * 9, "{near} of {frames}");
    }

    #[test]
    fn the_patch_is_sharpest_at_the_optimum() {
        let mut scan = scan(6);
        let sharp = parfocal_autofocus::mgm(&scan.observe(scan.optimum()));

        for step in [-0.4, -0.2, 0.2, 0.4] {
            let elsewhere = scan.optimum().moved(step);
            if elsewhere.distance(scan.optimum()) > 0.1 {
                assert!(parfocal_autofocus::mgm(&scan.observe(elsewhere)) < sharp);
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
