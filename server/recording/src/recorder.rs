//! Records while frames come: one thread compresses, another writes. Offering a frame never waits.

use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};
use std::sync::mpsc::{Receiver, RecvTimeoutError, SyncSender, TrySendError, sync_channel};
use std::sync::{Arc, Mutex, PoisonError};
use std::thread::JoinHandle;
use std::time::Duration;
use std::{io, thread};

use super::codec::Coder;
use super::columns::{FrameRow, PatchRow};
use super::disk::{Room, room};
use super::error::RecordingError;
use super::header::Ended;
use super::writing::Writer;
use parfocal_base::FocalPower;
use parfocal_base::clock::Moment;
use parfocal_base::{guarded, priority};
use parfocal_imaging::MosaicFrame;

/// Frames that may wait to be compressed: a third of a second at 25 a second. The camera reuses their memory.
const WAITING: usize = 8;
/// Compressed frames that may wait for the disk: more than a second at 25 a second.
const COMPRESSED: usize = 32;
/// How often a thread without frames checks whether to end.
const PAUSE: Duration = Duration::from_millis(50);

/// A frame to record, and what is known about it.
#[derive(Debug, Clone)]
pub struct CapturedFrame {
    /// The camera's number of the frame.
    pub number: u64,
    /// End of its exposure.
    pub exposed_at: Moment,
    /// Length of its exposure.
    pub exposure: Duration,
    /// Focal power asked of the lens after the frame.
    pub asked: FocalPower,
    /// Focal power at the middle of its exposure, if known.
    pub measured: Option<FocalPower>,
    /// Best focal power; `None` unless a simulation knows it.
    pub optimal: Option<FocalPower>,
    /// The patch.
    pub patch: PatchRow,
    /// Its samples.
    pub mosaic: Arc<MosaicFrame>,
}

impl CapturedFrame {
    fn row(&self, start: Moment) -> FrameRow {
        let value = |power: Option<FocalPower>| power.map_or(f64::NAN, FocalPower::get);
        FrameRow {
            time: self.exposed_at.as_nanos().cast_signed().wrapping_sub(start.as_nanos().cast_signed()),
            number: self.number,
            exposure: self.exposure.as_secs_f64() * 1e3,
            asked: self.asked.get(),
            measured: value(self.measured),
            optimal: value(self.optimal),
            patch: self.patch,
        }
    }
}

/// Where frames are offered.
#[derive(Debug)]
pub struct Intake {
    frames: SyncSender<CapturedFrame>,
    lost: Arc<AtomicU64>,
}

impl Intake {
    /// An intake that holds up to `capacity` frames, and the receiver that gets them.
    pub fn new(capacity: usize) -> (Arc<Self>, Receiver<CapturedFrame>) {
        let (frames, taken) = sync_channel(capacity);
        (Arc::new(Self { frames, lost: Arc::default() }), taken)
    }

    /// Offers a frame; returns at once. A frame that does not fit is lost and counted.
    pub fn offer(&self, shot: CapturedFrame) {
        if let Err(TrySendError::Full(_)) = self.frames.try_send(shot) {
            self.lost.fetch_add(1, Ordering::Relaxed);
        }
    }
}

/// How far a recording has come.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct RecordingProgress {
    /// Frames recorded so far.
    pub frames: u64,
    /// Frames lost because this machine or its disk was too slow.
    pub lost: u64,
    /// Bytes of the frames recorded.
    pub bytes: u64,
    /// How it ended, if it has.
    pub ended: Option<Ended>,
}

/// A recording under way. Dropping it stops it.
pub struct Recorder {
    folder: PathBuf,
    intake: Arc<Intake>,
    progress: Arc<Mutex<RecordingProgress>>,
    stop: Arc<AtomicBool>,
    threads: Vec<JoinHandle<()>>,
}

impl Recorder {
    /// Starts to record into `writer` the frames that are offered to [`Recorder::intake`]. Times count from `start`.
    ///
    /// # Errors
    /// If the codecs do not work, or the system has no thread left.
    pub fn start(writer: Writer, start: Moment) -> Result<Self, RecordingError> {
        let folder = writer.folder().to_owned();
        let no_thread = |error: io::Error| RecordingError::unwritable(&folder, 0, &error);

        let (intake, frames) = Intake::new(WAITING);
        let (sender, compressed) = sync_channel(COMPRESSED);
        let progress = Arc::new(Mutex::new(RecordingProgress::default()));
        let stop = Arc::new(AtomicBool::new(false));

        let compressor = Compressor {
            coder: Coder::of_frames(writer.size().0, writer.size().1)?,
            size: writer.size(),
            start,
            frames,
            compressed: sender,
            stop: Arc::clone(&stop),
        };
        let storer = Storer { writer, compressed, lost: Arc::clone(&intake.lost), progress: Arc::clone(&progress) };

        let compressing = thread::Builder::new().name("compressing".into()).spawn(move || compressor.run());
        let storing = thread::Builder::new().name("recording".into()).spawn(move || storer.run());
        let threads = vec![compressing.map_err(no_thread)?, storing.map_err(no_thread)?];
        Ok(Self { folder, intake, progress, stop, threads })
    }

