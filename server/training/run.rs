//! One training from beginning to end: legs of updates, validations, checkpoints, and the best weights so far, in a run
//! folder.
#![allow(clippy::cast_possible_truncation, reason = "event files hold single precision")]

use std::fs;
use std::path::{Path, PathBuf};
use std::sync::Arc;

use tch::Device;

use super::checkpoint::{Checkpoint, CheckpointError};
use super::clip::Clip;
use super::curves::{self, Point};
use super::error::TrainError;
use super::evaluate::{Benchmark, Conditions, FRAMES, Outcome, Row, evaluate};
use super::model_card::{self, Made};
use super::pictures::{Split, varied};
use super::recipe::Recipe;
use super::tensorboard::EventFile;
use super::trainer::{Trainer, trainer};
use crate::autofocus::shipped::{self, Design};
use crate::autofocus::{PolicyName, Registry, weights};
use crate::clock::Clock;

/// Updates between two moments at which a training may stop. All scans begin anew at each, so that none need be saved.
pub const LEG: u64 = 100;
const CHECKPOINT: &str = "checkpoint.safetensors";
const CARD: &str = "MODEL_CARD.md";
const VERSION: &str = env!("CARGO_PKG_VERSION");

/// What a caller is told after each leg.
#[derive(Debug, Clone, PartialEq)]
pub struct Progress {
    /// Updates done.
    pub updates: u64,
    /// Mean loss over the leg.
    pub loss: f64,
    /// Share of random actions, for policies that explore so.
    pub epsilon: Option<f64>,
    /// Latest validation's mean absolute error.
    pub validation: Option<f64>,
}

/// What a training begins with.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum Beginning {
    /// Random weights.
    Nothing,
    /// The weights in a file (safetensors) of the same policy.
    Weights(PathBuf),
    /// The checkpoint in its run folder.
    Checkpoint,
}

/// A training in a run folder.
pub struct Run {
    recipe: Recipe,
    design: Design,
    seed: u64,
    folder: PathBuf,
    trainer: Box<dyn Trainer>,
    validation: Benchmark,
    curve: Vec<Point>,
    best: f64,
    other_version: Option<String>,
    /// What it trains on, in words.
    data: String,
    /// Weights it began with, if not with random ones.
    origin: Option<String>,
}

impl Run {
    /// A training by `recipe` in `folder`, on `footage`, or on drawn pictures where there is none, with its networks on
    /// `device`.
    ///
    /// # Errors
    /// When the recipe fits no policy, the folder cannot be written, or what it should begin with cannot be used.
    pub fn start(
        recipe: Recipe,
        seed: u64,
        footage: Vec<Arc<Clip>>,
        folder: &Path,
        beginning: &Beginning,
        device: Device,
    ) -> Result<Self, TrainError> {
        let design = recipe.design()?;
        // Read first: drawing pictures takes a while, and a checkpoint that is not there should be told at once.
        let resume = matches!(beginning, Beginning::Checkpoint);
        let checkpoint = if resume { Some(Checkpoint::read(&folder.join(CHECKPOINT))?) } else { None };
        let unfit = |error: super::clip::ClipError| TrainError::Recipe(error.to_string());
        let data = match footage.len() {
            0 => format!("{} drawn pictures and brain phantoms", recipe.pictures),
            count => format!("{count} clips of footage"),
        };
        let clips = if footage.is_empty() { varied(Split::Training, recipe.pictures).map_err(unfit)? } else { footage };
        let held_out = varied(Split::Validation, recipe.pictures.min(60)).map_err(unfit)?;
        let count = 2 * held_out.len();
        let validation =
            Benchmark { clips: held_out, conditions: Conditions::HalfVaried, seed: 1, count, frames: FRAMES };
        let mut trainer = trainer(design, &recipe, clips, seed, device)?;
        let mut origin = None;
        if let Beginning::Weights(file) = beginning {
            let unfit = |reason: String| TrainError::Weights { path: file.clone(), reason };
            let bytes = fs::read(file).map_err(|error| unfit(error.to_string()))?;
            trainer.begin_from(&bytes).map_err(|error| unfit(error.to_string()))?;
            origin = Some(file.display().to_string());
        }
        let folder = folder.to_owned();
        let (curve, best, other_version) = (Vec::new(), f64::INFINITY, None);
        let mut run =
            Self { recipe, design, seed, folder, trainer, validation, curve, best, other_version, data, origin };
        match checkpoint {
            Some(checkpoint) => run.restore(&checkpoint)?,
            None => run.open_folder()?,
        }
        Ok(run)
    }

