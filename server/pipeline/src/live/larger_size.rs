//! The thread that makes the pictures of one larger size, while it has viewers. It takes the latest
//! frame whenever it is done with one, so neither the smallest size nor the loop waits for it.

use std::time::Duration;

use super::frame_encoder::FrameEncoder;
use super::frame_thread::{FrameSlot, FrameThread};
use super::publisher::Publisher;
use crate::control::ControlledFrame;
use parfocal_base::clock::Moment;
use parfocal_base::guarded;
use parfocal_imaging::{Developer, Size};

/// Longest wait for a frame before checking whether more will come.
const PATIENCE: Duration = Duration::from_millis(500);

/// Least time between the exposures of two pictures at [`Size::Full`], for 25 a second. At a camera's own rate they
/// would keep most of a core busy. Their number would then depend on what else the machine does, such as running a
/// policy.
const FULL_INTERVAL: Duration = Duration::from_millis(38);

/// The thread of one larger size; ends when dropped.
pub(super) struct LargerSize {
    publisher: Publisher,
    thread: FrameThread,
}

impl LargerSize {
    /// Starts the thread for `size`, which publishes its pictures through `outlet`.
    ///
    /// # Errors
    /// If the system cannot create a thread or an encoder.
    pub(super) fn start(developer: Developer, size: Size, publisher: Publisher) -> std::io::Result<Self> {
        let frame_encoder = FrameEncoder::new(developer, size).map_err(std::io::Error::other)?;
        let worker = Worker { publisher: publisher.clone(), frame_encoder, last: None };
        let thread = FrameThread::start(format!("imaging-{}", size.name()), |slot| worker.run(&slot))?;
        Ok(Self { publisher, thread })
    }

    /// Hands `frame` over if this size has viewers; never waits.
    pub(super) fn offer(&self, frame: &ControlledFrame) {
        if self.publisher.is_watched() {
            self.thread.offer(frame);
        }
    }
}

struct Worker {
    publisher: Publisher,
    frame_encoder: FrameEncoder,
    /// When the last frame that became a picture was exposed.
    last: Option<Moment>,
}

impl Worker {
    fn run(mut self, slot: &FrameSlot) {
        parfocal_base::priority::lower_further();
        while !slot.is_closed() {
            let Some(frame) = slot.take(PATIENCE) else { continue };
            // Its last viewer may have left meanwhile.
            if !self.publisher.is_watched() || !self.is_due(&frame) {
                continue;
            }

            // One bad picture must not end the live view.
            if guarded(|| self.make(&frame)).is_err() {
                tracing::error!("a larger picture could not be made; continuing with the next");
            }
        }
    }

    fn is_due(&self, frame: &ControlledFrame) -> bool {
        let exposed = frame.frame.exposed_at;
        let early = |last| self.frame_encoder.size() == Size::Full && exposed.since(last) < FULL_INTERVAL;
        !self.last.is_some_and(early)
    }

    fn make(&mut self, frame: &ControlledFrame) {
        self.last = Some(frame.frame.exposed_at);
        let began = self.publisher.clock.now();
        self.frame_encoder.develop(&frame.frame.image);
        self.publisher.publish(&mut self.frame_encoder, frame, began);
    }
}
