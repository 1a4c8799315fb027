//! A camera, a lens and a policy that do what the test says.

use std::sync::atomic::{AtomicUsize, Ordering};
use std::sync::mpsc::{Receiver, RecvTimeoutError, Sender, channel};
use std::sync::{Arc, Condvar, Mutex};
use std::time::Duration;

use parfocal_autofocus::{Decision, FieldOfView, Observation, Policy, Registry};
use parfocal_base::FocalPower;
use parfocal_base::PolicyName;
use parfocal_base::clock::{Clock, Moment};
use parfocal_base::ids::SegmentId;
use parfocal_devices::camera::{Camera, CameraError, CameraHealth, Controls, Frame, FrameImage};
use parfocal_devices::lens::{Lens, LensDynamics, LensError, LensHealth, LensInfo, Optics, Response};
use parfocal_imaging::RgbImage;
use parfocal_pipeline::control::{Command, Drive};
use rustix::thread::{Pid, gettid};

pub fn power(value: f64) -> FocalPower {
    FocalPower::new(value).unwrap()
}

pub fn frame(number: u64, exposed_at: Moment) -> Frame {
    sized_frame(number, exposed_at, 32)
}

pub fn sized_frame(number: u64, exposed_at: Moment, side: usize) -> Frame {
    let picture = RgbImage::new(side, side, vec![90; 3 * side * side]).unwrap();
    let image = FrameImage::Rgb(Arc::new(picture));
    Frame { number, exposed_at, exposure: Duration::ZERO, image, truth: None }
}

/// What the policy named `scripted` does at each step.
#[derive(Debug, Clone, Copy)]
pub enum Deed {
    GoTo(f64),
    Panic,
    Hang,
    /// Like [`Deed::Hang`], but keeps a processor busy.
    Spin,
}

/// Sets what the policy `scripted` does, and records its instances, threads and observations.
#[derive(Clone)]
pub struct Script(Arc<ScriptState>);

struct ScriptState {
    deed: Mutex<Deed>,
    changed: Condvar,
    instances: AtomicUsize,
    seen: Mutex<Vec<f64>>,
    threads: Mutex<Vec<Pid>>,
}

impl Script {
    pub fn new(deed: Deed) -> Self {
        Self(Arc::new(ScriptState {
            deed: Mutex::new(deed),
            changed: Condvar::new(),
            instances: AtomicUsize::new(0),
            seen: Mutex::default(),
            threads: Mutex::default(),
        }))
    }

    /// From now on the policy does `deed`. An instance that hangs returns.
    pub fn set(&self, deed: Deed) {
        *self.0.deed.lock().unwrap() = deed;
        self.0.changed.notify_all();
    }

    /// Number of instances built so far.
    pub fn instances(&self) -> usize {
        self.0.instances.load(Ordering::SeqCst)
    }

    /// The threads on which instances ran, latest last.
    pub fn threads(&self) -> Vec<Pid> {
        self.0.threads.lock().unwrap().clone()
    }

    /// Focal powers that the policy was shown.
    pub fn seen(&self) -> Vec<f64> {
        self.0.seen.lock().unwrap().clone()
    }

    pub fn registry(&self) -> Registry {
        let state = self.0.clone();
        Registry::standard().with("scripted", "does as the test says", move || {
            state.instances.fetch_add(1, Ordering::SeqCst);
            Box::new(Scripted(state.clone()))
        })
    }
}

struct Scripted(Arc<ScriptState>);

impl Policy for Scripted {
    fn field_of_view(&self) -> FieldOfView {
        FieldOfView::Patch
    }

    fn step(&mut self, seen: &Observation<'_>) -> Decision {
        self.0.seen.lock().unwrap().push(seen.focal_power.get());
        let mut threads = self.0.threads.lock().unwrap();
        if !threads.contains(&gettid()) {
            threads.push(gettid());
        }
        drop(threads);
        let deed = *self.0.deed.lock().unwrap();
        match deed {
            Deed::GoTo(target) => Decision { target, metric: Some(target), belief: Some([0.5, f32::NAN].into()) },
            Deed::Panic => panic!("as the test asked"),
            Deed::Hang => {
                let deed = self.0.deed.lock().unwrap();
                drop(self.0.changed.wait_while(deed, |deed| matches!(deed, Deed::Hang)).unwrap());
                Decision { target: 0.99, ..Decision::default() }
            }
            Deed::Spin => {
                while matches!(*self.0.deed.lock().unwrap(), Deed::Spin) {
                    std::hint::spin_loop();
                }
                Decision { target: 0.99, ..Decision::default() }
            }
        }
    }
}

