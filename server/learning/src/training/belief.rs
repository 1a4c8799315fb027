//! Trains the belief tracker. In simulation the optimum is known at every frame, so the posterior is learned directly,
//! by cross-entropy, on scans that the tracker itself steers.

use std::ops::Range;

use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use rayon::prelude::*;
use tch::{Device, Kind, Tensor, nn};

use super::environment::{Environment, lead_astray};
use super::optimiser::{Flat, Optimiser, half_cosine};
use super::recipe::belief::BeliefRecipe;
use super::run::checkpoint::Checkpoint;
use super::trainer::{Trainer, drawn_with};
use crate::LearningError;
use crate::scans::scenery::Scenery;
use crate::scans::variety::Variety;
use parfocal_autofocus::belief::{Trace, spread_over_bins};
use parfocal_autofocus::networks::{BELIEF_INPUT, BINS, BeliefNetwork, compute_on_this_thread};
use parfocal_base::BlurRate;
use parfocal_devices::simulation::normal::standard_normal;
use parfocal_imaging::{View, WIDER};

/// Most parts into which the scans are divided. Each core plays one part after another and learns from it, and waits
/// for the others once an update. Their number is fixed, so the number of cores does not change a digit.
const PARTS: usize = 4;

/// A training in progress.
pub struct BeliefTrainer {
    recipe: BeliefRecipe,
    scenery: Scenery,
    store: nn::VarStore,
    optimiser: Optimiser,
    parts: Vec<Part>,
    updates: u64,
}

/// Some of the scans, with all that is needed to play them and to learn from them.
struct Part {
    /// Their indices among all scans.
    scans: Range<usize>,
    actors: Vec<Actor>,
    /// The network in training, as it was when the present update began.
    network: BeliefNetwork,
    variables: Flat,
    /// The network's memory of each scan.
    memory: Tensor,
    rng: ChaCha8Rng,
}

struct Actor {
    environment: Environment,
    trace: Trace,
    windows_left: usize,
    /// How many wider patches are seen, finest first.
    wider: usize,
}

/// Share of scans in which some of the wider patches are missing, as in a picture that is too small for them.
const NARROW: f64 = 0.1;

/// Share of scans in which the tracker gets the blur rate of the optics as an input.
const KNOWN: f64 = 0.4;
/// Error of that blur rate: standard deviation of its logarithm around the true one's.
const MEASURED: f64 = 0.15;

/// Frames of N scans and the beliefs to learn: inputs `[N, T, BELIEF_INPUT]`, beliefs `[N, T, BINS]`.
struct Batch {
    inputs: Tensor,
    beliefs: Tensor,
}

impl BeliefTrainer {
    /// A training from random weights on `scenery`, with its network on `device`.
    pub fn new(recipe: BeliefRecipe, scenery: Scenery, seed: u64, device: Device) -> Self {
        let store = nn::VarStore::new(device);
        drawn_with(seed, || BeliefNetwork::new(&store.root(), BELIEF_INPUT));
        let optimiser = Optimiser::new(recipe.optimiser, &store);

        let count = PARTS.min(recipe.scans);
        let scans = |part: usize| part * recipe.scans / count..(part + 1) * recipe.scans / count;
        let parts = (0..count).map(|part| Part::of(scans(part), device)).collect();

        let mut trainer = Self { recipe, scenery, store, optimiser, parts, updates: 0 };
        trainer.begin_leg(seed);
        trainer
    }
}

impl Part {
    /// A part of the `scans` with these indices, none of which has begun.
    fn of(scans: Range<usize>, device: Device) -> Self {
        let store = nn::VarStore::new(device);
        let network = drawn_with(0, || BeliefNetwork::new(&store.root(), BELIEF_INPUT));
        let memory = network.blank(scans.len(), device);
        let rng = ChaCha8Rng::seed_from_u64(0);
        Self { scans, actors: Vec::new(), variables: Flat::of(&store), network, memory, rng }
    }

    /// Replaces all scans by new ones drawn with `seed`.
    fn begin_leg(&mut self, recipe: &BeliefRecipe, scenery: &Scenery, seed: u64) {
        self.rng = ChaCha8Rng::seed_from_u64(seed);
        self.rng.set_stream(self.scans.start as u64);

        let draw = |scan: usize| {
            let mut actor = Actor::draw(recipe, scenery, &mut self.rng);
            // Scans end one after another, not all at once.
            actor.windows_left = 1 + scan % recipe.windows_a_scan;
            actor
        };
        self.actors = self.scans.clone().map(draw).collect();
        let _ = self.memory.zero_();
    }

    /// Plays a window of each scan. Returns the sum of the loss over all frames, and its gradient.
    fn play(&mut self, window: usize) -> (f64, Tensor) {
        let before = self.memory.shallow_clone();
        let batch = self.collect(window);
        let (logits, _) = self.network.forward(&batch.inputs, &before);
        let loss = -(logits.log_softmax(-1, Kind::Float) * batch.beliefs).sum(Kind::Float);
        (loss.double_value(&[]), self.variables.gradient(&loss))
    }

