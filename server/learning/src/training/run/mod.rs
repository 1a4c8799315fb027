//! One training from beginning to end, in a run folder: legs of updates, validations, checkpoints, and the best weights
//! so far.

pub mod checkpoint;
pub mod comparison;
mod curves;
pub mod folder;
mod material;
mod model_card;
pub mod resume;
pub mod tensorboard;

use std::fmt::Display;
use std::fs;
use std::path::Path;

use tch::Device;

use super::belief::BeliefTrainer;
use super::dqn::DqnTrainer;
use super::recipe::{LEG, Recipe};
use super::trainer::Trainer;
use crate::LearningError;
use crate::evaluation::{Outcome, Row, evaluate};
use crate::scans::benchmark::{Benchmark, Conditions, FRAMES};
use crate::scans::pictures::{Split, varied};
use crate::scans::relief;
use crate::scans::scenery::Scenery;
use crate::scans::simulated::Scene;
use checkpoint::Checkpoint;
use comparison::{BENCHMARK, BenchmarkFigures, RECIPE};
use curves::Point;
use folder::{RunFolder, unwritable};
use material::Material;
pub use material::Sources;
use model_card::Provenance;
use parfocal_autofocus::shipped::{self, Design};
use parfocal_autofocus::{Registry, weights};
use parfocal_base::PolicyName;
use parfocal_base::clock::Clock;
use resume::ResumeRequest;
use tensorboard::EventFile;

const CARD: &str = "MODEL_CARD.md";
const VERSION: &str = env!("CARGO_PKG_VERSION");

/// Progress of a training, reported after each leg.
#[derive(Debug, Clone, PartialEq)]
pub struct TrainingProgress {
    /// Updates done so far.
    pub updates: u64,
    /// Mean loss over the leg.
    pub loss: f64,
    /// Share of random actions; `None` for policies that do not explore with random actions.
    pub epsilon: Option<f64>,
    /// Mean absolute error of the validation after this leg; `None` if there was none.
    pub validation: Option<f64>,
}

/// A training in a run folder.
pub struct Run {
    recipe: Recipe,
    design: Design,
    seed: u64,
    folder: RunFolder,
    trainer: Box<dyn Trainer>,
    validation: Benchmark,
    curve: Vec<Point>,
    best: f64,
    other_version: Option<String>,
    material: Material,
    /// File of the weights that it began with; `None` for random ones.
    origin: Option<String>,
}

impl Run {
    /// Begins a training by `recipe` in `folder`, which must be new or empty. It trains on `sources`, with its networks
    /// on `device`. It begins with the weights in the file `from` (safetensors), or with random ones.
    ///
    /// # Errors
    /// If the recipe fits no policy, the folder cannot be written, or the weights, footage or recordings cannot be
    /// used.
    pub fn begin(
        recipe: Recipe,
        seed: u64,
        sources: &Sources,
        folder: &Path,
        from: Option<&Path>,
        device: Device,
    ) -> Result<Self, LearningError> {
        // Drawing pictures takes a while, so check everything else first.
        let design = recipe.design()?;
        let weights = from.map(|file| beginning(design, file)).transpose()?;
        let folder = RunFolder::begin(folder)?;

        let material = Material::open(sources, &recipe)?;
        let mut run = Self::new(recipe, design, seed, folder, material, device)?;

        if let (Some(bytes), Some(file)) = (weights, from) {
            run.trainer.begin_from(&bytes).map_err(|error| unfit(file, &error))?;
            run.origin = Some(file.display().to_string());
        }

        run.folder.write(RECIPE, run.recipe_text().as_bytes())?;
        Ok(run)
    }

    /// Resumes the training in `folder` from its checkpoint. It must match `request`.
    ///
    /// # Errors
    /// If there is no checkpoint, it is damaged or does not match, or the footage or recordings are gone or have
    /// changed.
    pub fn resume(folder: &Path, request: &ResumeRequest, device: Device) -> Result<Self, LearningError> {
        let (folder, mut checkpoint) = RunFolder::go_on(folder)?;
        let text = checkpoint.notes.get("recipe").map_or("", String::as_str);
        let recipe = Recipe::parse(text).map_err(|error| checkpoint.damaged(format!("its recipe: {error}")))?;

        let seed = checkpoint.number("seed")?;
        request.check(folder.path(), &recipe, seed)?;

        let design = recipe.design()?;
        let material = Material::again(&checkpoint, &request.sources, &recipe)?;
        let mut run = Self::new(recipe, design, seed, folder, material, device)?;

        let version = checkpoint.notes.get("version").map_or("another version", String::as_str);
        run.other_version = (version != VERSION).then(|| version.to_owned());
        run.best = checkpoint.number("best")?;
        run.origin = checkpoint.notes.get("origin").cloned();
        run.curve = curves::parse(checkpoint.notes.get("curve").map_or("", String::as_str));

        run.trainer.restore(&mut checkpoint)?;
        Ok(run)
    }

