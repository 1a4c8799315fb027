//! One training from beginning to end: legs of updates, validations, checkpoints, and the best weights so far, in a run
//! folder.
#![allow(clippy::cast_possible_truncation, reason = "event files hold single precision")]

use std::fs;
use std::path::{Path, PathBuf};
use std::sync::Arc;

use tch::Device;

use super::belief::BeliefTrainer;
use super::checkpoint::{Checkpoint, CheckpointError};
use super::clip::Clip;
use super::curves::curves;
use super::dqn::DqnTrainer;
use super::evaluate::{Benchmark, Outcome, Row, evaluate};
use super::pictures::{Split, varied};
use super::recipe::Recipe;
use super::scan::ScanSettings;
use super::tensorboard::EventFile;
use crate::autofocus::shipped::{self, Design};
use crate::autofocus::{PolicyName, Registry, weights};
use crate::clock::Clock;

/// Updates between two moments at which a training may stop. All scans begin anew at each, so that none need be saved.
pub const LEG: u64 = 100;
const CHECKPOINT: &str = "checkpoint.safetensors";
const VERSION: &str = env!("CARGO_PKG_VERSION");

/// Why a training could not start or go on.
#[derive(Debug, thiserror::Error)]
pub enum TrainError {
    /// The recipe does not fit the policy.
    #[error("{0}")]
    Recipe(String),
    /// A checkpoint cannot be used.
    #[error(transparent)]
    Checkpoint(#[from] CheckpointError),
    /// The run folder cannot be written.
    #[error("cannot write to {}: {source}", path.display())]
    Folder {
        /// The file or folder.
        path: PathBuf,
        /// Why.
        source: std::io::Error,
    },
    /// The weights to begin with cannot be used.
    #[error("cannot begin with the weights {}: {reason}", path.display())]
    Weights {
        /// The file.
        path: PathBuf,
        /// Why.
        reason: String,
    },
    /// The weights came out damaged: the training diverged.
    #[error("the training diverged: {0}; lower the learning rate")]
    Diverged(String),
}

/// A learner of either kind.
enum Learner {
    Dqn(Box<DqnTrainer>),
    Belief(Box<BeliefTrainer>),
}

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

/// A training in a run folder.
pub struct Run {
    recipe: Recipe,
    design: Design,
    seed: u64,
    folder: PathBuf,
    learner: Learner,
    validation: Benchmark,
    curve: Vec<(u64, f64, Option<f64>)>,
    best: f64,
    other_version: Option<String>,
    /// What it trains on, in words.
    data: String,
    /// Weights it began with, if not with random ones.
    origin: Option<String>,
}

impl Run {
    /// A training by `recipe` in `folder`; from its checkpoint where `resume` is set. Trains on `footage`, or on drawn
    /// pictures where there is none, with its networks on `device`.
    ///
    /// # Errors
    /// When the recipe fits no policy, the folder cannot be written, or there is no fitting checkpoint to resume.
    pub fn start(
        recipe: Recipe,
        seed: u64,
        footage: Vec<Arc<Clip>>,
        folder: &Path,
        resume: bool,
        device: Device,
    ) -> Result<Self, TrainError> {
        let design = design(&recipe)?;
        // Read first: drawing pictures takes a while, and a checkpoint that is not there should be told at once.
        let checkpoint = if resume { Some(Checkpoint::read(&folder.join(CHECKPOINT))?) } else { None };
        let unfit = |error: super::clip::ClipError| TrainError::Recipe(error.to_string());
        let data = match footage.len() {
            0 => format!("{} drawn pictures and brain phantoms", recipe.pictures),
            count => format!("{count} clips of footage"),
        };
        let clips = if footage.is_empty() { varied(Split::Training, recipe.pictures).map_err(unfit)? } else { footage };
        let held_out = varied(Split::Validation, recipe.pictures.min(60)).map_err(unfit)?;
        let count = held_out.len();
        let validation =
            Benchmark { clips: held_out, settings: ScanSettings::reference(), seed: 1, count, frames: 250 };
        let learner = match (design, &recipe.dqn, &recipe.belief) {
            (Design::Values(sight), Some(dqn), _) => {
                Learner::Dqn(Box::new(DqnTrainer::new(sight, dqn.clone(), clips, seed, device)))
            }
            (Design::Belief, _, Some(belief)) => {
                Learner::Belief(Box::new(BeliefTrainer::new(belief.clone(), clips, seed, device)))
            }
            _ => return Err(TrainError::Recipe(format!("the recipe's section does not fit '{}'", recipe.policy))),
        };
        let folder = folder.to_owned();
        let (curve, best, other_version, origin) = (Vec::new(), f64::INFINITY, None, None);
        let mut run =
            Self { recipe, design, seed, folder, learner, validation, curve, best, other_version, data, origin };
        match checkpoint {
            Some(checkpoint) => run.restore(&checkpoint)?,
            None => run.open_folder()?,
        }
        Ok(run)
    }

