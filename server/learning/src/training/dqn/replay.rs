//! Replay memory: the latest frames of every actor, with patches as bytes. Windows of consecutive frames are drawn from
//! it.

use rand::{Rng, RngExt};

use crate::LearningError;
use crate::training::run::checkpoint::Checkpoint;
use parfocal_autofocus::networks::ACTIONS;
use parfocal_imaging::{PATCH_SIDE, Patch};

/// Bytes of a patch.
const PIXELS: usize = PATCH_SIDE * PATCH_SIDE;

/// What is remembered of a frame, besides what was seen.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Transition {
    /// Focal power the frame was seen at.
    pub focal_power: f32,
    /// Optimum at the next frame.
    pub next_optimum: f32,
    /// Index of the action taken, below `ACTIONS`.
    pub action: u8,
    /// Frames since the scan's start.
    pub age: u16,
}

/// What was seen of a frame, in compact form.
#[derive(Debug, Clone, PartialEq)]
pub enum CompactView {
    /// A patch: 1024 gray levels, row by row.
    Patch(Box<[u8]>),
    /// A scaled focus metric.
    Metric(f32),
}

impl CompactView {
    /// A patch in compact form.
    pub fn patch(patch: &Patch) -> Self {
        Self::Patch(patch.0.iter().map(|&gray| gray as u8).collect())
    }
}

/// What was seen of many frames, in compact form: patches of 1024 bytes each, or scaled metrics. One list is empty.
#[derive(Debug, Default, PartialEq)]
pub struct Frames {
    /// All frames' patches.
    pub patches: Vec<u8>,
    /// All frames' scaled metrics.
    pub metrics: Vec<f32>,
}

impl Frames {
    /// Adds a frame.
    pub fn push(&mut self, seen: &CompactView) {
        match seen {
            CompactView::Patch(patch) => self.patches.extend_from_slice(patch),
            CompactView::Metric(metric) => self.metrics.push(*metric),
        }
    }
}

/// Frames of many scans, in one ring for each actor.
#[derive(Debug)]
pub struct Replay {
    actors: Vec<Ring>,
    capacity: usize,
}

#[derive(Debug, Default)]
struct Ring {
    transitions: Vec<Transition>,
    frames: Frames,
    /// Index of the oldest frame. Once the ring is full, the next frame replaces it.
    head: usize,
}

/// Consecutive frames of one actor: positions in its ring, oldest first.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Window {
    actor: usize,
    start: usize,
}

impl Ring {
    /// Reserves room for `more` frames. Growing step by step would at times hold all frames twice. Room that is never
    /// filled costs no memory.
    fn reserve(&mut self, more: usize) {
        self.transitions.reserve_exact(more);
        if self.frames.metrics.is_empty() {
            self.frames.patches.reserve_exact(more * PIXELS);
        } else {
            self.frames.metrics.reserve_exact(more);
        }
    }
}

impl Replay {
    /// A memory of at most `frames` frames in all, for `actors` actors.
    pub fn new(frames: usize, actors: usize) -> Self {
        Self { actors: (0..actors).map(|_| Ring::default()).collect(), capacity: (frames / actors.max(1)).max(1) }
    }

    /// Frames held.
    pub fn len(&self) -> usize {
        self.actors.iter().map(|ring| ring.transitions.len()).sum()
    }

    /// Whether nothing is held.
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// Adds a frame of `actor`. Replaces its oldest frame if its ring is full.
    pub fn push(&mut self, actor: usize, seen: &CompactView, transition: Transition) {
        let capacity = self.capacity;
        let ring = &mut self.actors[actor];
        if ring.transitions.len() < capacity {
            ring.transitions.push(transition);
            ring.frames.push(seen);
            if ring.transitions.len() == 1 {
                ring.reserve(capacity - 1);
            }
            return;
        }

        // The ring is full: the new frame replaces the oldest.
        let at = ring.head;
        ring.transitions[at] = transition;
        match seen {
            CompactView::Patch(bytes) => ring.frames.patches[at * PIXELS..][..PIXELS].copy_from_slice(bytes),
            CompactView::Metric(metric) => ring.frames.metrics[at] = *metric,
        }
        ring.head = (at + 1) % capacity;
    }

