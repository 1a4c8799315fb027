//! Sets of simulated scans, and the two reference benchmarks: flat scenes as in the paper, and scenes with relief.

use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;

use super::pictures::{Split, reference};
use super::simulated::{Scan, ScanSettings, Scene};
use super::variety::Variety;
use super::{FocalTimeScan, ScanSet, relief};
use crate::LearningError;

/// Frames of a scan: the paper's 10 s at 25 a second.
pub const FRAMES: usize = 250;
/// Scans of the reference benchmark.
pub const COUNT: usize = 200;
/// Scenes of the reference benchmark with relief: each takes up to 12 MB.
const RELIEFS: usize = 100;
/// Seed of the reference benchmark.
pub const SEED: u64 = 2023;

/// How a set's simulated scans are drawn.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Conditions {
    /// All with these settings.
    Same(ScanSettings),
    /// With settings that fit each scene: [`ScanSettings::fitting`].
    Fitting,
    /// This many scans with settings that fit each scene, the others as varied as training scans can be. What holds on
    /// both is likely to hold elsewhere.
    VariedFrom(usize),
}

/// A set of simulated scans: scan `i` goes over scene `i` modulo their number.
#[derive(Debug, Clone)]
pub struct Benchmark {
    /// What is scanned.
    pub scenes: Vec<Scene>,
    /// How the scans are drawn.
    pub conditions: Conditions,
    /// Seed that all scans' courses are drawn from.
    pub seed: u64,
    /// Number of scans.
    pub count: usize,
    /// Frames of each scan.
    pub frames: usize,
}

impl Benchmark {
    /// The first `count` scans of the reference benchmark.
    ///
    /// # Errors
    /// None in practice: its pictures are large enough.
    pub fn reference(count: usize) -> Result<Self, LearningError> {
        let scenes = reference(Split::Test, count.min(COUNT) as u64)?.into_iter().map(Scene::Flat).collect();
        let conditions = Conditions::Fitting;
        Ok(Self { scenes, conditions, seed: SEED, count, frames: FRAMES })
    }

    /// The first `count` scans of the reference benchmark with relief: over scenes whose places lie at
    /// different distances, seen through lenses whose best picture is soft.
    ///
    /// # Errors
    /// None in practice: its scenes are large enough.
    pub fn relief(count: usize) -> Result<Self, LearningError> {
        let scenes =
            relief::deep_scenes(Split::Test, count.min(RELIEFS) as u64)?.into_iter().map(Scene::Stack).collect();
        Ok(Self { scenes, conditions: Conditions::Fitting, seed: SEED, count, frames: FRAMES })
    }

    /// Number of scans that are as varied as training scans can be.
    pub const fn varied(&self) -> usize {
        match self.conditions {
            Conditions::VariedFrom(first) => self.count.saturating_sub(first),
            Conditions::Same(_) | Conditions::Fitting => 0,
        }
    }
}

impl ScanSet for Benchmark {
    fn count(&self) -> usize {
        self.count
    }

    fn scan(&self, index: usize) -> (Box<dyn FocalTimeScan>, usize) {
        let scene = self.scenes[index % self.scenes.len()].clone();
        // Distinct streams for neighbouring seeds: the golden-ratio increment of SplitMix64.
        let seed = self.seed.wrapping_mul(0x9e37_79b9_7f4a_7c15).wrapping_add(index as u64);

        let settings = match self.conditions {
            Conditions::Same(settings) => settings,
            Conditions::Fitting => ScanSettings::fitting(&scene),
            Conditions::VariedFrom(first) if index < first => ScanSettings::fitting(&scene),
            Conditions::VariedFrom(_) => Variety { share: 1.0 }.draw(&scene, &mut ChaCha8Rng::seed_from_u64(!seed)),
        };

        (Box::new(Scan::over(scene, settings, seed)), self.frames)
    }
}
