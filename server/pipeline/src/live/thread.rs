//! The imaging thread: takes the loop's latest frame, makes the picture at the size of the cells, hands the
//! frame on to the larger sizes, and looks for the content area.

use std::sync::Arc;
use std::thread::JoinHandle;
use std::time::Duration;

use tokio::sync::watch;

use super::area::AreaWatch;
use super::depth_map::Surveyor;
use super::frame_encoder::FrameEncoder;
use super::larger_size::LargerSize;
use super::publisher::Publisher;
use super::{Counts, LiveHandle};
use crate::control::{Command, ControlHandle, ControlledFrame, Eye};
use parfocal_autofocus::Registry;
use parfocal_base::clock::Clock;
use parfocal_base::guarded;
use parfocal_imaging::{Developer, Size, content_area};

/// Frames from one search for the content area to the next. The area moves slowly, as the eyepiece slips in a hand.
const DETECT_EVERY: u64 = 10;

/// Longest wait for a frame before checking whether more will come.
const PATIENCE: Duration = Duration::from_millis(500);

/// Starts the thread, one for each larger size up to `largest`, and one for depth maps, of what `eye` sees and trackers
/// of `registry` believe; they end when the loop closes its slot.
///
/// # Errors
/// If the system cannot create a thread or an encoder.
pub fn start(
    control: ControlHandle,
    developer: &Developer,
    largest: Size,
    (eye, registry): (Eye, Registry),
    clock: &Arc<dyn Clock>,
) -> std::io::Result<(LiveHandle, JoinHandle<()>)> {
    let counts = Arc::new(Counts::default());
    let publisher = |size| {
        let (sender, frames) = watch::channel(None);
        (Publisher { size, sender, counts: Arc::clone(&counts), clock: Arc::clone(clock) }, frames)
    };

    let (cells, latest) = publisher(Size::Cell);
    let mut frames = vec![latest];
    let mut larger = Vec::new();
    for size in Size::ALL.into_iter().filter(|size| (Size::Half..=largest).contains(size)) {
        let (publisher, latest) = publisher(size);
        frames.push(latest);
        larger.push(LargerSize::start(developer.clone(), size, publisher)?);
    }

    let frame_encoder = FrameEncoder::new(developer.clone(), Size::Cell).map_err(std::io::Error::other)?;
    let taken = watch::Sender::default();
    let depth_maps = watch::Sender::default();
    let surveyor = Surveyor::start(eye, registry, depth_maps.clone())?;
    let handle = LiveHandle {
        frames: frames.into(),
        counts: Arc::clone(&counts),
        leaders: watch::Sender::default(),
        taken: taken.clone(),
        depth_maps,
    };
    let worker = Worker {
        control,
        publisher: cells,
        frame_encoder,
        larger,
        surveyor,
        taken,
        areas: AreaWatch::default(),
        looked: None,
    };
    let thread = std::thread::Builder::new().name("imaging".into()).spawn(move || worker.run())?;

    Ok((handle, thread))
}

struct Worker {
    control: ControlHandle,
    publisher: Publisher,
    frame_encoder: FrameEncoder,
    larger: Vec<LargerSize>,
    surveyor: Surveyor,
    /// Frames for those who make pictures of their own.
    taken: watch::Sender<Option<Arc<ControlledFrame>>>,
    areas: AreaWatch,
    /// Number of the frame in which the content area was last looked for.
    looked: Option<u64>,
}

impl Worker {
    fn run(mut self) {
        parfocal_base::priority::lower();
        while !self.control.frames.is_closed() {
            let Some(frame) = self.control.frames.take(PATIENCE) else { continue };

            // One bad picture must not end the live view.
            if guarded(|| self.turn(&frame)).is_err() {
                tracing::error!("a picture could not be made; continuing with the next");
            }
        }
    }

    fn turn(&mut self, frame: &ControlledFrame) {
        self.publisher.counts.note_step(&frame.record);
        let watched = self.publisher.is_watched();

        // We count from the last search: if frames come faster than this thread takes them, every multiple of ten could
        // be among those that it misses.
        let number = frame.frame.number;
        let detect = self.looked.is_none_or(|looked| number.abs_diff(looked) >= DETECT_EVERY);

        let began = self.publisher.clock.now();
        let image = &frame.frame.image;
        if watched || detect {
            self.frame_encoder.develop(image);
        }

        // The picture leaves first: its viewers wait neither for a larger size nor for the detection.
        if watched {
            self.publisher.publish(&mut self.frame_encoder, frame, began);
        }
        for larger in &self.larger {
            larger.offer(frame);
        }
        self.surveyor.offer(frame);
        if self.taken.receiver_count() > 0 {
            self.taken.send_replace(Some(Arc::new(frame.clone())));
        } else if self.taken.borrow().is_some() {
            // The camera may need the memory.
            self.taken.send_replace(None);
        }

        if detect {
            self.looked = Some(number);
            if let Some(news) = self.areas.see(content_area::detect(self.frame_encoder.gray(image))) {
                self.control.send(Command::ContentArea(news));
            }
        }
    }
}
