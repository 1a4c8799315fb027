//! Recordings made while the server runs: mosaics when the operator asks for them, and what a protocol asks for, from a
//! session's start to its end. What was begun during a session ends with it. A trial never waits for a recording, and
//! continues without one.

mod parts;
mod running;
mod starting;
mod status;
mod view;

pub use parts::RecorderParts;
pub use starting::StartError;
pub use status::RecordingStatus;

use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::time::Duration;

use tokio::sync::Mutex as Pen;
use tokio::task::spawn_blocking;
use tokio::time::{Instant, interval, timeout};

use parfocal_base::clock::Moment;
use parfocal_base::ids::SessionId;
use parfocal_recording::{Ended, Intake, Room, compressed_size, room};
use parfocal_records::store::Stamp;
use parfocal_trial::protocol::Record;
use running::Running;

/// Interval at which we check whether a recording has ended by itself.
const TICK: Duration = Duration::from_secs(1);
/// Interval at which a frame is compressed while nothing is recorded, to estimate how long the disk would last.
const MEASURE: Duration = Duration::from_secs(10);
/// Longest wait for that frame, and for the disk.
const PATIENCE: Duration = Duration::from_secs(1);

/// Whoever plays or exports a session waits at most this long until its recording is stored.
const STORING: Duration = Duration::from_secs(5);

/// Records at most one thing at a time. Clone freely.
#[derive(Clone)]
pub struct Recordings(Arc<Shared>);

struct Shared {
    parts: RecorderParts,
    state: Mutex<State>,
    /// Held while a recording is being started or stopped.
    pen: Pen<()>,
    /// Held while the disk is asked for its room, so that a disk that hangs blocks only one thread, however often
    /// somebody asks.
    asking: Arc<Pen<()>>,
}

#[derive(Default)]
struct State {
    active: Option<Active>,
    /// The session for which a recording was last started or attempted. A recording that ended early is not started
    /// again.
    followed: Option<SessionId>,
    /// Message to the operator about the last recording.
    notice: Option<Notice>,
    /// Compressed size of a frame in bytes, as measured last.
    frame_bytes: Option<u64>,
}

/// How a recording ended, or why it did not start, for the operator.
struct Notice {
    text: String,
    /// Whether something went wrong.
    warns: bool,
}

/// A recording under way.
struct Active {
    what: Running,
    /// The session that was under way when it began, whose name it has; `None` outside sessions.
    session: Option<SessionId>,
    /// Whether a protocol asked for it.
    by_protocol: bool,
    began: Moment,
}

impl Recordings {
    /// A recorder that records nothing yet. It follows protocols only while [`Recordings::run`] is awaited.
    pub fn new(parts: RecorderParts) -> Self {
        Self(Arc::new(Shared { parts, state: Mutex::default(), pen: Pen::new(()), asking: Arc::default() }))
    }

    /// Follows the sessions, and notices when a recording ends by itself. Never ends.
    pub async fn run(self) {
        let mut sessions = self.0.parts.conductor.operator_view();
        let mut ticks = interval(TICK);
        let mut measured: Option<Instant> = None;

        loop {
            tokio::select! {
                changed = sessions.changed() => if changed.is_err() { return },
                _ = ticks.tick() => {}
            }
            self.follow().await;
            self.notice_the_end().await;

            if self.0.state().active.is_none() && measured.is_none_or(|at| at.elapsed() >= MEASURE) {
                measured = Some(Instant::now());
                self.measure().await;
            }
        }
    }

    /// Begins to record mosaics.
    ///
    /// # Errors
    /// If a recording is already under way, the camera has no mosaics, or the disk has no room.
    pub async fn start(&self) -> Result<(), StartError> {
        let begun = self.to_the_end(|this| async move {
            if this.0.state().active.is_some() {
                return Err(StartError::UnderWay);
            }
            this.begin(Record::Mosaic, None).await
        });
        begun.await.unwrap_or_else(|| Err(ending()))
    }

    /// Ends the recording under way, if one is, and stores what was recorded.
    pub async fn stop(&self) {
        self.to_the_end(|this| async move { this.end().await }).await;
    }