    /// Begins with the weights in `file` in the place of random ones.
    ///
    /// # Errors
    /// When they cannot be read, or are damaged or another policy's.
    pub fn begin_from(&mut self, file: &Path) -> Result<(), TrainError> {
        let unfit = |reason: String| TrainError::Weights { path: file.to_owned(), reason };
        let bytes = fs::read(file).map_err(|error| unfit(error.to_string()))?;
        match &mut self.learner {
            Learner::Dqn(dqn) => dqn.begin_from(&bytes),
            Learner::Belief(belief) => weights::load(&belief.store, &bytes),
        }
        .map_err(|error| unfit(error.to_string()))?;
        self.origin = Some(file.display().to_string());
        Ok(())
    }

    /// Updates done.
    #[must_use]
    pub fn updates(&self) -> u64 {
        match &self.learner {
            Learner::Dqn(dqn) => dqn.updates(),
            Learner::Belief(belief) => belief.updates(),
        }
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
    /// training is complete.
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
            tell(&Progress { updates, loss, epsilon: self.epsilon(), validation });
        }
        self.save()?;
        Ok(self.updates() >= end)
    }

    /// One leg: as many updates as lie before the next multiple of [`LEG`], on scans that begin anew.
    fn leg(&mut self, end: u64) -> f64 {
        let goal = (self.updates() / LEG + 1).saturating_mul(LEG).min(end);
        // A stream of its own for each leg: what follows depends on the seed and on how far the training is, no more.
        let seed = self.seed.wrapping_mul(0x9e37_79b9_7f4a_7c15).wrapping_add(self.updates());
        match &mut self.learner {
            Learner::Dqn(dqn) => dqn.begin_leg(seed),
            Learner::Belief(belief) => belief.begin_leg(seed),
        }
        let (mut sum, mut count) = (0.0, 0.0);
        while self.updates() < goal {
            sum += match &mut self.learner {
                Learner::Dqn(dqn) => dqn.update(),
                Learner::Belief(belief) => belief.update(),
            };
            count += 1.0;
        }
        sum / f64::max(count, 1.0)
    }

    fn epsilon(&self) -> Option<f64> {
        match &self.learner {
            Learner::Dqn(dqn) => Some(dqn.epsilon()),
            Learner::Belief(_) => None,
        }
    }

    /// The present weights, with where they come from.
    fn weights(&self) -> Result<Vec<u8>, TrainError> {
        let store = match &self.learner {
            Learner::Dqn(dqn) => dqn.store(),
            Learner::Belief(belief) => &belief.store,
        };
        let made =
            format!("{}, seed {}, {} updates, parfocal {}", self.recipe.policy, self.seed, self.updates(), VERSION);
        weights::save(store, &made).map_err(|error| TrainError::Diverged(error.to_string()))
    }

    /// Runs the present weights on the validation scans; keeps them if they are the best so far.
    fn validate(&mut self) -> Result<f64, TrainError> {
        let bytes = self.weights()?;
        let design = self.design;
        shipped::build(design, &bytes).map_err(|error| TrainError::Diverged(error.to_string()))?;
        let name = PolicyName::new(&self.recipe.policy);
        let copy = bytes.clone();
        let registry = Registry::default().with(name.as_str(), "in training", move || {
            shipped::build(design, &copy).unwrap_or_else(|_| Box::new(crate::autofocus::Fixed::default()))
        });
        let outcomes = evaluate(&registry, &[name], &self.validation, &|_| ())
            .map_err(|error| TrainError::Diverged(error.to_string()))?;
        let row = outcomes.last().map(Outcome::row);
        let mae = row.as_ref().map_or(f64::INFINITY, |row| row.mae);
        if let Some(row) = row.filter(|_| mae < self.best) {
            self.best = mae;
            self.write(&format!("{}.safetensors", self.recipe.policy), &bytes)?;
            self.write("MODEL_CARD.md", self.card(&row).as_bytes())?;
        }
        Ok(mae)
    }

