//! Deep Q-learning on simulated focal-time scans (Mnih et al. 2015; double: van Hasselt et al. 2016). It learns from
//! windows of consecutive frames, so that each patch is encoded only once for all states that contain it.

mod batch;
#[cfg(test)]
mod drawn;
mod encoder;
mod head;
pub mod replay;
mod values;

use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use rayon::prelude::*;
use tch::{Device, Tensor, nn};

use super::environment::{Environment, lead_astray};
use super::optimiser::{Flat, Optimiser, half_cosine};
use super::recipe::dqn::{DqnRecipe, Target};
use super::run::checkpoint::Checkpoint;
use super::trainer::{Trainer, drawn_with};
use crate::LearningError;
use crate::scans::scenery::Scenery;
use crate::scans::variety::Variety;
use batch::{Batch, Targets, bellman, lookahead, smooth_l1};
use parfocal_autofocus::learned::{History, Input, action_step, best_action, scaled_focal_power};
use parfocal_autofocus::networks::ACTIONS;
use parfocal_autofocus::weights::{self, WeightsError, floats};
use replay::{CompactView, Frames, Replay, Transition};
use values::Values;

/// A training in progress.
pub struct DqnTrainer {
    recipe: DqnRecipe,
    scenery: Scenery,
    online: Values,
    target: Values,
    target_variables: Flat,
    optimiser: Optimiser,
    actors: Vec<Actor>,
    replay: Replay,
    rng: ChaCha8Rng,
    updates: u64,
    frames: u64,
}

struct Actor {
    environment: Environment,
    /// Frames since the scan's start.
    age: u16,
    frames_left: u16,
    /// The encodings and scaled focal powers.
    history: History,
}

impl DqnTrainer {
    /// A training from random weights on `scenery`, with its networks on `device`.
    pub fn new(input: Input, recipe: DqnRecipe, scenery: Scenery, seed: u64, device: Device) -> Self {
        let rng = ChaCha8Rng::seed_from_u64(seed);
        let (online, mut target) = drawn_with(seed, || (Values::new(input, device), Values::new(input, device)));
        target.store.freeze();

        let optimiser = Optimiser::new(recipe.optimiser, &online.store);
        let mut target_variables = Flat::of(&target.store);
        target_variables.approach(optimiser.flat(), 1.0);

        let replay = Replay::new(recipe.replay, recipe.scans);
        let mut trainer = Self {
            recipe,
            scenery,
            online,
            target,
            target_variables,
            optimiser,
            actors: Vec::new(),
            replay,
            rng,
            updates: 0,
            frames: 0,
        };

        trainer.begin_leg(seed);
        trainer
    }

    fn device(&self) -> Device {
        self.online.store.device()
    }

    /// Lets every actor see a frame, act, and advance to the next frame.
    fn play_a_frame(&mut self) {
        let input = self.online.network.input;
        let seen: Vec<CompactView> = self
            .actors
            .par_iter_mut()
            .map(|actor| {
                let patch = actor.environment.observe();
                input
                    .metric(&patch)
                    .map_or_else(|| CompactView::patch(&patch), |metric| CompactView::Metric(input.scaled(metric)))
            })
            .collect();

        let mut frames = Frames::default();
        for seen in &seen {
            frames.push(seen);
        }

        let encodings = self.online.encode(&frames);
        let count = self.actors.len() as i64;
        for (actor, encoding) in self.actors.iter_mut().zip(floats(&encodings).chunks_exact(input.width())) {
            actor.history.push(encoding, scaled_focal_power(actor.environment.focal_power().get()));
        }

        let device = self.device();
        let gather = |part: fn(&History) -> &Vec<f32>| {
            let all: Vec<f32> = self.actors.iter().flat_map(|actor| part(&actor.history)).copied().collect();
            Tensor::from_slice(&all).view([count, -1]).to_device(device)
        };

        let values =
            self.online.network.values(&gather(|history| &history.frames), &gather(|history| &history.focal_powers));

        let epsilon = self.recipe.epsilon(self.frames);
        for (index, values) in floats(&values).chunks_exact(ACTIONS).enumerate() {
            let explore = self.rng.random_bool(epsilon);
            let action = if explore { self.rng.random_range(0..ACTIONS) } else { best_action(values) };
            self.finish_frame(index, &seen[index], action);
        }

        self.frames += self.actors.len() as u64;
    }

    fn finish_frame(&mut self, index: usize, seen: &CompactView, action: usize) {
        let actor = &mut self.actors[index];
        let stood = actor.environment.focal_power();
        let mut target = stood.moved(action_step(action)).get();
        if actor.environment.wanders {
            target = lead_astray(target, &mut self.rng);
        }

        actor.environment.advance(target);
        let next_optimum = actor.environment.optimum().get() as f32;
        let focal_power = stood.get() as f32;
        let age = actor.age;
        self.replay.push(index, seen, Transition { focal_power, next_optimum, action: action as u8, age });

        actor.age += 1;
        actor.frames_left -= 1;
        if actor.frames_left == 0 {
            *actor = Actor::draw(&self.recipe, &self.scenery, &mut self.rng);
        }
    }

