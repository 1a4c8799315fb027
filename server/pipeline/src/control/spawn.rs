//! The loop's thread: starts it, passes frames to the stepper, publishes the results, and ends it.

use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::thread::JoinHandle;
use std::time::Duration;
use std::{io, thread};

use tokio::sync::{mpsc, watch};

use super::eye::Eye;
use super::lock::LockWatch;
use super::pilot::HoldReason;
use super::source::FrameSource;
use super::stepper::Stepper;
use super::tap::Tap;
use super::window::LatencyWindow;
use super::{Command, ControlHandle, ControlStatus, ControlledFrame, LatestSlot};
use parfocal_autofocus::Registry;
use parfocal_base::clock::{Clock, Moment};
use parfocal_base::guarded;
use parfocal_base::priority::{self, Scheduling, ThreadRole};
use parfocal_base::step::Hold;
use parfocal_base::step::StepRecord;
use parfocal_devices::camera::{Camera, CameraHealth, Controls, Frame, LEAST_FPS};
use parfocal_devices::lens::{Lens, MeasuredDynamics};
use parfocal_imaging::Reconstructor;

/// Longest wait for a frame before the loop looks for commands.
const TICK: Duration = Duration::from_millis(20);
/// Time without a frame after which the camera counts as failed: that of one and a half frames at the least rate.
const NO_FRAME: Duration = Duration::from_millis(1500 / LEAST_FPS as u64);
/// Status is published this often, and at every change.
const STATUS_INTERVAL: Duration = Duration::from_millis(200);
/// Longest wait, at the end, for a camera that does not answer.
const FAREWELL: Duration = Duration::from_secs(1);

/// The parts of the loop.
pub struct Rig {
    /// The source of frames.
    pub camera: Box<dyn Camera>,
    /// The lens to move.
    pub lens: Box<dyn Lens>,
    /// Reconstructs the patch from a mosaic.
    pub reconstructor: Reconstructor,
    /// The policies that can be put in charge.
    pub registry: Registry,
    /// The clock for latencies and time limits.
    pub clock: Arc<dyn Clock>,
}

/// How the loop runs.
#[derive(Debug, Clone)]
pub struct LoopSettings {
    /// Time between two frames, unless the camera tells its own. It is also the longest wait for a policy's answer.
    pub frame_period: Duration,
    /// Capacity of the telemetry channel, in records. Further records are dropped.
    pub telemetry_capacity: usize,
    /// The measured dynamics of a lens; `None` to use those that its driver assumes. They are not used for another lens.
    pub dynamics: Option<MeasuredDynamics>,
}

/// The running loop. Dropping it ends the loop and its camera, and waits for both. The lens is released first. A camera
/// that hangs is waited for at most one second.
pub struct ControlLoop {
    stop: Arc<AtomicBool>,
    thread: Option<JoinHandle<()>>,
}

impl ControlLoop {
    /// Starts the loop. The lens stays where it is until a command comes; one that is connected only later goes to the
    /// middle of its range. Also returns the handle for the rest of the
    /// server, and the telemetry; records that are not taken in time are dropped and counted.
    ///
    /// # Errors
    /// If the system has no thread left.
    pub fn spawn(settings: LoopSettings, rig: Rig) -> io::Result<(Self, ControlHandle, mpsc::Receiver<StepRecord>)> {
        let Rig { camera, lens, reconstructor, registry, clock } = rig;
        let mut stepper = Stepper::new(lens, Eye::new(reconstructor), registry, clock.clone(), settings.frame_period);
        if let Some(measured) = settings.dynamics {
            stepper = stepper.moving(measured);
        }

        let controls = camera.controls();
        let source = FrameSource::start(camera)?;

        let (telemetry, telemetry_out) = mpsc::channel(settings.telemetry_capacity.max(1));
        let (commands_in, commands) = mpsc::unbounded_channel();
        let frames = Arc::new(LatestSlot::default());
        let stop = Arc::new(AtomicBool::new(false));

        let tap = Tap::default();
        let now = clock.now();
        let mut worker = Worker {
            stepper,
            source,
            clock,
            telemetry,
            frames: frames.clone(),
            tap: tap.clone(),
            controls: controls.clone(),
            frame_period: settings.frame_period,
            published_at: now,
            last_frame_at: now,
            camera_fault: None,
            held_since: None,
            window: LatencyWindow::default(),
            lock: LockWatch::default(),
            steps: 0,
            telemetry_dropped: 0,
            priority: Scheduling::Ordinary,
        };
        let (publisher, status) = watch::channel(Arc::new(worker.status(now)));
        let handle = ControlHandle { commands: commands_in, status, frames, camera: controls, tap };

        let stopping = stop.clone();
        let thread =
            thread::Builder::new().name("control".into()).spawn(move || worker.run(commands, &publisher, &stopping))?;

        Ok((Self { stop, thread: Some(thread) }, handle, telemetry_out))
    }

