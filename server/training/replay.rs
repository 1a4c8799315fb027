//! Replay memory: the latest frames of every seat, patches as bytes, from which windows of consecutive frames are drawn.
#![allow(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "gray levels are whole numbers, 0..=255")]

use rand::{Rng, RngExt};

use super::checkpoint::{Checkpoint, CheckpointError};
use crate::imaging::Patch;

/// What one frame leaves behind, besides what was seen.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Step {
    /// Focal power the frame was seen at.
    pub focal_power: f32,
    /// Optimum at the next frame.
    pub next_optimum: f32,
    /// The action taken.
    pub action: u8,
    /// Frames since the scan's start.
    pub age: u16,
}

/// What was seen of a frame, in its compact form.
#[derive(Debug, Clone, PartialEq)]
pub enum Seen {
    /// A patch, as bytes.
    Patch(Box<[u8]>),
    /// A scaled metric.
    Metric(f32),
}

impl Seen {
    /// A patch in its compact form.
    #[must_use]
    pub fn patch(patch: &Patch) -> Self {
        Self::Patch(patch.0.iter().map(|&gray| gray as u8).collect())
    }
}

/// What was seen of many frames, in its compact form: patches, 1024 bytes each, or scaled metrics.
#[derive(Debug, Default)]
pub struct Frames {
    /// All frames' patches.
    pub patches: Vec<u8>,
    /// All frames' scaled metrics.
    pub metrics: Vec<f32>,
}

impl Frames {
    /// Adds a frame.
    pub fn push(&mut self, seen: &Seen) {
        match seen {
            Seen::Patch(patch) => self.patches.extend_from_slice(patch),
            Seen::Metric(metric) => self.metrics.push(*metric),
        }
    }
}

/// Frames of many scans, each seat's in a ring of its own.
#[derive(Debug)]
pub struct Replay {
    seats: Vec<Ring>,
    capacity: usize,
}

#[derive(Debug, Default)]
struct Ring {
    steps: Vec<Step>,
    patches: Vec<u8>,
    metrics: Vec<f32>,
    /// Where the next frame goes once the ring is full; the oldest frame.
    head: usize,
}

/// Consecutive frames of one seat: positions in its ring, oldest first.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Window {
    seat: usize,
    start: usize,
}

impl Ring {
    /// Makes room for `capacity` frames like `seen`: growing bit by bit would hold all twice at times. What is never
    /// filled costs no memory.
    fn reserve(&mut self, capacity: usize, seen: &Seen) {
        self.steps.reserve_exact(capacity);
        match seen {
            Seen::Patch(bytes) => self.patches.reserve_exact(capacity * bytes.len()),
            Seen::Metric(_) => self.metrics.reserve_exact(capacity),
        }
    }
}

impl Replay {
    /// A memory of at most `frames` frames for `seats` seats.
    #[must_use]
    pub fn new(frames: usize, seats: usize) -> Self {
        Self { seats: (0..seats).map(|_| Ring::default()).collect(), capacity: (frames / seats.max(1)).max(1) }
    }

    /// Frames held.
    #[must_use]
    pub fn len(&self) -> usize {
        self.seats.iter().map(|ring| ring.steps.len()).sum()
    }

    /// Whether nothing is held.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// Adds a frame of `seat`, in place of its oldest when full.
    pub fn push(&mut self, seat: usize, seen: &Seen, step: Step) {
        let capacity = self.capacity;
        let ring = &mut self.seats[seat];
        if ring.steps.len() < capacity {
            if ring.steps.is_empty() {
                ring.reserve(capacity, seen);
            }
            ring.steps.push(step);
            match seen {
                Seen::Patch(bytes) => ring.patches.extend_from_slice(bytes),
                Seen::Metric(metric) => ring.metrics.push(*metric),
            }
            return;
        }
        let at = ring.head;
        ring.steps[at] = step;
        match seen {
            Seen::Patch(bytes) => ring.patches[at * bytes.len()..(at + 1) * bytes.len()].copy_from_slice(bytes),
            Seen::Metric(metric) => ring.metrics[at] = *metric,
        }
        ring.head = (at + 1) % capacity;
    }

