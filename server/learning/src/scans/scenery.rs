//! The scenes of training scans, in groups. Each group is drawn with its own share.

use std::sync::Arc;

use rand::RngExt;
use rand_chacha::ChaCha8Rng;

use super::clip::Clip;
use super::simulated::Scene;

/// Groups of scenes, none of them empty, each with its share of the scans.
#[derive(Debug, Clone)]
pub struct Scenery {
    groups: Vec<Group>,
}

#[derive(Debug, Clone)]
struct Group {
    share: f64,
    scenes: Vec<Scene>,
}

impl Scenery {
    /// Each of `groups` with the same share of the scans; empty ones are left out. `None` if all are empty.
    pub fn evenly(groups: Vec<Vec<Scene>>) -> Option<Self> {
        let groups: Vec<Vec<Scene>> = groups.into_iter().filter(|scenes| !scenes.is_empty()).collect();
        let share = 1.0 / groups.len() as f64;
        let groups: Vec<Group> = groups.into_iter().map(|scenes| Group { share, scenes }).collect();
        (!groups.is_empty()).then_some(Self { groups })
    }

    /// This scenery with `share` of all scans over `scenes`; the other groups keep their proportions in the rest.
    /// Nothing changes if `scenes` is empty or `share` is 0.
    #[must_use]
    pub fn with(mut self, scenes: Vec<Scene>, share: f64) -> Self {
        if scenes.is_empty() || share <= 0.0 {
            return self;
        }

        self.groups.iter_mut().for_each(|group| group.share *= 1.0 - share);
        self.groups.push(Group { share, scenes });
        self
    }

    /// A scene for one scan.
    pub fn draw(&self, rng: &mut ChaCha8Rng) -> Scene {
        let scenes = self.group(rng);
        scenes[rng.random_range(0..scenes.len())].clone()
    }

    fn group(&self, rng: &mut ChaCha8Rng) -> &[Scene] {
        // With one group nothing is drawn from `rng`, so trainings on flat scenes alone give the same results as
        // before.
        if let [only] = &self.groups[..] {
            return &only.scenes;
        }

        let mut place: f64 = rng.random();
        for group in &self.groups {
            if place < group.share {
                return &group.scenes;
            }
            place -= group.share;
        }
        &self.groups[0].scenes
    }
}

impl From<Vec<Arc<Clip>>> for Scenery {
    /// Flat scenes alone; `clips` must not be empty.
    fn from(clips: Vec<Arc<Clip>>) -> Self {
        let scenes = clips.into_iter().map(Scene::Flat).collect();
        Self { groups: vec![Group { share: 1.0, scenes }] }
    }
}

#[cfg(test)]
mod tests {
    use rand::SeedableRng;

    use super::*;
    use crate::scans::pictures::Split;
    use crate::scans::relief;
    use parfocal_devices::simulation::texture::texture;

    #[test]
    fn scenes_are_drawn_by_their_groups_shares() {
        let flat = vec![Arc::new(Clip::still(texture(1, 128)).unwrap())];
        let stack = Scene::Stack(relief::scenes(Split::Training, 1).unwrap().remove(0));
        let scenery = Scenery::from(flat).with(vec![stack], 0.3);
        let mut rng = ChaCha8Rng::seed_from_u64(4);
        let stacks = (0..10_000).filter(|_| matches!(scenery.draw(&mut rng), Scene::Stack(_))).count();
        // Binomial: 3000 with a standard deviation of 46.
        assert!((2770..3230).contains(&stacks), "{stacks}");
    }
}