    /// Ends the loop, just like dropping it.
    pub fn stop(self) {
        drop(self);
    }
}

impl Drop for ControlLoop {
    fn drop(&mut self) {
        self.stop.store(true, Ordering::Relaxed);
        if let Some(thread) = self.thread.take()
            && thread.join().is_err()
        {
            tracing::error!("the control loop ended by a panic");
        }
    }
}

/// The state of the loop's thread.
struct Worker {
    stepper: Stepper,
    source: FrameSource,
    clock: Arc<dyn Clock>,
    // The loop's outputs. None of them makes it wait.
    telemetry: mpsc::Sender<StepRecord>,
    frames: Arc<LatestSlot<ControlledFrame>>,
    tap: Tap,
    /// Read only when a status is due.
    controls: Option<Controls>,
    /// Time between two frames of a camera that does not tell it.
    frame_period: Duration,
    published_at: Moment,
    last_frame_at: Moment,
    /// Why there are no usable frames: none come, or they are too small for a patch.
    camera_fault: Option<HoldReason>,
    /// Whether the policy caused the present hold, and since when the lens has been held for such a cause.
    held_since: Option<(bool, Moment)>,
    window: LatencyWindow,
    lock: LockWatch,
    steps: u64,
    telemetry_dropped: u64,
    /// Scheduling priority of the loop's thread.
    priority: Scheduling,
}

impl Worker {
    fn run(
        mut self,
        mut commands: mpsc::UnboundedReceiver<Command>,
        publisher: &watch::Sender<Arc<ControlStatus>>,
        stop: &AtomicBool,
    ) {
        self.priority = priority::raise(ThreadRole::Loop);
        while !stop.load(Ordering::Relaxed) {
            let frame = self.source.frames.take(TICK);
            // The last line of defence: if a frame or a command causes a panic, the loop continues with the next one.
            if let Err(panic) = guarded(|| self.turn(frame, &mut commands, publisher)) {
                tracing::error!(panic, "a step of the control loop failed");
            }
        }

        let Self { stepper, source, frames, .. } = self;
        // First, because a camera that hangs must not keep the lens under current.
        drop(stepper);
        frames.close();
        if !source.stop(FAREWELL) {
            tracing::warn!("the camera does not respond; its thread was abandoned");
        }
    }

    fn turn(
        &mut self,
        frame: Option<Frame>,
        commands: &mut mpsc::UnboundedReceiver<Command>,
        publisher: &watch::Sender<Arc<ControlStatus>>,
    ) {
        while let Ok(command) = commands.try_recv() {
            self.stepper.obey(command);
        }
        match frame {
            Some(frame) => self.step(frame),
            None => self.wait_on(),
        }
        self.publish(publisher);
    }

    fn step(&mut self, frame: Frame) {
        self.last_frame_at = self.clock.now();

        match self.stepper.step(frame) {
            Ok(controlled) => {
                self.camera_fault = None;
                self.steps += 1;
                self.window.add(self.last_frame_at, controlled.record.latency_micros);
                let power = controlled.record.measured.unwrap_or(controlled.record.asked);
                self.lock.see(controlled.belief.as_deref(), power, self.last_frame_at);

                if self.telemetry.try_send(controlled.record.clone()).is_err() {
                    self.telemetry_dropped += 1;
                }
                self.tap.offer(&controlled);
                self.frames.put(controlled);
            }
            Err(reason) => self.camera_fault = Some(reason),
        }
    }

