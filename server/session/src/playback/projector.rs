//! Makes the pictures and spectra of recordings, one after another, on a thread of low priority. A session under way
//! has precedence: only the people who play an earlier session have to wait.

use std::path::{Path, PathBuf};

use bytes::Bytes;
use tokio::sync::{mpsc, oneshot};

use super::spectrum::PlaceSpectrum;
use crate::conductor::ConductError;
use parfocal_base::{guarded, priority};
use parfocal_devices::camera::calibration;
use parfocal_imaging::{
    Calibration, Circle, Developer, GrayImage, JpegEncoder, MosaicFrame, RgbImage, Size, SpectrumSum,
};
use parfocal_recording::{AnyRecording, Recording, RecordingError};

/// Maximum number of pictures and spectra that wait to be made: enough for the requests that a few pages make ahead.
const WAITING: usize = 64;
/// Maximum number of recordings that are kept open.
const OPEN: usize = 4;

/// What the thread has to do next.
type Job = Box<dyn FnOnce(&mut Vec<Open>) + Send>;

/// A handle of the thread that looks into recordings. The thread ends when the handle is dropped.
pub(super) struct Projector {
    jobs: mpsc::Sender<Job>,
}

impl Projector {
    /// Starts the thread.
    ///
    /// # Errors
    /// If the system cannot start another thread.
    pub fn start() -> std::io::Result<Self> {
        let (jobs, waiting) = mpsc::channel(WAITING);
        std::thread::Builder::new().name("playback".into()).spawn(move || run(waiting))?;
        Ok(Self { jobs })
    }

    /// What `look` finds in the recording in `folder`. If the future is dropped before its turn comes, as when the page
    /// has jumped elsewhere, nothing is done.
    pub async fn ask<T: Send + 'static>(
        &self,
        folder: PathBuf,
        look: impl Fn(&mut Open) -> Result<T, ConductError> + Send + 'static,
    ) -> Result<T, ConductError> {
        let (reply, found) = oneshot::channel();
        let job: Job = Box::new(move |open| {
            if !reply.is_closed() {
                let _ = reply.send(guarded(|| look_into(open, &folder, look)).unwrap_or_else(|_| Err(failed())));
            }
        });
        self.jobs.send(job).await.map_err(|_| ConductError::ending())?;
        found.await.map_err(|_| ConductError::ending())?
    }
}

fn run(mut waiting: mpsc::Receiver<Job>) {
    priority::lower_further();
    let mut open: Vec<Open> = Vec::new();
    while let Some(job) = waiting.blocking_recv() {
        job(&mut open);
    }
}

/// An open recording, and the tools that make its pictures.
pub(super) struct Open {
    recording: AnyRecording,
    /// None for a recording of the view.
    mosaics: Option<MosaicDeveloper>,
}

fn look_into<T>(
    open: &mut Vec<Open>,
    folder: &Path,
    look: impl Fn(&mut Open) -> Result<T, ConductError>,
) -> Result<T, ConductError> {
    let place = open.iter().position(|open| open.recording.folder() == folder);
    let mut found = match place {
        Some(place) => open.remove(place),
        None => Open::new(folder)?,
    };

    let mut seen = look(&mut found);
    if matches!(seen, Err(ConductError::NotFound(_))) {
        // The recording may have grown since it was opened.
        found = Open::new(folder)?;
        seen = look(&mut found);
    }

    // The most recently used recording comes first. The least recently used one is closed.
    open.insert(0, found);
    open.truncate(OPEN);
    seen
}

impl Open {
    fn new(folder: &Path) -> Result<Self, ConductError> {
        let recording = AnyRecording::open(folder).map_err(unreadable)?;
        let mosaics = match &recording {
            AnyRecording::Mosaic(recording) => Some(MosaicDeveloper::new(recording)?),
            AnyRecording::View(_) => None,
        };
        Ok(Self { recording, mosaics })
    }

    /// Frame `number`, from 0, as a JPEG; a mosaic developed at `size`.
    pub fn picture(&mut self, number: usize, size: Size) -> Result<Bytes, ConductError> {
        match (&self.recording, &mut self.mosaics) {
            (AnyRecording::View(recording), _) => recording.picture(number).map(Bytes::from).map_err(unreadable),
            (AnyRecording::Mosaic(recording), Some(mosaics)) => mosaics.picture(recording, number, size),
            (AnyRecording::Mosaic(_), None) => Err(ConductError::ending()),
        }
    }