    /// Adds all frames to a checkpoint. Patches are borrowed, since a copy would double the memory.
    pub fn save<'a>(&'a self, checkpoint: &mut Checkpoint<'a>) {
        for (index, ring) in self.actors.iter().enumerate() {
            let name = |part: &str| format!("replay.{index}.{part}");
            let transitions = || ring.transitions.iter();

            checkpoint.put_floats(&name("focal_power"), transitions().map(|transition| transition.focal_power));
            checkpoint.put_floats(&name("next_optimum"), transitions().map(|transition| transition.next_optimum));
            checkpoint
                .put_bytes(&name("action"), transitions().map(|transition| transition.action).collect::<Vec<u8>>());
            checkpoint.put_bytes(
                &name("age"),
                transitions().flat_map(|transition| transition.age.to_le_bytes()).collect::<Vec<u8>>(),
            );
            checkpoint.put_bytes(&name("patches"), &ring.frames.patches);
            checkpoint.put_floats(&name("metrics"), ring.frames.metrics.iter().copied());
            checkpoint.notes.insert(name("head"), ring.head.to_string());
        }
    }

    /// Restores what [`Replay::save`] added. Moves the patches out of the checkpoint.
    ///
    /// # Errors
    /// If the checkpoint is damaged or belongs to another training.
    pub fn restore(&mut self, checkpoint: &mut Checkpoint<'_>) -> Result<(), LearningError> {
        let capacity = self.capacity;
        for (index, ring) in self.actors.iter_mut().enumerate() {
            let name = |part: &str| format!("replay.{index}.{part}");
            let focal_powers = checkpoint.floats(&name("focal_power"))?;
            let optima = checkpoint.floats(&name("next_optimum"))?;
            let patches = checkpoint.take_bytes(&name("patches"))?;
            let metrics = checkpoint.floats(&name("metrics"))?;

            // Older checkpoints lack this note: their oldest frame is the first.
            let head =
                if checkpoint.notes.contains_key(&name("head")) { checkpoint.number(&name("head"))? } else { 0 };
            let actions = checkpoint.bytes(&name("action"))?;
            let ages = checkpoint.bytes(&name("age"))?;
            let ages = ages.as_chunks::<2>().0;

            let count = focal_powers.len();
            let seen =
                [patches.len(), metrics.len()] == [count * PIXELS, 0] || [patches.len(), metrics.len()] == [0, count];
            let known = [optima.len(), actions.len(), ages.len()] == [count; 3];
            let fits = count <= capacity && (head == 0 || count == capacity && head < count);
            if !(seen && known && fits && actions.iter().all(|&action| usize::from(action) < ACTIONS)) {
                return Err(checkpoint.damaged(format!("frames of actor {index} are missing")));
            }

            let transitions = focal_powers.into_iter().zip(optima).zip(actions.iter().zip(ages)).map(
                |((focal_power, next_optimum), (&action, &age))| Transition {
                    focal_power,
                    next_optimum,
                    action,
                    age: u16::from_le_bytes(age),
                },
            );

            *ring = Ring { transitions: transitions.collect(), frames: Frames { patches, metrics }, head };
            if count > 0 {
                ring.reserve(capacity - count);
            }
        }
        Ok(())
    }

    /// Draws a window of `length` frames uniformly; `None` if the drawn actor holds fewer frames.
    pub fn draw(&self, length: usize, rng: &mut impl Rng) -> Option<Window> {
        let actor = rng.random_range(0..self.actors.len());
        let held = self.actors[actor].transitions.len();
        (held >= length).then(|| Window { actor, start: rng.random_range(0..=held - length) })
    }

    /// Appends the frames and transitions of `window` to the given lists.
    pub fn read(&self, window: Window, length: usize, frames: &mut Frames, transitions: &mut Vec<Transition>) {
        let ring = &self.actors[window.actor];
        let patch = ring.frames.patches.len() / ring.transitions.len().max(1);
        for offset in 0..length {
            let at = (ring.head + window.start + offset) % ring.transitions.len();
            transitions.push(ring.transitions[at]);
            frames.patches.extend_from_slice(&ring.frames.patches[at * patch..][..patch]);
            frames.metrics.extend(ring.frames.metrics.get(at));
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
            replay.push(0, &CompactView::Metric(f32::from(time)), Transition { age: time, ..Transition::default() });
        }
        assert_eq!(replay.len(), 10);

        let mut rng = ChaCha8Rng::seed_from_u64(4);
        let mut oldest = u16::MAX;
        for _ in 0..200 {
            let Some(window) = replay.draw(4, &mut rng) else { continue };
            let mut frames = Frames::default();
            let mut transitions = Vec::new();
            replay.read(window, 4, &mut frames, &mut transitions);
            assert!(transitions.windows(2).all(|pair| pair[1].age == pair[0].age + 1));
            let mut pairs = transitions.iter().zip(&frames.metrics);
            assert!(pairs.all(|(transition, metric)| (f32::from(transition.age) - *metric).abs() < f32::EPSILON));
            oldest = oldest.min(transitions[0].age);
        }
        assert_eq!(oldest, 27);
    }

    /// A replay memory whose first ring has wrapped, and the folder with its checkpoint.
    fn saved(seen: impl Fn(u16) -> CompactView) -> (Replay, tempfile::TempDir) {
        let mut replay = Replay::new(20, 2);
        for time in 0..13u16 {
            replay.push(0, &seen(time), Transition { age: time, ..Transition::default() });
        }
        replay.push(1, &seen(40), Transition { age: 40, ..Transition::default() });

        let folder = tempfile::tempdir().unwrap();
        let mut checkpoint = Checkpoint::default();
        replay.save(&mut checkpoint);
        // The checkpoint borrows the patches instead of copying them.
        assert_eq!(checkpoint.bytes("replay.0.patches").unwrap().as_ptr(), replay.actors[0].frames.patches.as_ptr());
        checkpoint.write(&folder.path().join("a")).unwrap();
        (replay, folder)
    }

    #[test]
    fn a_memory_comes_back_as_it_was_with_room_for_the_rest() {
        for patches in [true, false] {
            let seen = |time: u16| {
                if patches {
                    CompactView::Patch(vec![time as u8; PIXELS].into())
                } else {
                    CompactView::Metric(f32::from(time))
                }
            };
            let (mut replay, folder) = saved(seen);

            let mut back = Replay::new(20, 2);
            back.restore(&mut Checkpoint::read(&folder.path().join("a")).unwrap()).unwrap();

            for time in 50..53 {
                for memory in [&mut replay, &mut back] {
                    memory.push(1, &seen(time), Transition { age: time, ..Transition::default() });
                    memory.push(0, &seen(time), Transition { age: time, ..Transition::default() });
                }
            }

            for (one, other) in replay.actors.iter().zip(&back.actors) {
                assert_eq!((&one.transitions, one.head), (&other.transitions, other.head));
                assert_eq!(one.frames, other.frames);
            }
            assert!(!patches || back.actors[1].frames.patches.capacity() == 10 * PIXELS);
        }
    }

    #[test]
    fn a_damaged_memory_is_rejected() {
        let (_replay, folder) = saved(|_| CompactView::Patch(vec![1; PIXELS].into()));
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
            assert!(error.contains("is damaged: frames of actor"), "{error}");
        }
    }
}