    fn wait_on(&mut self) {
        self.stepper.idle();
        if self.clock.now().since(self.last_frame_at) >= NO_FRAME {
            self.lock.see(None, self.stepper.focal_power(), self.clock.now());
            let CameraHealth { working, simulated, message, .. } = self.source.health();
            let message = if working && !simulated {
                // It has not noticed that it stopped, so this is how it worked before.
                format!("no frame comes from the camera; the lens is held. Check cable and power. Before: {message}")
            } else {
                format!("no frame comes from the camera; the lens is held: {message}")
            };
            self.camera_fault = Some(HoldReason::new(Hold::CameraFailed, &message));
        }
    }

    /// Publishes the status if it is due, or if something changed that people must see at once. What the policy does is
    /// not among that: when statuses come would tell which one runs.
    fn publish(&mut self, publisher: &watch::Sender<Arc<ControlStatus>>) {
        let now = self.clock.now();
        let reason = self.hold_reason();
        self.held_since = reason.map(|reason| {
            let caused_by_policy = reason.hold.caused_by_policy();
            self.held_since.filter(|held| held.0 == caused_by_policy).unwrap_or((caused_by_policy, now))
        });

        let changed = {
            let last = publisher.borrow();
            let reason = self.hold_reason().filter(|reason| !reason.hold.caused_by_policy());
            last.held.filter(|held| !held.caused_by_policy()) != reason.map(|reason| reason.hold)
                || reason.is_some_and(|reason| last.message.as_ref() != Some(&reason.message))
                || last.policy.as_ref() != self.stepper.policy()
                || last.geometry != self.stepper.geometry()
                || last.following != self.stepper.following()
        };
        if !changed && now.since(self.published_at) < STATUS_INTERVAL {
            return;
        }

        self.published_at = now;
        let status = self.status(now);
        // The operator may have changed the camera's frame rate.
        self.stepper.wait_at_most(status.camera_offer.frame_period().unwrap_or(self.frame_period));
        publisher.send_replace(Arc::new(status));
    }

    /// Why the lens is held; `None` if it is not.
    fn hold_reason(&self) -> Option<&HoldReason> {
        self.camera_fault.as_ref().or(self.stepper.hold_reason())
    }

    /// The loop's state at `now`.
    fn status(&mut self, now: Moment) -> ControlStatus {
        let figures = self.window.figures(now);
        let reason = self.hold_reason();
        let held = reason.map(|reason| reason.hold);
        let mut camera = self.source.health();
        // The driver may think that all is well. If it knows more, its own words stay.
        if let Some(fault) = self.camera_fault.as_ref().filter(|_| camera.working) {
            camera.working = false;
            camera.message = Arc::clone(&fault.message);
        }

        ControlStatus {
            at: now,
            camera,
            camera_offer: self.controls.as_ref().map(Controls::offered).unwrap_or_default(),
            lens: self.stepper.lens_health(),
            policy: self.stepper.policy().cloned(),
            focal_power: self.stepper.focal_power(),
            left_by_session: self.stepper.left_by_session(),
            held,
            held_for: self.held_since.map_or(Duration::ZERO, |(_, since)| now.since(since)),
            message: reason.map(|reason| reason.message.clone()),
            steps_per_second: figures.steps as f64,
            steps: self.steps,
            telemetry_dropped: self.telemetry_dropped,
            latency_p50_micros: figures.p50,
            latency_p99_micros: figures.p99,
            priority: if priority::withdrawn() { Scheduling::Withdrawn } else { self.priority },
            geometry: self.stepper.geometry(),
            lock: self.lock.told(),
            following: self.stepper.following(),
        }
    }
}