    /// Plays a window of each scan, steered by the network.
    fn collect(&mut self, window: usize) -> Batch {
        let count = self.actors.len();
        let device = self.memory.device();
        let mut inputs = vec![[0.0f32; BELIEF_INPUT]; count * window];
        let mut beliefs = vec![[0.0f32; BINS]; count * window];
        let mut now = vec![[0.0f32; BELIEF_INPUT]; count];
        let mut believed = vec![[0.0f32; BINS]; count];

        for t in 0..window {
            for (scan, actor) in self.actors.iter_mut().enumerate() {
                now[scan] = actor.see();
                inputs[scan * window + t] = now[scan];
            }

            let tensor = Tensor::from_slice(now.as_flattened()).view([-1, 1, BELIEF_INPUT as i64]).to_device(device);
            let (logits, memory) = tch::no_grad(|| self.network.forward(&tensor, &self.memory));
            self.memory = memory;
            logits.softmax(-1, Kind::Float).view([-1]).copy_data(believed.as_flattened_mut(), count * BINS);

            for (scan, actor) in self.actors.iter_mut().enumerate() {
                let stands = actor.environment.focal_power().get();
                let mut aim = actor.trace.aim(stands, &believed[scan]);
                if actor.environment.wanders {
                    aim = lead_astray(aim, &mut self.rng);
                }
                actor.trace.ask(aim.clamp(0.0, 1.0));
                actor.environment.advance(aim);
                let place = actor.environment.optimum().get();
                spread_over_bins(place, &mut beliefs[scan * window + t]);
            }
        }

        let window = window as i64;
        let tensor = |values: &[f32], width: usize| {
            Tensor::from_slice(values).view([-1, window, width as i64]).to_device(device)
        };
        Batch { inputs: tensor(inputs.as_flattened(), BELIEF_INPUT), beliefs: tensor(beliefs.as_flattened(), BINS) }
    }

    fn replace_finished(&mut self, recipe: &BeliefRecipe, scenery: &Scenery) {
        for (scan, actor) in self.actors.iter_mut().enumerate() {
            actor.windows_left -= 1;
            if actor.windows_left == 0 {
                *actor = Actor::draw(recipe, scenery, &mut self.rng);
                let _ = self.memory.select(1, scan as i64).fill_(0.0);
            }
        }
    }
}

impl Trainer for BeliefTrainer {
    fn store(&self) -> &nn::VarStore {
        &self.store
    }

    fn updates(&self) -> u64 {
        self.updates
    }

    fn begin_leg(&mut self, seed: u64) {
        let (recipe, scenery) = (&self.recipe, &self.scenery);
        self.parts.par_iter_mut().for_each(|part| part.begin_leg(recipe, scenery, seed));
    }

    fn update(&mut self) -> f64 {
        for part in &mut self.parts {
            part.variables.approach(self.optimiser.flat(), 1.0);
        }

        let (recipe, scenery) = (&self.recipe, &self.scenery);
        let play = |part: &mut Part| {
            compute_on_this_thread();
            let played = part.play(recipe.window);
            part.replace_finished(recipe, scenery);
            played
        };
        let found: Vec<(f64, Tensor)> = self.parts.par_iter_mut().map(play).collect();

        let frames = (self.recipe.scans * self.recipe.window) as f64;
        let loss = found.iter().map(|(loss, _)| loss).sum::<f64>() / frames;
        let gradient: Tensor = found.into_iter().map(|(_, gradient)| gradient).sum();

        let warm = (self.updates as f64 / 200.0).min(1.0);
        let rate = half_cosine(self.updates as f64 / self.recipe.updates as f64, self.recipe.final_rate);
        self.optimiser.descend(gradient / frames, self.recipe.clip, warm * rate);

        self.updates += 1;
        loss
    }

    fn save<'a>(&'a self, checkpoint: &mut Checkpoint<'a>) {
        checkpoint.put_store("network", &self.store);
        self.optimiser.save(checkpoint);
        checkpoint.notes.insert("updates".to_owned(), self.updates.to_string());
    }

    fn restore(&mut self, checkpoint: &mut Checkpoint<'_>) -> Result<(), LearningError> {
        checkpoint.fill_store("network", &self.store)?;
        self.optimiser.restore(checkpoint)?;
        self.updates = checkpoint.number("updates")?;
        Ok(())
    }
}

impl Actor {
    fn draw(recipe: &BeliefRecipe, scenery: &Scenery, rng: &mut ChaCha8Rng) -> Self {
        let environment = Environment::draw(scenery, Variety { share: recipe.variety }, recipe.wandering, rng);
        let is_known = rng.random_bool(KNOWN);
        let wider = if rng.random_bool(NARROW) { rng.random_range(0..WIDER.len()) } else { WIDER.len() };

        let measured = |blur: BlurRate| BlurRate::new(blur.get() * (MEASURED * standard_normal(rng)).exp());
        let blur = environment.blur().and_then(measured).filter(|_| is_known);
        Self { environment, trace: Trace::knowing(blur), windows_left: recipe.windows_a_scan, wider }
    }

    /// The network's input at this frame.
    fn see(&mut self) -> [f32; BELIEF_INPUT] {
        let mut view = if self.wider > 0 { self.environment.view() } else { View::from(self.environment.observe()) };
        view.wider[self.wider..].fill(None);
        // A picture that is too small for the widest patch has no surroundings either.
        view.surroundings = view.surroundings.filter(|_| self.wider == WIDER.len());
        self.trace.input(&view, self.environment.focal_power().get())
    }
}
