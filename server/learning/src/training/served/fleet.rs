//! Environments side by side, stepped together.

use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;
use rayon::prelude::*;

use crate::scans::scenery::Scenery;
use crate::scans::variety::Variety;
use crate::training::environment::Environment;
use parfocal_autofocus::STEP;
use parfocal_base::FocalPower;
use parfocal_imaging::{PATCH_SIDE, Patch, WIDER};

/// Bytes of a patch: a gray level for each of its pixels.
const PATCH_BYTES: usize = PATCH_SIDE * PATCH_SIDE;

/// What an environment shows of a frame.
#[derive(Debug, Clone, Copy, PartialEq, Eq, clap::ValueEnum)]
pub enum Shows {
    /// The patch.
    Patch,
    /// The patch, and those at two coarser scales around it.
    View,
}

impl Shows {
    /// Patches of a frame.
    pub const fn patches(self) -> usize {
        match self {
            Self::Patch => 1,
            Self::View => 1 + WIDER.len(),
        }
    }

    /// Bytes of a frame.
    const fn bytes(self) -> usize {
        self.patches() * PATCH_BYTES
    }
}

/// How an environment begins another scan.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Begin {
    /// It does not: its scan goes on.
    Not,
    /// With the environment's own random numbers.
    Next,
    /// With random numbers from this seed, now and later.
    Seeded(u64),
}

/// Where the lens of an environment is sent.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Action {
    /// By this number of the paper's steps.
    Steps(i8),
    /// To this focal power, which is finite.
    Target(f64),
}

/// Environments side by side.
pub struct Fleet {
    slots: Vec<Slot>,
    scenery: Scenery,
    variety: Variety,
    shows: Shows,
    /// Frames of a scan.
    frames: u32,
}

/// One environment, its random numbers, and how far its scan has come.
struct Slot {
    environment: Environment,
    rng: ChaCha8Rng,
    frame: u32,
}

impl Slot {
    fn begin(&mut self, scenery: &Scenery, variety: Variety) {
        self.environment = Environment::draw(scenery, variety, 0.0, &mut self.rng);
        self.frame = 0;
    }
}

impl Fleet {
    /// `count` environments over `scenery`, whose scans have `frames` frames.
    pub fn new(scenery: Scenery, variety: Variety, shows: Shows, count: usize, frames: u32, seed: u64) -> Self {
        let slots = (0..count as u64)
            .map(|index| {
                // Distinct streams for neighbouring seeds, as in the benchmark.
                let seed = seed.wrapping_mul(0x9e37_79b9_7f4a_7c15).wrapping_add(index);
                let mut rng = ChaCha8Rng::seed_from_u64(seed);
                let environment = Environment::draw(&scenery, variety, 0.0, &mut rng);
                Slot { environment, rng, frame: 0 }
            })
            .collect();
        Self { slots, scenery, variety, shows, frames }
    }

    /// Number of environments.
    pub const fn count(&self) -> usize {
        self.slots.len()
    }

    /// What they show of a frame.
    pub const fn shows(&self) -> Shows {
        self.shows
    }

    /// Begins scans as `begins` says, one for each environment.
    pub fn reset(&mut self, begins: &[Begin]) {
        for (slot, &begin) in self.slots.iter_mut().zip(begins) {
            match begin {
                Begin::Not => continue,
                Begin::Next => {}
                Begin::Seeded(seed) => slot.rng = ChaCha8Rng::seed_from_u64(seed),
            }
            slot.begin(&self.scenery, self.variety);
        }
    }

    /// Sends each lens where `actions` says and advances by a frame. An environment whose scan had ended begins the
    /// next one instead, without its action.
    pub fn step(&mut self, actions: &[Action]) {
        for (slot, &action) in self.slots.iter_mut().zip(actions) {
            if slot.frame >= self.frames {
                slot.begin(&self.scenery, self.variety);
                continue;
            }

            let target = match action {
                Action::Steps(steps) => slot.environment.focal_power().moved(f64::from(steps) * STEP).get(),
                Action::Target(target) => target,
            };
            slot.environment.advance(target);
            slot.frame += 1;
        }
    }

