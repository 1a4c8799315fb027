//! The imaging thread: takes the loop's latest frame, makes the picture, and looks for the content area.

use std::panic::{AssertUnwindSafe, catch_unwind};
use std::sync::Arc;
use std::sync::atomic::Ordering;
use std::thread::JoinHandle;
use std::time::Duration;

use bytes::Bytes;
use tokio::sync::watch;

use super::area::AreaWatch;
use super::{Counts, EncodedFrame, Insight, LiveHandle, Picture};
use crate::camera::FrameImage;
use crate::control::{Command, ControlHandle, ControlledFrame};
use crate::imaging::{GrayImage, JpegEncoder, JpegError, Reconstructor, RgbImage, content_area, rgb_to_gray};

/// Interval of the search for the content area, frames: it moves as slowly as a hand lets an eyepiece
/// slip.
const DETECT_EVERY: u64 = 10;

/// Longest wait for a frame before checking whether more will come.
const PATIENCE: Duration = Duration::from_millis(500);

/// Starts the thread; it ends when the loop closes its slot.
///
/// # Errors
/// When the system cannot make a thread or an encoder.
pub fn start(control: ControlHandle, reconstructor: Reconstructor) -> std::io::Result<(LiveHandle, JoinHandle<()>)> {
    let (sender, frames) = watch::channel(None);
    let counts = Arc::new(Counts::default());
    let handle = LiveHandle { frames, counts: Arc::clone(&counts) };

    let studio = Studio::new(reconstructor).map_err(std::io::Error::other)?;
    let worker = Worker { control, sender, counts, studio, areas: AreaWatch::default(), looked: None };
    let thread = std::thread::Builder::new().name("imaging".into()).spawn(move || worker.run())?;

    Ok((handle, thread))
}

struct Worker {
    control: ControlHandle,
    sender: watch::Sender<Option<Arc<EncodedFrame>>>,
    counts: Arc<Counts>,
    studio: Studio,
    areas: AreaWatch,
    /// The frame in which the content area was last looked for.
    looked: Option<u64>,
}

impl Worker {
    fn run(mut self) {
        crate::priority::lower();
        while !self.control.frames.is_closed() {
            let Some(frame) = self.control.frames.take(PATIENCE) else { continue };

            // One bad picture must not end the live view.
            if catch_unwind(AssertUnwindSafe(|| self.turn(frame))).is_err() {
                tracing::error!("a picture could not be made; going on with the next");
            }
        }
    }

    fn turn(&mut self, frame: ControlledFrame) {
        self.counts.latency.observe(f64::from(frame.record.latency_micros) / 1e6);
        let watched = self.counts.viewers() > 0;

        // By distance: where frames come faster than they are shown, those of a round number may never be
        // seen here.
        let detect = self.looked.is_none_or(|looked| frame.frame.number.abs_diff(looked) >= DETECT_EVERY);
        if !watched && !detect {
            return;
        }

        let number = frame.frame.number;
        let image = frame.frame.image.clone();
        self.studio.develop(&image);

        if watched {
            match self.studio.encode(&image) {
                Ok(jpeg) => self.publish(frame, &image, jpeg),
                Err(error) => tracing::error!(%error, "a picture could not be encoded"),
            }
        }

        // Detection comes after the picture has left: nobody waits for it.
        if detect {
            self.looked = Some(number);
            if let Some(news) = self.areas.see(content_area::detect(self.studio.gray(&image))) {
                self.control.send(Command::ContentArea(news));
            }
        }
    }

    fn publish(&self, controlled: ControlledFrame, image: &FrameImage, jpeg: Bytes) {
        self.counts.encoded.fetch_add(1, Ordering::Relaxed);
        self.counts.jpeg_bytes.fetch_add(jpeg.len() as u64, Ordering::Relaxed);

        let (width, height) = size(image);
        let ControlledFrame { frame, patch, content_area, record, belief } = controlled;

        self.sender.send_replace(Some(Arc::new(EncodedFrame {
            picture: Picture {
                number: frame.number,
                exposed_at: frame.exposed_at,
                width,
                height,
                jpeg,
                estimated: matches!(image, FrameImage::Mosaic(_)),
                patch,
                content_area,
            },
            insight: Insight {
                asked: record.asked,
                measured: record.measured,
                metric: record.metric,
                held: record.held,
                belief,
            },
        })));
    }
}

/// Size of the picture made from `image`.
fn size(image: &FrameImage) -> (usize, usize) {
    match image {
        FrameImage::Mosaic(mosaic) => (mosaic.band_width(), mosaic.band_height()),
        FrameImage::Rgb(rgb) => (rgb.width, rgb.height),
    }
}

/// Makes pictures, reusing its memory for each.
struct Studio {
    reconstructor: Reconstructor,
    encoder: JpegEncoder,
    rgb: RgbImage,
    gray: GrayImage,
}

impl Studio {
    fn new(reconstructor: Reconstructor) -> Result<Self, JpegError> {
        let encoder = JpegEncoder::new(JpegEncoder::DEFAULT_QUALITY)?;
        Ok(Self { reconstructor, encoder, rgb: RgbImage::default(), gray: GrayImage::default() })
    }

    /// Makes colour and gray from a mosaic; leaves a colour picture as it is.
    fn develop(&mut self, image: &FrameImage) {
        if let FrameImage::Mosaic(mosaic) = image {
            self.reconstructor.reconstruct(mosaic, &mut self.rgb, &mut self.gray);
        }
    }

    /// JPEG of `image`, which must be the one developed last.
    fn encode(&mut self, image: &FrameImage) -> Result<Bytes, JpegError> {
        match image {
            FrameImage::Mosaic(_) => self.encoder.encode(&self.rgb),
            FrameImage::Rgb(rgb) => self.encoder.encode(rgb),
        }
    }

    /// Gray picture of `image`, which must be the one developed last.
    fn gray(&mut self, image: &FrameImage) -> &GrayImage {
        if let FrameImage::Rgb(rgb) = image {
            rgb_to_gray(rgb, &mut self.gray);
        }
        &self.gray
    }
}