    /// Waits until the recording of a session that is over is stored, unless the disk takes long. Until then, nobody can
    /// tell it from one that was cut short.
    pub async fn settle(&self) {
        if timeout(STORING, self.notice_the_end()).await.is_err() {
            tracing::warn!("a recording is still being stored");
        }
    }

    /// Does `work` while nothing else begins or ends a recording, even if the caller is dropped, as a handler is when its
    /// browser disconnects, and [`Recordings::run`] when the server ends. `None` if it failed.
    async fn to_the_end<T, F>(&self, work: impl FnOnce(Self) -> F) -> Option<T>
    where
        T: Send + 'static,
        F: Future<Output = T> + Send + 'static,
    {
        let shared = Arc::clone(&self.0);
        let work = work(self.clone());
        let done = tokio::spawn(async move {
            let _pen = shared.pen.lock().await;
            work.await
        });
        done.await.ok()
    }

    /// The room on the disk; `None` if the disk does not say it in time.
    async fn room(&self) -> Option<Room> {
        let folder = self.0.parts.folder.clone();
        let asking = Arc::clone(&self.0.asking);
        let answer = async {
            let asking = asking.lock_owned().await;
            spawn_blocking(move || {
                let _asking = asking;
                room(&folder)
            })
            .await
        };
        timeout(PATIENCE, answer).await.ok()?.ok()?.ok()
    }

    /// The state of recording, for the operator's page. It is told even while the disk hangs.
    pub async fn status(&self) -> RecordingStatus {
        let parts = &self.0.parts;
        let room = self.room().await;

        let status = parts.status.borrow().clone();
        let state = self.0.state();

        let mut report = RecordingStatus {
            unavailable: parts.size.is_none().then(|| StartError::NoMosaics.to_string()),
            notice: state.notice.as_ref().map(|notice| notice.text.clone()),
            notice_warns: state.notice.as_ref().is_some_and(|notice| notice.warns),
            free_bytes: room.map(|room| room.available),
            reserve_bytes: room.map(|room| room.reserve),
            ..RecordingStatus::default()
        };

        let idle = state.frame_bytes.map(|bytes| bytes as f64 * status.camera.fps);
        report.bytes_per_second = idle.filter(|_| parts.size.is_some());

        if let Some(active) = &state.active {
            let progress = active.what.progress();
            let seconds = parts.clock.now().since(active.began).as_secs_f64();
            let frames = progress.frames as f64;
            let rate = match active.what {
                Running::Mosaic(_) => status.camera.fps,
                // Viewers get fewer pictures than the camera takes.
                Running::View(_) => frames / seconds,
            };
            let measured = Some(progress.bytes as f64 / frames * rate).filter(|bytes| bytes.is_finite());
            report.bytes_per_second = measured.or(report.bytes_per_second);
            report.recording = Some(active.what.kind());
            report.folder = active.what.folder().file_name().map(|name| name.to_string_lossy().into_owned());
            report.by_protocol = active.by_protocol;
            report.seconds = Some(seconds);
            report.frames = progress.frames;
            report.lost = progress.lost;
            report.bytes = progress.bytes;
        }

        let rate = report.bytes_per_second.filter(|rate| *rate > 0.0);
        report.seconds_left = room.zip(rate).map(|(room, rate)| room.spare() as f64 / rate);
        report
    }

    /// Starts the recording that the session under way asks for.
    async fn follow(&self) {
        let wanted = self.0.parts.conductor.to_record();
        let followed = self.0.state().followed;

        match wanted {
            Some((session, what)) if followed != Some(session) => {
                let begun = self.to_the_end(move |this| async move {
                    this.0.state().followed = Some(session);
                    this.end().await;
                    if let Err(error) = this.begin(what, Some(session)).await {
                        tracing::error!(%error, "a session is not being recorded");
                        let text = format!("This session is not being recorded. {error}");
                        this.0.state().notice = Some(Notice { text, warns: true });
                    }
                });
                begun.await;
            }
            Some(_) => {}
            None => self.0.state().followed = None,
        }
    }

