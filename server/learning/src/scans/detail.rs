//! Whether focal-time scans show anything to focus on. On a blank wall every policy performs as chance does.

use rayon::prelude::*;

use crate::LearningError;
use crate::scans::FocalTimeScan;
use crate::scans::ScanSet;
use parfocal_autofocus::mgm;
use parfocal_autofocus::spectrum::spectrum;
use parfocal_base::FocalPower;

/// Standard deviation in gray levels above which a patch is not mere sensor noise, whatever its spectrum.
const MOST_NOISE: f32 = 16.0;
/// Least ratio of the mean gradient magnitude in focus to that far out of focus. Shading, from a lamp or at the rim of
/// a lens, looks the same in both.
const LEAST_PEAK: f64 = 1.2;

/// Number of scans in `set` without detail: in no frame does even the sharpest patch show any.
pub fn without_detail(set: &dyn ScanSet) -> usize {
    let blank = |index: &usize| {
        let (mut scan, frames) = set.scan(*index);
        !shows_detail(scan.as_mut(), frames)
    };
    (0..set.count()).into_par_iter().filter(blank).count()
}

/// A warning about a set of `count` scans, `blank` of them without detail. `None` if `blank` is 0.
///
/// # Errors
/// If all scans are without detail.
pub fn warning(blank: usize, count: usize) -> Result<Option<String>, LearningError> {
    if blank == count {
        bail!(
            "there is nothing to focus on: even the sharpest patch shows no detail in any of {count} scans; use \
             pictures of something with texture, taken in focus"
        );
    }
    let percent = 100.0 * blank as f64 / count as f64;
    let words =
        || format!("in {percent:.1} % of the scans ({blank} of {count}) even the sharpest patch shows no detail");
    Ok((blank > 0).then(words))
}

/// Whether any frame has something to focus on; most scans show it in the first frame.
fn shows_detail(scan: &mut dyn FocalTimeScan, frames: usize) -> bool {
    (0..frames).any(|_| {
        let found = frame_shows_detail(scan);
        scan.advance();
        found
    })
}

fn frame_shows_detail(scan: &mut dyn FocalTimeScan) -> bool {
    let optimum = scan.optimum();
    let sharpest = scan.observe(optimum).patch;
    let spectrum = spectrum(&sharpest);
    if !spectrum.shows_detail() && spectrum.contrast() < MOST_NOISE {
        return false;
    }

    let farther = |a: &FocalPower, b: &FocalPower| a.distance(optimum).total_cmp(&b.distance(optimum));
    let far = [FocalPower::MIN, FocalPower::MAX].into_iter().max_by(farther).unwrap_or(FocalPower::MIN);
    mgm(&sharpest) > LEAST_PEAK * mgm(&scan.observe(far).patch)
}

#[cfg(test)]
mod tests {
    use std::sync::Arc;

    use rand::SeedableRng;
    use rand_chacha::ChaCha8Rng;

    use super::*;
    use crate::scans::benchmark::{Benchmark, Conditions};
    use crate::scans::clip::Clip;
    use crate::scans::simulated::Scene;
    use parfocal_devices::simulation::normal::standard_normal;
    use parfocal_devices::simulation::texture::texture;
    use parfocal_imaging::GrayImage;

    const SIDE: usize = 128;

    fn picture(level: impl FnMut(usize) -> f32) -> GrayImage {
        GrayImage { width: SIDE, height: SIDE, data: (0..SIDE * SIDE).map(level).collect() }
    }

    /// The share of 20 scans over `picture` that show no detail.
    fn share(picture: GrayImage) -> f64 {
        let scenes = vec![Scene::Flat(Arc::new(Clip::still(picture).unwrap()))];
        let set = Benchmark { scenes, conditions: Conditions::Fitting, seed: 3, count: 20, frames: 20 };
        f64::from(u32::try_from(without_detail(&set)).unwrap()) / 20.0
    }

    #[test]
    fn walls_shaded_or_noisy_have_nothing_to_focus_on_and_textures_have() {
        let mut rng = ChaCha8Rng::seed_from_u64(5);
        assert!((share(picture(|_| 255.0)) - 1.0).abs() < 1e-9, "white");
        let shaded = picture(|i| 40.0 + (i % SIDE) as f32);
        assert!((share(shaded) - 1.0).abs() < 1e-9, "shaded");
        let noisy = picture(|_| (100.0 + 2.0 * standard_normal(&mut rng)) as f32);
        assert!(share(noisy) > 0.8, "noisy");

        for seed in 0..24 {
            assert!(share(texture(seed, SIDE)) < 0.1, "texture {seed}");
        }
    }
}
