//! How scans for training differ from one another, so that a policy does not learn one rig, one hand
//! or one scene by heart.

use rand::{Rng, RngExt};

use super::simulated::{ScanSettings, Scene};
use parfocal_devices::simulation::normal::standard_normal;
use parfocal_devices::simulation::patch_defocus::Spot;
use parfocal_devices::simulation::unrest::Restlessness;
use parfocal_devices::simulation::walk::Motion;

/// How far training scans differ from the reference's.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Variety {
    /// Share of scans to vary: 0 gives plain scans (over still pictures, the reference's), 1 varies all.
    pub share: f64,
}

impl Variety {
    /// Settings for one scan over `scene`: with probability `share` they vary in speed, spot, noise, exposure and what
    /// else is in view.
    pub fn draw(&self, scene: &Scene, rng: &mut impl Rng) -> ScanSettings {
        let mut settings = ScanSettings::fitting(scene);
        if !rng.random_bool(self.share) {
            return settings;
        }

        let factor = |rng: &mut _, spread: f64| (spread * standard_normal(rng)).exp();
        settings.focus.speed *= factor(rng, 0.45);
        settings.focus.memory *= factor(rng, 0.4);
        settings.crop.speed *= factor(rng, 1.2);
        settings.crop.memory *= factor(rng, 0.4);

        if rng.random_bool(0.2) {
            // So fast that hardly anything of one frame is left in the next.
            settings.crop = Motion { speed: rng.random_range(15.0..40.0), memory: rng.random_range(5.0..30.0) };
        }

        settings.spot = if rng.random_bool(0.5) { Spot::Disc } else { Spot::Gaussian };
        settings.tremor = if rng.random_bool(0.5) { rng.random_range(0.0..0.6) } else { 0.0 };
        settings.flicker = if rng.random_bool(0.7) { rng.random_range(0.0..0.2) } else { 0.0 };
        settings.noise = if rng.random_bool(0.7) { rng.random_range(0.0..4.0) } else { 0.0 };

        let gain: f64 = rng.random_range(0.3..1.3);
        settings.veil = if rng.random_bool(0.3) { rng.random_range(0.0..0.4) } else { 0.0 };
        settings.unrest = rng.random_bool(0.5).then(|| restlessness(rng));
        settings.pattern = if rng.random_bool(0.4) { rng.random_range(0.0..3.0) } else { 0.0 };
        settings.covered = rng.random_bool(0.15);
        settings.exposure = (gain, rng.random_range(-0.5..1.0) * 120.0 * (1.0 - gain));

        settings
    }
}

/// From hardly to very restless. The most is about as restless as footage of tissue, judged by how the energies of
/// overlaid patches differ from frame to frame.
fn restlessness(rng: &mut impl Rng) -> Restlessness {
    Restlessness {
        strain: rng.random_range(0.0..0.03),
        contrast: rng.random_range(0.0..0.8),
        cell: rng.random_range(3.0..16.0),
        drift: rng.random_range(0.0f64..1.2).powi(2),
    }
}
