//! What a training trains on: drawn pictures, footage, and a bench's own recordings. The checkpoint holds their paths
//! and checksums, so that a resumed training uses the same.

use std::path::{Path, PathBuf};
use std::sync::Arc;

use sha2::{Digest, Sha256};

use super::checkpoint::Checkpoint;
use crate::LearningError;
use crate::scans::bench::BenchScenes;
use crate::scans::benchmark::{Benchmark, Conditions, FRAMES};
use crate::scans::clip::Clip;
use crate::scans::detail::{warning, without_detail};
use crate::scans::footage;
use crate::scans::pictures::{Split, varied};
use crate::scans::relief;
use crate::scans::scenery::Scenery;
use crate::scans::simulated::Scene;
use crate::scans::stack::source::StackSource;
use crate::training::recipe::Recipe;
use parfocal_base::notices::tell;
use parfocal_imaging::PixelFormat;

/// Least number of scans that are checked for detail to focus on.
const LEAST_CHECKED: usize = 60;

/// Paths of what a training trains on. Both lists may be empty.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub struct Sources {
    /// Videos, images or folders of images, instead of drawn pictures or, by the recipe's share, beside them.
    pub footage: Vec<PathBuf>,
    /// Folders of a bench's recorded scans and focal stacks, used besides the pictures.
    pub scans: Vec<String>,
    /// The format of raw mosaics in them; if it is `None`, the one of their length.
    pub raw: Option<PixelFormat>,
}

/// The pictures and recordings of a training, opened.
pub(super) struct Material {
    /// Drawn pictures; none if all flat scans are over footage.
    drawn: Vec<Arc<Clip>>,
    /// `None` without footage.
    footage: Option<Footage>,
    /// The bench's recordings, with their paths and hash; `None` without recordings.
    bench: Option<(BenchScenes, Origin)>,
    /// The format of raw mosaics that was given.
    raw: Option<PixelFormat>,
}

/// Clips, with their paths and hash.
type Footage = (Vec<Arc<Clip>>, Origin);

/// The absolute paths of pictures, and a hash of their content.
#[derive(Debug, Clone, PartialEq, Eq)]
struct Origin {
    paths: Vec<String>,
    sha256: String,
}

/// A kind of source: the name of its notes in a checkpoint, and its command-line option.
#[derive(Debug, Clone, Copy)]
struct Kind {
    name: &'static str,
    option: &'static str,
}

const FOOTAGE: Kind = Kind { name: "footage", option: "--footage" };
const SCANS: Kind = Kind { name: "scans", option: "--scans" };
/// The note in a checkpoint that holds the format of raw mosaics.
const RAW: &str = "raw";

impl Material {
    /// Opens the footage and recordings of `sources`, and draws the pictures that `recipe` needs beside them.
    pub fn open(sources: &Sources, recipe: &Recipe) -> Result<Self, LearningError> {
        let footage = footage(&sources.footage)?;
        let bench = bench(&sources.scans, sources.raw)?;
        Ok(Self { drawn: drawn(recipe, footage.is_some())?, footage, bench, raw: sources.raw })
    }

    /// Opens what the training of `checkpoint` was begun on. `asked` holds its new paths, if any were given.
    pub fn again(checkpoint: &Checkpoint<'_>, asked: &Sources, recipe: &Recipe) -> Result<Self, LearningError> {
        let paths = |footage: &[PathBuf]| footage.iter().map(|path| path.to_string_lossy().into_owned()).collect();
        let known = KnownSources::of(checkpoint, FOOTAGE, paths(&asked.footage))?;
        let scans = KnownSources::of(checkpoint, SCANS, asked.scans.clone())?;

        // A path that is given need not be text, as a note is.
        let from = match &asked.footage[..] {
            [] => known.paths().iter().map(PathBuf::from).collect(),
            given => given.to_vec(),
        };
        let footage = footage(&from).map_err(|error| known.unusable(error))?;
        known.check(footage.as_ref().map(|(_, origin)| origin))?;

        let noted = checkpoint.notes.get(RAW).and_then(|name| name.parse().ok());
        let raw = asked.raw.or(noted);
        let bench = bench(scans.paths(), raw).map_err(|error| scans.unusable(error))?;
        scans.check(bench.as_ref().map(|(_, origin)| origin))?;
        Ok(Self { drawn: drawn(recipe, footage.is_some())?, footage, bench, raw })
    }

    /// Adds the paths and hashes to the checkpoint's notes.
    pub fn note(&self, checkpoint: &mut Checkpoint<'_>) {
        let footage = self.footage.as_ref().map(|(_, origin)| origin);
        let bench = self.bench.as_ref().map(|(_, origin)| origin);
        for (kind, origin) in [(FOOTAGE, footage), (SCANS, bench)] {
            if let Some(origin) = origin {
                checkpoint.notes.insert(kind.name.to_owned(), origin.paths.join("\n"));
                checkpoint.notes.insert(kind.checksum(), origin.sha256.clone());
            }
        }
        if let Some(raw) = self.raw {
            checkpoint.notes.insert(RAW.to_owned(), raw.name().to_owned());
        }
    }