/// A command that puts policy `name` in charge from where the lens is.
pub fn drive(name: &str, segment: Option<SegmentId>) -> Command {
    Command::Drive { drive: Drive::Policy { name: PolicyName::new(name), start: None }, segment }
}

/// A lens that obeys at once, remembers its focal power, and fails on request.
#[derive(Clone)]
pub struct FakeLens(Arc<Mutex<LensState>>);

struct LensState {
    at: FocalPower,
    failure: Option<LensError>,
    panics: bool,
    dynamics: LensDynamics,
    serial: &'static str,
}

impl FakeLens {
    pub fn at(focal_power: FocalPower) -> Self {
        let dynamics = LensDynamics { delay: Duration::ZERO, settling: Duration::ZERO };
        let state = LensState { at: focal_power, failure: None, panics: false, dynamics, serial: "A" };
        Self(Arc::new(Mutex::new(state)))
    }

    pub fn slow(self, delay: Duration, settling: Duration) -> Self {
        self.0.lock().unwrap().dynamics = LensDynamics { delay, settling };
        self
    }

    pub fn fail(&self, failure: Option<LensError>) {
        self.0.lock().unwrap().failure = failure;
    }

    /// From now on it is another lens, with this serial number.
    pub fn swap(&self, serial: &'static str) {
        self.0.lock().unwrap().serial = serial;
    }

    pub fn panic(&self, panics: bool) {
        self.0.lock().unwrap().panics = panics;
    }

    fn described(&self) -> Result<LensInfo, LensError> {
        let state = self.0.lock().unwrap();
        state.failure.clone().map_or(Ok(()), Err)?;
        Ok(LensInfo {
            driver: "fake".into(),
            firmware: "none".into(),
            serial: state.serial.into(),
            min_dioptre: 0.0,
            max_dioptre: 1.0,
            temperature_celsius: None,
            mode: "focal power".into(),
            status: Vec::new(),
            line_errors: 0,
        })
    }

    /// The last focal power that the lens accepted.
    pub fn position(&self) -> FocalPower {
        self.0.lock().unwrap().at
    }
}

impl Lens for FakeLens {
    fn set(&mut self, target: FocalPower) -> Result<(), LensError> {
        let (panics, failure) = {
            let state = self.0.lock().unwrap();
            (state.panics, state.failure.clone())
        };

        assert!(!panics, "as the test asked");
        failure.map_or(Ok(()), Err)?;
        self.0.lock().unwrap().at = target;
        Ok(())
    }

    fn measured(&self) -> Option<FocalPower> {
        Some(self.position())
    }

    fn health(&self) -> LensHealth {
        let info = self.described().ok();
        LensHealth {
            name: "fake lens".into(),
            simulated: true,
            working: info.is_some(),
            caution: false,
            message: "as the test says".into(),
            line_errors: 0,
            info,
        }
    }

    fn info(&mut self) -> Result<LensInfo, LensError> {
        self.described()
    }

    fn dynamics(&self) -> LensDynamics {
        self.0.lock().unwrap().dynamics
    }

    fn optics(&self) -> Arc<dyn Optics> {
        Arc::new(Response::new(self.dynamics(), 0.0, self.position()))
    }
}

/// What a fake camera does next: a frame of this many pixels a side, a failure, or a panic.
pub enum Shot {
    Frame(usize),
    Failure,
    Panic,
}

/// A camera that delivers what the test sends.
pub struct FakeCamera {
    clock: Arc<dyn Clock>,
    shots: Receiver<Shot>,
    number: u64,
    pub controls: Option<Controls>,
}

impl FakeCamera {
    pub fn new(clock: Arc<dyn Clock>) -> (Self, Sender<Shot>) {
        let (sender, shots) = channel();
        (Self { clock, shots, number: 0, controls: None }, sender)
    }
}

impl Camera for FakeCamera {
    fn next_frame(&mut self, timeout: Duration) -> Result<Frame, CameraError> {
        match self.shots.recv_timeout(timeout) {
            Ok(Shot::Frame(side)) => {
                self.number += 1;
                Ok(sized_frame(self.number, self.clock.now(), side))
            }
            Ok(Shot::Failure) => Err(CameraError::Failed("as the test asked".into())),
            Ok(Shot::Panic) => panic!("as the test asked"),
            Err(RecvTimeoutError::Timeout) => Err(CameraError::Timeout(timeout)),
            Err(RecvTimeoutError::Disconnected) => Err(CameraError::Failed("the test is over".into())),
        }
    }

    fn controls(&self) -> Option<Controls> {
        self.controls.clone()
    }

    fn health(&self) -> CameraHealth {
        CameraHealth {
            name: "fake camera".into(),
            simulated: true,
            working: true,
            message: "as the test says".into(),
            fps: 0.0,
            lost: 0,
        }
    }
}
