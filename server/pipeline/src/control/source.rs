//! The camera's thread: takes frames as they come, and keeps the latest for the loop.

use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc::{Receiver, RecvTimeoutError, SyncSender, sync_channel};
use std::time::Duration;
use std::{io, thread};

use arc_swap::ArcSwap;

use super::LatestSlot;
use parfocal_base::guarded;
use parfocal_base::priority::{self, ThreadRole};
use parfocal_devices::camera::{Camera, CameraError, CameraHealth, Frame, LEAST_FPS};

/// Longest wait for one frame: its time at the least rate, and a quarter more, because frames are never quite even.
/// After it the thread checks whether it should stop, and asks the camera again.
const TIMEOUT: Duration = Duration::from_millis(1250 / LEAST_FPS as u64);
/// Pause after a failure without a wait, so that a dead camera does not keep a core busy.
const PAUSE: Duration = Duration::from_millis(50);

/// A camera that runs on its own thread: its frames and its health.
pub struct FrameSource {
    /// The slot with the latest frame.
    pub frames: Arc<LatestSlot<Frame>>,
    health: Arc<ArcSwap<CameraHealth>>,
    stop: Arc<AtomicBool>,
    ended: Receiver<()>,
}

impl FrameSource {
    /// Starts a thread that takes frames from `camera`.
    ///
    /// # Errors
    /// If the system has no thread left.
    pub fn start(camera: Box<dyn Camera>) -> io::Result<Self> {
        let frames = Arc::new(LatestSlot::default());
        let health = Arc::new(ArcSwap::from_pointee(camera.health()));
        let stop = Arc::new(AtomicBool::new(false));
        let (ending, ended) = sync_channel(0);

        let feed = Feed { frames: frames.clone(), health: health.clone(), stop: stop.clone(), _ending: ending };
        thread::Builder::new().name("camera".into()).spawn(move || feed.run(camera))?;
        Ok(Self { frames, health, stop, ended })
    }

    /// The camera's health after its last frame or failure.
    pub fn health(&self) -> CameraHealth {
        CameraHealth::clone(&self.health.load())
    }

    /// Ends the thread and waits for at most `timeout`. Returns whether it has ended.
    pub fn stop(&self, timeout: Duration) -> bool {
        self.stop.store(true, Ordering::Relaxed);
        self.ended.recv_timeout(timeout) == Err(RecvTimeoutError::Disconnected)
    }
}

/// The state of the camera's thread.
struct Feed {
    frames: Arc<LatestSlot<Frame>>,
    health: Arc<ArcSwap<CameraHealth>>,
    stop: Arc<AtomicBool>,
    /// Dropped when the thread ends, which wakes [`FrameSource::stop`].
    _ending: SyncSender<()>,
}

impl Feed {
    fn run(self, mut camera: Box<dyn Camera>) {
        if !camera.computes() {
            priority::raise(ThreadRole::Wire);
        }

        let mut failing = false;
        while !self.stop.load(Ordering::Relaxed) {
            let outcome = guarded(|| camera.next_frame(TIMEOUT));
            let failure = match outcome {
                Ok(Ok(frame)) => {
                    self.frames.put(frame);
                    None
                }
                Ok(Err(error)) => Some(error),
                Err(panic) => Some(CameraError::Failed(format!("its driver failed: {panic}"))),
            };

            self.health.store(Arc::new(camera.health()));

            if let Some(error) = &failure {
                if !failing {
                    tracing::warn!(%error, "no frame from the camera");
                }
                if !matches!(error, CameraError::Timeout(_)) {
                    thread::sleep(PAUSE);
                }
            } else if failing {
                tracing::info!("the camera delivers frames again");
            }

            failing = failure.is_some();
        }
    }
}
