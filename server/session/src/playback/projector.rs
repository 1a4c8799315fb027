//! Makes the pictures of recordings, one after another, on a thread of low priority. A session under way has
//! precedence: only the people who play an earlier session have to wait.

use std::path::{Path, PathBuf};

use bytes::Bytes;
use tokio::sync::{mpsc, oneshot};

use super::error::PlaybackError;
use parfocal_base::priority;
use parfocal_devices::camera::calibration;
use parfocal_imaging::{Developer, GrayImage, JpegEncoder, RgbImage, Size};
use parfocal_recording::{AnyRecording, Recording, RecordingError};

/// Maximum number of pictures that wait to be made: enough for the requests that a few pages make ahead.
const WAITING: usize = 64;
/// Maximum number of recordings that are kept open.
const OPEN: usize = 4;

/// A frame of a recording.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(super) struct Slide {
    /// Folder of the recording.
    pub folder: PathBuf,
    /// Index of the frame, from 0.
    pub number: usize,
    /// Size at which a mosaic is developed.
    pub size: Size,
}

type PictureResult = Result<Bytes, PlaybackError>;

/// A handle of the thread that makes pictures. The thread ends when the handle is dropped.
pub(super) struct Projector {
    slides: mpsc::Sender<(Slide, oneshot::Sender<PictureResult>)>,
}

impl Projector {
    /// Starts the thread.
    ///
    /// # Errors
    /// If the system cannot start another thread.
    pub fn start() -> std::io::Result<Self> {
        let (slides, waiting) = mpsc::channel(WAITING);
        std::thread::Builder::new().name("playback".into()).spawn(move || run(waiting))?;
        Ok(Self { slides })
    }

    /// The picture of `slide` as a JPEG. If the future is dropped before the picture's turn, it is not made.
    pub async fn picture(&self, slide: Slide) -> PictureResult {
        let (reply, made) = oneshot::channel();
        self.slides.send((slide, reply)).await.map_err(|_| PlaybackError::Ending)?;
        made.await.map_err(|_| PlaybackError::Ending)?
    }
}

fn run(mut waiting: mpsc::Receiver<(Slide, oneshot::Sender<PictureResult>)>) {
    priority::lower_further();
    let mut open: Vec<Open> = Vec::new();

    while let Some((slide, reply)) = waiting.blocking_recv() {
        // Nobody waits for this picture any more: the page has jumped elsewhere in the recording.
        if reply.is_closed() {
            continue;
        }
        let _ = reply.send(make(&mut open, &slide));
    }
}

/// An open recording, and the tools that make its pictures.
struct Open {
    recording: AnyRecording,
    /// None for a recording of the view.
    studio: Option<Studio>,
}

fn make(open: &mut Vec<Open>, slide: &Slide) -> PictureResult {
    let place = open.iter().position(|open| open.folder() == slide.folder);
    let mut found = match place {
        Some(place) => open.remove(place),
        None => Open::new(&slide.folder)?,
    };

    let mut made = found.picture(slide);
    if matches!(made, Err(PlaybackError::NotFound(_))) {
        // The recording may have grown since it was opened.
        found = Open::new(&slide.folder)?;
        made = found.picture(slide);
    }

    // The most recently used recording comes first. The least recently used one is closed.
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

    fn picture(&mut self, slide: &Slide) -> PictureResult {
        match (&self.recording, &mut self.studio) {
            (AnyRecording::View(recording), _) => recording.picture(slide.number).map(Bytes::from).map_err(unreadable),
            (AnyRecording::Mosaic(recording), Some(studio)) => studio.picture(recording, slide),
            (AnyRecording::Mosaic(_), None) => Err(PlaybackError::Ending),
        }
    }
}

/// Develops mosaics with the calibration that was stored in their recording.
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

    fn picture(&mut self, recording: &Recording, slide: &Slide) -> PictureResult {
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
