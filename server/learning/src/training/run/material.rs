//! What a training trains on: drawn pictures or footage, and a bench's own recordings. The checkpoint holds their paths
//! and checksums, so that a resumed training uses the same.

use std::path::{Path, PathBuf};
use std::sync::Arc;

use sha2::{Digest, Sha256};

use super::checkpoint::Checkpoint;
use crate::scans::bench::BenchScenes;
use crate::scans::benchmark::{Benchmark, Conditions, FRAMES};
use crate::scans::clip::{Clip, ClipError};
use crate::scans::detail::{warning, without_detail};
use crate::scans::footage;
use crate::scans::pictures::{Split, varied};
use crate::scans::relief;
use crate::scans::scenery::Scenery;
use crate::scans::simulated::Scene;
use crate::scans::stack::source::StackSource;
use crate::training::error::TrainError;
use crate::training::recipe::Recipe;
use parfocal_base::notices::tell;
use parfocal_imaging::PixelFormat;

/// Least number of scans that are checked for detail to focus on.
const LEAST_CHECKED: usize = 60;

/// Paths of what a training trains on. Both lists may be empty.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub struct Sources {
    /// Videos, images or folders of images, instead of drawn pictures.
    pub footage: Vec<PathBuf>,
    /// Folders of a bench's recorded scans and focal stacks, used besides the pictures.
    pub scans: Vec<String>,
    /// The format of raw mosaics in them; if it is `None`, the one of their length.
    pub raw: Option<PixelFormat>,
}