    fn new(
        recipe: Recipe,
        design: Design,
        seed: u64,
        folder: RunFolder,
        material: Material,
        device: Device,
    ) -> Result<Self, LearningError> {
        let validation = validation(&recipe, &material)?;
        let trainer = trainer(design, &recipe, material.scenery(&recipe)?, seed, device)?;

        Ok(Self {
            recipe,
            design,
            seed,
            folder,
            trainer,
            validation,
            curve: Vec::new(),
            best: f64::INFINITY,
            other_version: None,
            material,
            origin: None,
        })
    }

    /// The recipe of this training.
    pub const fn recipe(&self) -> &Recipe {
        &self.recipe
    }

    /// Updates done so far.
    pub fn updates(&self) -> u64 {
        self.trainer.updates()
    }

    /// Lowest mean absolute error of any validation so far; infinite before the first.
    pub const fn best(&self) -> f64 {
        self.best
    }

    /// The version of parfocal that made the checkpoint from which this training resumes; `None` if it is this version.
    /// With another version the result may differ.
    pub fn other_version(&self) -> Option<&str> {
        self.other_version.as_deref()
    }

    /// Trains to the end, or until `stop` returns true between two legs. Either way it leaves a checkpoint. Returns
    /// whether the training is complete. [`Run::report`] then adds the benchmark's figures to the model card.
    ///
    /// # Errors
    /// If the run folder cannot be written, or the training diverged.
    pub fn go(
        &mut self,
        clock: &dyn Clock,
        stop: &dyn Fn() -> bool,
        tell: &mut dyn FnMut(&TrainingProgress),
    ) -> Result<bool, LearningError> {
        let folder = self.folder.path().to_owned();
        let file = |error| unwritable(&folder, &error);
        let mut events = EventFile::create(&folder, clock, self.updates()).map_err(file)?;
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

            tell(&TrainingProgress { updates, loss, epsilon: self.trainer.epsilon(), validation });
        }

        // A complete training was saved after its last leg.
        let complete = self.updates() >= end;
        if !complete {
            self.save()?;
        }
        Ok(complete)
    }

    /// Trains one leg, up to the next multiple of [`LEG`] updates, on new scans. Returns the mean loss.
    fn leg(&mut self, end: u64) -> f64 {
        let goal = (self.updates() / LEG + 1).saturating_mul(LEG).min(end);

        // Each leg has its own random stream, so that it depends only on the seed and the number of updates done.
        let seed = self.seed.wrapping_mul(0x9e37_79b9_7f4a_7c15).wrapping_add(self.updates());
        self.trainer.begin_leg(seed);
        let mut sum = 0.0;
        let mut count = 0.0;

        while self.updates() < goal {
            sum += self.trainer.update();
            count += 1.0;
        }
        sum / f64::max(count, 1.0)
    }

    /// The present weights as safetensors, with a note of how they were made.
    fn weights(&self) -> Result<Vec<u8>, LearningError> {
        let made =
            format!("{}, seed {}, {} updates, parfocal {}", self.recipe.policy, self.seed, self.updates(), VERSION);
        weights::save(self.trainer.store(), &made).map_err(|error| diverged(&error))
    }

    /// Evaluates the present weights on the validation scans, and saves them if they are the best so far. Returns their
    /// mean absolute error.
    fn validate(&mut self) -> Result<f64, LearningError> {
        let bytes = self.weights()?;
        let row = self.figures(bytes.clone(), &self.validation)?;

        if row.mae < self.best {
            self.best = row.mae;
            self.folder.write(&self.weights_file(), &bytes)?;
            let made = Provenance {
                policy: &self.recipe.policy,
                seed: self.seed,
                updates: self.updates(),
                origin: self.origin.as_deref(),
                data: &self.material.words(),
            };
            self.folder.write(CARD, model_card::validated(&made, &row, &self.validation).as_bytes())?;
        }

        Ok(row.mae)
    }

    /// Evaluates the best weights on the reference benchmark, stores the figures and adds them to their model card,
    /// unless both is done.
    ///
    /// # Errors
    /// If the run folder cannot be read or written.
    pub fn report(&self) -> Result<(), LearningError> {
        let count = self.recipe.benchmark;
        if count == 0 || !self.best.is_finite() {
            return Ok(());
        }

        let card = String::from_utf8_lossy(&self.folder.read(CARD)?).into_owned();
        let is_on_card = model_card::is_benchmarked(&card);
        if is_on_card && self.folder.path().join(BENCHMARK).exists() {
            return Ok(());
        }

        let weights = beginning(self.design, &self.folder.path().join(self.weights_file()))?;
        let benchmark = Benchmark::reference(count)?;
        let row = self.figures(weights, &benchmark)?;

        let figures = serde_json::to_vec_pretty(&BenchmarkFigures::new(&row, count)).unwrap_or_default();
        self.folder.write(BENCHMARK, &figures)?;

        if is_on_card {
            return Ok(());
        }
        self.folder.write(CARD, model_card::benchmarked(&card, &row, count).as_bytes())
    }

    /// Evaluates the weights in `bytes` on `scans`.
    fn figures(&self, bytes: Vec<u8>, scans: &Benchmark) -> Result<Row, LearningError> {
        let design = self.design;
        let name = PolicyName::new(&self.recipe.policy);
        let build = move |bytes: &[u8]| shipped::build(design, bytes);
        let registry = Registry::default().made_of_weights(name.as_str(), "in training", bytes.into(), build);

        let outcomes = evaluate(&registry, &[name], scans, &|_| ()).map_err(|error| diverged(&error))?;
        outcomes.last().map(Outcome::row).ok_or_else(|| diverged(&"nothing was evaluated"))
    }

    fn weights_file(&self) -> String {
        format!("{}.safetensors", self.recipe.policy)
    }

    fn recipe_text(&self) -> String {
        toml::to_string(&self.recipe).unwrap_or_default()
    }

    fn save(&self) -> Result<(), LearningError> {
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
        self.folder.write("curves.csv", format!("updates,loss,validation_mae\n{points}\n").as_bytes())?;
        self.folder.write("curves.svg", curves::svg(&self.curve).as_bytes())?;

        note("curve", points);
        self.material.note(&mut checkpoint);
        self.folder.save(&checkpoint)
    }
}

