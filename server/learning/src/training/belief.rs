//! Trains the belief tracker. In simulation the optimum is known at every frame, so the posterior is learned directly,
//! by cross-entropy, on scans that the tracker itself steers.

use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use rayon::prelude::*;
use tch::{Device, Kind, Tensor, nn};

use super::environment::{Environment, lead_astray};
use super::optimiser::{Optimiser, half_cosine};
use super::recipe::belief::BeliefRecipe;
use super::run::checkpoint::{Checkpoint, CheckpointError};
use super::trainer::{Trainer, drawn_with};
use crate::scans::scenery::Scenery;
use crate::scans::variety::Variety;
use parfocal_autofocus::belief::{Trace, spread_over_bins};
use parfocal_autofocus::networks::{BELIEF_INPUT, BINS, BeliefNetwork};
use parfocal_base::BlurRate;
use parfocal_devices::simulation::normal::standard_normal;
use parfocal_imaging::{View, WIDER};

/// A training in progress.
pub struct BeliefTrainer {
    recipe: BeliefRecipe,
    scenery: Scenery,
    store: nn::VarStore,
    network: BeliefNetwork,
    optimiser: Optimiser,
    actors: Vec<Actor>,
    memory: Tensor,
    rng: ChaCha8Rng,
    updates: u64,
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

/// Frames and the beliefs to learn: inputs `[N, T, BELIEF_INPUT]`, beliefs `[N, T, BINS]`.
struct Batch {
    inputs: Tensor,
    beliefs: Tensor,
}

impl BeliefTrainer {
    /// A training from random weights on `scenery`, with its network on `device`.
    pub fn new(recipe: BeliefRecipe, scenery: Scenery, seed: u64, device: Device) -> Self {
        let rng = ChaCha8Rng::seed_from_u64(seed);

        let store = nn::VarStore::new(device);
        let network = drawn_with(seed, || BeliefNetwork::new(&store.root(), BELIEF_INPUT));
        let optimiser = Optimiser::new(recipe.optimiser, &store);

        let actors = Vec::new();
        let memory = network.blank(recipe.scans, device);
        let mut trainer = Self { recipe, scenery, store, network, optimiser, actors, memory, rng, updates: 0 };
        trainer.begin_leg(seed);
        trainer
    }

    fn collect(&mut self) -> Batch {
        let count = self.actors.len();
        let window = self.recipe.window;
        let device = self.store.device();
        let mut inputs = vec![0.0f32; count * window * BELIEF_INPUT];
        let mut beliefs = vec![0.0f32; count * window * BINS];
        let mut now = vec![0.0f32; count * BELIEF_INPUT];
        let mut believed = vec![0.0f32; count * BINS];

        for t in 0..window {
            // Each scan has its own random generators, so the result does not depend on the number of cores.
            self.actors
                .par_iter_mut()
                .zip(now.par_chunks_exact_mut(BELIEF_INPUT))
                .zip(inputs.par_chunks_exact_mut(window * BELIEF_INPUT))
                .for_each(|((actor, now), inputs)| {
                    now.copy_from_slice(&actor.see());
                    inputs[t * BELIEF_INPUT..][..BELIEF_INPUT].copy_from_slice(now);
                });

            let tensor = Tensor::from_slice(&now).view([count as i64, 1, BELIEF_INPUT as i64]).to_device(device);
            let (logits, memory) = tch::no_grad(|| self.network.forward(&tensor, &self.memory));
            self.memory = memory;
            logits.view([-1, BINS as i64]).softmax(-1, Kind::Float).copy_data(&mut believed, count * BINS);

            for (index, actor) in self.actors.iter_mut().enumerate() {
                let stands = actor.environment.focal_power().get();
                let belief = &believed[index * BINS..][..BINS];
                let mut aim = actor.trace.aim(stands, belief);
                if actor.environment.wanders {
                    aim = lead_astray(aim, &mut self.rng);
                }
                actor.trace.ask(aim.clamp(0.0, 1.0));
                actor.environment.advance(aim);
                let place = actor.environment.optimum().get();
                spread_over_bins(place, &mut beliefs[(index * window + t) * BINS..][..BINS]);
            }
        }

        let count = count as i64;
        let window = window as i64;
        Batch {
            inputs: Tensor::from_slice(&inputs).view([count, window, BELIEF_INPUT as i64]).to_device(device),
            beliefs: Tensor::from_slice(&beliefs).view([count, window, BINS as i64]).to_device(device),
        }
    }

    fn replace_finished(&mut self) {
        for (index, actor) in self.actors.iter_mut().enumerate() {
            actor.windows_left -= 1;
            if actor.windows_left == 0 {
                *actor = Actor::draw(&self.recipe, &self.scenery, &mut self.rng);
                let _ = self.memory.select(1, index as i64).fill_(0.0);
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
        self.rng = ChaCha8Rng::seed_from_u64(seed);

        let mut draw = |index| {
            let mut actor = Actor::draw(&self.recipe, &self.scenery, &mut self.rng);
            // Scans end one after another, not all at once.
            actor.windows_left = 1 + index % self.recipe.windows_a_scan;
            actor
        };

        self.actors = (0..self.recipe.scans).map(&mut draw).collect();
        self.memory = self.network.blank(self.recipe.scans, self.store.device());
    }

    fn update(&mut self) -> f64 {
        let before = self.memory.shallow_clone();
        let batch = self.collect();

        let (logits, _) = self.network.forward(&batch.inputs, &before);
        let loss = -(logits.log_softmax(-1, Kind::Float) * batch.beliefs).sum_dim_intlist(-1, false, Kind::Float);
        let loss = loss.mean(Kind::Float);

        let warm = (self.updates as f64 / 200.0).min(1.0);
        let rate = half_cosine(self.updates as f64 / self.recipe.updates as f64, self.recipe.final_rate);
        self.optimiser.minimise(&loss, self.recipe.clip, warm * rate);

        self.updates += 1;
        self.replace_finished();
        loss.double_value(&[])
    }

    fn save<'a>(&'a self, checkpoint: &mut Checkpoint<'a>) {
        checkpoint.put_store("network", &self.store);
        self.optimiser.save(checkpoint);
        checkpoint.notes.insert("updates".to_owned(), self.updates.to_string());
    }

    fn restore(&mut self, checkpoint: &mut Checkpoint<'_>) -> Result<(), CheckpointError> {
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