/// The pictures and recordings of a training, opened.
pub(super) struct Material {
    pub clips: Vec<Arc<Clip>>,
    /// The footage's paths and the hash of its pictures; `None` for drawn pictures.
    footage: Option<Origin>,
    /// The bench's recordings, with their paths and hash; `None` without recordings.
    bench: Option<(BenchScenes, Origin)>,
    /// The format of raw mosaics that was given.
    raw: Option<PixelFormat>,
}

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
    /// Opens the footage and recordings of `sources`. Without footage, draws `pictures` pictures instead.
    pub fn open(sources: &Sources, pictures: u64) -> Result<Self, TrainError> {
        let (clips, footage) = clips(&sources.footage, pictures)?;
        let bench = bench(&sources.scans, sources.raw)?;
        Ok(Self { clips, footage, bench, raw: sources.raw })
    }

    /// Opens what the training of `checkpoint` was begun on. `asked` holds its new paths, if any were given.
    pub fn again(checkpoint: &Checkpoint<'_>, asked: &Sources, pictures: u64) -> Result<Self, TrainError> {
        let paths = |footage: &[PathBuf]| footage.iter().map(|path| path.to_string_lossy().into_owned()).collect();
        let footage = KnownSources::of(checkpoint, FOOTAGE, paths(&asked.footage))?;
        let scans = KnownSources::of(checkpoint, SCANS, asked.scans.clone())?;

        let from = footage.paths().iter().map(PathBuf::from).collect::<Vec<_>>();
        let (clips, origin) = clips(&from, pictures).map_err(|error| footage.unusable(error))?;
        footage.check(origin.as_ref())?;

        let noted = checkpoint.notes.get(RAW).and_then(|name| name.parse().ok());
        let raw = asked.raw.or(noted);
        let bench = bench(scans.paths(), raw).map_err(|error| scans.unusable(error))?;
        scans.check(bench.as_ref().map(|(_, origin)| origin))?;
        Ok(Self { clips, footage: origin, bench, raw })
    }

    /// Adds the paths and hashes to the checkpoint's notes.
    pub fn note(&self, checkpoint: &mut Checkpoint<'_>) {
        let bench = self.bench.as_ref().map(|(_, origin)| origin);
        for (kind, origin) in [(FOOTAGE, self.footage.as_ref()), (SCANS, bench)] {
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
    pub fn scenery(&self, recipe: &Recipe) -> Result<Scenery, TrainError> {
        let relief =
            relief::scenes(Split::Training, recipe.reliefs).map_err(|error| TrainError::Recipe(error.to_string()))?;
        let relief = relief.into_iter().map(Scene::Stack).collect();
        let bench = self.bench.as_ref().map_or_else(Vec::new, |(scenes, _)| scenes.training.clone());
        Ok(Scenery::from(self.clips.clone()).with(relief, recipe.relief_share).with(bench, recipe.bench_share))
    }

    /// The bench's recordings to validate on; empty without recordings.
    pub fn bench_validation(&self) -> &[Scene] {
        self.bench.as_ref().map_or(&[], |(scenes, _)| &scenes.validation)
    }

    /// Describes the material in words, for a model card.
    pub fn words(&self) -> String {
        let pictures = match self.footage {
            None => format!("{} drawn pictures and brain phantoms", self.clips.len()),
            Some(_) => format!("{} clips of footage", self.clips.len()),
        };
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
    fn of(checkpoint: &Checkpoint<'_>, kind: Kind, asked: Vec<String>) -> Result<Self, TrainError> {
        let begun = checkpoint.notes.get(kind.name).map(|paths| Origin {
            paths: paths.lines().map(str::to_owned).collect(),
            sha256: checkpoint.notes.get(&kind.checksum()).cloned().unwrap_or_default(),
        });

        if begun.is_none() && !asked.is_empty() {
            let Kind { name, option } = kind;
            let instead = if name == FOOTAGE.name { "on drawn pictures" } else { "without recordings" };
            return Err(TrainError::Differs(format!(
                "this training was begun {instead}; leave out {option} to continue"
            )));
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
    fn unusable(&self, error: TrainError) -> TrainError {
        let is_there = |path: &String| Path::new(path).exists() || StackSource::parse(path, None).folder.exists();
        if !self.asked.is_empty() || self.paths().iter().all(is_there) {
            return error;
        }
        let Kind { name, option } = self.kind;
        let (is, its) = if name == FOOTAGE.name { ("is", "its new path") } else { ("are", "their new paths") };
        TrainError::Differs(format!(
            "the {name} that this training was begun on {is} gone: {error}; give {its} with {option}"
        ))
    }

    /// Rejects pictures that differ from those on which the training was begun.
    fn check(&self, now: Option<&Origin>) -> Result<(), TrainError> {
        let Some(begun) = &self.begun else { return Ok(()) };
        if now.is_some_and(|now| now.sha256 == begun.sha256) {
            return Ok(());
        }

        let Kind { name, option } = self.kind;
        let names = begun.paths.join(", ");
        Err(TrainError::Differs(if self.asked.is_empty() {
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

/// Reads the footage at `paths`, with its origin. Without paths, draws `pictures` pictures instead.
fn clips(paths: &[PathBuf], pictures: u64) -> Result<(Vec<Arc<Clip>>, Option<Origin>), TrainError> {
    if paths.is_empty() {
        let unfit = |error: ClipError| TrainError::Recipe(error.to_string());
        return Ok((varied(Split::Training, pictures).map_err(unfit)?, None));
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

    let paths = paths.iter().map(|path| absolute(&path.to_string_lossy())).collect();
    Ok((clips, Some(Origin { paths, sha256: hex::encode(hash.finalize()) })))
}

/// Reads the recordings in `folders`, with their origin; `None` without folders.
fn bench(folders: &[String], raw: Option<PixelFormat>) -> Result<Option<(BenchScenes, Origin)>, TrainError> {
    if folders.is_empty() {
        return Ok(None);
    }

    let scenes = BenchScenes::read(folders, raw)?;
    for doubt in &scenes.doubts {
        tell(format_args!("note: {doubt}"));
    }

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
fn check_detail(clips: &[Arc<Clip>]) -> Result<(), TrainError> {
    let count = clips.len().max(LEAST_CHECKED);
    let scenes = clips.iter().cloned().map(Scene::Flat).collect();
    let set = Benchmark { scenes, conditions: Conditions::Fitting, seed: 1, count, frames: FRAMES };

    if let Some(warning) = warning(without_detail(&set), count)? {
        tell(format_args!("note: {warning}; training learns nothing from those"));
    }
    Ok(())
}