    /// Writes what is seen now, and how each environment stands, into `answer`: all patches, then all focal powers, all
    /// optima, and whether each scan has ended.
    pub fn observe(&mut self, answer: &mut Vec<u8>) {
        let shows = self.shows;
        answer.resize(self.slots.len() * shows.bytes(), 0);

        // A frame takes a few microseconds: too little to hand to another thread by itself.
        let pictures = answer.par_chunks_exact_mut(shows.bytes());
        self.slots.par_iter_mut().zip(pictures).with_min_len(4).for_each(|(slot, bytes)| show(slot, shows, bytes));

        let number = |power: FocalPower| (power.get() as f32).to_le_bytes();
        answer.extend(self.slots.iter().flat_map(|slot| number(slot.environment.focal_power())));
        answer.extend(self.slots.iter().flat_map(|slot| number(slot.environment.optimum())));
        answer.extend(self.slots.iter().map(|slot| u8::from(slot.frame >= self.frames)));
    }
}

fn show(slot: &mut Slot, shows: Shows, bytes: &mut [u8]) {
    match shows {
        Shows::Patch => fill(bytes, &slot.environment.observe()),
        Shows::View => {
            let view = slot.environment.wide_view();
            let wider = view.wider.iter().map(Option::as_ref);
            let patches = std::iter::once(Some(&view.patch)).chain(wider);
            for (bytes, patch) in bytes.chunks_exact_mut(PATCH_BYTES).zip(patches) {
                // A picture that is too small for a coarser scale shows the patch there.
                fill(bytes, patch.unwrap_or(&view.patch));
            }
        }
    }
}

fn fill(bytes: &mut [u8], patch: &Patch) {
    for (byte, level) in bytes.iter_mut().zip(patch.0) {
        *byte = level.round().clamp(0.0, 255.0) as u8;
    }
}

#[cfg(test)]
mod tests {
    use std::sync::Arc;

    use super::*;
    use crate::scans::pictures::{Split, reference};

    fn fleet(count: usize, shows: Shows, seed: u64) -> Fleet {
        let scenery = Scenery::from(reference(Split::Training, 2).unwrap().into_iter().collect::<Vec<Arc<_>>>());
        Fleet::new(scenery, Variety { share: 0.0 }, shows, count, 5, seed)
    }

    fn seen(fleet: &mut Fleet) -> Vec<u8> {
        let mut answer = Vec::new();
        fleet.observe(&mut answer);
        answer
    }

    #[test]
    fn the_same_seed_gives_the_same_scans_however_many_run_beside_them() {
        let mut one = fleet(1, Shows::Patch, 7);
        let mut many = fleet(9, Shows::Patch, 3);
        one.reset(&[Begin::Seeded(11)]);
        many.reset(&[Begin::Seeded(11); 9]);
        for steps in [1, 1, -1, 0] {
            one.step(&[Action::Steps(steps)]);
            many.step(&[Action::Steps(steps); 9]);
            let (one, many) = (seen(&mut one), seen(&mut many));
            assert_eq!(one[..PATCH_BYTES], many[8 * PATCH_BYTES..9 * PATCH_BYTES]);
        }
    }

    #[test]
    fn an_ended_scan_is_followed_by_another_at_the_next_step() {
        let mut fleet = fleet(2, Shows::View, 1);
        let ended = |fleet: &mut Fleet| seen(fleet).split_off(2 * Shows::View.bytes() + 16);
        for _ in 0..5 {
            assert_eq!(ended(&mut fleet), [0, 0]);
            fleet.step(&[Action::Target(0.9); 2]);
        }
        assert_eq!(ended(&mut fleet), [1, 1]);
        fleet.step(&[Action::Target(0.1); 2]);
        assert_eq!(ended(&mut fleet), [0, 0]);
        assert!(fleet.slots.iter().all(|slot| slot.frame == 0));
    }
}