    /// The scenery for the scans of a training by `recipe`.
    pub fn scenery(&self, recipe: &Recipe) -> Result<Scenery, LearningError> {
        let relief = relief::scenes(Split::Training, recipe.reliefs)?;
        let relief = relief.into_iter().map(Scene::Stack).collect();
        let films = self.footage.as_ref().map_or_else(Vec::new, |(clips, _)| clips.clone());
        let flat = match &self.drawn[..] {
            [] => Scenery::from(films),
            drawn => {
                let films = films.into_iter().map(Scene::Flat).collect();
                Scenery::from(drawn.to_vec()).with(films, recipe.footage_share)
            }
        };
        let bench = self.bench.as_ref().map_or_else(Vec::new, |(scenes, _)| scenes.training.clone());
        Ok(flat.with(relief, recipe.relief_share).with(bench, recipe.bench_share))
    }

    /// The bench's recordings to validate on; empty without recordings.
    pub fn bench_validation(&self) -> &[Scene] {
        self.bench.as_ref().map_or(&[], |(scenes, _)| &scenes.validation)
    }

    /// Describes the material in words, for a model card.
    pub fn words(&self) -> String {
        let mut pictures = Vec::new();
        if !self.drawn.is_empty() {
            pictures.push(format!("{} drawn pictures and brain phantoms", self.drawn.len()));
        }
        if let Some((clips, _)) = &self.footage {
            pictures.push(format!("{} clips of footage", clips.len()));
        }
        let pictures = pictures.join(" and ");
        match &self.bench {
            None => pictures,
            Some((scenes, origin)) => format!(
                "{pictures}, and on {} recordings of a bench, {} of them kept for validation",
                origin.paths.len(),
                scenes.kept.len()
            ),
        }
    }
}

impl Kind {
    /// Name of the note that holds the hash.
    fn checksum(self) -> String {
        format!("{}_sha256", self.name)
    }
}

/// What a checkpoint says about a kind of source, and its new paths.
struct KnownSources {
    kind: Kind,
    /// Its paths and hash when the training was begun; `None` if the training used no such source.
    begun: Option<Origin>,
    /// The paths given when resuming; empty for those of before.
    asked: Vec<String>,
}

impl KnownSources {
    fn of(checkpoint: &Checkpoint<'_>, kind: Kind, asked: Vec<String>) -> Result<Self, LearningError> {
        let begun = checkpoint.notes.get(kind.name).map(|paths| Origin {
            paths: paths.lines().map(str::to_owned).collect(),
            sha256: checkpoint.notes.get(&kind.checksum()).cloned().unwrap_or_default(),
        });

        if begun.is_none() && !asked.is_empty() {
            let Kind { name, option } = kind;
            let instead = if name == FOOTAGE.name { "on drawn pictures" } else { "without recordings" };
            bail!("this training was begun {instead}; leave out {option} to continue");
        }
        Ok(Self { kind, begun, asked })
    }

    /// The paths to open now.
    fn paths(&self) -> &[String] {
        match &self.begun {
            Some(begun) if self.asked.is_empty() => &begun.paths,
            _ => &self.asked,
        }
    }

    /// Replaces `error` by one with advice if the cause is that a path of the first run no longer exists.
    fn unusable(&self, error: LearningError) -> LearningError {
        let is_there = |path: &String| Path::new(path).exists() || StackSource::parse(path, None).folder.exists();
        if !self.asked.is_empty() || self.paths().iter().all(is_there) {
            return error;
        }
        let Kind { name, option } = self.kind;
        let (is, its) = if name == FOOTAGE.name { ("is", "its new path") } else { ("are", "their new paths") };
        LearningError::new(format!(
            "the {name} that this training was begun on {is} gone: {error}; give {its} with {option}"
        ))
    }

    /// Rejects pictures that differ from those on which the training was begun.
    fn check(&self, now: Option<&Origin>) -> Result<(), LearningError> {
        let Some(begun) = &self.begun else { return Ok(()) };
        let Kind { name, option } = self.kind;
        let names = begun.paths.join(", ");

        if now.is_some_and(|now| now.sha256 == begun.sha256) {
            if name == SCANS.name && planes(self.paths()) != planes(&begun.paths) {
                bail!(
                    "this training was begun on {names}; give each folder the same :PLANES, or none where there was \
                     none"
                );
            }
            return Ok(());
        }

        Err(LearningError::new(if self.asked.is_empty() {
            let has = if name == FOOTAGE.name { "has" } else { "have" };
            format!(
                "the {name} that this training was begun on ({names}) {has} changed; give the path of the unchanged \
                 {name} with {option}, or start again in another folder"
            )
        } else {
            format!(
                "this training was begun on other {name}: {names}; leave out {option}, or give the same pictures in \
                 the same order"
            )
        }))
    }
}

