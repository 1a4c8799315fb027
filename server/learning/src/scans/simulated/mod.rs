//! Simulated focal-time scans: a crop walks over sharp pictures, the optimal focal power walks too, and what is seen at
//! another focal power is blurred in proportion to the distance (Budd et al., MICCAI 2023).

mod course;
mod flat;
mod sensor;
mod settings;
mod stacked;

use std::sync::Arc;

use super::FocalTimeScan;
use super::recorded::{Interpolation, RecordedScan};
use course::Course;
use flat::FlatLook;
use parfocal_base::{BlurRate, FocalPower};
use parfocal_imaging::{Patch, View};
use sensor::Sensor;
pub use settings::{ScanSettings, Scene};
use stacked::StackLook;

/// One focal-time scan, frame by frame. Its course depends only on its seed, never on what is observed.
#[derive(Debug, Clone)]
pub struct Scan {
    course: Course,
    look: Look,
    sensor: Sensor,
}

/// The light of a scene, before the sensor sees it.
#[derive(Debug, Clone)]
enum Look {
    Flat(Box<FlatLook>),
    Stack(Box<StackLook>),
    Recorded(Arc<RecordedScan>),
}

impl Scan {
    /// A scan over `scene` whose course is drawn from `seed`. Over a focal stack, blur, spot,
    /// tremor, veil and unrest of `settings` are ignored: the stack has its own.
    pub fn over(scene: Scene, settings: ScanSettings, seed: u64) -> Self {
        let (mut course, blur) = Course::draw(&scene, &settings, seed);
        let room = scene.room();
        let look = match scene {
            Scene::Flat(clip) => Look::Flat(Box::new(FlatLook::new(clip, blur, room, &settings, seed))),
            Scene::Stack(stack) => Look::Stack(Box::new(StackLook::new(stack, &mut course))),
            Scene::Recorded(scan) => Look::Recorded(scan),
        };
        Self { course, look, sensor: Sensor::new(&settings, seed) }
    }

    /// How fast blur grows. `None` for photographs, of which it is not known.
    pub fn blur(&self) -> Option<BlurRate> {
        match &self.look {
            Look::Flat(flat) => BlurRate::new(flat.blur),
            Look::Stack(stack) => stack.blur(),
            Look::Recorded(_) => None,
        }
    }

    /// What [`FocalTimeScan::patch`] shows, and the wider patches around it; without surroundings.
    pub fn wide_view(&mut self, focal_power: FocalPower) -> View {
        View { surroundings: None, ..self.view_of_light(focal_power) }
    }

    /// [`FocalTimeScan::observe`] with the surroundings as the light has them: without exposure, noise and rounding.
    fn view_of_light(&mut self, focal_power: FocalPower) -> View {
        let patch = self.patch(focal_power);
        let around = match &mut self.look {
            Look::Flat(flat) => flat.light_around(&self.course, &patch, focal_power),
            Look::Stack(stack) => stack.light_around(&self.course, focal_power),
            Look::Recorded(scan) => look_at_recorded(scan, self.course.time, focal_power),
        };

        let mut view = View { patch, ..around };
        for (index, patch) in view.wider.iter_mut().enumerate() {
            if let Some(patch) = patch {
                self.sensor.record_wider(patch, index, self.course.contrast);
            }
        }
        view
    }
}

fn look_at_recorded(scan: &RecordedScan, time: usize, focal_power: FocalPower) -> View {
    scan.see(scan.pose_at(time), focal_power, Interpolation::Interpolated)
}

impl FocalTimeScan for Scan {
    /// As [`Scan::wide_view`], with surroundings. They cost as much again, mostly for their noise.
    fn observe(&mut self, focal_power: FocalPower) -> View {
        let mut view = self.view_of_light(focal_power);
        if let Some(light) = view.surroundings.take() {
            view.surroundings = Some(self.sensor.record_surroundings(&light, &view.patch, self.course.contrast));
        }
        view
    }

    fn patch(&mut self, focal_power: FocalPower) -> Patch {
        let mut patch = match &mut self.look {
            Look::Flat(flat) => flat.light(&self.course, focal_power),
            Look::Stack(stack) => stack.light(&self.course, focal_power),
            Look::Recorded(scan) => look_at_recorded(scan, self.course.time, focal_power).patch,
        };
        self.sensor.record(&mut patch, self.course.contrast);
        patch
    }

    fn optimum(&self) -> FocalPower {
        match &self.look {
            Look::Flat(_) => FocalPower::nearest(self.course.focus.position()),
            Look::Stack(stack) => stack.optimum(&self.course),
            Look::Recorded(scan) => scan.optimum(scan.pose_at(self.course.time)),
        }
    }