    /// Adds all frames to a checkpoint, each seat's oldest first.
    pub fn save(&self, checkpoint: &mut Checkpoint) {
        for (index, ring) in self.seats.iter().enumerate() {
            let (newer, older) = ring.steps.split_at(ring.head);
            let steps = || older.iter().chain(newer);
            let name = |part: &str| format!("replay.{index}.{part}");
            checkpoint.put_floats(&name("focal_power"), steps().map(|step| step.focal_power));
            checkpoint.put_floats(&name("next_optimum"), steps().map(|step| step.next_optimum));
            checkpoint.put_bytes(&name("action"), steps().map(|step| step.action).collect());
            checkpoint.put_bytes(&name("age"), steps().flat_map(|step| step.age.to_le_bytes()).collect());
            let patch = ring.patches.len() / ring.steps.len().max(1);
            let mut patches = ring.patches.clone();
            patches.rotate_left(ring.head * patch);
            checkpoint.put_bytes(&name("patches"), patches);
            let mut metrics = ring.metrics.clone();
            let turned = if metrics.is_empty() { 0 } else { ring.head };
            metrics.rotate_left(turned);
            checkpoint.put_floats(&name("metrics"), metrics);
        }
    }

    /// Takes back what [`Replay::save`] added.
    ///
    /// # Errors
    /// When the checkpoint is of another training.
    pub fn restore(&mut self, checkpoint: &Checkpoint) -> Result<(), CheckpointError> {
        for (index, ring) in self.seats.iter_mut().enumerate() {
            let name = |part: &str| format!("replay.{index}.{part}");
            let focal_powers = checkpoint.floats(&name("focal_power"))?;
            let optima = checkpoint.floats(&name("next_optimum"))?;
            let (actions, ages) = (checkpoint.bytes(&name("action"))?, checkpoint.bytes(&name("age"))?);
            let ages = ages.as_chunks::<2>().0;
            ring.steps = focal_powers
                .into_iter()
                .zip(optima)
                .zip(actions.iter().zip(ages))
                .map(|((focal_power, next_optimum), (&action, &age))| Step {
                    focal_power,
                    next_optimum,
                    action,
                    age: u16::from_le_bytes(age),
                })
                .collect();
            ring.patches = checkpoint.bytes(&name("patches"))?.to_vec();
            ring.metrics = checkpoint.floats(&name("metrics"))?;
            ring.head = 0;
        }
        Ok(())
    }

    /// A window of `length` frames, uniformly drawn; `None` before a drawn seat holds as many.
    pub fn draw(&self, length: usize, rng: &mut impl Rng) -> Option<Window> {
        let seat = rng.random_range(0..self.seats.len());
        let held = self.seats[seat].steps.len();
        (held >= length).then(|| Window { seat, start: rng.random_range(0..=held - length) })
    }

    /// Appends what was seen in `window`, and its steps, to the given lists.
    pub fn read(&self, window: Window, length: usize, frames: &mut Frames, steps: &mut Vec<Step>) {
        let ring = &self.seats[window.seat];
        let patch = ring.patches.len() / ring.steps.len().max(1);
        for offset in 0..length {
            let at = (ring.head + window.start + offset) % ring.steps.len();
            steps.push(ring.steps[at]);
            frames.patches.extend_from_slice(&ring.patches[at * patch..(at + 1) * patch]);
            frames.metrics.extend(ring.metrics.get(at));
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use rand::SeedableRng;
    use rand_chacha::ChaCha8Rng;

    #[test]
    fn a_window_is_consecutive_after_the_ring_has_wrapped() {
        let mut replay = Replay::new(20, 2);
        for time in 0..37u16 {
            replay.push(0, &Seen::Metric(f32::from(time)), Step { age: time, ..Step::default() });
        }
        assert_eq!(replay.len(), 10);
        let mut rng = ChaCha8Rng::seed_from_u64(4);
        let mut oldest = u16::MAX;
        for _ in 0..200 {
            let Some(window) = replay.draw(4, &mut rng) else { continue };
            let (mut frames, mut steps) = (Frames::default(), Vec::new());
            replay.read(window, 4, &mut frames, &mut steps);
            assert!(steps.windows(2).all(|pair| pair[1].age == pair[0].age + 1));
            let mut pairs = steps.iter().zip(&frames.metrics);
            assert!(pairs.all(|(step, metric)| (f32::from(step.age) - *metric).abs() < f32::EPSILON));
            oldest = oldest.min(steps[0].age);
        }
        assert_eq!(oldest, 27);
    }
}