    fn batch(&mut self) -> Batch {
        let length = self.recipe.window;
        let mut frames = Frames::default();
        let mut transitions = Vec::new();
        let mut left = self.recipe.windows;
        while left > 0 {
            if let Some(window) = self.replay.draw(length, &mut self.rng) {
                self.replay.read(window, length, &mut frames, &mut transitions);
                left -= 1;
            }
        }

        Batch::new(frames, transitions, length, self.device())
    }

    /// The targets for the batch's states. `values` (`[S, 3]`, row by row) are the online network's.
    fn targets(&self, batch: &Batch, values: &[f32]) -> Targets {
        match self.recipe.target {
            Target::Lookahead(bonus) => lookahead(batch, bonus),
            Target::Bellman(returns) => {
                let encodings = tch::no_grad(|| self.target.encode(&batch.frames));
                let later = floats(&self.target.pass(batch, &encodings).values);
                let later = later.as_chunks::<ACTIONS>().0;
                let pickers = values.as_chunks::<ACTIONS>().0;

                let next = |(row, values): (usize, &[f32; ACTIONS])| {
                    values[best_action(if returns.double { &pickers[row] } else { values })]
                };
                let next: Vec<f32> = later.iter().enumerate().map(next).collect();
                bellman(batch, &next, returns, self.recipe.window)
            }
        }
    }
}

impl Trainer for DqnTrainer {
    fn store(&self) -> &nn::VarStore {
        &self.online.store
    }

    fn updates(&self) -> u64 {
        self.updates
    }

    fn begin_leg(&mut self, seed: u64) {
        self.rng = ChaCha8Rng::seed_from_u64(seed);

        let mut draw = |_| {
            let mut actor = Actor::draw(&self.recipe, &self.scenery, &mut self.rng);
            // Scans end one after another, not all at once.
            actor.frames_left = self.rng.random_range(1..=self.recipe.frames_a_scan);
            actor
        };
        self.actors = (0..self.recipe.scans).map(&mut draw).collect();
    }

    fn update(&mut self) -> f64 {
        // The first update waits until the warm-up has filled the replay memory.
        let goal = self.frames.max(self.recipe.warm_up) + self.recipe.frames_an_update as u64;
        while self.frames < goal {
            tch::no_grad(|| self.play_a_frame());
        }

        let batch = self.batch();
        let encodings = self.online.encode(&batch.frames);
        let pass = self.online.pass(&batch, &encodings);
        let values = floats(&pass.values);

        let (loss, grad_output) = smooth_l1(&values, &self.targets(&batch, &values));
        let grad_output = Tensor::from_slice(&grad_output).view_as(&pass.values).to_device(self.device());
        let gradient = self.online.gradient(self.optimiser.flat(), &batch, &encodings, pass, &grad_output);

        let rate = half_cosine(self.updates as f64 / self.recipe.updates as f64, self.recipe.final_rate);
        self.optimiser.descend(gradient, self.recipe.clip, rate);
        if matches!(self.recipe.target, Target::Bellman(_)) {
            self.target_variables.approach(self.optimiser.flat(), self.recipe.target_share);
        }

        self.updates += 1;
        loss
    }

    fn epsilon(&self) -> Option<f64> {
        Some(self.recipe.epsilon(self.frames))
    }

    fn begin_from(&mut self, bytes: &[u8]) -> Result<(), WeightsError> {
        weights::load(&self.online.store, bytes)?;
        self.target_variables.approach(self.optimiser.flat(), 1.0);
        Ok(())
    }

    fn save<'a>(&'a self, checkpoint: &mut Checkpoint<'a>) {
        checkpoint.put_store("network", &self.online.store);
        checkpoint.put_store("target", &self.target.store);
        self.optimiser.save(checkpoint);
        self.replay.save(checkpoint);
        checkpoint.notes.insert("updates".to_owned(), self.updates.to_string());
        checkpoint.notes.insert("frames".to_owned(), self.frames.to_string());
    }

    fn restore(&mut self, checkpoint: &mut Checkpoint<'_>) -> Result<(), LearningError> {
        checkpoint.fill_store("network", &self.online.store)?;
        checkpoint.fill_store("target", &self.target.store)?;
        self.optimiser.restore(checkpoint)?;
        self.replay.restore(checkpoint)?;
        self.updates = checkpoint.number("updates")?;
        self.frames = checkpoint.number("frames")?;
        Ok(())
    }
}

impl Actor {
    fn draw(recipe: &DqnRecipe, scenery: &Scenery, rng: &mut ChaCha8Rng) -> Self {
        let environment = Environment::draw(scenery, Variety { share: recipe.variety }, recipe.wandering, rng);
        Self { environment, age: 0, frames_left: recipe.frames_a_scan.max(1), history: History::default() }
    }
}