/// The planes that each of `folders` is named with. The checksum of their pictures does not tell them.
fn planes(folders: &[String]) -> Vec<Option<usize>> {
    folders.iter().map(|folder| StackSource::parse(folder, None).planes).collect()
}

/// Draws the pictures of `recipe`, unless footage takes the place of all of them.
fn drawn(recipe: &Recipe, has_footage: bool) -> Result<Vec<Arc<Clip>>, LearningError> {
    if has_footage && recipe.footage_share >= 1.0 {
        return Ok(Vec::new());
    }
    varied(Split::Training, recipe.pictures)
}

/// Reads the footage at `paths`, with its origin; `None` without paths.
fn footage(paths: &[PathBuf]) -> Result<Option<Footage>, LearningError> {
    if paths.is_empty() {
        return Ok(None);
    }

    let clips = footage::clips(paths)?;
    let mut hash = Sha256::new();
    for clip in &clips {
        clip.digest(&mut hash);
    }

    check_detail(&clips)?;

    let paths = paths.iter().map(|path| absolute(&path.to_string_lossy())).collect();
    Ok(Some((clips, Origin { paths, sha256: hex::encode(hash.finalize()) })))
}

/// Reads the recordings in `folders`, with their origin; `None` without folders.
fn bench(folders: &[String], raw: Option<PixelFormat>) -> Result<Option<(BenchScenes, Origin)>, LearningError> {
    if folders.is_empty() {
        return Ok(None);
    }

    let scenes = BenchScenes::read(folders, raw)?;
    match &scenes.kept[..] {
        [] => tell(format_args!(
            "note: validation uses the recordings that are trained on; with five or more, every fifth is kept for it"
        )),
        kept => tell(format_args!("kept for validation, not trained on: {}", kept.join(", "))),
    }

    let origin =
        Origin { paths: folders.iter().map(|folder| absolute(folder)).collect(), sha256: scenes.sha256.clone() };
    Ok(Some((scenes, origin)))
}

/// Paths are stored as absolute ones, since a training may be resumed from another working directory.
fn absolute(path: &str) -> String {
    std::path::absolute(path).map_or_else(|_| path.to_owned(), |path| path.to_string_lossy().into_owned())
}

/// Prints a note if scans over `clips` show nothing to focus on.
fn check_detail(clips: &[Arc<Clip>]) -> Result<(), LearningError> {
    let count = clips.len().max(LEAST_CHECKED);
    let scenes = clips.iter().cloned().map(Scene::Flat).collect();
    let set = Benchmark { scenes, conditions: Conditions::Fitting, seed: 1, count, frames: FRAMES };

    if let Some(warning) = warning(without_detail(&set), count)? {
        tell(format_args!("note: {warning}; training learns nothing from those"));
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use image::{GrayImage, Luma};
    use rand::SeedableRng;
    use rand_chacha::ChaCha8Rng;

    use super::*;
    use crate::training::recipe::shipped;

    #[test]
    fn footage_takes_its_share_of_the_flat_scans() {
        let folder = tempfile::tempdir().unwrap();
        let file = folder.path().join("checks.png");
        let checks = |x: u32, y: u32| Luma([if (x / 3 + y / 2).is_multiple_of(2) { 200 } else { 60 }]);
        GrayImage::from_fn(128, 128, checks).save(&file).unwrap();
        let sources = Sources { footage: vec![file], ..Sources::default() };

        let mut recipe = Recipe::parse(shipped("mgm-learned").unwrap()).unwrap();
        (recipe.pictures, recipe.footage_share) = (3, 0.25);
        let material = Material::open(&sources, &recipe).unwrap();
        assert_eq!(material.words(), "3 drawn pictures and brain phantoms and 1 clips of footage");

        let scenery = material.scenery(&recipe).unwrap();
        let mut rng = ChaCha8Rng::seed_from_u64(4);
        let is_footage = |scene: Scene| matches!(scene, Scene::Flat(clip) if clip.at(0).width == 128);
        let scans = (0..10_000).filter(|_| is_footage(scenery.draw(&mut rng))).count();
        // Binomial: 2500 with a standard deviation of 43.
        assert!((2280..2720).contains(&scans), "{scans}");

        recipe.footage_share = 1.0;
        let material = Material::open(&sources, &recipe).unwrap();
        assert_eq!(material.words(), "1 clips of footage");
    }
}
