//! Records the pictures that the surgeon's page gets, on a separate thread. A slow disk misses pictures, as a slow
//! viewer does.

use std::path::{Path, PathBuf};
use std::sync::{Arc, Mutex, PoisonError};
use std::thread::JoinHandle;

use tokio::runtime::Handle;
use tokio::sync::Notify;

use parfocal_base::clock::Moment;
use parfocal_base::{guarded, priority};
use parfocal_pipeline::live::Follower;
use parfocal_recording::{Ended, RecordingError, RecordingProgress, Room, ViewWriter, room};

/// A recording of the view under way. Dropping it stops it.
pub struct ViewRecorder {
    folder: PathBuf,
    progress: Arc<Mutex<RecordingProgress>>,
    stop: Arc<Notify>,
    thread: Option<JoinHandle<()>>,
}

impl ViewRecorder {
    /// Records the frames of `follower` into `writer`. Times count from `start`.
    ///
    /// # Errors
    /// If the system cannot create a thread.
    pub fn start(writer: ViewWriter, follower: Follower, start: Moment) -> Result<Self, RecordingError> {
        let folder = writer.folder().to_owned();
        let progress = Arc::new(Mutex::new(RecordingProgress::default()));
        let stop = Arc::new(Notify::new());

        let runtime = Handle::current();
        let worker = Worker { writer, follower, start, progress: Arc::clone(&progress), stop: Arc::clone(&stop) };
        let told = Arc::clone(&progress);
        let thread = std::thread::Builder::new().name("recording-view".into()).spawn(move || {
            priority::lower();
            // Otherwise the recording would seem to go on.
            if let Err(panic) = guarded(|| runtime.block_on(worker.run())) {
                let problem = RecordingError::panicked(&panic).to_string();
                told.lock().unwrap_or_else(PoisonError::into_inner).ended = Some(Ended::Failed(problem));
            }
        });

        let thread = thread.map_err(|error| RecordingError::unwritable(&folder, 0, &error))?;
        Ok(Self { folder, progress, stop, thread: Some(thread) })
    }

    /// Folder of the recording.
    pub fn folder(&self) -> &Path {
        &self.folder
    }

    /// Frames and bytes recorded so far, and how the recording ended if it has.
    pub fn progress(&self) -> RecordingProgress {
        self.progress.lock().unwrap_or_else(PoisonError::into_inner).clone()
    }

    /// Stops the recording and returns its final progress.
    pub fn stop(mut self) -> RecordingProgress {
        self.end();
        self.progress()
    }

    fn end(&mut self) {
        self.stop.notify_one();
        if let Some(thread) = self.thread.take()
            && thread.join().is_err()
        {
            tracing::error!("the thread that recorded the view ended by a panic");
        }
    }
}

impl Drop for ViewRecorder {
    fn drop(&mut self) {
        self.end();
    }
}

struct Worker {
    writer: ViewWriter,
    follower: Follower,
    start: Moment,
    progress: Arc<Mutex<RecordingProgress>>,
    stop: Arc<Notify>,
}

impl Worker {
    async fn run(mut self) {
        let ended = loop {
            let frame = tokio::select! {
                () = self.stop.notified() => break Ended::Stopped,
                frame = self.follower.next() => frame,
            };
            let Some(frame) = frame else { break Ended::Stopped };
            let picture = &frame.picture;

            let left = room(self.writer.folder()).map_or(u64::MAX, Room::spare);
            if left < picture.jpeg.len() as u64 {
                break Ended::DiskNearlyFull;
            }

            let time = picture.exposed_at.since(self.start).as_nanos() as u64;
            let size = (picture.width, picture.height);
            if let Err(error) = self.writer.add(picture.number, time, size, &picture.jpeg) {
                break Ended::Failed(error.to_string());
            }
            let mut progress = self.progress.lock().unwrap_or_else(PoisonError::into_inner);
            progress.frames += 1;
            progress.bytes += picture.jpeg.len() as u64;
        };

        let finished = self.writer.finish(ended.clone());
        let ended = match (ended, finished) {
            (Ended::Stopped, Err(error)) => Ended::Failed(error.to_string()),
            (ended, _) => ended,
        };
        self.progress.lock().unwrap_or_else(PoisonError::into_inner).ended = Some(ended);
    }
}