    /// The spectrum of frame `number`, from 0, within `circle`.
    pub fn spectrum(&mut self, number: usize, circle: Circle) -> Result<PlaceSpectrum, ConductError> {
        let (AnyRecording::Mosaic(recording), Some(mosaics)) = (&self.recording, &mut self.mosaics) else {
            return Err(ConductError::NotFound("a recording of the view has no spectra, only colours".to_owned()));
        };
        let sum = SpectrumSum::new(&mosaics.calibration, circle, recording.size());
        let mut sum = sum.map_err(|bad| ConductError::Invalid(bad.to_string()))?;
        sum.add(read(&mut mosaics.latest, recording, number)?);
        Ok(PlaceSpectrum::new(&mosaics.calibration, &sum.spectrum()))
    }
}

/// Develops mosaics with the calibration that was stored in their recording.
struct MosaicDeveloper {
    calibration: Calibration,
    developer: Developer,
    encoder: JpegEncoder,
    rgb: RgbImage,
    gray: GrayImage,
    /// The frame that was read last, with its number. The spectra at several places of one frame are asked for one by
    /// one, and mostly after its picture.
    latest: Option<(usize, MosaicFrame)>,
}

impl MosaicDeveloper {
    fn new(recording: &Recording) -> Result<Self, ConductError> {
        let calibration = calibration::of_recording(recording)
            .map_err(|error| ConductError::Damaged(format!("the recording's calibration: {error}")))?;
        let encoder =
            JpegEncoder::new(JpegEncoder::DEFAULT_QUALITY).map_err(|error| ConductError::Damaged(error.to_string()))?;

        let developer = Developer::new(&calibration);
        Ok(Self { calibration, developer, encoder, rgb: RgbImage::default(), gray: GrayImage::default(), latest: None })
    }

    fn picture(&mut self, recording: &Recording, number: usize, size: Size) -> Result<Bytes, ConductError> {
        let mosaic = read(&mut self.latest, recording, number)?;
        self.developer.develop(mosaic, size, &mut self.rgb, &mut self.gray);
        self.encoder.encode(&self.rgb).map_err(|error| ConductError::Damaged(error.to_string()))
    }
}

/// Frame `number` of `recording`: `latest`, if that is it.
fn read<'a>(
    latest: &'a mut Option<(usize, MosaicFrame)>,
    recording: &Recording,
    number: usize,
) -> Result<&'a MosaicFrame, ConductError> {
    let kept = latest.take().filter(|(kept, _)| *kept == number);
    let frame = match kept {
        Some(frame) => frame,
        None => (number, recording.frame(number).map_err(unreadable)?),
    };
    Ok(&latest.insert(frame).1)
}

/// After a panic. The recording that was looked into is closed, so it is opened anew for the next look.
fn failed() -> ConductError {
    ConductError::Damaged("the program failed at this frame; the server's log says how".to_owned())
}

fn unreadable(error: RecordingError) -> ConductError {
    match error {
        RecordingError::NoFrame { .. } | RecordingError::NoRecording(_) => ConductError::NotFound(error.to_string()),
        error => ConductError::Damaged(error.to_string()),
    }
}

#[cfg(test)]
mod tests {
    use parfocal_recording::{Ended, VIEW_FORMAT, VIEW_VERSION, ViewHeader, ViewWriter};

    use super::*;

    #[tokio::test]
    async fn a_look_that_panics_is_an_error_and_the_next_one_is_answered() {
        let temporary = tempfile::tempdir().unwrap();
        let folder = temporary.path().join("view");
        let header = ViewHeader {
            format: VIEW_FORMAT.to_owned(),
            version: VIEW_VERSION,
            software: "a test".to_owned(),
            started: "2026-03-01T12:00:00Z".parse().unwrap(),
            camera: "a test's".to_owned(),
            session: None,
            run: None,
            monotonic_ns: None,
            ended: None,
        };
        let jpeg = [0xFF, 0xD8, 0xFF, 0xD9];
        let mut writer = ViewWriter::create(&folder, header).unwrap();
        writer.add(1, 0, (1, 1), &jpeg).unwrap();
        writer.finish(Ended::Stopped).unwrap();

        let projector = Projector::start().unwrap();
        let failed = projector.ask(folder.clone(), |_| -> Result<(), _> { panic!("as the test asked") }).await;
        assert!(matches!(failed, Err(ConductError::Damaged(_))), "{failed:?}");
        let seen = projector.ask(folder, |open| open.picture(0, Size::Cell)).await;
        assert_eq!(seen.unwrap(), Bytes::copy_from_slice(&jpeg));
    }
}