/// A trainer, with random weights, of a policy of `design` as `recipe` says, with its networks on `device`.
fn trainer(
    design: Design,
    recipe: &Recipe,
    scenery: Scenery,
    seed: u64,
    device: Device,
) -> Result<Box<dyn Trainer>, LearningError> {
    Ok(match (design, &recipe.dqn, &recipe.belief) {
        (Design::Values(sight), Some(dqn), _) => Box::new(DqnTrainer::new(sight, dqn.clone(), scenery, seed, device)),
        (Design::Belief, _, Some(belief)) => Box::new(BeliefTrainer::new(belief.clone(), scenery, seed, device)),
        _ => return Err(recipe.has_the_wrong_section()),
    })
}

/// The scans that decide which weights are best:
///
/// - scans over drawn pictures, under the reference benchmark's conditions;
/// - as many over the same pictures, as varied as scans in training can be;
/// - if the recipe trains on relief, up to 60 scans over scenes with relief;
/// - if it trains on a bench's recordings, as many over those as over the pictures.
fn validation(recipe: &Recipe, material: &Material) -> Result<Benchmark, LearningError> {
    let flat = varied(Split::Validation, recipe.pictures.min(60))?;
    let flat: Vec<Scene> = flat.into_iter().map(Scene::Flat).collect();
    let relief = relief::scenes(Split::Validation, recipe.reliefs.min(60))?;

    let plain = flat.len();
    let bench = material.bench_validation().iter().cycle().take(flat.len()).cloned();
    let relief = relief.into_iter().map(Scene::Stack);
    let scenes: Vec<Scene> = flat.iter().cloned().chain(flat.clone()).chain(relief).chain(bench).collect();

    let count = scenes.len();
    Ok(Benchmark { scenes, conditions: Conditions::VariedFrom(plain), seed: 1, count, frames: FRAMES })
}

/// Reads the weights in `file` and checks that they fit a policy of `design`.
fn beginning(design: Design, file: &Path) -> Result<Vec<u8>, LearningError> {
    let bytes = fs::read(file).map_err(|error| unfit(file, &error))?;
    shipped::build(design, &bytes).map_err(|error| unfit(file, &error))?;
    Ok(bytes)
}

/// The error that the weights in `file` cannot be used.
fn unfit(file: &Path, reason: &dyn Display) -> LearningError {
    LearningError::new(format!("cannot use the weights {}: {reason}", file.display()))
}

/// The error that the training went astray, for example to weights that are not finite.
fn diverged(reason: &dyn Display) -> LearningError {
    LearningError::new(format!("the training diverged: {reason}; lower the learning rate"))
}
