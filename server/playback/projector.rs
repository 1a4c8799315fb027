//! Makes the pictures of recordings, one after another, on a thread of low priority. A session that is under way goes
//! first: whoever plays an earlier one waits, and nobody else does.

use std::path::{Path, PathBuf};

use bytes::Bytes;
use tokio::sync::{mpsc, oneshot};

use super::error::PlaybackError;
use crate::camera::calibration;
use crate::imaging::{Developer, GrayImage, JpegEncoder, RgbImage, Size};
use crate::priority;
use crate::recording::{AnyRecording, Recording, RecordingError};

/// Pictures that may wait to be made: what a few pages ask for ahead.
const WAITING: usize = 64;
/// Recordings that are kept open.
const OPEN: usize = 4;

/// A frame of a recording.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(super) struct Slide {
    /// The recording's folder.
    pub folder: PathBuf,
    /// The frame, from 0.
    pub number: usize,
    /// The size at which a mosaic is developed.
    pub size: Size,
}

type Made = Result<Bytes, PlaybackError>;

/// The thread that makes pictures; ends when dropped.
pub(super) struct Projector {
    slides: mpsc::Sender<(Slide, oneshot::Sender<Made>)>,
}

impl Projector {
    /// Starts the thread.
    ///
    /// # Errors
    /// When the system has no thread left.
    pub fn start() -> std::io::Result<Self> {
        let (slides, waiting) = mpsc::channel(WAITING);
        std::thread::Builder::new().name("playback".into()).spawn(move || run(waiting))?;
        Ok(Self { slides })
    }

    /// The picture of `slide`, as JPEG. If the future is dropped, the picture is not made.
    pub async fn picture(&self, slide: Slide) -> Made {
        let (reply, made) = oneshot::channel();
        self.slides.send((slide, reply)).await.map_err(|_| PlaybackError::Ending)?;
        made.await.map_err(|_| PlaybackError::Ending)?
    }
}

fn run(mut waiting: mpsc::Receiver<(Slide, oneshot::Sender<Made>)>) {
    priority::lower_further();
    let mut open: Vec<Open> = Vec::new();

    while let Some((slide, reply)) = waiting.blocking_recv() {
        // Nobody waits for it any more: the page has gone elsewhere in the recording.
        if reply.is_closed() {
            continue;
        }
        let _ = reply.send(make(&mut open, &slide));
    }
}

/// A recording kept open, and what makes its pictures.
struct Open {
    recording: AnyRecording,
    /// None of a recording of the view.
    studio: Option<Studio>,
}

fn make(open: &mut Vec<Open>, slide: &Slide) -> Made {
    let place = open.iter().position(|open| open.folder() == slide.folder);
    let mut found = match place {
        Some(place) => open.remove(place),
        None => Open::new(&slide.folder)?,
    };

    let mut made = found.picture(slide);
    if matches!(made, Err(PlaybackError::NotFound(_))) {
        // It may have become longer since it was opened.
        found = Open::new(&slide.folder)?;
        made = found.picture(slide);
    }

    // The one used last stands first; the one used longest ago is closed.
    open.insert(0, found);
    open.truncate(OPEN);
    made
}

impl Open {
    fn new(folder: &Path) -> Result<Self, PlaybackError> {
        let recording = AnyRecording::open(folder).map_err(unreadable)?;
        let studio = match &recording {
            AnyRecording::Mosaic(recording) => Some(Studio::new(recording)?),
            AnyRecording::View(_) => None,
        };
        Ok(Self { recording, studio })
    }

    fn folder(&self) -> &Path {
        self.recording.folder()
    }

    fn picture(&mut self, slide: &Slide) -> Made {
        match (&self.recording, &mut self.studio) {
            (AnyRecording::View(recording), _) => recording.picture(slide.number).map(Bytes::from).map_err(unreadable),
            (AnyRecording::Mosaic(recording), Some(studio)) => studio.picture(recording, slide),
            (AnyRecording::Mosaic(_), None) => Err(PlaybackError::Ending),
        }
    }
}

/// Develops mosaics with the calibration that they were recorded with.
struct Studio {
    developer: Developer,
    encoder: JpegEncoder,
    rgb: RgbImage,
    gray: GrayImage,
}

impl Studio {
    fn new(recording: &Recording) -> Result<Self, PlaybackError> {
        let calibration = calibration::read(&recording.calibration())
            .map_err(|error| PlaybackError::Unreadable(format!("the recording's calibration: {error}")))?;
        let encoder = JpegEncoder::new(JpegEncoder::DEFAULT_QUALITY)
            .map_err(|error| PlaybackError::Unreadable(error.to_string()))?;

        let developer = Developer::new(&calibration);
        Ok(Self { developer, encoder, rgb: RgbImage::default(), gray: GrayImage::default() })
    }

    fn picture(&mut self, recording: &Recording, slide: &Slide) -> Made {
        let mosaic = recording.frame(slide.number).map_err(unreadable)?;
        self.developer.develop(&mosaic, slide.size, &mut self.rgb, &mut self.gray);
        self.encoder.encode(&self.rgb).map_err(|error| PlaybackError::Unreadable(error.to_string()))
    }
}

fn unreadable(error: RecordingError) -> PlaybackError {
    match error {
        RecordingError::NoFrame { .. } | RecordingError::NoRecording(_) => PlaybackError::NotFound(error.to_string()),
        error => PlaybackError::Unreadable(error.to_string()),
    }
}
