//! What a training trains on: drawn pictures or footage. Its checkpoint names them, so that a resumed
//! training uses the same.

use std::path::PathBuf;
use std::sync::Arc;

use sha2::{Digest, Sha256};

use super::checkpoint::Checkpoint;
use crate::notices::tell;
use crate::scans::benchmark::{Benchmark, Conditions, FRAMES};
use crate::scans::clip::{Clip, ClipError};
use crate::scans::detail::{warning, without_detail};
use crate::scans::footage;
use crate::scans::pictures::{Split, varied};
use crate::scans::relief;
use crate::scans::scenery::Scenery;
use crate::scans::simulated::Scene;
use crate::training::error::TrainError;
use crate::training::recipe::Recipe;

/// Names of the notes in a checkpoint.
const FOOTAGE: &str = "footage";
const SHA256: &str = "footage_sha256";
/// Least number of scans that are looked at for detail.
const LEAST_CHECKED: usize = 60;

/// What a training trains on.
pub(super) struct Material {
    pub clips: Vec<Arc<Clip>>,
    /// Where the footage lies and the checksum of its pictures; `None` for drawn pictures.
    footage: Option<(Vec<PathBuf>, String)>,
}

impl Material {
    /// The footage at `paths`, or `pictures` drawn ones where there are none.
    pub fn open(paths: &[PathBuf], pictures: u64) -> Result<Self, TrainError> {
        if paths.is_empty() {
            let unfit = |error: ClipError| TrainError::Recipe(error.to_string());
            return Ok(Self { clips: varied(Split::Training, pictures).map_err(unfit)?, footage: None });
        }

        let mut clips = Vec::new();
        for path in paths {
            clips.extend(footage::clips(path)?);
        }

        let mut hash = Sha256::new();
        for clip in &clips {
            clip.digest(&mut hash);
        }

        check_detail(&clips)?;

        // A training may go on from another folder.
        let paths = paths.iter().map(|path| std::path::absolute(path).unwrap_or_else(|_| path.clone())).collect();
        Ok(Self { clips, footage: Some((paths, hex::encode(hash.finalize()))) })
    }

    /// What the training of `checkpoint` was begun on; `asked` says where its footage lies now, if
    /// it was given.
    pub fn again(checkpoint: &Checkpoint<'_>, asked: &[PathBuf], pictures: u64) -> Result<Self, TrainError> {
        let differs = |text: String| Err(TrainError::Differs(text));
        let Some(known) = checkpoint.notes.get(FOOTAGE) else {
            if !asked.is_empty() {
                return differs(
                    "this training was begun on drawn pictures; leave out --footage to continue".to_owned(),
                );
            }
            return Self::open(&[], pictures);
        };

        let known: Vec<PathBuf> = known.lines().map(PathBuf::from).collect();
        let names = known.iter().map(|path| path.display().to_string()).collect::<Vec<_>>().join(", ");
        let from = if asked.is_empty() { &known } else { asked };
        let gone = asked.is_empty() && known.iter().any(|path| !path.exists());

        let material = Self::open(from, pictures).map_err(|error| match error {
            TrainError::Footage(error) if gone => {
                let advice = "give its new path with --footage";
                TrainError::Differs(format!("the footage that this training was begun on is gone: {error}; {advice}"))
            }
            error => error,
        })?;

        match &material.footage {
            Some((_, sum)) if checkpoint.notes.get(SHA256) == Some(sum) => Ok(material),
            _ if asked.is_empty() => differs(format!(
                "the footage that this training was begun on ({names}) has changed; give the path of the unchanged \
                 footage with --footage, or start again in another folder"
            )),
            _ => differs(format!(
                "this training was begun on other footage: {names}; leave out --footage, or give the same \
                 pictures in the same order"
            )),
        }
    }

    /// Notes where the footage lies, and its checksum.
    pub fn note(&self, checkpoint: &mut Checkpoint<'_>) {
        if let Some((paths, sum)) = &self.footage {
            let paths: Vec<_> = paths.iter().map(|path| path.to_string_lossy()).collect();
            checkpoint.notes.insert(FOOTAGE.to_owned(), paths.join("\n"));
            checkpoint.notes.insert(SHA256.to_owned(), sum.clone());
        }
    }

    /// What the scans of a training by `recipe` go over.
    pub fn scenery(&self, recipe: &Recipe) -> Result<Scenery, TrainError> {
        let relief =
            relief::scenes(Split::Training, recipe.reliefs).map_err(|error| TrainError::Recipe(error.to_string()))?;
        let relief = relief.into_iter().map(Scene::Stack).collect();
        Ok(Scenery::from(self.clips.clone()).with(relief, recipe.relief_share))
    }

    /// The same in words, for a model card.
    pub fn words(&self) -> String {
        match self.footage {
            None => format!("{} drawn pictures and brain phantoms", self.clips.len()),
            Some(_) => format!("{} clips of footage", self.clips.len()),
        }
    }
}

/// Tells of scans over `clips` that show nothing to focus on.
fn check_detail(clips: &[Arc<Clip>]) -> Result<(), TrainError> {
    let count = clips.len().max(LEAST_CHECKED);
    let scenes = clips.iter().cloned().map(Scene::Flat).collect();
    let set = Benchmark { scenes, conditions: Conditions::Fitting, seed: 1, count, frames: FRAMES };

    if let Some(warning) = warning(without_detail(&set), count)? {
        tell(format_args!("note: {warning}; nothing can be learned there"));
    }
    Ok(())
}
