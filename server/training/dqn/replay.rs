//! Replay memory: the latest frames of every seat, patches as bytes, from which windows of consecutive frames are drawn.

use rand::{Rng, RngExt};

use crate::autofocus::networks::ACTIONS;
use crate::imaging::{PATCH_SIDE, Patch};
use crate::training::run::checkpoint::{Checkpoint, CheckpointError};

/// Bytes of a patch.
const PIXELS: usize = PATCH_SIDE * PATCH_SIDE;

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
    /// Makes room for `more` frames like those held: growing bit by bit would hold all twice at times. What is never filled
    /// costs no memory.
    fn reserve(&mut self, more: usize) {
        self.steps.reserve_exact(more);
        if self.metrics.is_empty() {
            self.patches.reserve_exact(more * PIXELS);
        } else {
            self.metrics.reserve_exact(more);
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
            ring.steps.push(step);
            match seen {
                Seen::Patch(bytes) => ring.patches.extend_from_slice(bytes),
                Seen::Metric(metric) => ring.metrics.push(*metric),
            }
            if ring.steps.len() == 1 {
                ring.reserve(capacity - 1);
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

    /// Adds all frames to a checkpoint: patches as they lie in memory, since a copy of them would take as much again.
    pub fn save<'a>(&'a self, checkpoint: &mut Checkpoint<'a>) {
        for (index, ring) in self.seats.iter().enumerate() {
            let name = |part: &str| format!("replay.{index}.{part}");
            let steps = || ring.steps.iter();
            checkpoint.put_floats(&name("focal_power"), steps().map(|step| step.focal_power));
            checkpoint.put_floats(&name("next_optimum"), steps().map(|step| step.next_optimum));
            checkpoint.put_bytes(&name("action"), steps().map(|step| step.action).collect::<Vec<u8>>());
            checkpoint.put_bytes(&name("age"), steps().flat_map(|step| step.age.to_le_bytes()).collect::<Vec<u8>>());
            checkpoint.put_bytes(&name("patches"), &ring.patches);
            checkpoint.put_floats(&name("metrics"), ring.metrics.iter().copied());
            checkpoint.notes.insert(name("head"), ring.head.to_string());
        }
    }

    /// Takes back what [`Replay::save`] added, patches out of the checkpoint.
    ///
    /// # Errors
    /// When the checkpoint is damaged or of another training.
    pub fn restore(&mut self, checkpoint: &mut Checkpoint<'_>) -> Result<(), CheckpointError> {
        let capacity = self.capacity;
        for (index, ring) in self.seats.iter_mut().enumerate() {
            let name = |part: &str| format!("replay.{index}.{part}");
            let focal_powers = checkpoint.floats(&name("focal_power"))?;
            let optima = checkpoint.floats(&name("next_optimum"))?;
            let patches = checkpoint.take_bytes(&name("patches"))?;
            let metrics = checkpoint.floats(&name("metrics"))?;
            // Of a seat that had not wrapped, and in checkpoints older than the note: the oldest is the first.
            let head =
                if checkpoint.notes.contains_key(&name("head")) { checkpoint.number(&name("head"))? } else { 0 };
            let (actions, ages) = (checkpoint.bytes(&name("action"))?, checkpoint.bytes(&name("age"))?);
            let ages = ages.as_chunks::<2>().0;
            let count = focal_powers.len();
            let seen =
                [patches.len(), metrics.len()] == [count * PIXELS, 0] || [patches.len(), metrics.len()] == [0, count];
            let known = [optima.len(), actions.len(), ages.len()] == [count; 3];
            let fits = count <= capacity && (head == 0 || count == capacity && head < count);
            if !(seen && known && fits && actions.iter().all(|&action| usize::from(action) < ACTIONS)) {
                return Err(checkpoint.damaged(format!("frames of seat {index} are missing")));
            }
            let steps = focal_powers.into_iter().zip(optima).zip(actions.iter().zip(ages)).map(
                |((focal_power, next_optimum), (&action, &age))| Step {
                    focal_power,
                    next_optimum,
                    action,
                    age: u16::from_le_bytes(age),
                },
            );
            *ring = Ring { steps: steps.collect(), patches, metrics, head };
            if count > 0 {
                ring.reserve(capacity - count);
            }
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
    /// Eleven frames a seat, so that rings of ten have wrapped; and what a replay memory restored from it holds.
    fn saved(seen: impl Fn(u16) -> Seen) -> (Replay, tempfile::TempDir) {
        let mut replay = Replay::new(20, 2);
        for time in 0..13u16 {
            replay.push(0, &seen(time), Step { age: time, ..Step::default() });
        }
        replay.push(1, &seen(40), Step { age: 40, ..Step::default() });
        let folder = tempfile::tempdir().unwrap();
        let mut checkpoint = Checkpoint::default();
        replay.save(&mut checkpoint);
        // What a checkpoint borrows it does not copy.
        assert_eq!(checkpoint.bytes("replay.0.patches").unwrap().as_ptr(), replay.seats[0].patches.as_ptr());
        checkpoint.write(&folder.path().join("a")).unwrap();
        (replay, folder)
    }

    #[test]
    fn a_memory_comes_back_as_it_was_with_room_for_the_rest() {
        for patches in [true, false] {
            let seen = |time: u16| {
                if patches { Seen::Patch(vec![time as u8; PIXELS].into()) } else { Seen::Metric(f32::from(time)) }
            };
            let (mut replay, folder) = saved(seen);
            let mut back = Replay::new(20, 2);
            back.restore(&mut Checkpoint::read(&folder.path().join("a")).unwrap()).unwrap();
            for time in 50..53 {
                for memory in [&mut replay, &mut back] {
                    memory.push(1, &seen(time), Step { age: time, ..Step::default() });
                    memory.push(0, &seen(time), Step { age: time, ..Step::default() });
                }
            }
            for (one, other) in replay.seats.iter().zip(&back.seats) {
                assert_eq!((&one.steps, one.head), (&other.steps, other.head));
                assert!(one.patches == other.patches && one.metrics == other.metrics);
            }
            assert!(!patches || back.seats[1].patches.capacity() == 10 * PIXELS);
        }
    }

    #[test]
    fn a_damaged_memory_is_told() {
        let (_replay, folder) = saved(|_| Seen::Patch(vec![1; PIXELS].into()));
        let path = folder.path().join("a");
        let damage: [fn(&mut Checkpoint<'_>); 4] = [
            |checkpoint| checkpoint.put_bytes("replay.0.patches", vec![0; 77]),
            |checkpoint| checkpoint.put_bytes("replay.1.action", vec![9]),
            |checkpoint| checkpoint.put_floats("replay.1.next_optimum", []),
            |checkpoint| drop(checkpoint.notes.insert("replay.0.head".to_owned(), "10".to_owned())),
        ];
        for damage in damage {
            let mut checkpoint = Checkpoint::read(&path).unwrap();
            damage(&mut checkpoint);
            let error = Replay::new(20, 2).restore(&mut checkpoint).unwrap_err().to_string();
            assert!(error.contains("is damaged: frames of seat"), "{error}");
        }
    }
}