    /// Updates done.
    #[must_use]
    pub fn updates(&self) -> u64 {
        self.trainer.updates()
    }

    /// Lowest mean absolute error in a validation so far.
    #[must_use]
    pub const fn best(&self) -> f64 {
        self.best
    }

    /// The version of parfocal that made the checkpoint this training goes on from, where it is not this one: what follows
    /// may differ from what would have followed there.
    #[must_use]
    pub fn other_version(&self) -> Option<&str> {
        self.other_version.as_deref()
    }

    /// Trains to the end, or until `stop` says so between two legs; either way leaves a checkpoint. Returns whether the
    /// training is complete; [`Run::report`] then adds the benchmark's figures to the model card.
    ///
    /// # Errors
    /// When the run folder cannot be written, or the training diverged.
    pub fn go(
        &mut self,
        clock: &dyn Clock,
        stop: &dyn Fn() -> bool,
        tell: &mut dyn FnMut(&Progress),
    ) -> Result<bool, TrainError> {
        let folder = self.folder.clone();
        let file = |source| TrainError::Folder { path: folder.clone(), source };
        let mut events = EventFile::create(&self.folder, clock, self.updates()).map_err(file)?;
        let end = self.recipe.updates();
        while self.updates() < end && !stop() {
            let loss = self.leg(end);
            let updates = self.updates();
            events.scalar(clock, updates, "loss", loss as f32).map_err(file)?;
            let due = updates.is_multiple_of(self.recipe.validate_every) || updates >= end;
            let validation = if due { Some(self.validate()?) } else { None };
            if let Some(mae) = validation {
                events.scalar(clock, updates, "validation/mae", mae as f32).map_err(file)?;
            }
            self.curve.push((updates, loss, validation));
            if due {
                self.save()?;
            }
            tell(&Progress { updates, loss, epsilon: self.trainer.epsilon(), validation });
        }
        self.save()?;
        Ok(self.updates() >= end)
    }

    /// One leg: as many updates as lie before the next multiple of [`LEG`], on scans that begin anew.
    fn leg(&mut self, end: u64) -> f64 {
        let goal = (self.updates() / LEG + 1).saturating_mul(LEG).min(end);
        // A stream of its own for each leg: what follows depends on the seed and on how far the training is, no more.
        let seed = self.seed.wrapping_mul(0x9e37_79b9_7f4a_7c15).wrapping_add(self.updates());
        self.trainer.begin_leg(seed);
        let (mut sum, mut count) = (0.0, 0.0);
        while self.updates() < goal {
            sum += self.trainer.update();
            count += 1.0;
        }
        sum / f64::max(count, 1.0)
    }

    /// The present weights, with where they come from.
    fn weights(&self) -> Result<Vec<u8>, TrainError> {
        let made =
            format!("{}, seed {}, {} updates, parfocal {}", self.recipe.policy, self.seed, self.updates(), VERSION);
        weights::save(self.trainer.store(), &made).map_err(|error| TrainError::Diverged(error.to_string()))
    }

    /// Runs the present weights on the validation scans; keeps them if they are the best so far.
    fn validate(&mut self) -> Result<f64, TrainError> {
        let bytes = self.weights()?;
        let row = self.figures(bytes.clone(), &self.validation)?;
        if row.mae < self.best {
            self.best = row.mae;
            self.write(&self.weights_file(), &bytes)?;
            let made = Made {
                policy: &self.recipe.policy,
                seed: self.seed,
                updates: self.updates(),
                origin: self.origin.as_deref(),
                data: &self.data,
            };
            self.write(CARD, model_card::validated(&made, &row, self.validation.count).as_bytes())?;
        }
        Ok(row.mae)
    }

