//! Recordings of a bench as scenes to train on: focal-time scans and focal stacks. Some are kept for validation.

use std::path::Path;
use std::sync::Arc;

use rayon::prelude::*;
use sha2::{Digest, Sha256};

use super::planes::PlaneStack;
use super::recorded::{Kept, RecordedScan};
use super::relief::{Distance, StackScene};
use super::simulated::Scene;
use super::stack::source::StackSource;
use crate::LearningError;
use parfocal_base::notices::tell;
use parfocal_devices::camera::recorded::{HEADER, ScanFolder};
use parfocal_imaging::PixelFormat;

/// One folder in this many is kept for validation.
const KEPT_OF: usize = 5;
/// In training, the number of planes that make the range varies by these factors (least, most), because lenses differ
/// in how far they reach.
const REACH: (f64, f64) = (0.75, 1.3);
/// Each stack is also trained on smaller by this factor, as through an optic that spreads its blur over fewer pixels.
const SMALLER: f64 = 0.71;

/// Scenes of a bench.
#[derive(Debug, Clone)]
pub struct BenchScenes {
    /// Scenes to train on.
    pub training: Vec<Scene>,
    /// Scenes to validate on: those of every fifth folder, or the training scenes if there are fewer than five folders.
    pub validation: Vec<Scene>,
    /// Folders kept for validation, as the caller named them.
    pub kept: Vec<String>,
    /// SHA-256 of all pictures as they are used, in hexadecimal.
    pub sha256: String,
}

impl BenchScenes {
    /// Reads the recordings in `folders`. Each is a recorded scan or a focal stack. For a stack, `DIR:PLANES` says how
    /// many planes make the range 0..=1. Raw mosaics are read in the format `raw`, or if it is `None`, in the one of
    /// their length. Notes on standard error tell what is doubtful about the pictures.
    ///
    /// # Errors
    /// If a folder is missing, or what is in it cannot be used.
    pub fn read(folders: &[String], raw: Option<PixelFormat>) -> Result<Self, LearningError> {
        let read: Vec<(Vec<Scene>, Vec<String>)> =
            folders.par_iter().map(|folder| recording(folder, raw)).collect::<Result<_, _>>()?;
        let (recordings, doubts): (Vec<_>, Vec<_>) = read.into_iter().unzip();

        let mut hash = Sha256::new();
        for scene in recordings.iter().flatten() {
            match scene {
                Scene::Flat(clip) => clip.digest(&mut hash),
                Scene::Stack(stack) => stack.planes.digest(&mut hash),
                Scene::Recorded(scan) => scan.digest(&mut hash),
            }
        }

        let is_kept = |index: usize| index % KEPT_OF == KEPT_OF - 1;
        let scenes = |kept: bool| -> Vec<Scene> {
            let chosen = recordings.iter().enumerate().filter(|(index, _)| is_kept(*index) == kept);
            chosen.flat_map(|(_, scenes)| scenes.clone()).collect()
        };

        let training = scenes(false);
        let kept: Vec<String> =
            folders.iter().enumerate().filter(|(index, _)| is_kept(*index)).map(|(_, folder)| folder.clone()).collect();
        let validation = if kept.is_empty() { training.clone() } else { scenes(true) };

        for doubt in doubts.into_iter().flatten() {
            tell(format_args!("note: {doubt}"));
        }
        Ok(Self { training, validation, kept, sha256: hex::encode(hash.finalize()) })
    }
}

/// The scenes of one folder, and what is doubtful about its pictures.
fn recording(folder: &str, raw: Option<PixelFormat>) -> Result<(Vec<Scene>, Vec<String>), LearningError> {
    if Path::new(folder).join(HEADER).exists() {
        let scan = RecordedScan::read(&ScanFolder::open(Path::new(folder))?, Kept::Surroundings, &|| ())?;
        if scan.poses().len() < 2 {
            bail!(
                "the scan {folder} has only one pose; to use its pictures as a focal stack, name the folder that holds \
                 them"
            );
        }
        return Ok((vec![Scene::Recorded(Arc::new(scan))], Vec::new()));
    }

    let source = StackSource::parse(folder, raw);
    if !source.folder.exists() {
        bail!(
            "there is no folder {folder}; name folders of recorded scans (scan.json) or focal stacks (pictures, or a \
             TIFF)"
        );
    }

    let (scaled, doubts) = source.at_scales()?;
    let mut scenes: Vec<StackScene> = Vec::new();
    for stack in scaled {
        // A stack that is small enough is the same at both scales.
        if scenes.iter().any(|scene| scene.planes.size() == stack.pictures.size()) {
            continue;
        }

        let (planes, (first, last)) = (stack.planes, stack.pictures.range());
        if planes < 3 || planes as f64 > last - first + 1.0 {
            return Err(source.too_small(planes));
        }

        let smaller = stack.smaller(SMALLER);
        for pictures in [Some(Arc::unwrap_or_clone(stack.pictures)), smaller].into_iter().flatten() {
            scenes.push(scene(planes, pictures));
        }
    }
    Ok((scenes.into_iter().map(|scene| Scene::Stack(Arc::new(scene))).collect(), doubts))
}

/// A photographed stack in which about `planes` planes make the range of focal power.
fn scene(planes: usize, pictures: PlaneStack) -> StackScene {
    let (first, last) = pictures.range();
    let reach = |factor: f64| (factor * planes.saturating_sub(1) as f64).clamp(1.0, last - first);
    StackScene {
        slopes: (reach(REACH.0), reach(REACH.1)),
        planes: pictures,
        distance: Distance::Following { spacing: 1.0 },
    }
}