    /// What whoever uses the weights should know of them.
    fn card(&self, row: &Row) -> String {
        format!(
            "# {}\n\nTrained by `parfocal train` {}, seed {}, {} updates, recipe in `recipe.toml`, beginning with {}, \
             on {}.\n\n\
             On {} validation scans: mean absolute focal power error {:.4} ± {:.4}, in focus {:.1} %.\n\n\
             Input: 32x32 gray patches (0..255) and focal powers (0..1). Weights: safetensors, float32, PyTorch's names \
             and layouts. Not a medical device.\n",
            self.recipe.policy,
            VERSION,
            self.seed,
            self.updates(),
            self.origin.as_ref().map_or("random weights".to_owned(), |file| format!("the weights {file}")),
            self.data,
            self.validation.count,
            row.mae,
            row.sd,
            100.0 * row.in_focus,
        )
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
        match &self.learner {
            Learner::Dqn(dqn) => dqn.save(&mut checkpoint),
            Learner::Belief(belief) => belief.save(&mut checkpoint),
        }
        let mut note = |name: &str, value: String| checkpoint.notes.insert(name.to_owned(), value);
        note("version", VERSION.to_owned());
        note("recipe", self.recipe_text());
        note("seed", self.seed.to_string());
        note("best", self.best.to_string());
        if let Some(origin) = &self.origin {
            note("origin", origin.clone());
        }
        let curve: Vec<String> = self
            .curve
            .iter()
            .map(|(updates, loss, mae)| {
                format!("{updates},{loss},{}", mae.map_or(String::new(), |mae| mae.to_string()))
            })
            .collect();
        self.write("curves.csv", format!("updates,loss,validation_mae\n{}\n", curve.join("\n")).as_bytes())?;
        self.write("curves.svg", curves(&self.curve).as_bytes())?;
        note("curve", curve.join("\n"));
        Ok(checkpoint.write(&self.folder.join(CHECKPOINT))?)
    }

    fn restore(&mut self, checkpoint: &Checkpoint) -> Result<(), TrainError> {
        if checkpoint.notes.get("recipe") != Some(&self.recipe_text()) {
            return Err(CheckpointError::Unfit("it was made by another recipe".to_owned()).into());
        }
        let version = checkpoint.notes.get("version").map_or("an earlier version", String::as_str);
        self.other_version = (version != VERSION).then(|| version.to_owned());
        self.seed = checkpoint.number("seed")?;
        self.best = checkpoint.number("best")?;
        self.origin = checkpoint.notes.get("origin").cloned();
        for line in checkpoint.notes.get("curve").into_iter().flat_map(|curve| curve.lines()) {
            let mut parts = line.split(',');
            let mut next = || parts.next().unwrap_or_default().to_owned();
            if let (Ok(updates), Ok(loss)) = (next().parse(), next().parse()) {
                self.curve.push((updates, loss, next().parse().ok()));
            }
        }
        match &mut self.learner {
            Learner::Dqn(dqn) => dqn.restore(checkpoint)?,
            Learner::Belief(belief) => belief.restore(checkpoint)?,
        }
        Ok(())
    }

    fn write(&self, name: &str, bytes: &[u8]) -> Result<(), TrainError> {
        let path = self.folder.join(name);
        let beside = path.with_extension("partial");
        let done = fs::write(&beside, bytes).and_then(|()| fs::rename(&beside, &path));
        done.map_err(|source| TrainError::Folder { path, source })
    }
}

fn design(recipe: &Recipe) -> Result<Design, TrainError> {
    let unknown = || {
        TrainError::Recipe(format!(
            "'{}' is no learned policy; there are mgm-learned, mlr-learned, cnn-learned and parfocal",
            recipe.policy
        ))
    };
    shipped::design(&recipe.policy).ok_or_else(unknown)
}
