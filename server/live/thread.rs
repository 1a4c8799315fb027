//! The imaging thread: takes the loop's latest frame, finds the content area for the loop, and makes the picture.

use std::sync::Arc;
use std::sync::atomic::Ordering;
use std::thread::JoinHandle;
use std::time::Duration;

use bytes::Bytes;
use tokio::sync::watch;

use super::{Counts, EncodedFrame, Insight, LiveHandle, Picture};
use crate::camera::FrameImage;
use crate::control::{ControlHandle, ControlledFrame};
use crate::imaging::RgbImage;

/// Starts the thread; it ends when the loop closes its slot.
///
/// # Errors
/// When the system cannot make a thread.
pub fn start(control: ControlHandle) -> std::io::Result<(LiveHandle, JoinHandle<()>)> {
    let (sender, frames) = watch::channel(None);
    let counts = Arc::new(Counts::default());
    let handle = LiveHandle { frames, counts: Arc::clone(&counts) };
    let thread = std::thread::Builder::new().name("imaging".into()).spawn(move || run(&control, &sender, &counts))?;
    Ok((handle, thread))
}

fn run(control: &ControlHandle, sender: &watch::Sender<Option<Arc<EncodedFrame>>>, counts: &Counts) {
    while !control.frames.is_closed() {
        let Some(controlled) = control.frames.take(Duration::from_millis(500)) else { continue };
        if counts.viewers() == 0 {
            continue;
        }
        if let Some(encoded) = encode(controlled) {
            counts.encoded.fetch_add(1, Ordering::Relaxed);
            counts.jpeg_bytes.fetch_add(encoded.picture.jpeg.len() as u64, Ordering::Relaxed);
            sender.send_replace(Some(Arc::new(encoded)));
        }
    }
}

fn encode(controlled: ControlledFrame) -> Option<EncodedFrame> {
    let FrameImage::Rgb(rgb) = &controlled.frame.image else { return None };
    let jpeg = jpeg(rgb)?;
    let record = controlled.record;
    Some(EncodedFrame {
        picture: Picture {
            number: controlled.frame.number,
            exposed_at: controlled.frame.exposed_at,
            width: rgb.width,
            height: rgb.height,
            jpeg,
            patch: controlled.patch,
            content_area: controlled.content_area,
        },
        insight: Insight {
            asked: record.asked,
            measured: record.measured,
            metric: record.metric,
            held: record.held,
            belief: controlled.belief,
        },
    })
}

fn jpeg(rgb: &RgbImage) -> Option<Bytes> {
    let mut bytes = Vec::new();
    let encoder = image::codecs::jpeg::JpegEncoder::new_with_quality(&mut bytes, 80);
    let (width, height) = (u32::try_from(rgb.width).ok()?, u32::try_from(rgb.height).ok()?);
    image::ImageEncoder::write_image(encoder, &rgb.data, width, height, image::ExtendedColorType::Rgb8).ok()?;
    Some(bytes.into())
}
