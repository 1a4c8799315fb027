//! What a focus step costs: the metrics, each policy's step, and a whole step of the control loop.
#![allow(missing_docs, clippy::cast_possible_truncation, clippy::cast_precision_loss, reason = "a benchmark")]

use std::hint::black_box;
use std::sync::Arc;
use std::time::Duration;

use criterion::{Criterion, criterion_group, criterion_main};
use parfocal::autofocus::{Observation, PolicyName, Registry, mgm, mlr};
use parfocal::camera::{self, CameraSettings, Frame, FrameImage};
use parfocal::clock::{Clock, SystemClock};
use parfocal::control::{Command, ControlLoop, ControlledFrame, Drive, Eye, LatencyFigures, Rig, Settings, Stepper};
use parfocal::imaging::{Calibration, GrayImage, JpegEncoder, MosaicFrame, Patch, Reconstructor, RgbImage};
use parfocal::lens::{FocalPower, Lens, SimulatedLens};

fn texture(index: usize) -> usize {
    (index * index * 37 + index * 11) % 256
}

fn patch() -> Patch {
    Patch(std::array::from_fn(|index| texture(index) as f32))
}

fn metrics(criterion: &mut Criterion) {
    let patch = patch();
    criterion.bench_function("metric/mgm", |bench| bench.iter(|| mgm(black_box(&patch))));
    criterion.bench_function("metric/mlr", |bench| bench.iter(|| mlr(black_box(&patch))));
}

fn available() -> impl Iterator<Item = PolicyName> {
    Registry::standard().entries().into_iter().filter(|entry| entry.available).map(|entry| entry.name)
}

fn policies(criterion: &mut Criterion) {
    let patch = patch();
    for name in available() {
        let mut policy = Registry::standard().build(&name).expect("is available");
        let mut focal_power = FocalPower::MIDDLE;
        criterion.bench_function(&format!("policy/{name}"), |bench| {
            bench.iter(|| {
                let decision = policy.step(&Observation { patch: black_box(&patch), focal_power });
                focal_power = FocalPower::nearest(decision.target);
            });
        });
    }
}

/// From a mosaic in memory to the lens command, the hop to the policy's thread and back included.
fn steps(criterion: &mut Criterion) {
    let samples = (0..2048 * 1088).map(|index| texture(index) as u16).collect();
    let image = FrameImage::Mosaic(Arc::new(MosaicFrame::new(2048, 1088, samples).expect("fits")));
    for name in available() {
        let clock = Arc::new(SystemClock);
        let eye = Eye::new(Reconstructor::new(&Calibration::default()));
        let lens = Box::new(SimulatedLens::new(clock.clone()));
        let mut stepper = Stepper::new(lens, eye, Registry::standard(), clock.clone(), Duration::from_millis(20));
        let drive = Drive::Policy { name: name.clone(), start: None };
        stepper.obey(Command::Drive { drive, segment: None });
        let mut number = 0;
        criterion.bench_function(&format!("step/{name}"), |bench| {
            bench.iter(|| {
                number += 1;
                let (exposed_at, exposure) = (clock.now(), Duration::ZERO);
                let frame = Frame { number, exposed_at, exposure, image: image.clone(), truth: None };
                stepper.step(frame)
            });
        });
    }
}

/// Exposure to lens command in the whole loop: phantom at 50 frames a second, telemetry drained, and a thread that makes a
/// picture of each frame meanwhile, as the live view does.
fn latency(_: &mut Criterion) {
    const STEPS: usize = 500;
    let clock = Arc::new(SystemClock);
    let lens = Box::new(SimulatedLens::new(clock.clone()));
    let settings = CameraSettings { fps: 50.0, seed: 1, optics: lens.optics(), clock: clock.clone() };
    let camera = camera::open("phantom", settings).expect("is there");
    let mut reconstructor = Reconstructor::new(&Calibration::default());
    let rig = Rig { camera, lens, reconstructor: reconstructor.clone(), registry: Registry::standard(), clock };
    let settings = Settings { frame_period: Duration::from_millis(20), telemetry_capacity: 256, dynamics: None };
    let (control, handle, mut telemetry) = ControlLoop::spawn(settings, rig).expect("starts");
    handle.send(Command::Drive {
        drive: Drive::Policy { name: PolicyName::new("mgm-hill-climber"), start: None },
        segment: None,
    });
    let frames = handle.frames.clone();
    let viewer = std::thread::spawn(move || {
        let (mut rgb, mut gray) = (RgbImage::default(), GrayImage::default());
        let mut encoder = JpegEncoder::new(80).expect("starts");
        while !frames.is_closed() {
            if let Some(ControlledFrame { frame: Frame { image: FrameImage::Mosaic(mosaic), .. }, .. }) =
                frames.take(Duration::from_millis(100))
            {
                reconstructor.reconstruct(&mosaic, &mut rgb, &mut gray);
                black_box(encoder.encode(&rgb).expect("encodes"));
            }
        }
    });
    let mut latencies: Vec<u32> = std::iter::from_fn(|| telemetry.blocking_recv())
        .filter(|record| record.policy.is_some())
        .map(|record| record.latency_micros)
        .take(STEPS)
        .collect();
    let fps = handle.status.borrow().steps_per_second;
    control.stop();
    let _ = viewer.join();
    let LatencyFigures { steps, p50, p99 } = LatencyFigures::of(&mut latencies);
    println!("loop/latency            {steps} steps at {fps} a second: p50 {p50} µs, p99 {p99} µs");
}

criterion_group!(benches, metrics, policies, steps, latency);
criterion_main!(benches);