    /// Ends the recording under way if it has ended by itself, or if its session is over: who may see that session must
    /// not see the next one, too.
    async fn notice_the_end(&self) {
        let noticed = self.to_the_end(|this| async move {
            let under_way = this.0.parts.conductor.session_under_way();
            let is_over = |active: &Active| {
                active.what.progress().ended.is_some() || active.session.is_some_and(|own| under_way != Some(own))
            };
            let ended = this.0.state().active.as_ref().is_some_and(is_over);
            if ended {
                this.end().await;
            }
        });
        noticed.await;
    }

    /// Begins to record. The caller must hold the pen, and no recording may be under way.
    async fn begin(&self, what: Record, session: Option<SessionId>) -> Result<(), StartError> {
        let shared = Arc::clone(&self.0);
        spawn_blocking(move || shared.begin(what, session)).await.unwrap_or_else(|_| Err(ending()))
    }

    /// Ends the recording under way, if there is one. The caller must hold the pen.
    async fn end(&self) {
        let Some(active) = self.0.state().active.take() else { return };
        self.0.parts.tap.disconnect();

        let folder = active.what.folder().display().to_string();
        let Ok(progress) = spawn_blocking(move || active.what.stop()).await else { return };
        tracing::info!(folder, frames = progress.frames, lost = progress.lost, "a recording ended");

        let lost = match progress.lost {
            0 => String::new(),
            lost => format!(" {lost} frames were lost, because this machine or its disk was too slow."),
        };
        let because = match progress.ended {
            Some(Ended::Stopped) | None => String::new(),
            Some(Ended::DiskNearlyFull) => {
                " The recording stopped by itself, because the disk is nearly full; the trial goes on.".to_owned()
            }
            Some(Ended::Failed(problem)) => format!(" The recording stopped: {problem}. The trial goes on."),
        };
        let warns = !(because.is_empty() && lost.is_empty());
        let text = format!("{} frames are saved in {folder}.{because}{lost}", progress.frames);
        self.0.state().notice = Some(Notice { text, warns });
    }

    /// Compresses one frame to measure its size in bytes.
    async fn measure(&self) {
        if self.0.parts.size.is_none() {
            return;
        }

        let (intake, frames) = Intake::new(1);
        {
            // Hold the pen, so that no recording starts between the check and the connection.
            let _pen = self.0.pen.lock().await;
            if self.0.state().active.is_none() {
                self.0.parts.tap.connect(intake);
            }
        }

        let shared = Arc::clone(&self.0);
        let size = spawn_blocking(move || {
            let shot = frames.recv_timeout(PATIENCE).ok();
            let state = shared.state();
            if state.active.is_none() {
                shared.parts.tap.disconnect();
            }
            drop(state);
            shot.and_then(|shot| compressed_size(&shot.mosaic).ok())
        });

        if let Ok(Some(bytes)) = size.await {
            self.0.state().frame_bytes = Some(bytes as u64);
        }
    }
}

/// Why nothing begins any more.
fn ending() -> StartError {
    StartError::Failed("the server is ending".to_owned())
}

impl Shared {
    fn state(&self) -> MutexGuard<'_, State> {
        self.state.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Begins to record. `asked_by` is the session whose protocol asked for it, if one did.
    fn begin(&self, what: Record, asked_by: Option<SessionId>) -> Result<(), StartError> {
        let session = asked_by.or_else(|| self.parts.conductor.session_under_way());
        // Both clocks at once: a slow disk must not come between them.
        let began = Stamp { wall: self.parts.clock.wall(), at: self.parts.clock.now() };
        let folder = starting::new_folder(&self.parts.folder, asked_by, began.wall);
        let Some(running) = starting::start(&self.parts, what, &folder, session, began)? else { return Ok(()) };

        tracing::info!(folder = %running.folder().display(), "a recording began");
        let mut state = self.state();
        state.notice = None;
        if let Running::Mosaic(recorder) = &running {
            // Connect while the state is locked, so that a measurement does not disconnect the tap.
            self.parts.tap.connect(recorder.intake());
        }
        state.active = Some(Active { what: running, session, by_protocol: asked_by.is_some(), began: began.at });
        Ok(())
    }
}