    fn advance(&mut self) {
        self.course.advance();
        self.sensor.advance();
        match &mut self.look {
            Look::Flat(flat) => flat.advance(),
            Look::Stack(stack) => stack.advance(&self.course),
            Look::Recorded(_) => {}
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use rand::SeedableRng;
    use rand_chacha::ChaCha8Rng;

    use crate::scans::clip::Clip;
    use crate::scans::reach::whole;
    use crate::scans::recorded::{Kept, Stack};
    use crate::scans::relief::{Distance, StackScene};
    use crate::scans::variety::Variety;
    use parfocal_devices::simulation::blur::gaussian_blur;
    use parfocal_devices::simulation::normal::cheap_normal;
    use parfocal_devices::simulation::texture::texture;
    use parfocal_imaging::{GrayImage, PATCH_SIDE, Square, WIDER, block_means};

    fn flat(picture: GrayImage) -> Scene {
        Scene::Flat(Arc::new(Clip::still(picture).unwrap()))
    }

    fn scan(seed: u64) -> Scan {
        Scan::over(flat(texture(1, 256)), ScanSettings::default(), seed)
    }

    #[test]
    fn looking_changes_nothing_of_the_course() {
        let mut looked_at = scan(5);
        let mut left_alone = scan(5);

        for _ in 0..50 {
            looked_at.patch(FocalPower::MIN);
            looked_at.advance();
            left_alone.advance();
        }

        assert_eq!(looked_at.optimum(), left_alone.optimum());
        assert_eq!(looked_at.patch(FocalPower::MIDDLE), left_alone.patch(FocalPower::MIDDLE));
    }

    #[test]
    fn the_patch_is_the_same_whether_wider_ones_are_looked_at_or_not() {
        let stack = crate::scans::relief::scenes(crate::scans::pictures::Split::Training, 1).unwrap().remove(0);
        let mut rng = ChaCha8Rng::seed_from_u64(9);

        for scene in [flat(texture(1, 256)), Scene::Stack(stack)] {
            for seed in 0..10 {
                let settings = Variety { share: 1.0 }.draw(&scene, &mut rng);
                let (mut one, mut other) = [(); 2].map(|()| Scan::over(scene.clone(), settings, seed)).into();
                for _ in 0..10 {
                    assert_eq!(one.observe(FocalPower::MIDDLE).patch, other.patch(FocalPower::MIDDLE));
                    one.advance();
                    other.advance();
                }
            }
        }
    }

    #[test]
    fn wider_patches_show_the_same_blur_as_the_patch() {
        let picture = texture(1, 256);
        let mut scan = Scan::over(flat(picture.clone()), ScanSettings::default(), 5);

        for step in [0.0, 0.2, -0.4] {
            let focal_power = scan.optimum().moved(step);
            let sigma = scan.blur().unwrap().get() * focal_power.distance(scan.optimum());
            let blurred = gaussian_blur(&picture, sigma);
            let seen = scan.observe(focal_power);
            for (patch, scale) in seen.wider.iter().zip(WIDER) {
                let square = Square::around(whole(scan.course.corner()), scale, (256, 256)).unwrap();
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
            let sharp = parfocal_autofocus::mgm(&scan.patch(best));

            for step in [-0.5, 0.5] {
                let elsewhere = best.moved(step);
                if elsewhere.distance(best) > 0.3 {
                    seen += 1;
                    sharper += usize::from(parfocal_autofocus::mgm(&scan.patch(elsewhere)) < sharp);
                }
            }
        }

        assert!(seen > 10 && sharper == seen, "{sharper} of {seen}");
    }

    #[test]
    fn a_recorded_scan_is_shown_as_it_was_recorded_to_and_fro() {
        let level = |pose: u8, power: u8| View::from(Patch([f32::from(10 * pose + power); PATCH_SIDE * PATCH_SIDE]));
        let pose = |pose| Stack::of(&[0, 1, 2].map(|power| level(pose, power)), FocalPower::MIDDLE, Kept::Patches);
        let powers = crate::scans::recorded::evenly_spread(3);
        let recorded = Arc::new(RecordedScan::new(powers, (1..4).map(pose).collect()));

        let scene = Scene::Recorded(recorded);
        let mut scan = Scan::over(scene.clone(), ScanSettings::fitting(&scene), 3);
        let mut shown = Vec::new();
        for _ in 0..8 {
            shown.push(scan.patch(FocalPower::MAX).0[0] as u8);
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
                let curve = powers.iter().map(|&power| (power, parfocal_autofocus::mgm(&scan.patch(power))));
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
        let sharp = parfocal_autofocus::mgm(&scan.patch(scan.optimum()));

        for step in [-0.4, -0.2, 0.2, 0.4] {
            let elsewhere = scan.optimum().moved(step);
            if elsewhere.distance(scan.optimum()) > 0.1 {
                assert!(parfocal_autofocus::mgm(&scan.patch(elsewhere)) < sharp);
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