    /// Where frames are offered.
    pub fn intake(&self) -> Arc<Intake> {
        Arc::clone(&self.intake)
    }

    /// The recording's folder.
    pub fn folder(&self) -> &Path {
        &self.folder
    }

    /// How far it has come.
    pub fn progress(&self) -> RecordingProgress {
        let mut progress = self.progress.lock().unwrap_or_else(PoisonError::into_inner).clone();
        progress.lost = self.intake.lost.load(Ordering::Relaxed);
        progress
    }

    /// Stops, stores the frames that were offered before, and returns how the recording ended.
    pub fn stop(mut self) -> RecordingProgress {
        self.end();
        self.progress()
    }

    fn end(&mut self) {
        self.stop.store(true, Ordering::Relaxed);
        for thread in self.threads.drain(..) {
            if thread.join().is_err() {
                tracing::error!("a recording thread panicked");
            }
        }
    }
}

impl Drop for Recorder {
    fn drop(&mut self) {
        self.end();
    }
}

/// A compressed frame, or why there will be no more.
type Compressed = Result<(FrameRow, Vec<u8>), RecordingError>;

struct Compressor {
    coder: Coder,
    size: (usize, usize),
    start: Moment,
    frames: Receiver<CapturedFrame>,
    compressed: SyncSender<Compressed>,
    stop: Arc<AtomicBool>,
}

impl Compressor {
    fn run(self) {
        priority::lower();
        loop {
            let shot = match self.frames.recv_timeout(PAUSE) {
                Ok(shot) => shot,
                Err(RecvTimeoutError::Timeout) if !self.stop.load(Ordering::Relaxed) => continue,
                Err(_) => return,
            };

            let compressed = guarded(|| self.compress(&shot));
            let compressed = compressed.unwrap_or_else(|panic| Err(RecordingError::panicked(&panic)));
            let last = compressed.is_err();
            if self.compressed.send(compressed).is_err() || last {
                return;
            }
        }
    }

    fn compress(&self, shot: &CapturedFrame) -> Compressed {
        let found = (shot.mosaic.width(), shot.mosaic.height());
        if found != self.size {
            let (width, height) = self.size;
            return Err(RecordingError::Failed(format!(
                "the camera's frames changed from {width}x{height} to {}x{}; start another recording",
                found.0, found.1
            )));
        }
        Ok((shot.row(self.start), self.coder.encode(shot.mosaic.samples())?))
    }
}

struct Storer {
    writer: Writer,
    compressed: Receiver<Compressed>,
    lost: Arc<AtomicU64>,
    progress: Arc<Mutex<RecordingProgress>>,
}

impl Storer {
    fn run(self) {
        priority::lower();
        let progress = Arc::clone(&self.progress);
        // Otherwise the recording would seem to go on.
        if let Err(panic) = guarded(|| self.record()) {
            let problem = RecordingError::panicked(&panic).to_string();
            progress.lock().unwrap_or_else(PoisonError::into_inner).ended = Some(Ended::Failed(problem));
        }
    }

    fn record(mut self) {
        let ended = loop {
            match self.compressed.recv() {
                Ok(Ok((row, frame))) => {
                    if let Some(ended) = self.store(row, frame) {
                        break ended;
                    }
                }
                Ok(Err(error)) => break Ended::Failed(error.to_string()),
                Err(_) => break Ended::Stopped,
            }
        };

        let Self { mut writer, progress, lost, .. } = self;
        writer.set_lost(lost.load(Ordering::Relaxed));
        let finished = writer.finish(ended.clone());

        let mut progress = progress.lock().unwrap_or_else(PoisonError::into_inner);
        // If a shard could not be written, the frames that waited for it are lost.
        progress.frames = writer.stored() as u64;
        progress.ended = Some(match (ended, finished) {
            (Ended::Stopped, Err(error)) => Ended::Failed(error.to_string()),
            (ended, _) => ended,
        });
    }

    /// Stores a frame. Returns why the recording ends, if it does.
    fn store(&mut self, row: FrameRow, frame: Vec<u8>) -> Option<Ended> {
        let bytes = frame.len() as u64;

        // If the space on the disk is unknown, frames are written until it is full.
        let room = room(self.writer.folder()).map_or(u64::MAX, Room::spare);
        if self.writer.waiting_bytes() + bytes > room {
            return Some(Ended::DiskNearlyFull);
        }

        self.writer.set_lost(self.lost.load(Ordering::Relaxed));
        if let Err(error) = self.writer.add(row, frame) {
            return Some(Ended::Failed(error.to_string()));
        }

        let mut progress = self.progress.lock().unwrap_or_else(PoisonError::into_inner);
        progress.frames += 1;
        progress.bytes += bytes;
        None
    }
}

/// Bytes that `mosaic` takes in a recording.
///
/// # Errors
/// If the codecs do not work.
pub fn compressed_size(mosaic: &MosaicFrame) -> Result<usize, RecordingError> {
    Coder::of_frames(mosaic.width(), mosaic.height())?.encode(mosaic.samples()).map(|stored| stored.len())
}