    /// Runs the best weights on the reference benchmark, for their model card.
    ///
    /// # Errors
    /// When the run folder cannot be read or written.
    pub fn report(&self) -> Result<(), TrainError> {
        let count = self.recipe.benchmark;
        if count == 0 || !self.best.is_finite() {
            return Ok(());
        }
        let read = |name: &str| {
            let path = self.folder.join(name);
            fs::read(&path).map_err(|source| TrainError::Folder { path, source })
        };
        let benchmark = Benchmark::reference(count).map_err(|error| TrainError::Recipe(error.to_string()))?;
        let row = self.figures(read(&self.weights_file())?, &benchmark)?;
        let card = model_card::benchmarked(&String::from_utf8_lossy(&read(CARD)?), &row, count);
        self.write(CARD, card.as_bytes())
    }

    /// The figures of the weights in `bytes` on `scans`.
    fn figures(&self, bytes: Vec<u8>, scans: &Benchmark) -> Result<Row, TrainError> {
        let diverged = |error: &dyn std::fmt::Display| TrainError::Diverged(error.to_string());
        let design = self.design;
        shipped::build(design, &bytes).map_err(|error| diverged(&error))?;
        let name = PolicyName::new(&self.recipe.policy);
        let registry = Registry::default().with(name.as_str(), "in training", move || {
            shipped::build(design, &bytes).unwrap_or_else(|_| Box::new(crate::autofocus::Fixed::default()))
        });
        let outcomes = evaluate(&registry, &[name], scans, &|_| ()).map_err(|error| diverged(&error))?;
        outcomes.last().map(Outcome::row).ok_or_else(|| diverged(&"nothing was evaluated"))
    }

    fn weights_file(&self) -> String {
        format!("{}.safetensors", self.recipe.policy)
    }

    fn open_folder(&self) -> Result<(), TrainError> {
        let file = |source| TrainError::Folder { path: self.folder.clone(), source };
        if self.folder.join(CHECKPOINT).exists() {
            let text = format!(
                "{} holds a training already; go on with it by --resume, or choose another folder",
                self.folder.display()
            );
            return Err(TrainError::Recipe(text));
        }
        fs::create_dir_all(&self.folder).map_err(file)?;
        self.write("recipe.toml", self.recipe_text().as_bytes())
    }

    fn recipe_text(&self) -> String {
        toml::to_string(&self.recipe).unwrap_or_default()
    }

    fn save(&self) -> Result<(), TrainError> {
        let mut checkpoint = Checkpoint::default();
        self.trainer.save(&mut checkpoint);
        let mut note = |name: &str, value: String| checkpoint.notes.insert(name.to_owned(), value);
        note("version", VERSION.to_owned());
        note("recipe", self.recipe_text());
        note("seed", self.seed.to_string());
        note("best", self.best.to_string());
        if let Some(origin) = &self.origin {
            note("origin", origin.clone());
        }
        let points = curves::text(&self.curve);
        self.write("curves.csv", format!("updates,loss,validation_mae\n{points}\n").as_bytes())?;
        self.write("curves.svg", curves::svg(&self.curve).as_bytes())?;
        note("curve", points);
        Ok(checkpoint.write(&self.folder.join(CHECKPOINT))?)
    }

    fn restore(&mut self, checkpoint: &Checkpoint) -> Result<(), TrainError> {
        let recipe = checkpoint.notes.get("recipe").map(|text| Recipe::parse(text));
        if recipe != Some(Ok(self.recipe.clone())) {
            return Err(CheckpointError::Unfit("it was made by another recipe".to_owned()).into());
        }
        let version = checkpoint.notes.get("version").map_or("an earlier version", String::as_str);
        self.other_version = (version != VERSION).then(|| version.to_owned());
        self.seed = checkpoint.number("seed")?;
        self.best = checkpoint.number("best")?;
        self.origin = checkpoint.notes.get("origin").cloned();
        self.curve = curves::parse(checkpoint.notes.get("curve").map_or("", String::as_str));
        self.trainer.restore(checkpoint)?;
        Ok(())
    }

    fn write(&self, name: &str, bytes: &[u8]) -> Result<(), TrainError> {
        let path = self.folder.join(name);
        let beside = path.with_extension("partial");
        let done = fs::write(&beside, bytes).and_then(|()| fs::rename(&beside, &path));
        done.map_err(|source| TrainError::Folder { path, source })
    }
}
